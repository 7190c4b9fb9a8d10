"""Calls without sense: the host lives on, and every answer is the one that the phase of the instance allows."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from stimuli import rows
from subjects import ERROR, KINDS, OK, Answer, Subject

from gapsense.fmi.life import ALLOWED

NEXT = {
    "fmi2EnterInitializationMode": "initializing",
    "fmi2ExitInitializationMode": "running",
    "fmi2Terminate": "terminated",
}
NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, -1e300, math.nan, math.inf, -math.inf, 5e-324)
TEXTS = ("", "table", "%s%n", "x" * 1000, "/etc/passwd", "nothing.csv", "\udcff")


class Instance:
    """What is expected of an instance: its phase, its time, the phases that it has saved."""

    def __init__(self, subject: Subject, number: int, rng: random.Random) -> None:
        self.subject, self.number, self.rng = subject, number, rng
        self.phase, self.time = "instantiated", 0.0
        self.saved: dict[int, str] = {}

    def call(self) -> tuple[Any, ...]:
        """The next call: a sensible one as a rule."""
        rng = self.rng
        if rng.random() < 0.6:
            return self.sensible()
        name = rng.choice([*(call[4:] for call in ALLOWED), *ALWAYS])
        return name, self.number, *self.arguments(name)

    def sensible(self) -> tuple[Any, ...]:
        name = {
            "instantiated": "EnterInitializationMode",
            "initializing": "ExitInitializationMode",
            "running": "DoStep",
        }.get(self.phase, "Reset")
        if name == "DoStep":
            return name, self.number, self.time, self.subject.step, 1
        return name, self.number

    def arguments(self, name: str) -> tuple[Any, ...]:
        """Arguments for a call, good and bad ones."""
        rng, ports = self.rng, self.subject.component.ports
        number = rng.choice([*NUMBERS, rng.uniform(-10.0, 10.0)])
        if name == "SetupExperiment":
            return rng.randint(0, 1), number, rng.choice(NUMBERS[:3]), rng.randint(0, 1), number
        if name == "DoStep":
            step = (
                self.subject.step
            )  # nothing longer than some of them: an actuator divides them up, and takes its time
            sizes = (step, 2.0 * step, 0.37 * step, 1e-300, 5e-324, 0.0, -step, math.nan, math.inf)
            return rng.choice([self.time, number]), rng.choice(sizes), rng.randint(0, 1)
        if name.endswith("FMUstate"):
            slot = 10 * self.number + rng.randint(0, 2)
            return (rng.randbytes(rng.randint(0, 60)).hex(), slot) if name[:2] == "De" else (slot,)
        if name == "SetDebugLogging":
            return (1, [])
        if name[3:] not in KINDS:
            return ()
        refs = [rng.choice([rng.randrange(len(ports)), rng.randrange(2**32)]) for _ in range(rng.randint(0, 4))]
        return (refs,) if name[:3] == "Get" else (refs, [self.value(name[3:]) for _ in refs])

    def value(self, kind: str) -> Any:
        rng = self.rng
        made = {"Real": rng.choice(NUMBERS), "Integer": rng.randint(-(2**31), 2**31 - 1), "String": rng.choice(TEXTS)}
        return made.get(kind, rng.randint(0, 1))

    def judge(self, name: str, arguments: tuple[Any, ...], answer: Answer) -> None:
        """Hold an answer against what the phase allows, and follow it."""
        call = f"fmi2{name}"
        assert answer.status in (OK, ERROR), (name, arguments, answer)
        assert len(answer.log) == (answer.status == ERROR), (name, arguments, answer)
        if call in ALLOWED and self.phase not in ALLOWED[call]:
            assert answer.status == ERROR, (self.phase, name, answer)
        if answer.status == ERROR:
            self.phase = "failed"
        elif name == "GetFMUstate":
            self.saved[arguments[0]] = self.phase
        elif name == "FreeFMUstate":
            self.saved.pop(arguments[0], None)
        elif name == "SetFMUstate":
            self.phase = self.saved[arguments[0]]
        elif name == "DoStep":
            self.time = arguments[0] + arguments[1]
        else:
            self.phase = NEXT.get(call, "instantiated" if name == "Reset" else self.phase)


ALWAYS = ("Reset", "SetDebugLogging", "GetFMUstate", "SetFMUstate", "FreeFMUstate", "SerializeFMUstate")
ALWAYS += ("DeSerializeFMUstate",)


# the life of an instance is the same code in all components of a kind, which gets 42,000 calls
@pytest.mark.parametrize("count", [300, pytest.param(3_000, marks=pytest.mark.slow)])
def test_calls_without_sense_end_nothing(subject: Subject, count: int) -> None:
    rng = random.Random(f"{subject.component.name} {count}")
    several = [Instance(subject, subject.new().number, rng) for _ in range(2)]
    made = 0
    while made < count:
        one = rng.choice(several)
        ((name, _, *arguments),) = calls = [one.call()]
        one.judge(name, tuple(arguments), subject.ask(*calls)[0])
        made += 1
    for one in several:
        subject.ask(("Reset", one.number), ("free", one.number))
    stimulus = rows(subject.component, 5)
    sound = subject.new("sound")
    sound.bring("running").run(stimulus)
    sound.do("free")
