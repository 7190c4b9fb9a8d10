"""Random calls of a native FMU of FMI 3.0: `python fuzz3.py FOLDER_OF_FMUS COMPONENT CALLS SEED`.

Prints how many calls were refused.  Whatever is called, a refusal is one message, and what is not refused none.
"""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path
from typing import Any

import native3
from fmpy.fmi1 import FMICallException

ODD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e300, -1e-300, 5e-324)
KINDS = ("Float64", "Int32", "Int64", "UInt64", "Boolean", "String", "Float32", "UInt8")
MOST_ROWS = 50


class Fuzzed:
    """One instance and the states that were saved of it."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.rng = random.Random(seed)
        self.one = native3.Instance(native3.fmu(folder))
        self.references = [v.valueReference for v in self.one.fmu.description.modelVariables]
        self.states = [self.one.slave.getFMUState()]
        self.bytes = [self.one.slave.serializeFMUState(self.states[0])]
        self.time, self.step = 0.0, float(self.one.fmu.description.defaultExperiment.stepSize)

    def number(self) -> float:
        return self.rng.choice((*ODD, self.rng.uniform(-1.0, 1.0), 1.0, 0.01))

    def value(self, kind: str) -> Any:
        if kind.startswith("Float"):
            return self.number()
        if kind == "String":
            return self.rng.choice(("", "für", "%s%n", "nowhere.csv", "a" * 2000, *self.texts()))
        return bool(self.rng.getrandbits(1)) if kind == "Boolean" else self.rng.randrange(MOST_ROWS)

    def texts(self) -> list[str]:
        return [v.start for v in self.one.fmu.description.modelVariables if v.type == "String"]

    def sizes(self, references: list[int]) -> int:
        """How many values these variables may have, or any number."""
        count = sum(self.rng.choice((1, 1, 1, 25, 29, 5)) for _ in references)
        return max(0, count + self.rng.choice((0, 0, 0, 1, -1)))

    def some(self) -> list[int]:
        count = self.rng.choice((0, 1, 1, 2, 5))
        return [self.rng.choice((*self.references, 9999, 2**32 - 1)) for _ in range(count)]

    def call(self) -> None:
        """One of the calls below."""
        getattr(self, self.rng.choice([name for name in dir(self) if name.startswith("do_")]))()

    def do_get(self) -> None:
        references = self.some()
        getattr(self.one.slave, f"get{self.rng.choice(KINDS)}")(references, self.sizes(references))

    def do_set(self) -> None:
        kind = self.rng.choice(KINDS)
        references = self.some()
        getattr(self.one.slave, f"set{kind}")(references, [self.value(kind) for _ in range(self.sizes(references))])

    def do_array(self) -> None:
        names = [v for v in self.one.fmu.description.modelVariables if v.dimensions]
        if names:
            variable = self.rng.choice(names)
            self.one.slave.setFloat64([variable.valueReference], [self.number() for _ in range(self.rng.randrange(40))])

    def do_configure(self) -> None:
        self.one.slave.enterConfigurationMode()
        for variable in self.one.fmu.description.modelVariables:
            if variable.causality == "structuralParameter":
                self.one.slave.setUInt64([variable.valueReference], [self.rng.randrange(MOST_ROWS)])
        self.one.slave.exitConfigurationMode()

    def do_start(self) -> None:
        self.one.slave.reset()
        self.time = 0.0
        self.one.start([self.rng.choice((0.0, 0.0, self.number())) for _ in self.one.inputs])

    def do_step(self) -> None:
        step = self.step * self.rng.choice((1.0, 1.0, 1.0, 2.0, 0.5, self.rng.random()))
        self.one.slave.doStep(self.rng.choice((self.time, self.time, self.time, self.number())), step)
        self.time += step

    def do_odd_step(self) -> None:
        self.one.slave.doStep(self.time, self.rng.choice((*ODD[:5], -1.0)))

    def do_life(self) -> None:
        names = ("enterInitializationMode", "exitInitializationMode", "terminate", "enterEventMode", "reset")
        getattr(self.one.slave, self.rng.choice(names))()

    def do_save(self) -> None:
        self.states.append(self.one.slave.getFMUState())
        self.bytes.append(self.one.slave.serializeFMUState(self.states[-1]))
        if len(self.states) > 5:
            self.one.slave.freeFMUState(self.states.pop(self.rng.randrange(5)))

    def do_restore(self) -> None:
        self.one.slave.setFMUState(self.rng.choice(self.states))

    def do_bytes(self) -> None:
        data = bytearray(self.rng.choice(self.bytes))
        for _ in range(self.rng.choice((0, 1, 8))):
            data[self.rng.randrange(len(data))] = self.rng.randrange(256)
        data = data[: self.rng.choice((len(data), len(data), self.rng.randrange(1, len(data))))]
        self.states.append(self.one.slave.deserializeFMUState(bytes(data)))


def main(fmus: str, name: str, calls: str, seed: str) -> None:
    native3.PLACE[:] = [Path(fmus)]
    fuzzed = Fuzzed(next(folder for folder in native3.FOLDERS if folder.name == name), int(seed))
    refusals = 0
    for _ in range(int(calls)):
        before = len(fuzzed.one.log)
        try:
            fuzzed.call()
            told = 0
        except FMICallException as error:
            assert error.status == native3.ERROR, error
            told = 1
        refusals += told
        assert len(fuzzed.one.log) == before + told, fuzzed.one.log[before:]
    print(refusals)


if __name__ == "__main__":
    main(*sys.argv[1:])
