"""Moving-horizon estimator: position of a reluctance actuator from its voltage and current only.

The hybrid model of `mhe_model` runs on the measured voltage; its state at the newest sample is the causal estimate, and
the landing that it predicts is the mode.  A window holds the samples of one operation and ends some time after its
landing, or with a command.  `mhe_window` corrects the parameters by the currents of the window, spread over the samples
that follow, and runs the model through it again: the smoothed estimate, and where the causal one goes on.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.mhe_effort import USUAL
from gapsense.estimators.mhe_model import (
    Device,
    Model,
    Point,
    advance,
    current,
    device,
    mean_of,
    model,
    point,
    with_device,
)
from gapsense.estimators.mhe_pass import JUMP, LARGE, drives
from gapsense.estimators.mhe_records import (
    RING,
    START,
    Learnt,
    Samples,
    Work,
    first_work,
    get,
    place,
    priors,
    published,
    put,
)
from gapsense.estimators.mhe_window import BAD, LOGARITHMS, work_on
from gapsense.estimators.readings import INNOVATION, LOST, RESTARTED, Health, can_be_read, health, most_current
from gapsense.estimators.reduced_model import GapLaw
from gapsense.linalg import vector
from gapsense.records import Array, Memory, Scalar, Table, Vector, zeros
from gapsense.trace import clip, cond, fabs, floor, load, not_, sqrt, square, store, where

STEADY, SETTLED = 0.15, 0.025  # change of a voltage that is held, and of its current in the time of its mean
SETTLED_WELL = 0.005  # the same where more is learnt: at the end of a soft landing the current still creeps
RECENT = 1.0 / 16.0  # weight of a sample in the means of a held voltage and its current
SAME = 30.0  # samples over which the model's error of the current is the same
KNOWN = 6.0  # operations that were explained, after which innovations are judged
STRANGE, STRANGE_SOFT = 4.4, 6.1  # deviations of a mean innovation that no healthy device has; where more is learnt
ANYWHERE = 1.0 / 12.0  # variance of the place of an edge that may be anywhere in a sampling period [1]
PLACED = 1.0 / 8.0  # weight of an edge in that of the last ones
MEDIAN = 0.6745 * 20.0**0.5  # of the sizes of third differences, over the deviation of white noise
LEVELLING = 1.0 / 500.0  # share by which a sample moves the deviation of the noise that is seen
TOLD_TOO_LOW, TOO_NOISY = 1.3, 12.0  # times the noise that was told: what is seen counts; and is told
LEARNT = 0.25  # error of the current that what was learnt from such noise makes, over its deviation
WILD = 15.0  # deviations of a current's bend between equal voltages: a spike


class Parameters(NamedTuple):
    """The actuator as a user knows it, how well, and the tuning."""

    sample_time: Scalar  # T_s [s]
    coil_resistance: Scalar  # R [ohm]
    coil_turns: Scalar  # N [1]
    mover_mass: Scalar  # m [kg]
    spring_stiffness: Scalar  # k_sp [N/m]
    spring_rest: Scalar  # z_sp [m]
    damping: Scalar  # c_f [N s/m]
    stop_lower: Scalar  # z_min [m]
    stop_upper: Scalar  # z_max [m]
    core_reluctance: Scalar  # R_c0 [1/H]
    core_saturation: Scalar  # lambda_sat [Wb]
    core_bend: Scalar  # K: b = K lambda_sat / N^2 [1/H]; 0: the core is that of Froehlich and Kennelly
    core_eddy: Scalar  # g_e [S]
    core_hysteresis: Scalar  # I_h [A]
    core_turnover: Scalar  # l_h [Wb]
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
    option_further: Scalar  # 1: damping, core reluctance and bend are learnt too
    option_command: Scalar  # 1: a window ends when the input `command` changes
    option_zero: Scalar  # 1: the current that is left after a long time without voltage is the sensor's offset
    option_mean: Scalar  # 1: the voltage is the mean since the last sample
    noise_voltage: Scalar  # sigma_v [V]
    noise_current: Scalar  # sigma_i [A]
    model_error: Scalar  # of the current, the same over `SAME` samples [A]
    edge: Scalar  # jump of the voltage beyond which a sample's current does not count [V]
    window_tail: Scalar  # at rest after a landing until the window ends [s]
    window_longest: Scalar  # [s]
    window_pace: Scalar  # pieces of a pass that a step may take; 0: as many as the sample time allows
    publish_within: Scalar  # age of a sample beyond which it is not published; 0: all are [s]
    prior_resistance: Scalar  # relative standard deviations before the first window
    prior_eddy: Scalar
    prior_gap: Scalar
    prior_knee: Scalar
    prior_saturation: Scalar
    prior_hysteresis: Scalar
    prior_mass: Scalar
    prior_rest: Scalar
    prior_damping: Scalar  # with `option_further`
    prior_core: Scalar  # the same; standard deviation [1/H]
    prior_bend: Scalar  # the same [1]
    range_voltage: Scalar  # a reading beyond counts as lost [V]
    range_current: Scalar  # [A]
    health_limit: Scalar  # largest misfit [1]


class Held(NamedTuple):
    """A voltage that hardly changes: its mean and that of its current, of late, and what they say of R."""

    held: Scalar  # samples so far
    held_level: Scalar  # voltage of the first of them
    held_voltage: Scalar
    held_current: Scalar
    held_drift: Scalar  # last current less its mean
    held_resistance: Scalar  # at the end of the last one that was long and large enough; or 0
    zero: Scalar  # current that was measured at the end of the last one without voltage that was long enough


class Watch(NamedTuple):
    """What the innovations of the causal estimate say of now."""

    surprise: Scalar  # mean of the innovations, of late [A]
    is_strange: Scalar  # 1: it was too large in this operation, which begins with an edge of the voltage
    is_moving: Scalar  # 1: there was a motion in this operation
    is_suspect: Scalar  # 1: an operation was strange, and none since then was not
    place: Scalar  # of the last edge of the voltage, between two samples, from where the model has it [periods]
    place_variance: Scalar
    spread: Scalar  # variance of the places of edges, of late
    faded: Scalar  # flux linkage by which the model is off now if that edge is a period off [Wb]


class State(NamedTuple):
    """The samples, the model at the newest one, the window, and what was learnt."""

    last_command: Scalar
    causal: Annotated[Array, Vector(10)]  # a `Point`
    believed: Annotated[Array, Memory(11)]  # the `Device` that it belongs to
    noise: Scalar  # standard deviation of the current, as it is seen; at least what was told [A]
    held: Held
    watch: Watch
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


def first_watch() -> Watch:
    """Nothing was seen yet."""
    return Watch(0.0, 0.0, 0.0, 0.0, place=0.0, place_variance=0.0, spread=ANYWHERE, faded=0.0)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, on the stop to which the spring pushes."""
    d, has_voltage = device(par), can_be_read(inputs.voltage, par.range_voltage)
    u = where(has_voltage, inputs.voltage, 0.0)
    at = point(0.0, 0.0, clip(d.rest, par.stop_lower, par.stop_upper), 0.0, u, model(par, d))
    work, samples = (
        first_work(at, inputs.time, par),
        Samples(0.0, zeros(RING), zeros(RING), zeros(RING), zeros(RING)),
    )
    held, smoothed = Held(0.0, u, u, 0.0, 0.0, 0.0, 0.0), (zeros(RING), zeros(RING))
    learns = (held, first_watch(), work, samples)
    state = State(inputs.command, vector(at), zeros(len(d)), par.noise_current, *learns, *smoothed)
    is_lost = not_(has_voltage & _has_current(inputs, par))
    shown = Shown(0.0, inputs.time, at.position, 0.0, 0.0)
    return state, _outputs(at, d, 0.0, shown, work.learnt, published(priors(par), par), is_lost, False, par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: the model follows, a piece of the work on the window is done, a smoothed sample is published."""
    before, can_read = Point(*state.causal), _has_current(inputs, par)
    has_voltage = can_be_read(inputs.voltage, par.range_voltage)
    u = where(has_voltage, inputs.voltage, before.voltage)
    zero = where(par.option_zero > 0.0, state.held.zero, 0.0)
    i = where(can_read, inputs.current - zero, load(state.samples.currents, state.samples.newest))
    told, noise = par.noise_current, _noise(state.noise, state.samples, u, i, par)
    par = par._replace(noise_current=where(noise > TOLD_TOO_LOW * told, noise, told))
    is_edge = _is_edge(u, before.voltage, par)
    has_current = can_read & not_(_is_wild(state.samples, u, i, par))
    w = where(has_current & not_(is_edge), weight(par), 0.0)
    samples = _remembered(state.samples, u, i, w, where(inputs.command == state.last_command, 0.0, 1.0))
    held = _held(_forgotten(state.held, inputs.command == state.last_command, par), u, i + zero, par)
    smoothed = (state.fluxes, state.positions)
    R = where(held.held_resistance > 0.0, held.held_resistance, _resistance(held, par))
    first = model(par, device(par))
    work, smoothed, caught = work_on(state.work, samples, smoothed, before, R, inputs.time, first, par)
    is_first, is_new = state.work.begins > 1.0, caught & (work.follows < 1.0)
    is_told = _is_told_late(work, state.work.learnt, par)
    is_other = is_new | is_first | is_told
    believed = cond(is_other, lambda: put(state.believed, get(work.device, START)), lambda: state.believed)
    work = work._replace(follows=where(caught, 1.0, work.follows))
    m = with_device(first, Device(*get(believed, START)))
    before = Point(*cond(is_told, lambda: vector(point(*before[:4], before.voltage, m)), lambda: state.causal))
    at = cond(caught, lambda: work.walk.at, lambda: vector(advance(before, u, m)))
    now = Point(*at)
    innovation = where(has_current, i - current(now, mean_of(before.voltage, u, m), m), 0.0)
    watch = _watched(state.watch, innovation, has_current, u - before.voltage, now, work.learnt, m, par)
    work, shown = _published(work, samples.newest, smoothed, now, inputs.time, par)
    state = State(inputs.command, at, believed, noise, held, watch, work, samples, *smoothed)
    is_lost, known = not_(has_voltage & has_current), get(work.learnt.deviations, START)
    is_strange = (watch.is_strange > 0.0) | (watch.is_suspect > 0.0) | (noise > TOO_NOISY * told)
    return state, _outputs(now, m.d, innovation, shown, work.learnt, known, is_lost, is_strange, par)


def _watched(
    before: Watch,
    innovation: Scalar,
    counts: Scalar,
    change: Scalar,
    now: Point,
    learnt: Learnt,
    m: Model,
    par: Parameters,
) -> Watch:
    """An operation whose innovations are too large is strange; only another one, with a motion, takes that back."""
    usual = sqrt(square(par.noise_current) * (0.5 * RECENT + square(LEARNT)) + square(par.model_error))
    is_edge, between = drives(change, par), (now.position > par.stop_lower) & (now.position < par.stop_upper)
    fades = 1.0 - par.sample_time * m.load * now.mmf_slope
    faded = where(is_edge, par.sample_time * change, before.faded * fades)
    by_place = faded * now.mmf_slope * m.through
    is_known = learnt.explained >= KNOWN
    placed = before.spread + PLACED * (square(before.place) + before.place_variance - before.spread)
    spread = where(is_edge & is_known & (before.is_strange < 1.0), placed, before.spread)
    variance = where(is_edge, spread, before.place_variance)
    told = where(counts & not_(is_edge | between), weight(par) * square(by_place) * variance, 0.0)
    variance = variance / (1.0 + told)
    missing = innovation - by_place * where(is_edge, 0.0, before.place)
    place = clip(
        where(is_edge, 0.0, before.place) + variance * weight(par) * by_place * where(told > 0.0, missing, 0.0),
        -0.5,
        0.5,
    )
    surprise = before.surprise + where(
        counts & not_(is_edge), RECENT * (innovation - by_place * place - before.surprise), 0.0
    )
    most = where(par.option_further > 0.0, STRANGE_SOFT, STRANGE)
    is_strange = is_known & (fabs(surprise) > most * usual)
    is_over = is_edge & (before.is_strange + before.is_moving > 0.0)
    return Watch(
        surprise=surprise,
        is_strange=where(is_strange, 1.0, where(is_over, 0.0, before.is_strange)),
        is_moving=where(between, 1.0, where(is_over, 0.0, before.is_moving)),
        is_suspect=where(is_over, before.is_strange, before.is_suspect),
        place=place,
        place_variance=variance,
        spread=spread,
        faded=faded,
    )


def _is_told_late(work: Work, before: Learnt, par: Parameters) -> Scalar:
    """What a window has told is so late, with `option.further`, that the causal estimate does not wait for the next."""
    is_told, is_late = work.learnt.windows > before.windows, work.age > USUAL.later
    return (par.option_further > 0.0) & is_told & is_late & (work.learnt.misfit < BAD)


def _has_current(inputs: Inputs, par: Parameters) -> Scalar:
    return can_be_read(inputs.current, most_current(par.range_current, par.range_voltage, par.coil_resistance))


def _is_edge(u: Scalar, before: Scalar, par: Parameters) -> Scalar:
    return drives(u - before, par)


def _is_wild(before: Samples, u: Scalar, i: Scalar, par: Parameters) -> Scalar:
    """A current that is far from the line through the last two, although the voltage has not changed."""
    last, older, _ = _last(before.currents, before)
    is_far = square(i - 2.0 * last + older) * weight(par) > square(WILD)
    return is_far & _is_held(before, u, par.edge + JUMP * par.noise_voltage)


def _noise(noise: Scalar, before: Samples, u: Scalar, i: Scalar, par: Parameters) -> Scalar:
    """The median of the third differences where the voltage has not changed, by steps: spikes do not move it far."""
    last, older, oldest = _last(before.currents, before)
    is_more = fabs(i - 3.0 * last + 3.0 * older - oldest) > MEDIAN * noise
    moved = noise * where(is_more, 1.0 + LEVELLING, 1.0 - LEVELLING)
    counts = _is_held(before, u, JUMP * par.noise_voltage) & (moved > par.noise_current)
    return where(counts, moved, noise)


def _last(memory: Array, samples: Samples) -> list[Scalar]:
    """The three newest entries, the newest first."""
    return [load(memory, place(samples.newest, age)) for age in (0.0, 1.0, 2.0)]


def _is_held(before: Samples, u: Scalar, most: Scalar) -> Scalar:
    """The voltage has changed by no more than this in each of the last three samples and this one."""
    voltages = [u, *_last(before.voltages, before)]
    is_held: Scalar = True
    for new, old in zip(voltages, voltages[1:]):
        is_held = (fabs(new - old) <= most) & is_held
    return is_held


def _remembered(before: Samples, u: Scalar, i: Scalar, w: Scalar, has_command: Scalar) -> Samples:
    newest = where(before.newest < RING - 1.0, before.newest + 1.0, 0.0)
    return Samples(
        newest,
        voltages=store(before.voltages, newest, u),
        currents=store(before.currents, newest, i),
        weights=store(before.weights, newest, w),
        commands=store(before.commands, newest, has_command),
    )


def weight(par: Parameters) -> Scalar:
    """w^2 of a current: noise, and an error of the model that is the same over some samples."""
    return 1.0 / (square(par.noise_current) + SAME * square(par.model_error))


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
        return spot, work.ready - 1.0 - skipped, Shown(1.0, time - age * par.sample_time, z, v, load(fluxes, spot))

    def none() -> tuple[Scalar, Scalar, Shown]:
        return work.shown, 0.0, Shown(0.0, time, now.position, now.velocity, now.flux_linkage)

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
    is_lost: Scalar,
    is_strange: Scalar,
    par: Parameters,
) -> Outputs:
    """The mode is that of the model; deviations of logarithms are relative."""
    mode = where(at.position <= par.stop_lower, 1.0, where(at.position >= par.stop_upper, 3.0, 2.0))
    causes = {
        INNOVATION: (learnt.misfit >= par.health_limit) | is_strange,
        LOST: is_lost,
        RESTARTED: learnt.given_up > 0.0,
    }
    sizes = [value if k < LOGARITHMS else 1.0 for k, value in enumerate(d)]
    stds = Certainty(*(size * std for size, std in zip(sizes, known)))
    motion = (at.position, at.velocity, at.flux_linkage, mode, innovation)
    return Outputs(*motion, health(causes), shown, Operation(*learnt[:6]), Found(*d), stds)
