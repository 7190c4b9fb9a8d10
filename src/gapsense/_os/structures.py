"""Structures of C for ctypes, read from the source that declares them."""

from __future__ import annotations

import ctypes
import re
from typing import Any

NUMBERS = {
    "int": ctypes.c_int,
    "ptrdiff_t": ctypes.c_ssize_t,
    "size_t": ctypes.c_size_t,
    "int64_t": ctypes.c_int64,
    "double": ctypes.c_double,
}
TYPEDEF = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
FIELDS = re.compile(r"(?:const )?(\w+) (?:\(\*(\w+)\)\([^)]*\)|([\w*, ]+));")  # a function is a plain address


def structures(source: str, **known: Any) -> dict[str, Any]:
    """The structures that a source declares, by name; one in another, called `block`, shares its fields with that."""
    made: dict[str, Any] = {**NUMBERS, **known}
    for body, name in TYPEDEF.findall(COMMENT.sub("", source)):
        fields = [
            (
                field.lstrip("*"),
                ctypes.c_void_p if function else pointer(made.get(kind)) if "*" in field else made[kind],
            )
            for kind, function, names in FIELDS.findall(body)
            for field in (function or names).split(", ")
        ]
        inner = [field for field, kind in fields if field == "block"]
        made.setdefault(name, type(name, (ctypes.Structure,), {"_anonymous_": inner, "_fields_": fields}))
    return made


def pointer(kind: Any) -> Any:
    """Pointer to a structure or to whole numbers; to anything else a plain address."""
    is_typed = kind is ctypes.c_int or (kind and issubclass(kind, ctypes.Structure))
    return ctypes.POINTER(kind) if is_typed else ctypes.c_void_p
