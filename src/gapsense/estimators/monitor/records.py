"""Ports and records of `Monitor`."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.kernels.interface import input_, measured, output, parameter, part, ports, sample_time
from gapsense.kernels.layout import Array, Choice, Scalar, Vector

PHASES, VALUES = 4, 8


class Verdict(Choice):
    """What the device is; the numbers are those of the output `verdict`."""

    learning, healthy, worn, faulty = range(4)


class Phase(Choice):
    """Where an operation is, by the motion that `Mhe` expects."""

    before, moving, landed, held = range(4)


def of_mhe(unit: str, signal: str, description: str, **more: Any) -> Scalar:
    """An output of `Mhe`."""
    return input_(unit, description, source=f"mhe.{signal}", **more)


def learnt(unit: str, signal: str, nominal: float) -> Scalar:
    """A value that `Mhe` has learnt, or its standard deviation."""
    return of_mhe(unit, signal, f"`{signal}` of Mhe", nominal=nominal)


def usual(kind: str, where: str) -> Scalar:
    """A mean innovation that is usual, to begin with."""
    return parameter("A", f"Usual mean innovation {where}, {kind}; counts with baseline.windows", 0.0)


def known(what: str) -> Scalar:
    """The logarithm of a learnt value when the device was healthy, to begin with."""
    return parameter("1", f"Logarithm of {what} of the healthy device; counts with baseline.windows", 0.0)


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
    baseline_closing_before: Scalar = usual("closing", "before the motion")
    baseline_closing_moving: Scalar = usual("closing", "in the motion")
    baseline_closing_landed: Scalar = usual("closing", "after the landing")
    baseline_closing_held: Scalar = usual("closing", "in the rest")
    baseline_opening_before: Scalar = usual("opening", "before the motion")
    baseline_opening_moving: Scalar = usual("opening", "in the motion")
    baseline_opening_landed: Scalar = usual("opening", "after the landing")
    baseline_opening_held: Scalar = usual("opening", "in the rest")
    baseline_resistance: Scalar = known("the resistance")
    baseline_eddy: Scalar = known("the eddy currents")
    baseline_gap_factor: Scalar = known("the gap factor")
    baseline_knee: Scalar = known("the knee")
    baseline_saturation: Scalar = known("the saturation")
    baseline_hysteresis: Scalar = known("the hysteresis")
    baseline_mass: Scalar = known("the mass")
    baseline_rest_position: Scalar = known("the rest position")


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
    resistance: Scalar = learnt("Ohm", "resistance", 48.0)
    eddy: Scalar = learnt("S", "eddy", 1e-3)
    gap_factor: Scalar = learnt("1", "gap_factor", 1.0)
    knee: Scalar = learnt("A", "knee", 0.5)
    saturation: Scalar = learnt("Wb", "saturation", 25e-3)
    hysteresis: Scalar = learnt("A", "hysteresis", 10e-3)
    mass: Scalar = learnt("kg", "mass", 1.6e-3)
    rest_position: Scalar = learnt("m", "rest_position", 19e-3)
    resistance_std: Scalar = learnt("Ohm", "resistance_std", 0.1)
    eddy_std: Scalar = learnt("S", "eddy_std", 1e-4)
    gap_factor_std: Scalar = learnt("1", "gap_factor_std", 0.01)
    knee_std: Scalar = learnt("A", "knee_std", 0.01)
    saturation_std: Scalar = learnt("Wb", "saturation_std", 1e-4)
    hysteresis_std: Scalar = learnt("A", "hysteresis_std", 1e-3)
    mass_std: Scalar = learnt("kg", "mass_std", 1e-5)
    rest_position_std: Scalar = learnt("m", "rest_position_std", 1e-4)


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


def evidence(what: str) -> Scalar:
    """An output for a cause."""
    return output("1", f"Evidence, 0 to 1: {what}", min=0.0, max=1.0)


@ports()
class Evidence(NamedTuple):
    """How much speaks for each cause; their order is that of `signatures`."""

    evidence_stuck_upper: Scalar = evidence("stuck at the upper stop")
    evidence_stuck_lower: Scalar = evidence("stuck at the lower stop")
    evidence_lower_stop: Scalar = evidence("lower stop higher")
    evidence_upper_stop: Scalar = evidence("upper stop lower")
    evidence_spring: Scalar = evidence("spring weaker or broken")
    evidence_turns: Scalar = evidence("turns shorted")
    evidence_contact: Scalar = evidence("resistance in the circuit higher at once, as of a contact")
    evidence_open: Scalar = evidence("circuit open")
    evidence_supply: Scalar = evidence("voltage lower than measured")
    evidence_gain: Scalar = evidence("current sensor reads too little")
    evidence_friction: Scalar = evidence("friction, damping or mass higher")
    evidence_still: Scalar = evidence("no voltage, or none that moves the device")


def since(what: str) -> Scalar:
    """An output for a cause."""
    return output("s", f"Begin of the operation in which the evidence passed 0.5, or -1: {what}", min=-1.0)


@ports()
class Since(NamedTuple):
    """Since when more than half speaks for each cause."""

    since_stuck_upper: Scalar = since("stuck at the upper stop")
    since_stuck_lower: Scalar = since("stuck at the lower stop")
    since_lower_stop: Scalar = since("lower stop higher")
    since_upper_stop: Scalar = since("upper stop lower")
    since_spring: Scalar = since("spring weaker or broken")
    since_turns: Scalar = since("turns shorted")
    since_contact: Scalar = since("resistance higher at once")
    since_open: Scalar = since("circuit open")
    since_supply: Scalar = since("voltage lower than measured")
    since_gain: Scalar = since("current sensor reads too little")
    since_friction: Scalar = since("friction, damping or mass higher")
    since_still: Scalar = since("no voltage, or none that moves the device")


def trend(what: str) -> Scalar:
    """An output for a learnt value."""
    return output("1", f"Relative change per 1,000 operations: {what}")


@ports()
class Trend(NamedTuple):
    """Where the learnt values go."""

    trend_resistance: Scalar = trend("resistance")
    trend_eddy: Scalar = trend("eddy currents")
    trend_gap_factor: Scalar = trend("gap factor")
    trend_knee: Scalar = trend("knee")
    trend_saturation: Scalar = trend("saturation")
    trend_hysteresis: Scalar = trend("hysteresis")
    trend_mass: Scalar = trend("mass")
    trend_rest_position: Scalar = trend("rest position")


def kept(unit: str, what: str) -> Scalar:
    """An output that is a parameter after a restart."""
    return output(unit, f"For the parameter of that name after a restart: {what}")


@ports()
class Kept(NamedTuple):
    """The baseline, in the order of the parameters."""

    baseline_windows: Scalar = kept("1", "windows behind the baseline")
    baseline_size: Scalar = kept("A", "usual size of a profile")
    baseline_closing_before: Scalar = kept("A", "mean innovation of a closing before the motion")
    baseline_closing_moving: Scalar = kept("A", "in the motion")
    baseline_closing_landed: Scalar = kept("A", "after the landing")
    baseline_closing_held: Scalar = kept("A", "in the rest")
    baseline_opening_before: Scalar = kept("A", "mean innovation of an opening before the motion")
    baseline_opening_moving: Scalar = kept("A", "in the motion")
    baseline_opening_landed: Scalar = kept("A", "after the landing")
    baseline_opening_held: Scalar = kept("A", "in the rest")
    baseline_resistance: Scalar = kept("1", "logarithm of the resistance [ohm]")
    baseline_eddy: Scalar = kept("1", "logarithm of the eddy currents [S]")
    baseline_gap_factor: Scalar = kept("1", "logarithm of the gap factor")
    baseline_knee: Scalar = kept("1", "logarithm of the knee [A]")
    baseline_saturation: Scalar = kept("1", "logarithm of the saturation [Wb]")
    baseline_hysteresis: Scalar = kept("1", "logarithm of the hysteresis [A]")
    baseline_mass: Scalar = kept("1", "logarithm of the mass [kg]")
    baseline_rest_position: Scalar = kept("1", "logarithm of the rest position [m]")


def differs(where: str) -> Scalar:
    """An output: an entry of the profile that the evidence rests on."""
    return output("A", f"Mean innovation less the usual one, of the last operation or of the fault: {where}")


@ports()
class Profile(NamedTuple):
    """What sudden causes are judged by."""

    profile_closing_before: Scalar = differs("closing, before the motion")
    profile_closing_moving: Scalar = differs("closing, in the motion")
    profile_closing_landed: Scalar = differs("closing, after the landing")
    profile_closing_held: Scalar = differs("closing, in the rest")
    profile_opening_before: Scalar = differs("opening, before the motion")
    profile_opening_moving: Scalar = differs("opening, in the motion")
    profile_opening_landed: Scalar = differs("opening, after the landing")
    profile_opening_held: Scalar = differs("opening, in the rest")


def moves(what: str) -> Scalar:
    """An output: how far a learnt value has moved."""
    return output("1", f"Change since the baseline, in usual wanderings: {what}")


@ports()
class Moved(NamedTuple):
    """What gradual causes are judged by."""

    moved_resistance: Scalar = moves("resistance")
    moved_eddy: Scalar = moves("eddy currents")
    moved_gap_factor: Scalar = moves("gap factor")
    moved_knee: Scalar = moves("knee")
    moved_saturation: Scalar = moves("saturation")
    moved_hysteresis: Scalar = moves("hysteresis")
    moved_mass: Scalar = moves("mass")
    moved_rest_position: Scalar = moves("rest position")


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
    evidence: Evidence = part()
    since: Since = part()
    profile: Profile = part()
    moved: Moved = part()
    trend: Trend = part()
    kept: Kept = part()
