"""Ports and records of `Monitor`."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.estimators.monitor.signatures import CAUSES_TOLD
from gapsense.kernels.interface import input_, measured, output, parameter, part, ports, record_of, sample_time
from gapsense.kernels.layout import Array, Choice, Scalar, Vector


class Verdict(Choice):
    """What the device is; the numbers are those of the output `verdict`."""

    learning, healthy, worn, faulty = range(4)


class Phase(Choice):
    """Where an operation is, by the motion that `Mhe` expects."""

    before, moving, landed, held = range(4)


PHASES = len(Phase)


def of_mhe(unit: str, signal: str, description: str, **more: Any) -> Scalar:
    """An output of `Mhe`."""
    return input_(unit, description, source=f"mhe.{signal}", **more)


LEARNT = {  # what `Mhe` learns, and in which unit
    "resistance": ("resistance", "Ohm"),
    "eddy": ("eddy currents", "S"),
    "gap_factor": ("gap factor", "1"),
    "knee": ("knee", "A"),
    "saturation": ("saturation", "Wb"),
    "hysteresis": ("hysteresis", "A"),
    "mass": ("mass", "kg"),
    "rest_position": ("rest position", "m"),
}
VALUES = len(LEARNT)
WHERE = ("before the motion", "in the motion", "after the landing", "in the rest")  # by phase
MEANS = {f"{kind}_{p.name}": (kind, WHERE[p]) for kind in ("closing", "opening") for p in Phase}  # of innovations
USUAL = "Usual mean innovation {1}, {0}; counts with baseline.windows"
HEALTHY = "Logarithm of the {0} of the healthy device; counts with baseline.windows"
UsualMeans = record_of("UsualMeans", MEANS, "baseline_{}", lambda _, mean: parameter("A", USUAL.format(*mean), 0.0))
HealthyValues = record_of(
    "HealthyValues", LEARNT, "baseline_{}", lambda _, value: parameter("1", HEALTHY.format(value[0]), 0.0)
)


def learnt(name: str, nominal: float) -> Scalar:
    """A value that `Mhe` has learnt, or its standard deviation."""
    unit = LEARNT[name.removesuffix("_std")][1]
    return of_mhe(unit, name, f"`{name}` of Mhe", nominal=nominal)


@ports()
class Parameters(NamedTuple):
    """Limits, and the baseline of an earlier run."""

    sample_time: Scalar = sample_time(20e-6)
    settle: Scalar = parameter("s", "Time after a landing that has a mean innovation of its own", 3e-3, min=0.0)
    limit_strange: Scalar = parameter("1", "Size from which an operation is strange, in usual sizes", 3.0, min=1.0)
    limit_worn: Scalar = parameter(
        "1", "Size of what has moved from which a device is worn, in usual wanderings", 3.0, min=0.1
    )
    least_size: Scalar = parameter("A", "Usual size of a profile, at least", 0.7e-3, min=0.0)
    learn_windows: Scalar = parameter("1", "Good windows that make a baseline", 60.0, min=2.0)
    baseline_windows: Scalar = parameter(
        "1", "Windows behind the baseline below; fewer than learn.windows: it is learnt", 0.0, min=0.0
    )
    baseline_size: Scalar = parameter("A", "Usual size of a profile; counts with baseline.windows", 1e-3, min=0.0)
    means: Annotated[Any, UsualMeans] = UsualMeans()
    values: Annotated[Any, HealthyValues] = HealthyValues()


@ports()
class Inputs(NamedTuple):
    """The command, and outputs of `Mhe`."""

    time: Scalar
    command: Scalar = input_("1", "Above 0.5: the coil is to be switched on")
    current: Scalar = measured("A", "Measured coil current; NaN where it was lost", nominal=0.4)
    innovation: Scalar = of_mhe("A", "innovation", "Innovation", nominal=1e-2)
    mode: Scalar = of_mhe("1", "mode", "Mode that Mhe expects: 2 moving", min=0.0, max=3.0)
    health_causes: Scalar = of_mhe("1", "health_causes", "Why Mhe is not healthy: bit 1 counts", min=0.0)
    windows: Scalar = of_mhe("1", "windows", "Windows solved so far", min=0.0, nominal=100.0)
    misfit: Scalar = of_mhe("1", "misfit", "Misfit of the last one", min=0.0)
    resistance: Scalar = learnt("resistance", 48.0)
    eddy: Scalar = learnt("eddy", 1e-3)
    gap_factor: Scalar = learnt("gap_factor", 1.0)
    knee: Scalar = learnt("knee", 0.5)
    saturation: Scalar = learnt("saturation", 25e-3)
    hysteresis: Scalar = learnt("hysteresis", 10e-3)
    mass: Scalar = learnt("mass", 1.6e-3)
    rest_position: Scalar = learnt("rest_position", 19e-3)
    resistance_std: Scalar = learnt("resistance_std", 0.1)
    eddy_std: Scalar = learnt("eddy_std", 1e-4)
    gap_factor_std: Scalar = learnt("gap_factor_std", 0.01)
    knee_std: Scalar = learnt("knee_std", 0.01)
    saturation_std: Scalar = learnt("saturation_std", 1e-4)
    hysteresis_std: Scalar = learnt("hysteresis_std", 1e-3)
    mass_std: Scalar = learnt("mass_std", 1e-5)
    rest_position_std: Scalar = learnt("rest_position_std", 1e-4)


class Baseline(NamedTuple):
    """What is usual; while it is learnt, means so far."""

    taught: Scalar  # good windows
    usual_size: Scalar  # root mean square of the deviations of an operation's profile [A]
    usual: Annotated[Array, Vector(8)]  # mean innovations of a closing and of an opening [A]
    healthy: Annotated[Array, Vector(8)]  # logarithms of the learnt values
    closings: Scalar = 0.0  # that taught the profile
    openings: Scalar = 0.0
    squares: Scalar = 0.0  # sum of the squared deviations [A^2]


class Usual(NamedTuple):
    """Recent operations that were usual. By them a device is recognised while `Mhe` has not relearnt it yet."""

    lengths: Annotated[Array, Vector(8)]  # samples of the phases of a closing and of an opening
    currents: Annotated[Array, Vector(8)]  # mean currents in them [A]
    closings_known: Scalar = 0.0
    openings_known: Scalar = 0.0


class Operation(NamedTuple):
    """The operation so far."""

    command: Scalar  # flag
    began: Scalar  # time of its first sample [s]
    sums: Annotated[Array, Vector(4)]  # of the innovations in each phase [A]
    counts: Annotated[Array, Vector(4)]
    charges: Annotated[Array, Vector(4)]  # sums of the currents in the usual phases [A]
    samples: Annotated[Array, Vector(4)]  # and how many
    last: Scalar  # current that was not lost [A]
    age: Scalar = 0.0  # samples
    rested: Scalar = 0.0  # samples since the landing
    is_commanded: Scalar = 1.0  # flag: it is not what was before the first change of the command
    is_lost: Scalar = 0.0  # flag: `Mhe` feeds the current back, or has done so
    has_moved: Scalar = 0.0  # flag
    is_abnormal: Scalar = 0.0  # flag: by `Mhe`


class Course(NamedTuple):
    """What the last operations were."""

    verdict: Scalar  # a `Verdict`
    profile: Annotated[Array, Vector(8)]  # deviations of the last closing and opening, or those of the fault
    sound: Annotated[Array, Vector(8)]  # logarithms of the learnt values before the fault
    size: Scalar = 0.0  # of the last operation, in usual sizes
    commands: Scalar = 0.0
    motions: Scalar = 0.0
    suspected: Scalar = 0.0  # flag: the last operation was strange, and the one before was not
    is_still: Scalar = 0.0  # flag: the last operation had no motion
    is_dead: Scalar = 0.0  # flag: the last closing had no current, though `Mhe` expected some
    quiet: Scalar = 0.0  # operations in a row that were not strange
    familiar: Scalar = 0.0  # operations in a row with the current of usual ones
    is_relearnt: Scalar = 0.0  # flag: a fault has passed, and `Mhe` has not yet got used to it
    onset: Scalar = 0.0  # begin of the first strange operation [s]
    faults: Scalar = 0.0
    passed: Scalar = 0.0


class Learnt(NamedTuple):
    """What `Mhe` has learnt."""

    solved: Scalar  # windows so far
    values: Annotated[Array, Vector(8)]  # logarithms after the last good window
    quick: Annotated[Array, Vector(8)]  # their means
    slow: Annotated[Array, Vector(8)]
    wandering: Annotated[Array, Vector(8)]  # of the logarithms, as is usual


class State(NamedTuple):
    """The baseline, the operation, and what was found."""

    baseline: Baseline
    usually: Usual
    operation: Operation
    course: Course
    learnt: Learnt
    evidence: Annotated[Array, Vector(12)]
    since: Annotated[Array, Vector(12)]


# outputs for each cause, each learnt value, each mean innovation; in the order of `CAUSES`, `LEARNT`, `MEANS`

PASSED = "Begin of the operation in which the evidence passed 0.5, or -1"
DIFFERS = "Mean innovation less the usual one, of the last operation or of the fault"  # which the evidence rests on
MOVED = "Change since the baseline, in usual wanderings"
SHORTER = {"since_contact": "resistance higher at once"}
Evidence = record_of(
    "Evidence", CAUSES_TOLD, "evidence_{}", lambda _, why: output("1", f"Evidence, 0 to 1: {why}", min=0.0, max=1.0)
)
Since = record_of(
    "Since", CAUSES_TOLD, "since_{}", lambda n, why: output("s", f"{PASSED}: {SHORTER.get(n, why)}", min=-1.0)
)
Trend = record_of(
    "Trend", LEARNT, "trend_{}", lambda _, value: output("1", f"Relative change per 1,000 operations: {value[0]}")
)
Profile = record_of("Profile", MEANS, "profile_{}", lambda _, mean: output("A", f"{DIFFERS}: {', '.join(mean)}"))
Moved = record_of("Moved", LEARNT, "moved_{}", lambda _, value: output("1", f"{MOVED}: {value[0]}"))


def kept_output(unit: str, what: str) -> Scalar:
    """An output that is a parameter after a restart."""
    return output(unit, f"For the parameter of that name after a restart: {what}")


def _kept_mean(field: str, mean: tuple[str, str]) -> Scalar:
    kind, where = mean
    article = "an" if kind == "opening" else "a"
    return kept_output("A", f"mean innovation of {article} {kind} {where}" if where == WHERE[0] else where)


def _kept_value(field: str, value: tuple[str, str]) -> Scalar:
    what, unit = value
    shown = {"1": "", "Ohm": " [ohm]"}.get(unit, f" [{unit}]")
    return kept_output("1", f"logarithm of the {what}{shown}")


KeptMeans = record_of("KeptMeans", MEANS, "baseline_{}", _kept_mean)
KeptValues = record_of("KeptValues", LEARNT, "baseline_{}", _kept_value)


@ports(feedthrough=("command", "windows", "misfit"))
class Outputs(NamedTuple):
    """The verdict and what it rests on."""

    verdict: Scalar = output("1", "0: learning, 1: healthy, 2: worn, 3: faulty", min=0.0, max=3.0)
    cause: Scalar = output(
        "1",
        "The most likely cause, by the number of its evidence; 0: none, or one that is not known",
        min=0.0,
        max=12.0,
    )
    onset: Scalar = output("s", "Begin of the first operation of the last fault; 0: there was none")
    faults: Scalar = output("1", "Faults so far", min=0.0)
    passed: Scalar = output("1", "Faults that have passed: the device is healthy again", min=0.0)
    commands: Scalar = output("1", "Operations that were commanded and are over", min=0.0)
    motions: Scalar = output("1", "Those with a motion", min=0.0)
    strangeness: Scalar = output("1", "Size of the last operation's profile, in usual sizes", min=0.0)
    wear: Scalar = output("1", "Size of what has moved since the baseline, in usual wanderings", min=0.0)
    evidence: Annotated[Any, Evidence] = part()
    since: Annotated[Any, Since] = part()
    profile: Annotated[Any, Profile] = part()
    moved: Annotated[Any, Moved] = part()
    trend: Annotated[Any, Trend] = part()
    baseline_windows: Scalar = kept_output("1", "windows behind the baseline")
    baseline_size: Scalar = kept_output("A", "usual size of a profile")
    kept_means: Annotated[Any, KeptMeans] = part()
    kept_values: Annotated[Any, KeptValues] = part()
