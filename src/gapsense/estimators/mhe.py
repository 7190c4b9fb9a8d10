"""Moving-horizon estimator: position of a reluctance actuator from its voltage and current only.

The hybrid model of `mhe_model` runs on the measured voltage; its state at the newest sample is the causal estimate, and
the landing that it predicts is the mode.  A window holds the samples of one operation and ends some time after its
landing, or with a command.  `mhe_window` corrects the parameters by the currents of the window, spread over the samples
that follow, and runs the model through it again: the smoothed estimate, and where the causal one goes on.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.mhe_effort import USUAL
from gapsense.estimators.mhe_follow import Coil, Follow, Sample, first_follow, followed, noticed
from gapsense.estimators.mhe_model import (
    Device,
    Point,
    advance,
    current,
    device,
    mean_of,
    model,
    point,
    with_device,
)
from gapsense.estimators.mhe_parameters import Parameters
from gapsense.estimators.mhe_pass import JUMP, LARGE, drives
from gapsense.estimators.mhe_records import (
    RING,
    START,
    Learnt,
    Samples,
    Work,
    first_work,
    get,
    priors,
    published,
    put,
)
from gapsense.estimators.mhe_watch import (
    RECENT,
    Seen,
    Watch,
    as_seen,
    first_watch,
    is_strange,
    is_untold,
    is_wild,
    listened,
    watched,
    weight,
)
from gapsense.estimators.mhe_window import LOGARITHMS, waits, work_on
from gapsense.estimators.readings import (
    INNOVATION,
    LOST,
    OTHER,
    RESTARTED,
    STILL,
    UNTOLD,
    Health,
    can_be_read,
    health,
    most_current,
)
from gapsense.linalg import vector
from gapsense.records import Array, Memory, Scalar, Vector, zeros
from gapsense.trace import clip, cond, fabs, floor, load, not_, store, where

FAR = 5.5  # deviations from what was told that a device of the type does not have
STEADY, SETTLED = 0.15, 0.025  # change of a voltage that is held, and of its current in the time of its mean
SETTLED_WELL = 0.005  # the same where more is learnt: at the end of a soft landing the current still creeps


class Held(NamedTuple):
    """A voltage that hardly changes: its mean and that of its current, of late, and what they say of R."""

    held: Scalar  # samples so far
    held_level: Scalar  # voltage of the first of them
    held_voltage: Scalar
    held_current: Scalar
    held_drift: Scalar  # last current less its mean
    held_resistance: Scalar  # at the end of the last one that was long and large enough; or 0
    zero: Scalar  # current that was measured at the end of the last one without voltage that was long enough


class State(NamedTuple):
    """The samples, the model at the newest one, the window, and what was learnt."""

    last_command: Scalar
    causal: Annotated[Array, Vector(10)]  # a `Point`
    believed: Annotated[Array, Memory(11)]  # the `Device` that it belongs to
    held: Held
    watch: Watch
    follow: Follow
    work: Work
    samples: Samples
    fluxes: Annotated[Array, Memory(RING)]  # of the last trial
    positions: Annotated[Array, Memory(RING)]


class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample; `command` is 0 where it is not wired."""

    time: Scalar
    voltage: Scalar
    current: Scalar
    command: Scalar


class Shown(NamedTuple):
    """Smoothed values of `smoothed_time`, or causal ones."""

    smoothed_published: Scalar  # 1: smoothed; 0: there are none
    smoothed_time: Scalar
    smoothed_position: Scalar
    smoothed_velocity: Scalar
    smoothed_flux_linkage: Scalar


class Found(NamedTuple):
    """The `Device` in use by the causal estimate."""

    resistance: Scalar
    eddy: Scalar
    gap_factor: Scalar
    knee: Scalar
    saturation: Scalar
    hysteresis: Scalar
    mass: Scalar
    rest_position: Scalar
    viscous_damping: Scalar
    core_reluctance: Scalar
    gap_bend: Scalar


class Certainty(NamedTuple):
    """Standard deviations of these after the last window; 0 of what is not learnt."""

    resistance_std: Scalar
    eddy_std: Scalar
    gap_factor_std: Scalar
    knee_std: Scalar
    saturation_std: Scalar
    hysteresis_std: Scalar
    mass_std: Scalar
    rest_position_std: Scalar
    viscous_damping_std: Scalar
    core_reluctance_std: Scalar
    gap_bend_std: Scalar


class Operation(NamedTuple):
    """The last operation that was solved, and its window."""

    takeoff_time: Scalar
    landing_time: Scalar
    impact_speed: Scalar
    bounces: Scalar  # landings after the first one, in the same window
    windows: Scalar  # so far
    misfit: Scalar  # of the window: cost over what noise and model error make


class Outputs(NamedTuple):
    """Causal estimates at the sample, smoothed ones, the last operation, what was learnt."""

    position: Scalar
    velocity: Scalar
    flux_linkage: Scalar
    mode: Scalar
    innovation: Scalar
    health: Health
    shown: Shown
    operation: Operation
    found: Found
    certainty: Certainty


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, on the stop to which the spring pushes."""
    d, has_voltage = device(par), can_be_read(inputs.voltage, par.range_voltage)
    u = where(has_voltage, inputs.voltage, 0.0)
    at = point(0.0, 0.0, clip(d.rest, par.stop_lower, par.stop_upper), 0.0, u, model(par, d))
    work, samples = (
        first_work(at, inputs.time, par),
        Samples(newest=0.0, voltages=zeros(RING), currents=zeros(RING), weights=zeros(RING), commands=zeros(RING)),
    )
    held, smoothed = (
        Held(held=0.0, held_level=u, held_voltage=u, held_current=0.0, held_drift=0.0, held_resistance=0.0, zero=0.0),
        (zeros(RING), zeros(RING)),
    )
    learns = (held, first_watch(par), first_follow(), work, samples)
    state = State(inputs.command, vector(at), zeros(len(d)), *learns, *smoothed)
    fine = health({LOST: not_(has_voltage & _has_current(inputs, par))})
    shown = Shown(
        smoothed_published=0.0,
        smoothed_time=inputs.time,
        smoothed_position=at.position,
        smoothed_velocity=0.0,
        smoothed_flux_linkage=0.0,
    )
    return state, _outputs(at, d, 0.0, shown, work.learnt, published(priors(par), par), fine, par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: the model follows, a piece of the work on the window is done, a smoothed sample is published."""
    before, can_read = Point(*state.causal), _has_current(inputs, par)
    has_voltage = can_be_read(inputs.voltage, par.range_voltage)
    u = where(has_voltage, inputs.voltage, before.voltage)
    zero = where(par.option_zero > 0.0, state.held.zero, 0.0)
    i = where(can_read, inputs.current - zero, load(state.samples.currents, state.samples.newest))
    is_edge, heard = drives(u - before.voltage, par), listened(state.watch, state.samples, u, i, par)
    told, par = par, as_seen(heard, par)
    has_current = can_read & not_(is_wild(state.samples, u, i, par))
    w = where(has_current & not_(is_edge), weight(par), 0.0)
    samples = _remembered(state.samples, u, i, w, where(inputs.command == state.last_command, 0.0, 1.0))
    held = _held(_forgotten(state.held, inputs.command == state.last_command, par), u, i + zero, par)
    smoothed = (state.fluxes, state.positions)
    R = where(held.held_resistance > 0.0, held.held_resistance, _resistance(held, par))
    first = model(par, device(par))
    doubtful = state.work._replace(doubt=where(is_strange(state.watch), 1.0, state.work.doubt))
    follow = state.follow
    work, smoothed, caught = cond(
        follow.is_on > 0.0,
        lambda: (waits(doubtful, before), smoothed, False),
        lambda: work_on(doubtful, samples, smoothed, before, R, inputs.time, first, par),
    )
    is_first, is_new = state.work.begins > 1.0, caught & (work.follows < 1.0)
    is_told = _is_told_late(work, state.work.learnt)
    is_other = is_new | is_first | is_told
    believed = cond(is_other, lambda: put(state.believed, get(work.device, START)), lambda: state.believed)
    work = work._replace(follows=where(caught, 1.0, work.follows))
    m = with_device(first, Device(*get(believed, START)))
    before = Point(*cond(is_told, lambda: vector(point(*before[:4], before.voltage, m)), lambda: state.causal))
    seen = Sample(voltage=u, current=i, counts=w > 0.0, variance=1.0 / weight(par))

    def by_model() -> tuple[Array, Array]:
        at = cond(caught, lambda: work.walk.at, lambda: vector(advance(before, u, m)))
        return at, follow.covariance

    at, covariance = cond(follow.is_on > 0.0, lambda: followed(before, follow, seen, m), by_model)
    now = Point(*at)
    innovation = where(has_current, i - current(now, mean_of(before.voltage, u, m), m), 0.0)
    seen = Seen(
        innovation=innovation,
        has_current=has_current,
        jump=u - before.voltage,
        is_edge=is_edge,
        change=inputs.command - state.last_command,
        is_fed_back=follow.is_on,
    )
    watch = watched(heard, seen, now, work.learnt, m, par)
    coil = Coil(
        is_large=watch.is_large > 0.0,
        is_edge=is_edge,
        pulls=fabs(held.held_current) > LARGE * par.noise_current,
        resistance=_resistance(held, par),
    )
    follow = noticed(follow._replace(covariance=covariance), coil, now, m)
    is_back = (state.follow.is_on > 0.0) & (follow.is_on + follow.is_futile < 1.0)
    is_old = work.age > par.window_longest / par.sample_time
    work = work._replace(age=where(is_back & is_old, RING, work.age))
    work, shown = _published(work, samples.newest, smoothed, now, inputs.time, par)
    state = State(inputs.command, at, believed, held, watch, follow, work, samples, *smoothed)
    causes = {
        INNOVATION: (work.learnt.misfit >= par.health_limit) | is_strange(watch),
        LOST: not_(has_voltage & has_current),
        RESTARTED: work.learnt.given_up > 0.0,
        STILL: watch.is_still > 0.0,
        OTHER: _is_other(work, par),
        UNTOLD: is_untold(watch, told),
    }
    known = get(work.learnt.deviations, START)
    return state, _outputs(now, m.d, innovation, shown, work.learnt, known, health(causes), par)


def _is_other(work: Work, par: Parameters) -> Scalar:
    """Something was learnt that is too far from what was told."""
    is_other: Scalar = False
    for q, s in zip(get(work.q_prior, START), priors(par)):
        is_other = (fabs(q) > FAR * s) | is_other
    return is_other


def _is_told_late(work: Work, before: Learnt) -> Scalar:
    """What a window has told is so late that the causal estimate does not wait for the next."""
    is_told, is_late = work.learnt.windows > before.windows, work.age > USUAL.later
    return is_told & is_late & (work.learnt.rejected < 1.0)


def _has_current(inputs: Inputs, par: Parameters) -> Scalar:
    return can_be_read(inputs.current, most_current(par.range_current, par.range_voltage, par.coil_resistance))


def _remembered(before: Samples, u: Scalar, i: Scalar, w: Scalar, has_command: Scalar) -> Samples:
    newest = where(before.newest < RING - 1.0, before.newest + 1.0, 0.0)
    return Samples(
        newest,
        voltages=store(before.voltages, newest, u),
        currents=store(before.currents, newest, i),
        weights=store(before.weights, newest, w),
        commands=store(before.commands, newest, has_command),
    )


def _forgotten(held: Held, goes_on: Scalar, par: Parameters) -> Held:
    """With a command the resistance of a voltage that was held in the operation before is an old one."""
    return held._replace(held_resistance=where(goes_on | not_(par.option_command > 0.0), held.held_resistance, 0.0))


def _held(before: Held, u: Scalar, i: Scalar, par: Parameters) -> Held:
    changes = fabs(u - before.held_level) > STEADY * fabs(before.held_level) + JUMP * par.noise_voltage
    share = where(changes, 1.0, RECENT)
    R, is_long = _resistance(before, par), before.held >= par.window_tail / par.sample_time
    is_off = is_long & (fabs(before.held_voltage) < par.edge)
    return Held(
        held=where(changes, 0.0, before.held + 1.0),
        held_level=where(changes, u, before.held_level),
        held_voltage=before.held_voltage + share * (u - before.held_voltage),
        held_current=before.held_current + share * (i - before.held_current),
        held_drift=before.held_drift + share * (i - before.held_current - before.held_drift),
        held_resistance=where(changes & (R > 0.0), R, before.held_resistance),
        zero=where(changes & is_off, before.held_current, before.zero),
    )


def _resistance(held: Held, par: Parameters) -> Scalar:
    """Voltage over current, if both are held and large enough; else 0."""
    is_long = held.held >= par.window_tail / par.sample_time
    is_large = (fabs(held.held_current) > LARGE * par.noise_current) & (fabs(held.held_voltage) > par.edge)
    settled = where(par.option_further > 0.0, SETTLED_WELL, SETTLED)
    is_settled = fabs(held.held_drift) < settled * fabs(held.held_current)
    through = held.held_current - where(par.option_zero > 0.0, held.zero, 0.0)
    ratio = held.held_voltage / where(is_large, through, 1.0)
    return where(is_long & is_large & is_settled & (ratio > 0.0), ratio, 0.0)


def _published(
    work: Work, newest: Scalar, smoothed: tuple[Array, Array], now: Point, time: Scalar, par: Parameters
) -> tuple[Work, Shown]:
    """The next smoothed sample, if there is one; the velocity is the mean since the one before."""
    fluxes, positions = smoothed

    def ready() -> tuple[Scalar, Scalar, Shown]:
        oldest = where(work.shown >= newest, newest + RING - work.shown, newest - work.shown) - 1.0
        late = where(par.publish_within > 0.0, oldest - par.publish_within / par.sample_time, 0.0)
        skipped = clip(-floor(-late), 0.0, work.ready - 1.0)
        before, spot = (_behind(work.shown + skipped + k) for k in (0.0, 1.0))
        z = load(positions, spot)
        v = (z - load(positions, before)) / par.sample_time
        age = oldest - skipped
        return (
            spot,
            work.ready - 1.0 - skipped,
            Shown(
                smoothed_published=1.0,
                smoothed_time=time - age * par.sample_time,
                smoothed_position=z,
                smoothed_velocity=v,
                smoothed_flux_linkage=load(fluxes, spot),
            ),
        )

    def none() -> tuple[Scalar, Scalar, Shown]:
        return (
            work.shown,
            0.0,
            Shown(
                smoothed_published=0.0,
                smoothed_time=time,
                smoothed_position=now.position,
                smoothed_velocity=now.velocity,
                smoothed_flux_linkage=now.flux_linkage,
            ),
        )

    spot, left, shown = cond(work.ready > 0.0, ready, none)
    return work._replace(shown=spot, ready=left), shown


def _behind(spot: Scalar) -> Scalar:
    """A place in the memory that may be beyond its end."""
    return where(spot < RING, spot, spot - RING)


def _outputs(
    at: Point,
    d: Device,
    innovation: Scalar,
    shown: Shown,
    learnt: Learnt,
    known: Array,
    fine: Health,
    par: Parameters,
) -> Outputs:
    """The mode is that of the model; deviations of logarithms are relative."""
    mode = where(at.position <= par.stop_lower, 1.0, where(at.position >= par.stop_upper, 3.0, 2.0))
    sizes = [value if k < LOGARITHMS else 1.0 for k, value in enumerate(d)]
    stds = Certainty(*(size * std for size, std in zip(sizes, known)))
    motion = (at.position, at.velocity, at.flux_linkage, mode, innovation)
    return Outputs(*motion, fine, shown, Operation(*learnt[:6]), Found(*d), stds)
