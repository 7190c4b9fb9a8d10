"""One FMU instance: life cycle and parameters, with errors that carry the component's own words."""

from __future__ import annotations

import atexit
import ctypes
import math
import os
import re
import shutil
import sys
import tempfile
import zipfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from ctypes import c_bool, c_char_p, c_int, c_size_t, c_void_p
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from gapsense._os.files import sha256
from gapsense._os.locks import temporary_folder as locked_folder
from gapsense.cosim.fmu.descriptions import FOLDERS, Description, Variable, path_in
from gapsense.problems import FmuError
from gapsense.tables import Value

PLAIN = re.compile(r"[A-Za-z0-9_./:\\~-]+")
C_TYPES_3: Mapping[str, Any] = {
    "Float64": ctypes.c_double,
    "Float32": ctypes.c_float,
    **{f"{s}Int{n}": getattr(ctypes, f"c_{s.lower()}int{n}") for s in ("", "U") for n in (8, 16, 32, 64)},
    "Enumeration": ctypes.c_int64,
    "Boolean": ctypes.c_bool,
    "String": ctypes.c_char_p,
}
GET, SET, STEP, SLOPE = "fmi2GetReal", "fmi2SetReal", "fmi2DoStep", "fmi2SetRealInputDerivatives"
STATUS = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
# No status of FMI: the step was done and is to be the last; it ended the run before it was over; it went elsewhere.
ENDS, ENDS_WITHIN, ASTRAY = 1001, 1002, 1003
TERMINATED, LAST_TIME = 3, 2  # what can be asked after a step that was discarded
STEADY = "Choose a step that it can do in one go, or ask its author"
LONGEST = 500  # characters of a message shown in an error; its `log` has all
KEPT = 1000  # log messages per instance; the oldest are dropped
NEEDED = (  # what every run calls, or may
    *("fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2ExitInitializationMode"),
    *(STEP, "fmi2Terminate", "fmi2Reset", "fmi2FreeInstance"),
)
CO_SIMULATION = 1
C_TYPES: Mapping[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Enumeration": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}


class Message(NamedTuple):
    """What a component logged at one time."""

    status: int
    text: str


def collector(messages: deque[Message], escape: str = "%%") -> Callable[..., None]:
    """Function for the logger of an FMU that keeps its messages; `escape` is what a text has for `%`."""

    def log(*said: Any) -> None:
        status, _, text = said[-3:]
        messages.append(Message(status, (text or b"").decode("utf-8", "replace").replace(escape, "%")))

    return log


@contextmanager
def folder_kept() -> Iterator[None]:
    """Let components go to other working folders: relative paths mean the same before and after."""
    folder = Path.cwd()
    try:
        yield
    finally:
        os.chdir(folder)


@contextmanager
def process_kept() -> Iterator[None]:
    """Loading changes the working folder, and Python FMUs the search path, where each then stands once.

    What Python compiles meanwhile is not kept: it would go with the unpacked FMU.
    """
    keeps_nothing, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        with folder_kept():
            yield
    finally:
        sys.dont_write_bytecode = keeps_nothing
        sys.path[:] = dict.fromkeys(sys.path)


# An instance in its library. What fmpy does for this takes longer than many a run: it loads much, and looks at all
# functions of each instance.


Logger2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Logger3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    """What an FMU of FMI 2.0 may call."""

    _fields_ = [
        ("logger", Logger2),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


Made = tuple[int, object]  # an instance, and the functions that its library may call, which live as long


def load(folder: Path, fmi: int, identifier: str) -> ctypes.CDLL:
    """The library of an unpacked FMU; its folder, where some look for what they need, is the working folder then."""
    file = folder / path_in(fmi, identifier)
    os.chdir(file.parent)
    return ctypes.CDLL(str(file))


def call_instantiate(library: ctypes.CDLL, function: str, kept: object, *arguments: Any) -> Made:
    """Make an instance by the function of the library that does so; `kept` are its callbacks."""
    make = library[function]
    make.restype = c_void_p
    if not (component := make(*arguments)):
        raise OSError(f"{function} returned no instance")
    return component, kept


def instance_2(library: ctypes.CDLL, name: str, guid: str, folder: Path, log: Callable[..., None]) -> Made:
    """An instance of FMI 2.0."""
    standard = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    allocate, free = (ctypes.cast(function, c_void_p) for function in (standard.calloc, standard.free))
    callbacks = Callbacks(logger=Logger2(log), allocate=allocate, free=free)
    texts = name.encode(), c_int(CO_SIMULATION), guid.encode(), (folder / "resources").as_uri().encode()
    return call_instantiate(library, "fmi2Instantiate", callbacks, *texts, ctypes.byref(callbacks), c_int(0), c_int(1))


def instance_3(library: ctypes.CDLL, name: str, guid: str, folder: Path, log: Callable[..., None]) -> Made:
    """An instance of FMI 3.0, without event mode, early return and intermediate values."""
    logger, no, none = Logger3(log), c_bool(False), c_void_p()
    texts = name.encode(), guid.encode(), os.path.join(folder, "resources", "").encode()  # noqa: PTH118  # ends in `/`
    options = (no, c_bool(True), no, no, none, c_size_t(0), none)
    return call_instantiate(library, "fmi3InstantiateCoSimulation", logger, *texts, *options, logger, none)


class Instance:
    """An FMU of FMI 2.0, loaded as `name` from its unpacked `folder`. After `fmi2Fatal` it is never touched again.

    Whoever calls an entry point names that of FMI 2.0; one of FMI 3.0 translates.
    """

    needed: tuple[str, ...] = NEEDED
    make, escape = staticmethod(instance_2), "%%"
    is_near = True  # in this process, so that C may call it
    last = math.nan  # time that the last step has reached [s], where one was told
    failed, status = "", 0  # the entry point that failed last, and what it returned

    def __init__(self, name: str, description: Description, folder: Path) -> None:
        self.name, self.description = name, description
        self.messages: deque[Message] = deque(maxlen=KEPT)
        self.is_dead = self.is_used = False
        self.held: dict[str, ctypes.c_void_p] = {}
        self.entries: dict[str, Callable[..., int]] = {}
        try:
            with process_kept():
                component, self.kept = self.instantiate(folder)
        except (OSError, AttributeError) as error:  # AttributeError: the library lacks a function
            raise self.error(f"cannot be instantiated: {error}{self.said()}.") from error
        self.pointer = ctypes.c_void_p(component)

    def instantiate(self, folder: Path) -> Made:
        """Make the instance in its library, which has what every run needs."""
        self.library = load(folder, self.description.fmi, self.description.identifier)
        self.entries = {name: self.library[self.entry(name)] for name in self.needed}
        return self.make(self.library, self.name, self.description.guid, folder, collector(self.messages, self.escape))

    @property
    def has_only_reals(self) -> bool:
        """True if one call for Real variables moves all inputs, and one all outputs."""
        moved = (*self.description.of("input"), *self.description.of("output"))
        return all(variable.type == "Real" and variable.size in ("", "Float64") for variable in moved)

    def entry(self, function: str) -> str:
        """Name that this version of FMI has for an entry point of FMI 2.0."""
        return function

    def function(self, name: str) -> Callable[..., int]:
        """Raw entry point, to be called with ctypes objects only."""
        if name not in self.entries:
            try:
                self.entries[name] = self.library[self.entry(name)]
            except AttributeError:
                raise self.error(f"its library has no function `{self.entry(name)}`. Export it again.") from None
        return self.entries[name]

    def call(self, function: str, *arguments: Any) -> None:
        """Call an entry point and raise FmuError if it fails."""
        status = self.function(function)(self.pointer, *arguments)
        if status > WARNING:
            raise self.failure(function, status)

    def failure(self, function: str, status: int, time: float | None = None, step: int | None = None) -> FmuError:
        """Error for a call that failed; the instance counts as dead if it said `fmi2Fatal`."""
        self.failed, self.status, self.is_dead = function, status, self.is_dead or status == FATAL
        if status == ASTRAY:
            found = f"reported that it reached t = {self.last:.9g} s, the end of the step expected. {STEADY}"
        else:
            word = self.entry(STATUS[status]) if 0 <= status < len(STATUS) else f"status {status}"
            found = f"returned {word}"
        return self.error(f"{self.entry(function)} {found}{self.said()}.", time, step)

    def error(self, cause: str, time: float | None = None, step: int | None = None) -> FmuError:
        """An error of this component, with all that it has logged."""
        return FmuError(self.name, cause, time=time, step=step, log=self.log())

    def said(self) -> str:
        """What the component logged about a failure, in one line, to end a sentence with.

        Its own words have status discard or error; after an exception pythonfmu adds a fatal one that often knows less.
        """
        own = [m.text for m in self.messages if m.status in (DISCARD, ERROR)]
        texts = own or [m.text for m in self.messages if m.status == FATAL] or [m.text for m in self.messages]
        lines = dict.fromkeys(summary(text).rstrip(".") for text in texts[-3:])
        return f"; the component says: {'; '.join(lines)}" if lines else "; the component gives no reason"

    def log(self) -> str:
        """Everything logged, oldest first."""
        return "\n".join(message.text for message in self.messages)

    def initialize(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Set values and enter initialization mode; a used instance is reset first, which equals a fresh one."""
        if self.is_used:
            self.messages.clear()
            self.call("fmi2Reset")
        self.is_used = True
        self.enter(values, start, stop)

    def enter(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Everything before and at the start of the initialization mode."""
        yes, no, none = ctypes.c_int(1), ctypes.c_int(0), ctypes.c_double(0.0)
        self.call("fmi2SetupExperiment", no, none, ctypes.c_double(start), yes, ctypes.c_double(stop))
        self.set_all(values)
        self.call("fmi2EnterInitializationMode")

    def set_all(self, values: Mapping[str, Value]) -> None:
        """Set variables by name, those of one type in one call; other elements of an array keep their start values."""
        named = self.description.whole(self.description.variables[name] for name in values)
        for alike in of_one_type(named):
            self.move("Set", alike, [raw(v, values.get(v.name, v.start or 0)) for v in alike])

    def change(self, name: str, value: Value) -> None:
        """Set a variable during a run; other elements of its array stay as they are."""
        others = self.description.arrays.get(self.description.variables[name].array, ())
        self.set_all({**self.get_all(others), name: value})

    def get_all(self, variables: Sequence[Variable]) -> dict[str, Value]:
        """Read variables, those of one type in one call; their values by name, in the order of the variables."""
        groups = of_one_type(self.description.whole(variables))
        found = {v.name: value for alike in groups for v, value in zip(alike, self.move("Get", alike))}
        return {variable.name: plain(variable, found[variable.name]) for variable in variables}

    def move(self, action: str, alike: Sequence[Variable], values: Sequence[Any] = ()) -> Any:
        """Set or get the values of variables of one type; an array, or FmuError."""
        buffer = (self.c_type(alike[0]) * len(alike))(*values)
        status = self.mover(action, alike, buffer)()
        if status > WARNING:
            raise self.failure(self.accessor(action, alike[0]), status)
        return buffer

    def c_type(self, variable: Variable) -> Any:
        """Type of C that a variable has."""
        return C_TYPES[variable.type]

    def accessor(self, action: str, variable: Variable) -> str:
        """Entry point that gets or sets values of this variable's type."""
        return f"fmi2{action}{'Integer' if variable.type == 'Enumeration' else variable.type}"

    def mover(self, action: str, variables: Sequence[Variable], values: Any) -> Callable[[], int]:
        """Function that gets or sets the values of variables of one type, an array, and returns the status."""
        entry, pointer = self.function(self.accessor(action, variables[0])), self.pointer
        references = referring(variables)
        arguments = (references, ctypes.c_size_t(len(references)), values, *self.after(len(variables)))
        return partial(entry, pointer, *arguments)

    def sloper(self, variables: Sequence[Variable], slopes: Any) -> Callable[[], int]:
        """Function that tells how Real inputs go on in the next step, by an array [1/s], and returns the status."""
        entry, count = self.function(SLOPE), len(variables)
        orders = (c_int * count)(*[1] * count)
        return partial(entry, self.pointer, referring(variables), c_size_t(count), orders, slopes)

    def after(self, _: int) -> tuple[Any, ...]:
        """Arguments of an accessor after the values, of which there are so many."""
        return ()

    def doer(self, duration: float) -> Callable[[float], int]:
        """Function of the start time that does a step and returns the status."""
        entry, pointer, time = self.function(STEP), self.pointer, ctypes.c_double()
        step, keep = ctypes.c_double(duration), ctypes.c_int(1)

        def do(start: float) -> int:
            time.value = start
            status = entry(pointer, time, step, keep)
            return status if status != DISCARD else self.judge_step(status, start, duration)

        return do

    def judge_step(self, status: int, start: float, duration: float) -> int:
        """Judge the status of a step; FMI 2.0 tells when asked that it was the orderly end of the component.

        pythonfmu says the same of every step that its component has refused: with words of that, nothing was done.
        """
        if status != DISCARD:
            return status
        said, last = list(self.messages), ctypes.c_double(math.nan)
        has_refused = bool(said) and said[-1].status in (DISCARD, ERROR)
        ends = self.read_status("fmi2GetBooleanStatus", TERMINATED, ctypes.c_int(0))
        is_told = ends and self.read_status("fmi2GetRealStatus", LAST_TIME, last)
        self.messages.clear()  # of words about these questions
        self.messages.extend(said)
        self.last = last.value if is_told else start + duration
        if not ends or (has_refused and self.last <= start):
            return status
        return judge_time(start, duration, self.last, ends=True, early=False)

    def read_status(self, function: str, kind: int, value: Any) -> bool:
        """Read a kind of status into `value`; False if the FMU does not tell it, or if it is 0 for `no`."""
        try:
            status = self.function(function)(self.pointer, ctypes.c_int(kind), ctypes.byref(value))
        except FmuError:  # a library without this function
            return False
        return status <= WARNING and (kind != TERMINATED or bool(value.value))

    def state(self) -> bytes:
        """The whole state of the instance, as `restore` takes it."""
        state, size = ctypes.c_void_p(), ctypes.c_size_t()
        self.call("fmi2GetFMUstate", ctypes.byref(state))
        try:
            self.call("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
            buffer = ctypes.create_string_buffer(size.value)
            self.call("fmi2SerializeFMUstate", state, buffer, size)
        finally:
            self.call("fmi2FreeFMUstate", ctypes.byref(state))
        return buffer.raw

    def restore(self, saved: bytes) -> None:
        """Remember what another instance of the same FMU did."""
        state, size = ctypes.c_void_p(), ctypes.c_size_t(len(saved))
        self.call("fmi2DeSerializeFMUstate", ctypes.create_string_buffer(saved, len(saved)), size, ctypes.byref(state))
        try:
            self.call("fmi2SetFMUstate", state)
        finally:
            self.call("fmi2FreeFMUstate", ctypes.byref(state))

    def hold(self, name: str) -> None:
        """Keep the state as it is now under a name, for `back`."""
        self.call("fmi2GetFMUstate", ctypes.byref(self.held.setdefault(name, ctypes.c_void_p())))

    def back(self, name: str) -> None:
        """Go back to the state that is held under this name."""
        self.call("fmi2SetFMUstate", self.held[name])

    def facts(self) -> dict[str, Any]:
        """What a result says about where it ran; nothing for an FMU in this process."""
        return {}

    def close(self) -> None:
        """Free the instance and its library, unless it is dead."""
        if not self.is_dead:
            for held in self.held.values():
                with suppress(FmuError):
                    self.call("fmi2FreeFMUstate", ctypes.byref(held))
            self.is_dead = True
            free, handle = self.library[self.entry("fmi2FreeInstance")], c_void_p(self.library._handle)
            free.restype = None
            free(self.pointer)
            if sys.platform == "win32":
                ctypes.windll.kernel32.FreeLibrary(handle)
            else:
                ctypes.CDLL(None).dlclose(handle)


def judge_time(start: float, duration: float, last: float, *, ends: bool, early: bool) -> int:
    """Judge the time that a step has reached, as a status; that of an FMU is told with some rounding."""
    end = start + duration
    slack = 1e-2 * duration + 1e-15 * abs(end)
    if not start - slack <= last <= end + slack:
        return ASTRAY
    is_short = last < end - slack
    if ends:
        return ENDS_WITHIN if is_short else ENDS
    return ASTRAY if early or is_short else 0


def referring(variables: Sequence[Variable]) -> Any:
    """References of variables as an array of C; the elements of an array, one after the other, have one reference."""
    numbers = [variable.reference for variable in variables if variable.place == 0]
    return (ctypes.c_uint * len(numbers))(*numbers)


def of_one_type(variables: Iterable[Variable]) -> Iterable[list[Variable]]:
    """Variables in groups that one call can move."""
    groups: dict[str, list[Variable]] = {}
    for variable in variables:
        groups.setdefault(variable.size or variable.type, []).append(variable)
    return groups.values()


def raw(variable: Variable, value: Value) -> Any:
    """A value as an array of C takes it."""
    return str(value).encode("utf-8") if variable.type == "String" else variable.number(value)


def plain(variable: Variable, value: Any) -> Value:
    """A value that was read from an array of C."""
    if variable.type == "String":
        return (value or b"").decode("utf-8", "replace")
    return bool(value) if variable.type == "Boolean" else value


def summary(text: str) -> str:
    """One line for a logged text: of one with a traceback only what stands before it and its last line."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    start = next((i for i, line in enumerate(lines) if line.startswith("Traceback (")), None)
    words = " ".join(lines if start is None else [*lines[:start], lines[-1]])
    return words[:LONGEST] or "(empty message)"


# FMI 3.0: what differs from 2.0.


def instance_of(name: str, description: Description, folder: Path) -> Instance:
    """An FMU of either version, loaded as `name` from its unpacked `folder`."""
    return (Instance3 if description.fmi == 3 else Instance)(name, description, folder)


class Instance3(Instance):
    """An FMU of FMI 3.0, without event mode, early return and clocks."""

    needed = tuple(name for name in NEEDED if name != "fmi2SetupExperiment")
    make, escape = staticmethod(instance_3), "%"

    def entry(self, function: str) -> str:
        """Name that FMI 3.0 has for an entry point or a status of FMI 2.0."""
        return function.replace("fmi2", "fmi3", 1).replace("FMUstate", "FMUState").replace("DeSer", "Deser")

    def enter(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Everything before and at the start of the initialization mode."""
        yes, no, none = ctypes.c_bool(True), ctypes.c_bool(False), ctypes.c_double(0.0)
        sizes = {name: value for name, value in values.items() if self.description.variables[name].is_structural}
        if sizes:
            self.call("fmi2EnterConfigurationMode")
            self.set_all(sizes)
            self.call("fmi2ExitConfigurationMode")
        self.set_all({name: value for name, value in values.items() if name not in sizes})
        self.call("fmi2EnterInitializationMode", no, none, ctypes.c_double(start), yes, ctypes.c_double(stop))

    def c_type(self, variable: Variable) -> Any:
        """Type of C that a variable has."""
        return C_TYPES_3[variable.size or variable.type]

    def accessor(self, action: str, variable: Variable) -> str:
        """Entry point that gets or sets values of this variable's type, as FMI 2.0 might call it."""
        return f"fmi2{action}{'Int64' if variable.type == 'Enumeration' else variable.size or variable.type}"

    def after(self, count: int) -> tuple[Any, ...]:
        """Arguments of an accessor after the values: their number, as there may be arrays."""
        return (ctypes.c_size_t(count),)

    def doer(self, duration: float) -> Callable[[float], int]:
        """Function of the start time that does a step and returns the status, or what its end means."""
        entry, pointer, time, keep = self.function(STEP), self.pointer, ctypes.c_double(), ctypes.c_bool(True)
        step, last = ctypes.c_double(duration), ctypes.c_double()
        event, ends, early = (ctypes.c_bool() for _ in range(3))
        answers = tuple(ctypes.byref(answer) for answer in (event, ends, early, last))

        def do(start: float) -> int:
            time.value, last.value = start, start + duration  # where an FMU does not tell it
            event.value = ends.value = early.value = False
            status = entry(pointer, time, step, keep, *answers)
            self.last = last.value
            end = (
                judge_time(start, duration, last.value, ends=ends.value, early=early.value) if status <= WARNING else 0
            )
            return end or status

        return do

    def judge_step(self, status: int, start: float, duration: float) -> int:
        """The status of a step, which says it all."""
        return status


# FMUs unpacked once per process and content: the same library is then never loaded from two places.
#
# Libraries of Python FMUs stay in memory for ever, so what is unpacked anew for each run costs memory for each run.


def unpack_fmu(description: Description) -> Path:
    """Unpack what a run needs of an FMU into a folder, which stays until the process ends."""
    folder = home(os.getpid()) / description.sha256
    if not folder.is_dir():
        if sha256(description.path) != description.sha256:
            raise FmuError(description.name, f"`{description.path}` has changed since it was read. Start again.")
        part = Path(tempfile.mkdtemp(dir=folder.parent))
        try:
            with zipfile.ZipFile(description.path) as archive:
                archive.extractall(part, [name for name in archive.namelist() if is_needed(name)])
        except (OSError, zipfile.BadZipFile) as error:
            shutil.rmtree(part, ignore_errors=True)
            cause = getattr(error, "strerror", None) or error
            why = f"`{description.path}` cannot be unpacked into `{folder.parent}`: {cause}"
            raise FmuError(description.name, f"{why}. Check the file and the free space on that disk.") from error
        with suppress(OSError):  # another thread was faster
            part.rename(folder)
    return folder


def is_needed(member: str) -> bool:
    """True unless no run needs it: documentation, sources, binaries of other platforms."""
    folder, *inner = member.split("/")
    is_foreign = folder == "binaries" and len(inner) > 1 and inner[0] not in FOLDERS.values()
    return folder not in ("documentation", "sources") and not is_foreign


@cache
def home(process: int) -> Path:
    """Folder for what this process unpacks. It is removed when the process ends, or by the next process."""
    folder = temporary_folder()
    atexit.register(remove, folder, process)
    return folder


def temporary_folder() -> Path:
    """A new folder with a plain ASCII path: FMUs may fail on any other, see section 1 of hosts.md."""
    for base in (None, Path("/tmp"), Path()):
        folder = locked_folder(base).resolve()
        if PLAIN.fullmatch(str(folder)):
            return folder
        shutil.rmtree(folder)
    raise FmuError("fmus", "no temporary folder has a plain ASCII path. Set TMPDIR to one that has.")


def remove(folder: Path, process: int) -> None:
    """Remove the folder of a process, unless this one was forked from it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)
