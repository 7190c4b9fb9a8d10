"""What `RunToRun` is told, keeps and says."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.estimators import reduced_model
from gapsense.estimators.mhe import model as mhe_model
from gapsense.estimators.reduced_model import GapLaw
from gapsense.kernels.interface import choice, input_, measured, output, parameter, ports, same, sample_time
from gapsense.kernels.layout import (
    COUNT,
    Array,
    Choice,
    Count,
    Covariance,
    Memory,
    Scalar,
    Table,
    Vector,
    Whole,
    blank,
    names,
)

LONGEST = 1024  # samples of an operation that are kept
PIECES = LONGEST // 8  # most samples of half of the time in which a slope of the current is taken
OPENING, CLOSING = 0.0, 1.0  # commands, and halves of the memories
BAD = 6.0  # misfit of an estimate that is not believed


class LawKind(Choice):
    """From what it learns: a contact, or the parameters that an estimator has learnt."""

    contact, model = range(2)


EKF, MHE = same(reduced_model.Parameters), same(mhe_model.Parameters)


@ports()
class Parameters(NamedTuple):
    """The actuator as a user knows it, the voltages, and the shape of an operation."""

    sample_time: Scalar = sample_time(20e-6)  # T_s
    law: Annotated[Scalar, LawKind] = choice("What it learns from")
    coil_resistance: Scalar = EKF
    coil_turns: Scalar = EKF
    mover_mass: Scalar = EKF
    spring_stiffness: Scalar = EKF
    spring_rest: Scalar = EKF
    damping: Scalar = EKF
    stop_lower: Scalar = EKF
    stop_upper: Scalar = EKF
    core_reluctance: Scalar = EKF
    gap_law: Annotated[Scalar, GapLaw] = EKF
    gap_reluctance: Scalar = EKF
    gap_slope: Scalar = EKF
    gap_fringing: Scalar = EKF
    gap_window: Scalar = EKF
    gap_file_gap: Annotated[Array, Table()] = EKF
    gap_file_reluctance: Annotated[Array, Table()] = EKF
    gap_file_spline: Annotated[Array, Table()] = EKF
    gap_factor: Scalar = MHE
    gap_bend: Scalar = MHE
    voltage_least: Scalar = parameter("V", "Least mean voltage of the bridge; 0: half bridge", -30.0)
    voltage_most: Scalar = parameter("V", "Largest mean voltage of the bridge", 30.0, min=1e-9)
    voltage_hold: Scalar = parameter("V", "Of an ordinary closing, and after a soft one", 24.0, min=1e-9)
    closing_lead: Scalar = parameter("s", "From the command until the mover is to take off", 1.5e-3, min=1e-9)
    closing_travel: Scalar = parameter(
        "s", "Then until it is near the other stop, in the first cycle", 3.4e-3, min=1e-9
    )
    opening_lead: Scalar = parameter("s", "From the command until the mover is to take off", 1.2e-3, min=1e-9)
    opening_travel: Scalar = parameter(
        "s", "Then until it is near the other stop, in the first cycle", 3.4e-3, min=1e-9
    )
    approach_time: Scalar = parameter("s", "Then for so long it is expected to land", 3.5e-3, min=0.0)
    approach_distance: Scalar = parameter("m", "Distance from the stop at which the approach begins", 80e-6, min=0.0)
    approach_first: Scalar = parameter("m/s", "Speed of the first approaches", 0.4, min=1e-9)
    approach_least: Scalar = parameter("m/s", "Speed of the slowest ones", 0.08, min=1e-9)


def of_mhe(unit: str, output: str) -> Any:
    """An output of `Mhe`."""
    return input_(unit, f"Law model: `{output}` of `Mhe`", is_optional=True)


@ports()
class Inputs(NamedTuple):
    """Measurements at the sample `time`, and what an estimator says."""

    time: Scalar
    enable: Scalar = input_("1", "0.5 or less when a closing begins: the cycle is an ordinary one", start=1.0)
    command: Scalar = input_("1", "Above 0.5: closed")
    voltage: Scalar = input_("V", "Mean voltage since the last sample", source="drive.voltage_mean", nominal=30.0)
    current: Scalar = measured("A", "Measured coil current", nominal=0.4)
    mode: Scalar = measured(
        "1",
        "Law contact: 1 at the lower stop, 2 moving, 3 at the upper stop; 0: not known",
        nominal=2.0,
        min=0.0,
        max=3.0,
    )
    impact_speed: Scalar = input_(
        "m/s", "Law contact: speed of the landing, of the operation that ends", min=0.0, is_optional=True
    )
    estimated_flux_linkage: Scalar = of_mhe("Wb", "flux_linkage")
    windows: Scalar = of_mhe("1", "windows")
    misfit: Scalar = of_mhe("1", "misfit")
    landing_time: Scalar = of_mhe("s", "landing_time")
    estimated_impact_speed: Scalar = of_mhe("m/s", "impact_speed")
    smoothed_published: Scalar = of_mhe("1", "smoothed_published")
    smoothed_time: Scalar = of_mhe("s", "smoothed_time")
    smoothed_flux_linkage: Scalar = of_mhe("Wb", "smoothed_flux_linkage")
    estimated_resistance: Scalar = of_mhe("Ohm", "resistance")
    estimated_mass: Scalar = of_mhe("kg", "mass")
    estimated_rest_position: Scalar = of_mhe("m", "rest_position")
    estimated_viscous_damping: Scalar = of_mhe("N.s/m", "viscous_damping")
    estimated_gap_factor: Scalar = of_mhe("1", "gap_factor")
    estimated_gap_bend: Scalar = of_mhe("1", "gap_bend")
    estimated_voltage_offset: Scalar = of_mhe("V", "voltage_offset")


@ports(feedthrough=Inputs._fields[1:])
class Outputs(NamedTuple):
    """What is to be done, and why."""

    voltage_reference: Scalar = output("V", "Mean voltage that is to be until the next sample", nominal=30.0)
    flux_reference: Scalar = output("Wb", "Flux linkage at the next sample; 0: no profile", nominal=0.02)
    flux_linkage: Scalar = output("Wb", "By the integral of u - R i", nominal=0.02)
    resistance: Scalar = output("Ohm", "Resistance R in use", nominal=48.0)
    approach_speed: Scalar = output("m/s", "Speed that this operation is to land with", min=0.0)
    balance_flux: Scalar = output(
        "Wb", "Flux linkage that balances the spring where this operation begins", nominal=0.02
    )
    cycle: Scalar = output("1", "Cycles begun so far", min=0.0)
    state: Scalar = output(
        "1",
        "0: no command yet, 1: first cycles, ordinary, 2: soft, 3: soft, but the last operation that was judged "
        "did not arrive in time, 4: ordinary cycle after that, 5: ordinary, as ordinary closings leave the mover open",
        min=0.0,
        max=5.0,
    )
    warnings: Scalar = output(
        "1",
        "Of this cycle and the last one, a sum of 1: contact silent in an ordinary operation, 2: profile "
        "faster than the voltage allows, 4: voltage used up by the resistance, 8: estimator has explained no "
        "window, 16: a reading lost or wild, 32: the reading of the voltage has an offset, 64: a soft operation "
        "landed hard, 128: an operation landed hard or not at all, and the next ones are ordinary, 256: the current is "
        "too noisy for what a contact teaches, 512: an ordinary closing has left the mover open",
        min=0.0,
        max=1023.0,
    )


class Law(NamedTuple):
    """What is known of one kind of operation."""

    mean: Annotated[Array, Vector(4)]  # a, b, q, r of the mover
    cov: Annotated[Array, Covariance(4)]
    slopes: Annotated[Array, Vector(4)]  # of the position at a soft landing by a, b, q, r: their mean of late
    trend: Annotated[Array, Vector(4)]  # change of a, b, q, r from operation to operation
    speed: Scalar  # of the next approach [m/s]
    floor: Scalar  # below which that does not come [m/s]
    lead: Scalar  # of the last one, with what it has waited [s]
    travel: Scalar  # [s]
    missed: Scalar  # operations in a row that did not arrive
    length: Scalar  # samples of the last one
    was_plain: Scalar  # 1: that was an ordinary one
    was_followed: Scalar  # 1: in that the flux linkage could follow the profile
    late: Scalar  # of an opening: by which the last one came late, by an estimator or as it floated [s]
    floated: Scalar  # 1: the last one has ended; its mover went on after the planned arrival, by the current
    seated: Scalar  # reluctance with which a mover that has arrived is seated, of that when open; 0: not known
    rested: Scalar  # the same of closings, over the root of that once they are held; 0: not known [H^(-1/2)]


LAW = len(names(Law))  # numbers in memory
LAW_SPANS = tuple(COUNT if name == "length" else None for name in names(Law))


class Running(NamedTuple):
    """The operation that is under way."""

    command: Annotated[Scalar, Whole(0, 1)]
    age: Annotated[Scalar, Count]  # samples since the command
    is_plain: Scalar  # ordinary voltages
    start_flux: Scalar  # where the profile begins [Wb]
    speed: Scalar
    lead: Scalar  # with what its plan has waited for the voltage [s]
    travel: Scalar
    learnt: Annotated[Array, Vector(9)]  # factor, bend, rest, mass, damping, a, b, q, r of its mover
    balance_flux: Scalar  # of the spring where it begins [Wb]
    wanted: Scalar  # flux linkage that the profile wants now, or 0 [Wb]
    limited: Scalar  # samples of the motion at a limit of the voltage
    unfollowed: Scalar  # of these those in which the plan was not made anew
    position: Scalar  # of the mover that is believed, if the plan may wait for it [m]
    velocity: Scalar  # [m/s]
    behind: Scalar  # by which it is behind its path [m]
    deviates: Scalar  # 1: from the next sample on its path begins where it is
    deviation: Annotated[Array, Vector(4)]  # a `Deviation`
    since_limit: Scalar  # samples since the last one
    piece: Annotated[Scalar, Whole(0, PIECES)]  # samples of half of the time in which a slope of the current is taken
    due: Annotated[Scalar, Count]  # sample at which the mover is to have arrived
    held: Annotated[Scalar, Count]  # sample at which the voltage has held it for a while
    is_judged: Scalar  # 1: the estimator has told what became of it
    last_age: Scalar  # samples of the operation before
    last_is_judged: Scalar  # the same of that
    strain: Scalar  # largest share of the voltage that the resistance has needed
    averaged: Scalar  # soft operations, with this, whose noisy current is averaged; 0: it is used as it is
    reluctance: Scalar  # where it begins [1/H]
    drawn_before: Scalar  # what an estimator had added to its flux linkage when it began [Wb]
    drawn_till_told: Scalar  # what an estimator has added to its flux linkage until its arrival was told [Wb]


class Heard(NamedTuple):
    """What the contact has said in this operation."""

    last_mode: Scalar
    began: Scalar  # 1: with the mover on the stop where it begins
    takeoff: Annotated[Scalar, Count]  # last sample with which it left that before it landed, or 0
    landing: Annotated[Scalar, Count]  # first one with which it landed, or 0
    hardest: Scalar  # hardest landing by the bends of the current [m/s]
    hit: Annotated[Scalar, Count]  # its sample, or 0
    bent: Scalar  # of an ordinary closing: sum of the squares of the bends around its contact [m^2/s^2]
    moment: Scalar  # of these, before the contact [samples m^2/s^2]
    taken: Annotated[Scalar, Whole(0, PIECES)]  # samples that are taken away from the two times


class Coil(NamedTuple):
    """Resistance and flux linkage, both by the integral of u - R i."""

    flux: Scalar  # [Wb]
    remanence: Scalar  # what it is believed to be at the start of the next one
    charge: Scalar  # integral of the current since then [A s]
    passed: Scalar  # the same of the measured one [A s]
    asked: Scalar  # voltage, at the last sample [V]
    bridge_gain: Scalar  # measured voltage over what was asked, of late
    voltage_zero: Scalar  # of the reading of the voltage [V]
    last_voltage: Scalar
    last_current: Scalar
    used: Scalar  # the same, or with the mean of the last operations, as it is integrated [A]
    far: Scalar  # readings of the current in a row that were too far from the one before
    change: Scalar  # of the current in the last sample
    noise: Scalar  # of the current: its standard deviation [A]
    calm: Scalar  # samples in a row in which the current has hardly changed
    resistance: Scalar  # in use [ohm]
    measured: Scalar  # that of the last cycle
    found: Scalar  # the same, by that cycle alone
    step: Scalar  # change of that since the cycle before
    trend: Scalar  # change per cycle of a mean with a noisy current
    held_voltage: Scalar  # means of late
    held_current: Scalar
    late_current: Scalar  # the same over a longer time
    highest: Scalar  # of the held current in this cycle [A]
    lowest: Scalar  # of it since then
    rise: Scalar  # largest one from such a lowest one
    zero: Scalar  # of the current sensor [A]
    top: Scalar  # flux linkage with which closings end: its mean of late, or 0 [Wb]
    shift: Scalar  # of this cycle's flux linkage, towards that [Wb]
    needed: Scalar  # current of an ordinary closing, at least [A]
    drawn: Scalar  # what an estimator has added to the flux linkage in this cycle [Wb]
    balanced: Scalar  # resistance with which cycles end where they should without that: its mean of late [ohm]


class Pass(NamedTuple):
    """The motion without stops that is compared with the contact."""

    half: Annotated[Scalar, Whole(0, 1)]  # operation whose samples it takes
    left: Annotated[Scalar, Whole(0, LONGEST)]  # first sample of the motion
    at: Annotated[Scalar, Whole(0, LONGEST)]  # sample that is next
    last: Annotated[Scalar, Whole(-1, LONGEST - 1)]  # sample of the landing; before `at`: nothing is to be done
    landed: Scalar  # 1: there was one
    correction: Scalar  # of the resistance with which the samples were integrated [ohm]
    impact: Scalar  # impact speed that somebody has measured, or 0
    motion: Annotated[Array, Vector(10)]  # a `Motion`


class Noted(NamedTuple):
    """What was noticed in a cycle, 1 or 0, in the order of the bits of `warnings`."""

    unseen: Scalar  # an ordinary operation of which the contact has said nothing
    too_fast: Scalar  # a soft one with the voltage at its limit
    used_up: Scalar  # a soft one whose resistance needs nearly all voltage
    unexplained: Scalar  # the estimator has explained no window, or too few to be followed
    lost: Scalar  # a reading was lost or wild
    shifted: Scalar  # the reading of the voltage has an offset
    hard: Scalar  # a soft operation landed hard
    changed: Scalar  # a soft operation landed hard or not at all, and what was learnt is not believed any more
    noisy: Scalar  # the current is too noisy for the flux linkage that a soft landing needs
    open: Scalar  # an ordinary closing has left the mover open


NOTHING = blank(Noted)


class State(NamedTuple):
    """All that is kept; memories have an opening in their first half, a closing in the second one."""

    coil: Coil
    running: Running
    heard: Heard
    course: Pass
    noted: Noted
    laws: Annotated[Array, Memory(2 * LAW, LAW_SPANS)]
    fluxes: Annotated[Array, Memory(2 * LONGEST)]  # by the loop [Wb]
    # what the profile wanted where it was followed, or 0 [Wb]; if the current is averaged: its mean beside the flux [A]
    profiles: Annotated[Array, Memory(2 * LONGEST)]
    charges: Annotated[Array, Memory(2 * LONGEST)]  # [A s]
    errors: Annotated[Array, Memory(2 * LONGEST)]  # of the loop's flux linkage [Wb]
    cycles: Scalar
    since_plain: Scalar  # cycles since the last ordinary one
    explained_well: Scalar  # operations in a row, by an estimator
    landed_hard: Scalar  # operations of late, by an estimator; less half of the soft ones since then
    by_model: Scalar  # 1: it learns from what an estimator has learnt, not from the contact
    first_mass: Scalar  # that the estimator was told: another one is learnt, and in use [kg]
    smoothed_until: Scalar  # time of the last smoothed sample [s]
    is_ready: Scalar  # 1: enough is known for soft cycles; -1: it was, and two in a row did not arrive
    is_strong: Scalar  # 1: the voltage that holds is the largest one, as an ordinary closing did not arrive
    is_open: Scalar  # 1: the last ordinary closing has left the mover open
    tardy: Scalar  # soft openings in a row whose contact came late, though it is learnt from
    contact_late: Scalar  # by which the contact of ordinary closings came after the bend, their mean of late [s]
    late: Annotated[Scalar, Whole(0, PIECES)]  # samples of that which are taken away; 0: it is prompt
    fell: Scalar  # 1: the last operation that was judged did not arrive in time
    alarm: Scalar  # operations that are to be ordinary; negative: none is
    explained: Scalar  # 1: the estimator has explained a window in this cycle
    remembered: Annotated[Array, Vector(10)]  # what was noticed in the last cycle
    warnings: Scalar  # sum of what was noticed in this cycle, or in the last one
