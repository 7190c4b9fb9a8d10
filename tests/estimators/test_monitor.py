"""`Monitor` on operations that are made up: what is usual, what is strange, what passes, and what stays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pytest

from gapsense.estimators import readings
from gapsense.estimators.monitor import monitor
from gapsense.estimators.monitor.records import Inputs, Outputs, Parameters, Verdict
from gapsense.estimators.monitor.signatures import CAUSES, GRADUAL, MISSING, SUDDEN, direction
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat, names, record

KERNEL = Kernel(monitor).scalar
PAR = Parameters(sample_time=1e-3, settle=3e-3, learn_windows=20.0)
PHASES = [1, 3, 3, 4]  # samples of an operation in each phase, after that at the edge
VALUES = np.array([48.0, 1e-3, 1.0, 0.5, 25e-3, 8e-3, 1.6e-3, 19e-3])
STD = 0.002
USUAL = 1e-3  # deviation of a mean innovation [A]
OUTPUTS = names(Outputs)
KEPT = [name for name in OUTPUTS if name.startswith("baseline")]


class Bench:
    """A monitor, and operations for it."""

    def __init__(self, par: Parameters = PAR, seed: int = 1) -> None:
        self.rng, self.par, self.time, self.windows = np.random.default_rng(seed), tuple(flat(par)), 0.0, 0.0
        self.is_on, self.current = False, 0.0
        self.values = VALUES.copy()
        self.state, self.outputs = KERNEL["initial"](self.sample(0.0, 3.0, 0.0), self.par)

    def sample(self, innovation: float, mode: float, causes: float) -> tuple[float, ...]:
        """Inputs now."""
        found = (*self.values, *(STD * self.values))
        return (self.time, float(self.is_on), self.current, innovation, mode, causes, self.windows, 0.6, *found)

    def operate(
        self,
        profile: Sequence[float] = (0.0,) * 8,
        causes: float = 0.0,
        moves: bool = True,
        share: float = 1.0,
        spike: float = 0.0,
    ) -> None:
        """One operation with mean innovations of a profile, a closing or an opening in turn, and of a current.

        A spike is added to the last innovation after the landing of a closing.
        """
        self.is_on, rests = not self.is_on, 1.0 if self.is_on else 3.0
        self.windows += 1.0
        means = np.array(profile[:4] if self.is_on else profile[4:]) + USUAL * self.rng.standard_normal(4)
        modes = [rests, rests, 2.0, 4.0 - rests, 4.0 - rests]
        spikes = (0.0, 0.0, 0.0, spike if self.is_on else 0.0, 0.0)
        for mean, last, mode, count in zip((5.0, *means), spikes, modes, (1, *PHASES)):  # the edge does not count
            for k in range(count):
                self.time += 1e-3
                self.current = share * ((30.0 / self.values[0] if self.is_on else 0.0) + float(mean))
                innovation = float(mean) + (last if k == count - 1 else 0.0)
                given = self.sample(innovation, mode if moves else rests, causes)
                self.state, self.outputs = KERNEL["step"](self.state, given, self.par)

    def said(self, *wanted: str) -> list[float]:
        """Outputs by name."""
        return [self.outputs[OUTPUTS.index(name)] for name in wanted]


@pytest.fixture
def bench() -> Bench:
    """One that knows its device."""
    made = Bench()
    for _ in range(40):
        made.operate()
    return made


def operated(bench: Bench, count: int, **more: object) -> list[float]:
    """Verdicts after each of some operations, which the command of the next one ends."""
    found = []
    for _ in range(count):
        bench.operate(**more)  # type: ignore[arg-type]
        found.append(bench.said("verdict")[0])
    return found


def test_it_learns_and_is_silent(bench: Bench) -> None:
    assert bench.said("verdict", "baseline_windows", "faults") == [float(Verdict.healthy), 20.0, 0.0]
    assert bench.said("baseline_mass")[0] == pytest.approx(np.log(1.6e-3))
    assert bench.said("baseline_size")[0] == pytest.approx(2.0 * USUAL, rel=0.3)
    assert set(operated(bench, 200)) == {float(Verdict.healthy)}
    assert bench.said("commands") == bench.said("motions")


@pytest.mark.parametrize("number", range(len(SUDDEN)))
def test_a_sudden_cause_is_told_after_two_operations_and_passes(bench: Bench, number: int) -> None:
    """The command after two operations ends them; an opening that is stronger than its closing came first."""
    cause, entries, _ = SUDDEN[number]
    if np.linalg.norm(entries[4:]) > np.linalg.norm(entries[:4]):
        bench.operate()
    assert operated(bench, 3, profile=[0.1 * x for x in direction(entries)], causes=1.0)[-1] == float(Verdict.faulty)
    assert bench.said("cause", f"since_{cause}") == [CAUSES.index(cause) + 1.0, bench.said("onset")[0]]
    assert bench.said(f"evidence_{cause}")[0] > 0.9
    assert operated(bench, 3)[-1] == float(Verdict.healthy)
    assert bench.said("faults", "passed", "cause", f"since_{cause}") == [1.0, 1.0, 0.0, -1.0]


def test_a_fault_that_mhe_gets_used_to_stays(bench: Bench) -> None:
    """Operations are usual again, but with another resistance."""
    entries = next(s.entries for s in SUDDEN if s.cause == "contact")
    bench.operate([0.1 * x for x in direction(entries)], causes=1.0)
    bench.values[0] *= 1.1
    assert operated(bench, 20)[-1] == float(Verdict.faulty)
    bench.values[0] /= 1.1
    assert operated(bench, 2)[-1] == float(Verdict.healthy)


def test_a_fault_that_moves_what_is_learnt_stays(bench: Bench) -> None:
    """Innovations are usual again, but with other currents and another mass; it is not far enough for wear."""
    entries = next(s.entries for s in SUDDEN if s.cause == "friction")
    bench.operate([0.1 * x for x in direction(entries)], causes=1.0)
    bench.values[6] *= 1.0 + 2.0 * monitor.WANDER * STD
    assert operated(bench, 20, share=0.8)[-1] == float(Verdict.faulty)
    assert monitor.SAME < bench.said("wear")[0] < PAR.limit_worn
    bench.values[6] = VALUES[6]
    assert operated(bench, 2, share=0.8)[-1] == float(Verdict.healthy)


@pytest.mark.parametrize(("share", "cause"), [(0.0, "open"), (1.0, "gain")])
def test_a_circuit_without_a_current_is_open(bench: Bench, share: float, cause: str) -> None:
    """The direction is that of a sensor that reads too little; the second operation has no motion, or has one."""
    entries = next(s.entries for s in SUDDEN if s.cause == "gain")
    if bench.is_on:
        bench.operate()
    for moves in (True, share > 0.0, True):
        bench.operate([0.6 * x for x in direction(entries)], causes=1.0, moves=moves, share=share)
    assert bench.said("cause") == [CAUSES.index(cause) + 1.0]


def test_what_mhe_does_while_it_feeds_the_current_back_is_no_part_of_a_profile(bench: Bench) -> None:
    """It then may have far more current than the coil, without a motion."""
    entries = next(s.entries for s in SUDDEN if s.cause == "stuck_lower")
    if not bench.is_on:
        bench.operate()
    profile = [0.1 * x for x in direction(entries)]
    assert operated(bench, 3, profile=profile, causes=1.0, spike=-1.2)[-1] == float(Verdict.faulty)
    assert bench.said("cause") == [CAUSES.index("stuck_lower") + 1.0]
    assert bench.said("profile_closing_before", "profile_closing_landed") == pytest.approx(
        [profile[0], profile[2]], abs=3.0 * USUAL
    )


def test_the_current_of_a_coil_that_has_cooled_counts(bench: Bench) -> None:
    """It is more than usual closings end with, and so is that of `Mhe`."""
    bench.values[0] *= 0.8
    if bench.is_on:
        bench.operate()
    operated(bench, 2, profile=[0.0, 0.0, -0.01, -0.012, 0.0, 0.0, 0.0, 0.0])
    assert bench.said("profile_closing_landed", "profile_closing_held") == pytest.approx(
        [-0.01, -0.012], abs=3.0 * USUAL
    )


def test_neither_noise_nor_a_cold_coil_nor_mhe_alone_is_a_fault(bench: Bench) -> None:
    assert set(operated(bench, 4, causes=1.0)) == {float(Verdict.healthy)}
    assert set(operated(bench, 4, profile=[0.1] * 8, causes=readings.UNLEARNT)) == {float(Verdict.healthy)}
    assert set(operated(bench, 2, profile=[0.01] * 8)) == {float(Verdict.healthy)}
    if bench.is_on:
        bench.operate()
    colder = [2e-3, 8.6e-3, 17.6e-3, 2e-3, 0.0, 0.0, 0.0, 0.0]
    assert set(operated(bench, 1, profile=colder, causes=1.0) + operated(bench, 4)) == {float(Verdict.healthy)}


def test_commands_without_motion_are_counted_and_told(bench: Bench) -> None:
    before = bench.said("commands", "motions")
    assert operated(bench, 3, moves=False)[-1] == float(Verdict.faulty)
    assert bench.said("cause", "evidence_still") == [12.0, 1.0]
    assert np.subtract(bench.said("commands", "motions"), before).tolist() == [3.0, 1.0]


def test_wear_is_told_by_what_moves_and_the_temperature_is_none(bench: Bench) -> None:
    bench.values[0] *= 1.3
    assert set(operated(bench, 50)) == {float(Verdict.healthy)}
    cause, entries, _ = GRADUAL[0]
    bench.values[1:] *= np.exp(0.1 * np.array(entries) / np.linalg.norm(entries))
    assert operated(bench, 2)[-1] == float(Verdict.worn)
    assert bench.said("cause") == [CAUSES.index(cause) + 1.0]


def test_what_mhe_still_settles_on_is_no_baseline() -> None:
    """Its values come nearer by an eighth with each window; the last third of the windows makes the baseline."""
    bench, off = Bench(), 60.0 * STD
    while bench.said("verdict") == [float(Verdict.learning)]:
        bench.values = VALUES * (1.0 + off)
        off *= 0.875
        bench.operate()
    bench.values = VALUES.copy()
    assert set(operated(bench, 4)) == {float(Verdict.healthy)}
    assert bench.said("wear")[0] < 0.7 * PAR.limit_worn


def test_eddy_currents_count_half() -> None:
    bench = Bench()
    operated(bench, 40)
    bench.values[1] *= np.exp(1.5 * PAR.limit_worn * monitor.WANDER * STD)
    assert set(operated(bench, 4)) == {float(Verdict.healthy)}
    assert bench.said("moved_eddy", "wear") == pytest.approx([4.5, 2.25], rel=1e-2)


def test_wear_stays_told_while_mhe_is_lost(bench: Bench) -> None:
    """Learnt values go back to what they were as `Mhe` doubts them, and its bit 1 is set."""
    bench.values[6] *= np.exp(4.0 * monitor.WANDER * STD)
    assert operated(bench, 3)[-1] == float(Verdict.worn)
    bench.values = VALUES.copy()
    assert set(operated(bench, 6, causes=1.0)) == {float(Verdict.worn)}
    assert operated(bench, 4)[-1] == float(Verdict.healthy)


def test_a_trend_is_that_of_a_value(bench: Bench) -> None:
    for _ in range(3000):
        bench.values[6] *= 1.0 + 1e-5
        bench.operate()
    assert bench.said("trend_mass")[0] == pytest.approx(0.01, rel=0.02)
    assert bench.said("trend_rest_position")[0] == pytest.approx(0.0, abs=1e-12)


def test_a_restart_begins_with_the_baseline(bench: Bench) -> None:
    kept, starts = dict(zip(KEPT, bench.said(*KEPT))), dict(zip(names(Parameters), flat(PAR)))
    assert len(KEPT) == 18 and starts.keys() >= kept.keys()
    again = Bench(record(Parameters, {**starts, **kept}.values()), seed=2)
    assert again.said("verdict", *KEPT) == [float(Verdict.healthy), *kept.values()]
    entries = next(s.entries for s in SUDDEN if s.cause == "turns")
    assert operated(again, 3, profile=[0.1 * x for x in direction(entries)], causes=1.0)[-1] == float(Verdict.faulty)
    assert again.said("cause") == [CAUSES.index("turns") + 1.0]


def test_inputs_are_those_of_mhe() -> None:
    from gapsense.estimators.mhe import mhe

    assert {*names(Inputs)} - {"time", "command", "current"} <= {*names(mhe.Outputs)}


def test_every_cause_has_outputs_and_a_signature() -> None:
    def of(kind: str) -> Iterable[str]:
        return (name.removeprefix(kind) for name in OUTPUTS if name.startswith(kind))

    assert tuple(of("evidence_")) == tuple(of("since_")) == CAUSES
    assert {s.cause for s in SUDDEN} == {*CAUSES} - {*MISSING}
    assert {s.cause for s in GRADUAL} <= {*CAUSES}
