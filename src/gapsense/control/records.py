"""What `RunToRun` is told, keeps and says."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.reduced_model import GapLaw
from gapsense.kernels.layout import COUNT, Array, Choice, Count, Memory, Scalar, Table, Vector, Whole

LONGEST = 1024  # samples of an operation that are kept
OPENING, CLOSING = 0.0, 1.0  # commands, and halves of the memories
LAW = 19  # numbers of a `Law`
LAW_SPANS = (*[None] * 16, COUNT, None, None)  # its `length` is a count
BAD = 6.0  # misfit of an estimate that is not believed


class LawKind(Choice):
    """From what it learns: a contact, or the parameters that an estimator has learnt."""

    contact, model = range(2)


class Parameters(NamedTuple):
    """The actuator as a user knows it, the voltages, and the shape of an operation."""

    sample_time: Scalar  # T_s [s]
    law: Annotated[Scalar, LawKind]
    coil_resistance: Scalar  # R [ohm]
    coil_turns: Scalar  # N [1]
    mover_mass: Scalar  # m [kg]
    spring_stiffness: Scalar  # k_sp [N/m]
    spring_rest: Scalar  # z_sp [m]
    damping: Scalar  # c_f [N s/m]
    stop_lower: Scalar  # z_min [m]
    stop_upper: Scalar  # z_max [m]
    core_reluctance: Scalar  # R_c0 [1/H]
    gap_law: Annotated[Scalar, GapLaw]
    gap_reluctance: Scalar  # R_g0 [1/H]
    gap_slope: Scalar  # R_g0' [1/(H m)]
    gap_fringing: Scalar  # k_f [1/m]
    gap_window: Scalar  # c_f [m]
    gap_file_gap: Annotated[Array, Table()]  # increasing [m]
    gap_file_reluctance: Annotated[Array, Table()]  # increasing [1/H]
    gap_file_spline: Annotated[Array, Table()]  # second derivative of its spline [1/(H m^2)]
    gap_factor: Scalar  # of R_g [1]
    gap_bend: Scalar  # added to it between the stops [1]
    voltage_least: Scalar  # that the bridge can give [V]
    voltage_most: Scalar  # [V]
    voltage_hold: Scalar  # of an ordinary operation, and after a soft one [V]
    closing_lead: Scalar  # until the mover is to leave its stop [s]
    closing_travel: Scalar  # then until it is near the other one [s]
    opening_lead: Scalar
    opening_travel: Scalar
    approach_time: Scalar  # for which the mover is expected after that [s]
    approach_distance: Scalar  # to the stop, where the approach begins [m]
    approach_first: Scalar  # speed of the first approach [m/s]
    approach_least: Scalar  # of the slowest one [m/s]


class Inputs(NamedTuple):
    """Measurements at the sample `time`, and what an estimator says."""

    time: Scalar
    enable: Scalar
    command: Scalar  # above 0.5: closed
    voltage: Scalar  # mean since the last sample
    current: Scalar
    mode: Scalar  # 0: not known
    impact_speed: Scalar  # of the last landing; 0: not known
    estimated_flux_linkage: Scalar  # causal
    windows: Scalar  # that were solved
    misfit: Scalar  # of the last one
    landing_time: Scalar  # in it
    estimated_impact_speed: Scalar  # of that landing
    smoothed_published: Scalar
    smoothed_time: Scalar
    smoothed_flux_linkage: Scalar
    estimated_resistance: Scalar
    estimated_mass: Scalar
    estimated_rest_position: Scalar
    estimated_viscous_damping: Scalar
    estimated_gap_factor: Scalar  # factor
    estimated_gap_bend: Scalar


class Outputs(NamedTuple):
    """What is to be done, and why."""

    voltage_reference: Scalar  # mean until the next sample
    flux_reference: Scalar  # 0 where there is none
    flux_linkage: Scalar
    resistance: Scalar
    approach_speed: Scalar  # of this operation
    balance_flux: Scalar  # of the spring where this operation begins
    cycle: Scalar  # so far
    state: Scalar
    warnings: Scalar


class Law(NamedTuple):
    """What is known of one kind of operation."""

    mean: Array  # a, b, q of the mover
    cov: Array  # (3, 3)
    slopes: Array  # of the position at a soft landing by a, b, q: their mean of late, (3,)
    speed: Scalar  # of the next approach [m/s]
    floor: Scalar  # below which that does not come [m/s]
    travel: Scalar  # [s]
    missed: Scalar  # operations in a row that did not arrive
    length: Scalar  # samples of the last one
    was_plain: Scalar  # 1: that was an ordinary one
    was_followed: Scalar  # 1: in that the flux linkage could follow the profile


class Running(NamedTuple):
    """The operation that is under way."""

    command: Annotated[Scalar, Whole(0, 1)]
    age: Annotated[Scalar, Count]  # samples since the command
    is_plain: Scalar  # ordinary voltages
    start_flux: Scalar  # where the profile begins [Wb]
    speed: Scalar
    travel: Scalar
    learnt: Annotated[Array, Vector(8)]  # factor, bend, rest, mass, damping, a, b, q of its mover
    balance_flux: Scalar  # of the spring where it begins [Wb]
    wanted: Scalar  # flux linkage that the profile wants now, or 0 [Wb]
    limited: Scalar  # samples of the motion at a limit of the voltage
    since_limit: Scalar  # samples since the last one
    is_judged: Scalar  # 1: the estimator has told what became of it
    last_age: Scalar  # samples of the operation before
    last_is_judged: Scalar  # the same of that
    strain: Scalar  # largest share of the voltage that the resistance has needed


class Heard(NamedTuple):
    """What the contact has said in this operation."""

    last_mode: Scalar
    began: Scalar  # 1: with the mover on the stop where it begins
    takeoff: Annotated[Scalar, Count]  # last sample with which it left that before it landed, or 0
    landing: Annotated[Scalar, Count]  # first one with which it landed, or 0
    hardest: Scalar  # hardest landing by the bends of the current [m/s]
    hit: Annotated[Scalar, Count]  # its sample, or 0


class Coil(NamedTuple):
    """Resistance and flux linkage, both by the integral of u - R i."""

    flux: Scalar  # [Wb]
    remanence: Scalar  # what it is believed to be at the start of the next one
    charge: Scalar  # integral of the current since then [A s]
    asked: Scalar  # voltage, at the last sample [V]
    bridge_gain: Scalar  # measured voltage over what was asked, of late
    voltage_zero: Scalar  # of the reading of the voltage [V]
    last_voltage: Scalar
    last_current: Scalar
    far: Scalar  # readings of the current in a row that were too far from the one before
    change: Scalar  # of the current in the last sample
    noise: Scalar  # of the current: its standard deviation [A]
    calm: Scalar  # samples in a row in which the current has hardly changed
    resistance: Scalar  # in use [ohm]
    measured: Scalar  # that of the last cycle
    trend: Scalar  # change per cycle
    held_voltage: Scalar  # means of late
    held_current: Scalar
    late_current: Scalar  # the same over a longer time
    zero: Scalar  # of the current sensor [A]
    top: Scalar  # flux linkage with which closings end: its mean of late, or 0 [Wb]
    shift: Scalar  # of this cycle's flux linkage, towards that [Wb]


class Pass(NamedTuple):
    """The motion without stops that is compared with the contact."""

    half: Annotated[Scalar, Whole(0, 1)]  # operation whose samples it takes
    left: Annotated[Scalar, Whole(0, LONGEST)]  # first sample of the motion
    at: Annotated[Scalar, Whole(0, LONGEST)]  # sample that is next
    last: Annotated[Scalar, Whole(-1, LONGEST - 1)]  # sample of the landing; before `at`: nothing is to be done
    landed: Scalar  # 1: there was one
    correction: Scalar  # of the resistance with which the samples were integrated [ohm]
    impact: Scalar  # impact speed that somebody has measured, or 0
    motion: Annotated[Array, Vector(8)]  # a `Motion`


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


NOTHING = Noted(*[0.0] * len(Noted._fields))


class State(NamedTuple):
    """All that is kept; memories have an opening in their first half, a closing in the second one."""

    coil: Coil
    running: Running
    heard: Heard
    course: Pass
    noted: Noted
    laws: Annotated[Array, Memory(2 * LAW, LAW_SPANS)]
    fluxes: Annotated[Array, Memory(2 * LONGEST)]  # by the loop [Wb]
    profiles: Annotated[Array, Memory(2 * LONGEST)]  # what the profile wanted where it was followed, or 0 [Wb]
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
    fell: Scalar  # 1: the last operation that was judged did not arrive in time
    alarm: Scalar  # operations that are to be ordinary
    explained: Scalar  # 1: the estimator has explained a window in this cycle
    remembered: Annotated[Array, Vector(8)]  # what was noticed in the last cycle
