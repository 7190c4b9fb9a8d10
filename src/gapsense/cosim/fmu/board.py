"""A component on a board.  Its FMU goes along: it judges values and steps, and is what the board is compared with."""

from __future__ import annotations

import ctypes
import json
import struct
from array import array
from base64 import b64decode, b64encode
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from gapsense.cosim.fmu.descriptions import Description, Variable
from gapsense.cosim.fmu.instance import ERROR, WARNING, Instance, Instance3
from gapsense.cosim.fmu.line import ABOUT, LOAD, SAVE, SET, START, STEP, BoardError, Link
from gapsense.fmi.steps import samples_due
from gapsense.fmi.values import fields
from gapsense.problems import FmuError, suggest
from gapsense.tables import Value

NUMBERS = {4: "<f4", 8: "<f8"}


class OnBoard(Instance):
    """A component on the board at the end of `link`, of whose outputs only those `wanted` are read.

    `duration` [s] is that of its steps, `clock` [Hz] that of the board, if it is known.
    """

    is_near = False

    def __init__(
        self,
        name: str,
        description: Description,
        folder: Path,
        link: Link,
        wanted: Collection[str],
        clock: float | None,
    ) -> None:
        super().__init__(name, description, folder)
        self.link, self.clock, self.folder = link, clock, folder / "resources"
        self.cause, self.is_running, self.duration = "", False, 0.0
        self.period = self.elapsed = self.start = 0.0
        try:
            with self.explain_errors():
                self.learn(wanted)
        except FmuError:
            super().close()
            raise

    @contextmanager
    def explain_errors(self) -> Iterator[None]:
        """Tell what is wrong with the board as the error of its component."""
        try:
            yield
        except BoardError as error:
            self.cause = f"the board `{self.link.line.board}` {error}."
            raise self.error(self.cause) from error

    def learn(self, wanted: Collection[str]) -> None:
        """Find the component on the board, and what it calls its inputs, outputs and parameters."""
        known: dict[str, int] = {}
        for place in range(self.link.count):
            text = self.link.whole(ABOUT, place, 1).decode()
            name, *lists = text.split("\n")
            known[name] = place
            if name == self.description.name:
                self.place, self.inputs, self.outputs, self.numbers, self.fixed = place, *(t.split() for t in lists)
        if self.description.name not in known:
            raise BoardError(f"has no `{self.description.name}`. {suggest(self.description.name, known)} Export it")
        about = self.link.ask(ABOUT, self.place, struct.pack("<I", 0))
        self.state_size, self.memory = struct.unpack_from("<2I", about)
        self.unit = about[8:].partition(b"\0")[0].decode()
        self.type = np.dtype(NUMBERS[self.link.size])
        if missing := sorted(set(wanted) - set(self.outputs)):
            raise BoardError(
                f"has no output `{missing[0]}`, which is connected or recorded. Export it with this output"
            )
        named = {v.name: v for c in ("input", "output") for v in self.description.of(c)}
        if strange := [n for n in (*self.inputs, *self.outputs) if n not in named and n not in ("time", "dt")]:
            raise BoardError(f"has `{strange[0]}`, which the FMU has not. Export its firmware again")
        self.taken, self.fetch_inputs = self.fetching([named[n] for n in self.inputs if n in named])
        self.theirs, self.fetch_outputs = self.fetching([named[n] for n in self.outputs])
        self.found = np.zeros(len(self.outputs))
        self.forget()

    def fetching(self, variables: Sequence[Variable]) -> tuple[Any, Callable[[], int]]:
        """An array of values of the FMU, and the function that fetches them."""
        values = (ctypes.c_double * len(variables))()
        fetch = super().mover("Get", variables, values) if variables else lambda: 0
        return np.ctypeslib.as_array(values), fetch

    def forget(self) -> None:
        """Begin to count and to compare."""
        self.counts, self.worst, self.largest = array("L"), np.zeros(len(self.found)), np.zeros(len(self.found))
        self.repeated: dict[str, int] = {}  # requests by why
        self.first: float | None = None  # time of the first one [s]

    # What the master calls.

    def mover(self, action: str, variables: Sequence[Variable], values: Any) -> Callable[[], int]:
        """Function that sets or gets values; outputs are those of the board once it runs."""
        move = super().mover(action, variables, values)
        own = {name: k for k, name in enumerate(self.outputs)}
        places = [(k, own[v.name]) for k, v in enumerate(variables) if v.causality == "output" and v.name in own]
        if action == "Set" or not places:
            return move

        def take() -> int:
            status = move()
            if status <= WARNING and self.is_running:
                for k, place in places:
                    values[k] = self.found[place]
            return status

        return take

    def initialize(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Set parameters and enter initialization mode."""
        self.is_running, self.start, self.cause = False, start, ""
        self.forget()
        super().initialize(values, start, stop)

    def call(self, function: str, *arguments: Any) -> None:
        """Call an entry point; at the end of the initialization the board starts too."""
        super().call(function, *arguments)
        if function == "fmi2ExitInitializationMode":
            with self.explain_errors():
                self.send_parameters()
                self.elapsed = 0.0
                self.move_once(START, self.start, 0.0)
            self.is_running = True

    def send_parameters(self) -> None:
        """Give the board the numbers that the FMU has."""
        parameters, rules = self.description.of("parameter"), self.description.rules
        given = self.get_all(parameters)
        made: dict[str, Any] = {name.replace(".", "_"): value for name, value in given.items()}
        chosen = {v.name.replace(".", "_"): [*v.items.values()] for v in parameters if v.items}  # of FMI 3.0
        made |= {name: items.index(made[name]) for name, items in chosen.items()}
        if rules:
            known = {port.name for port in rules.ports}
            own = {name: value for name, value in given.items() if name in known}
            made |= fields(rules._replace(rising=(), limits=()), own, self.folder)
        if unknown := [name for name in (*self.numbers, *self.fixed) if name not in made]:
            raise BoardError(f"has a parameter `{unknown[0]}`, which the FMU has not. Export its firmware again")
        self.period = float(given.get("sample_time", 0.0))
        numbers, fixed = (b"".join(self.bytes_of(made[n]) for n in names) for names in (self.numbers, self.fixed))
        self.ask(SET, numbers + struct.pack("<I", crc32(fixed)))

    def bytes_of(self, value: Any) -> bytes:
        """Numbers as the board has them."""
        return np.ravel(np.asarray(value, dtype=float)).astype(self.type).tobytes()

    def ask(self, what: int, data: bytes, time: float | None = None) -> bytes:
        """The answer of the board; notes how often it was asked in vain."""
        answer = self.link.ask(what, self.place, data)
        for trouble in self.link.troubles:
            self.repeated[trouble] = self.repeated.get(trouble, 0) + 1
            self.first = time if self.first is None else self.first
        return answer

    def move_once(self, what: int, time: float, dt: float) -> None:
        """Give the board its inputs, let it start or step, take its outputs and the count."""
        self.fetch_inputs()
        own = iter(self.taken)
        values = [time if n == "time" else dt if n == "dt" else next(own) for n in self.inputs]
        answer = self.ask(what, self.bytes_of(values), time)
        self.found = np.frombuffer(answer, self.type, len(self.outputs)).astype(float)
        if what == STEP:
            self.counts.append(struct.unpack_from("<I", answer, len(answer) - 4)[0])

    def doer(self, duration: float) -> Callable[[float], int]:
        """Function of the start time that does a step, here and on the board, and returns the status."""
        do, self.duration = super().doer(duration), duration

        def both(start: float) -> int:
            status = do(start)
            if status > WARNING:
                return status
            try:
                with self.explain_errors():
                    self.advance(start + duration, duration)
            except FmuError:  # which `failure` makes again, with the time of the step
                return ERROR
            self.compare()
            return status

        return both

    def advance(self, end: float, duration: float) -> None:
        """The samples that fall due in a step, on the board."""
        if not self.period:
            return self.move_once(STEP, end, duration)
        count, self.elapsed = samples_due(end, duration, self.period, self.elapsed)
        for k in range(count - 1, -1, -1):
            self.move_once(STEP, end - k * self.period, self.period)

    def compare(self) -> None:
        """Note how far the outputs of the board are from those of the FMU."""
        self.fetch_outputs()
        np.fmax(self.worst, np.abs(self.found - self.theirs), out=self.worst)
        np.fmax(self.largest, np.abs(self.theirs), out=self.largest)

    def failure(self, function: str, status: int, time: float | None = None, step: int | None = None) -> FmuError:
        """Error for a call that failed, or for a board that does."""
        if self.cause:
            return self.error(self.cause, time, step)
        return super().failure(function, status, time, step)

    def change(self, name: str, value: Value) -> None:
        """Set a variable during a run."""
        super().change(name, value)
        with self.explain_errors():
            self.send_parameters()

    def state(self) -> bytes:
        """All that the FMU and the board remember."""
        with self.explain_errors():
            there = self.link.whole(SAVE, self.place, 0, self.state_size)
        both = [b64encode(part).decode() for part in (super().state(), there)]
        return json.dumps([*both, self.found.tolist(), self.elapsed]).encode()

    def restore(self, saved: bytes) -> None:
        """Remember what another instance of the same FMU, and the board, did."""
        here, there, found, self.elapsed = json.loads(saved)
        super().restore(b64decode(here))
        content, room = b64decode(there), self.link.most - 4
        with self.explain_errors():
            self.send_parameters()
            for at in range(0, len(content), room):
                self.ask(LOAD, struct.pack("<I", at) + content[at : at + room])
        self.found = np.array(found)

    # What a result says about the board after a run.

    def facts(self) -> dict[str, Any]:
        """How long its steps took, what memory it uses, how far it was from the FMU; of JSON."""
        if not self.link.is_lost:
            with suppress(BoardError):
                self.link.hello()
        counts = np.array(self.counts, dtype=float)
        took = [float(x) for x in (counts.mean(), np.quantile(counts, 0.99), counts.max())] if counts.size else []
        names = zip(self.outputs, self.worst.tolist(), self.largest.tolist())
        return {
            "board": self.link.line.board,
            "real": "double" if self.link.size == 8 else "float",
            "unit": self.unit,
            "counts": took,  # mean, 99 %, most of a step
            "clock": self.clock,
            "steps": len(self.counts),
            "period": self.period or self.duration,
            "memory": self.memory,
            "stack": self.link.stack,
            "ram": self.link.ram,
            "flash": self.link.flash,
            "difference": {name: [worst, largest] for name, worst, largest in names},
            "repeated": self.repeated,
            "first": self.first,
        }


class OnBoard3(OnBoard, Instance3):
    """The same for an FMU of FMI 3.0."""
