"""The Python side of the Linux binary of an FMU, which has the text of this file in it and calls the functions below.

For Python 3.9 and later, the standard library only.  Messages for the host are bytes: for each a digit for its status,
its category, a zero, its text, a zero.
"""

from __future__ import annotations

import importlib.util
import sys
import threading
import traceback
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

ERROR = 3  # fmi2Error
FUNCTIONS = {"exp", "log", "tanh"}
# By name and content of the script, which a host may unpack often.  Two threads may run this file at the same time.
CLASSES: dict[tuple[str, bytes], type] = globals().setdefault("CLASSES", {})
LOCK: Any = globals().setdefault("LOCK", threading.Lock())


class Refusal(Exception):
    """What the host asks for cannot be; the message says why."""


class NotProvided(Refusal):
    """What the host asks for is missing; nothing has failed."""


# --- Making slaves ---


def maker(name: str, resources: str, guid: str | None, is_model_exchange: int, visible: int) -> Callable[[], Any]:
    """What makes slaves of the class in the resources, all with these arguments."""
    found = slave_class(resources)
    own = vars(found).get("guid")  # classes made by our packager have it
    if is_model_exchange:
        raise Refusal(said(name, found, "model_exchange"))
    if own is not None and own != guid:
        raise Refusal(said(name, found, "wrong_guid", guid, own))
    if own is not None:
        quicken(found.kernel)  # type: ignore[attr-defined]
    return partial(found, instance_name=name, resources=resources, visible=bool(visible))


def quicken(kernel: ModuleType) -> None:
    """Let a kernel call exp, log and tanh of the binary, which give the bits of its own."""
    for name in FUNCTIONS & {*vars(kernel)}:
        own = getattr(kernel, name)
        if isinstance(own, FunctionType) and "in_c" in globals():
            setattr(kernel, name, globals()["in_c"](name, own))


def slave_class(resources: str) -> type:
    """The slave's class; `resources` are on the search path from here on, as pythonfmu's slaves expect."""
    note = Path(resources, "slavemodule.txt")
    name = note.read_text("utf-8", "replace").strip() if note.is_file() else ""
    script = Path(resources, f"{name}.py")
    if not name or not script.is_file():
        raise Refusal(f"`{note}` should name the script of this FMU, and says `{name}`. Extract the whole FMU again.")
    if resources not in sys.path:
        sys.path.insert(0, resources)
    key = name, script.read_bytes()
    with LOCK:
        if key not in CLASSES:
            CLASSES[key] = find_class(module_of(name, script))
    return CLASSES[key]


def module_of(name: str, script: Path) -> ModuleType:
    """Run the script as the module of this name, also if another FMU has one of the same name."""
    spec = importlib.util.spec_from_file_location(name, script)
    assert spec is not None and spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def find_class(module: ModuleType) -> type:
    """The class in a module that is furthest from pythonfmu's own, as its builder chooses it."""
    base: type = importlib.import_module("pythonfmu").Fmi2Slave
    classes = [c for c in vars(module).values() if isinstance(c, type) and issubclass(c, base)]
    classes = [c for c in classes if not getattr(c, "__abstractmethods__", None)]
    if not classes:
        raise Refusal(f"`{module.__file__}` has no class derived from pythonfmu's Fmi2Slave. Build the FMU again.")
    return max(classes, key=lambda c: len(c.__mro__))


# --- Messages ---


def said(name: str, of: type, key: str, *values: Any) -> str:
    """A sentence in the words that the FMU brings along, or nearly so."""
    words = sys.modules.get(f"{of.__module__}.sentences")
    if words is None:
        return f"`{name}` ({of.__name__}): {' '.join([key.replace('_', ' '), *map(str, values)])}"
    text: str = words.say("said", name, of.__name__, words.say(key, *values))
    return text


def refuse(slave: Any, key: str, *values: Any) -> None:
    """Refuse a call."""
    kind = NotProvided if key == "not_provided" else Refusal
    raise kind(said(slave.instance_name, type(slave), key, *values))


def log_failure(slave: Any, error: BaseException) -> None:
    """Log an exception, unless the slave has done so.  For our shell, a call that failed is the end of the run."""
    if hasattr(slave, "enter") and not isinstance(error, NotProvided):
        slave.enter("failed")
    if not getattr(error, "is_logged", False):
        message = as_message(f"`{slave.instance_name}` ({type(slave).__name__})", error)
        slave._get_log_queue().append(message)


def as_message(who: str, error: BaseException) -> SimpleNamespace:
    """An exception as a message."""
    lines = traceback.format_exception(type(error), error, error.__traceback__)
    text = str(error) if isinstance(error, Refusal) else f"{who}: {type(error).__name__}: {error}\n{''.join(lines)}"
    return SimpleNamespace(status=ERROR, category="logStatusError", msg=text)


def not_made(name: str, error: BaseException) -> bytes:
    """Message that there is no slave."""
    return records([as_message(f"`{name}` cannot be made", error)], None)


def take(queue: list[Any], wanted: list[str] | None) -> bytes:
    """Messages in a slave's log of the categories that the host wants, or of all; the log is then empty."""
    messages = queue[:]
    del queue[:]
    return records(messages, wanted)


def records(messages: Iterable[Any], wanted: list[str] | None) -> bytes:
    """The messages that the host wants, as bytes; of a host that wants none, those on errors, its only sign of them."""
    is_all = wanted is None or "logAll" in wanted
    chosen = [m for m in messages if is_all or m.category in (wanted or ["logStatusError"])]
    return b"".join(b"%d%s\0%s\0" % (m.status, *encode([m.category, m.msg])) for m in chosen)


def encode(texts: Iterable[Any]) -> list[bytes]:
    """Texts for C.  Bytes that were not UTF-8 when they came from there are themselves again."""
    return [_encoded(str(text).replace("\0", " ")) for text in texts]


def _encoded(text: str) -> bytes:
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        return text.encode("utf-8", "backslashreplace")


IS_COMPLETE = True  # the binary looks for it
