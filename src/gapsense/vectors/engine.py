"""Which scenarios run as vectors, and many runs of one, in threads."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from itertools import groupby

from gapsense._os.native import own_compiler
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.run.recording import Recording, Subject, Take
from gapsense.cosim.scenario.records import ITERATIVE, Port
from gapsense.fmi.components import own
from gapsense.fmi.sentences import Refusal
from gapsense.tables import Value

Recordings = Iterator["tuple[int, Recording | None]"]  # place of a take, and what the run recorded


class Stopped(Exception):
    """The runs were given up, because the caller has stopped."""


def obstacle(subject: Subject) -> str:
    """Why a scenario cannot run as vectors, in a sentence; nothing if it can."""
    experiment, components = subject.scenario.experiment, subject.scenario.components
    if experiment.pace:
        return "It has a pace."
    if experiment.method == ITERATIVE:
        return "Its loops are iterated (`method`)."
    if experiment.step_control is not None:
        return "Its steps are controlled (`step_control`)."
    if experiment.isolation != "none" or any(c.isolation != "none" for c in components.values()):
        return "The scenario asks for separate processes (`isolation`)."
    if any(c.board for c in components.values()):
        return "A component is on a board (`board`)."
    if own_compiler() is None:
        return "There is no C compiler, neither the one that `CC` names nor `cc`, `gcc`, `clang` or ziglang's."
    foreign = [f"`{name}` ({d.path.name})" for name, d in subject.descriptions.items() if not is_ours(d)]
    if foreign:
        return f"These FMUs are not from this version: {', '.join(foreign)}. Build them with `gapsense build`."
    from gapsense.kernels.lanes.library import INSTEAD
    from gapsense.vectors import library

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        is_compiled = library.loop() and all(library.functions(d.name) for d in subject.descriptions.values())
    why = " ".join(str(warning.message).removesuffix(INSTEAD) for warning in said)
    return "" if is_compiled else why or "The C compiler failed."


def is_ours(description: Description) -> bool:
    """True if an FMU is what this package builds of its own component, native or not, as its GUID tells."""
    return any(description.guid == own_guid(description.name, is_native) for is_native in (False, True))


@cache
def own_guid(name: str, is_native: bool) -> str:
    """GUID of our FMU of that name; empty if there is none."""
    try:
        folder = own(name)
    except FileNotFoundError:
        return ""
    from gapsense.fmi import package  # here: not needed for FMUs of others
    from gapsense.fmi.native import parts

    return parts.gather(folder, {}).guid if is_native else package.guid(folder)


class Vectors:
    """A scenario that runs as vectors; models of it are made once for each set of sampling periods."""

    def __init__(self, subject: Subject) -> None:
        from gapsense.vectors import block, library, model

        self.subject, self.block, self.model = subject, block.Block, cache(partial(model.Model, subject))
        self.width: int = library.loop().width()
        self.is_stopped = False  # the caller no longer waits for runs

    def record(self, takes: Sequence[Take]) -> Recordings:
        """What runs record, in any order; None for those that would fail as vectors, and so have to be done by FMUs."""
        by_periods = sorted(range(len(takes)), key=lambda k: self.periods(takes[k]))
        for periods, group in groupby(by_periods, key=lambda k: self.periods(takes[k])):
            places = [*group]
            for first in range(0, len(places), self.width):
                own = places[first : first + self.width]
                try:
                    found = self.block(self.model(periods), [takes[k] for k in own], self.go_on).run()
                except Refusal:  # of a period that does not go with the steps
                    found = [None] * len(own)
                yield from zip(own, found)

    def go_on(self) -> None:
        """Raise Stopped if the caller no longer waits."""
        if self.is_stopped:
            raise Stopped

    def periods(self, take: Take) -> tuple[float, ...]:
        """Sampling period of each component in a run [s], 0 of one that is not sampled."""
        return tuple(self.period(name, take.values) for name in self.subject.order.names)

    def period(self, name: str, values: Mapping[Port, Value]) -> float:
        """Sampling period of one component."""
        variable = self.subject.descriptions[name].variables.get("sample_time")
        if variable is None:
            return 0.0
        component = self.subject.scenario.components[name]
        given = values.get(Port(name, "sample_time"), component.values.get("sample_time", variable.start))
        return float(given or 0.0)
