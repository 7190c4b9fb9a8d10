"""Strict reading of TOML: every value is asked for by name and type, and every problem is kept, not raised."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from gapsense._os.files import read_bytes
from gapsense.problems import suggest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Value = float | int | bool | str
INFINITE = (-math.inf, math.inf)
LARGEST = sys.float_info.max
MOST = 2**53  # of what is counted
LONGEST = 100  # characters of a value in a message
LARGEST_FILE = 64 * 10**6  # bytes


class Kind(NamedTuple):
    """A type that a value may have: its name in messages, the test, the same as JSON schema; of a list, its items."""

    name: str
    accepts: Callable[[Any], bool]
    schema: Mapping[str, Any]
    of: Kind | None = None


class Key(NamedTuple):
    """A key that a table may have; one of kind `TABLE` or `TABLES` says in `section` what these hold."""

    name: str
    kind: Kind
    what: str
    example: str = ""  # as a file has it
    default: Any = None
    required: bool = False
    choices: tuple[str, ...] = ()
    otherwise: str = ""  # what holds without it, if there is no default
    section: Section | None = None
    pattern: str = ""  # of free names
    is_dotted: bool = False  # free names with dots, which may be written as tables too
    is_other: bool = False  # an alternative to its neighbours; examples leave it out
    is_path: Callable[[str, str], bool] | None = None  # of a name and its text: relative to the file it stands in
    unit: str = ""


class Section(NamedTuple):
    """A kind of table: how its header is written, what it is for, its keys, and that of names one is free to choose."""

    header: str
    what: str
    keys: tuple[Key, ...] = ()
    free: Key | None = None
    at: str = ""  # its header with names, for examples
    before: str = ""  # what an example needs before that to be whole


def is_number(value: Any) -> bool:
    """True for a finite integer or float, but not for `inf`, `nan` or truth values."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST


def is_integer(value: Any) -> bool:
    """True for an integer that is no truth value."""
    return isinstance(value, int) and not isinstance(value, bool)


def is_count(value: Any, least: int) -> bool:
    """True for an integer of at least that, and not so large that a number loses its last digit."""
    return is_integer(value) and bool(least <= value <= MOST)


def is_text(value: Any) -> bool:
    """True for a text without NUL characters, which no file name and no variable can have."""
    return isinstance(value, str) and "\0" not in value


def is_scalar(value: Any) -> bool:
    """True for what a parameter may be."""
    return isinstance(value, bool) or is_text(value) or is_number(value)


def is_list(value: Any, accepts: Callable[[Any], bool]) -> bool:
    """True for a list of what is accepted."""
    return isinstance(value, list) and all(map(accepts, value))


def is_span(value: Any) -> bool:
    """True for a pair of numbers in rising order, or infinities."""
    is_pair = is_list(value, lambda x: is_number(x) or x in INFINITE) and len(value) == 2
    return is_pair and bool(value[0] <= value[1])


OF_SCALARS = {"type": ["number", "boolean", "string"]}
NUMBER = Kind("a finite number", is_number, {"type": "number"})
POSITIVE = Kind("a positive number", lambda v: is_number(v) and v > 0, {"type": "number", "exclusiveMinimum": 0})
NOT_NEGATIVE = Kind("a number of at least 0", lambda v: is_number(v) and v >= 0, {"type": "number", "minimum": 0})
COUNT = Kind("a whole number of at least 1", lambda v: is_count(v, 1), {"type": "integer", "minimum": 1})
INDEX = Kind("a whole number of at least 0", lambda v: is_count(v, 0), {"type": "integer", "minimum": 0})
TRUTH = Kind("true or false", lambda value: isinstance(value, bool), {"type": "boolean"})
TEXT = Kind("a text", is_text, {"type": "string"})
TABLE = Kind("a table", lambda value: isinstance(value, dict), {"type": "object"})
TABLES = Kind("an array of tables", lambda value: is_list(value, TABLE.accepts), {"type": "array"})
TEXTS = Kind(
    "a list of texts", lambda value: is_list(value, TEXT.accepts), {"type": "array", "items": {"type": "string"}}, TEXT
)
NUMBER_OR_TEXT = Kind("a name or a finite number", lambda v: is_text(v) or is_number(v), {"type": ["number", "string"]})
SCALAR = Kind("a finite number, a truth value or a text", is_scalar, OF_SCALARS)
NUMBERS = Kind(
    "a list of finite numbers",
    lambda value: is_list(value, is_number),
    {"type": "array", "items": {"type": "number"}},
    NUMBER,
)
LIST = Kind(
    "a list of finite numbers, truth values or texts",
    lambda value: is_list(value, is_scalar) and bool(value),
    {"type": "array", "items": OF_SCALARS, "minItems": 1},
    SCALAR,
)
BOUNDS = Kind(
    "a pair [lowest, highest] in rising order (`-inf` and `inf` are allowed)",
    is_span,
    {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
)
TYPES = {name.lower(): kind for name, kind in globals().items() if isinstance(kind, Kind)}  # by names in tables of keys


def read_toml(path: Path, problems: list[str]) -> dict[str, Any] | None:
    """Content of a TOML file, or None after noting why it cannot be read."""
    try:
        return tomllib.loads(read_bytes(path, LARGEST_FILE).decode("utf-8-sig"))
    except FileNotFoundError:
        problems.append(f"{path}: there is no such file. Correct the path.")
    except UnicodeDecodeError as error:
        problems.append(f"{path}: byte {error.start} is not UTF-8. Save the file as UTF-8.")
    except OSError as error:
        problems.append(f"{path}: cannot be read: {error.strerror}. Correct the path.")
    except tomllib.TOMLDecodeError as error:
        twice = "; a key may be written only once" if str(error).startswith("Cannot") else ""
        problems.append(f"{path}: not valid TOML: {error}. Correct that line{twice}.")
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, tables in tables without end
        problems.append(f"{path}: cannot be read: {error}. Correct the file.")
    return None


def parse_toml(text: str) -> dict[str, Any] | None:
    """Parse a text as TOML; None if it is not TOML."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return None


def parsed_value(text: str) -> Any:
    """What a text means as the value of a key; one that TOML does not take as a value means itself."""
    read = parse_toml(f"value = {text}")
    return read["value"] if read and len(read) == 1 else text


def merge_tables(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Lay `changes` over `base`: tables are merged key by key, everything else is replaced."""
    out = dict(base)
    for key, value in changes.items():
        old = out.get(key)
        out[key] = merge_tables(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return out


class Table:
    """A TOML table that is read key by key; what is never asked for is an unknown key."""

    def __init__(self, data: Mapping[str, Any], file: str, place: str, problems: list[str]) -> None:
        self.data, self.file, self.place, self.problems = data, file, place, problems
        self.asked: set[str] = set()

    def where(self, key: str = "") -> str:
        """File and place of a key, as messages name it."""
        place = self.at(key)
        return f"{self.file}, {place}" if place else self.file

    def at(self, key: str) -> str:
        """Place of a key in its file."""
        return ".".join(part for part in (self.place, key) if part)

    def note(self, key: str, sentence: str) -> None:
        """Keep a problem with the value of `key`."""
        self.problems.append(f"{self.where(key)}: {sentence}")

    def take(self, key: str, kind: Kind, default: Any = None, *, required: bool = False) -> Any:
        """Value of `key` if it is of that kind; otherwise the default, after noting what is wrong."""
        self.asked.add(key)
        if key not in self.data:
            if required:
                self.note(key, f"missing; {kind.name} is expected. Add it.")
            return default
        value = self.data[key]
        if kind.accepts(value):
            return value
        self.note(key, refusal(value, kind))
        return default

    def read(self, section: Section) -> dict[str, Any]:
        """Values of all keys of a section but its tables, which are for `table`; notes every key that it has not."""
        self.asked.update(key.name for key in section.keys)
        given = {key.name: self.value(key) for key in section.keys if key.section is None}
        if section.free is None:
            self.finish()
        return given

    def value(self, key: Key) -> Any:
        """Value of a key of a section; one of some words is required, unless it has a default or may be left out."""
        if not key.choices:
            return self.take(key.name, key.kind, key.default, required=key.required)
        value = self.take(key.name, TEXT, key.default, required=key.default is None and not key.otherwise)
        if value is None or value in key.choices:
            return value
        self.note(key.name, f"`{value}` found. {suggest(value, key.choices)}")
        return key.default

    def table(self, key: str) -> Table:
        """Table below `key`, empty where there is none; if it is no table, nothing more is said about its content."""
        value = self.take(key, TABLE)
        child = self.child(value or {}, key)
        if value is None and key in self.data:
            child.problems = []
        return child

    def child(self, data: Mapping[str, Any], key: str) -> Table:
        """Reader for a table inside this one."""
        return Table(data, self.file, self.at(key), self.problems)

    def flat(self, kind: Kind) -> dict[str, Any]:
        """Values of that kind by dotted name; `[coil] resistance` means the same as `"coil.resistance"`."""
        out: dict[str, Any] = {}
        for name, value in flatten_table(self.data):
            if name in out:
                self.note(name, "given twice, once as a dotted key and once in a table. Remove one.")
            elif not kind.accepts(value):
                self.note(name, refusal(value, kind))
            else:
                out[name] = value
        return out

    def finish(self) -> None:
        """Note every key that nobody asked for."""
        for key in self.data:
            if key not in self.asked:
                self.note(key, f"unknown key. {suggest(key, self.asked)} Correct or remove it.")


def flatten_table(data: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield pairs of dotted name and value, depth first."""
    for key, value in data.items():
        if isinstance(value, dict):
            yield from flatten_table(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def refusal(value: Any, kind: Kind) -> str:
    """What a message says of a value of another kind: of a list, of its first wrong item."""
    if kind.of and isinstance(value, list) and (wrong := [item for item in value if not kind.of.accepts(item)]):
        return f"{describe_value(wrong[0])} found in the list, {kind.of.name} expected. Correct the value."
    is_large = kind in (COUNT, INDEX) and is_integer(value) and value > MOST
    limit = f", at most {MOST} (2^53)," if is_large else ""
    return f"{describe_value(value)} found, {kind.name}{limit} expected. Correct the value."


def describe_value(value: Any) -> str:
    """Describe, for a message, a value that was not expected."""
    if isinstance(value, dict) or (isinstance(value, list) and any(isinstance(item, dict) for item in value)):
        return "a table" if isinstance(value, dict) else "a list"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if is_integer(value) and abs(value) > LARGEST:
        return "a number of more than 308 digits"
    if isinstance(value, str) and "\0" in value:
        return "a text with a NUL character"
    text = f'"{value}"' if isinstance(value, str) else f"{value}"
    text = json.dumps(value, ensure_ascii=False, default=str) if isinstance(value, list) else text
    return f"`{text}`" if len(text) <= LONGEST else f"`{text[:LONGEST]}...`"
