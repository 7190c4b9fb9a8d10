"""Moving-horizon estimator: position of a reluctance actuator from its voltage and current only.

The hybrid model of `model` runs on the measured voltage; its state at the newest sample is the causal estimate, and
the landing that it predicts is the mode.  A window holds the samples of one operation and ends some time after its
landing, or with a command.  `solve` corrects the parameters by the currents of the window, spread over the samples that
follow, and runs the model through it again: the smoothed estimate, and where the causal one goes on.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, NamedTuple

from gapsense.estimators.kalman import Gaussian, condition, predict
from gapsense.estimators.mhe.model import (
    Bouncing,
    Device,
    Model,
    Parameters,
    Point,
    advance,
    current,
    device,
    electric,
    gain,
    gap,
    is_between,
    is_resting,
    mean_of,
    model,
    point,
    with_device,
)
from gapsense.estimators.mhe.solve import (
    FAR,
    LOGARITHMS,
    USUAL_EFFORT,
    is_lost,
    is_untypical,
    is_wandering,
    suspect,
    unlearn,
    wait,
    work_on,
)
from gapsense.estimators.mhe.window import (
    DOUBTFUL,
    LARGE,
    PRACTISED,
    PROVEN,
    RING,
    START,
    Learnt,
    PassStart,
    Samples,
    Smoothed,
    Work,
    as_outputs,
    bounces_on,
    count_kept,
    drives,
    first_work,
    get,
    place,
    priors,
    put,
)
from gapsense.estimators.readings import (
    CHANGING,
    CURRENT,
    INNOVATION,
    JUMP,
    LOST,
    OTHER,
    RESTARTED,
    STILL,
    UNLEARNT,
    UNTOLD,
    VOLTAGE,
    Health,
    can_be_read,
    health,
    most_current,
)
from gapsense.kernels.interface import input_, output, part, ports
from gapsense.kernels.layout import Array, Memory, Scalar, Vector, zeros
from gapsense.kernels.linalg import diagonal, identity, matrix, vector
from gapsense.kernels.trace import clip, cond, fabs, flag, floor, is_set, load, not_, sqrt, square, store, when, where

STEADY, SETTLED = 0.15, 0.025  # change of a voltage that is held, and of its current in the time of its mean
CREEPING = 0.05  # of a voltage that is held: the rate of the model's flux linkage with which a coil is not settled yet
SETTLED_WELL = 0.005  # the same where more is learnt: at the end of a soft landing the current still creeps
ZEROED, MEAN = 4.0, 0.5  # deviations by which a zero is another one, which is taken at once; else a share
SHIFTED = 0.25  # deviations by which a zero of the voltage is another one: what was learnt before is wrong
LONGEST_REST, LATE = 256.0, 3.0  # samples of which its mean is; power of time by which the later ones weigh more
LASTING = 2e-3  # of too large innovations until feedback begins or gives up; of rest until it ends [s]
AT_FIRST = (2e-3, 0.5e-3, 0.5)  # first deviations of flux linkage, position, velocity there [Wb], [m], [m/s]
FLUX, SPEED = 67e-6, 0.45  # deviations that come to flux linkage and velocity in a second [Wb/s^0.5], [m/s^1.5]
SAME_COIL, OTHER_COIL = 0.01, 0.03  # of R: how far off a held voltage over its current may be at first, and later

SAME = 30.0  # samples over which the model's error of the current is the same
# error of eddy currents in doubt, over their deviation before the first window, while the flux linkage rises or falls
RISING, FALLING = 1.6, 0.64
RECENT = 1.0 / 16.0  # weight of a sample in the mean of the innovations, and in those of a held voltage and its current
WILD = 15.0  # deviations of a current's bend between equal voltages: a spike
MEDIAN = 0.6745 * 20.0**0.5  # of the sizes of third differences, over the deviation of white noise
LEVELLING = 1.0 / 500.0  # share by which a sample moves the deviation of the noise that is seen
TOLD_TOO_LOW, TOO_NOISY = 1.3, 12.0  # times the noise that was told: what is seen counts; and is told
OFTEN, PULSED = 1.0 / 512.0, 0.02  # weight of a sample in the share of close edges; share from which it is PWM
UNKNOWN = 0.5  # largest deviation of the eddy currents that counts
DOUBTED = 0.5  # doubt of the eddy currents from which a device needs longer until it is proven
MINOR = 0.8  # error of the current under PWM, whose minor loops the hysteresis of the model does not have, over I_h
ANYWHERE = 1.0 / 12.0  # variance of the place of an edge that may be anywhere in a sampling period [1]
PLACED = 1.0 / 8.0  # weight of an edge in that of the last ones
KNOWN, KNOWN_SOFT = 2.0, 4.0  # operations that were explained, after which innovations are judged; where more is learnt
YOUNG = 6.0  # how much patience there is at first
LEARNT = 0.25  # error of the current that what was learnt from such noise makes, over its deviation
BOTH = 2.0  # operations, a closing and an opening: a fault may show in one of them only
STRANGE, STRANGE_SOFT = 4.4, 6.1  # deviations of a mean innovation that no healthy device has; where more is learnt
LITTLE_FLUX, EASY = 0.2, 0.5  # of saturation: little flux; share of the model's error that is left there
FINE = 0.7  # share of them within which an operation after a strange one is fine: what was learnt of a fault has more
SETTLED_SHARE = 0.52  # of the variance of a mean innovation that noise makes, where a device has settled
# evidence that what was learnt no longer fits: a sum, sample by sample, of the squared mean innovation in its variance,
# where the model's error counts this often, less what healthy devices may have; from `ENOUGH` on it is told
EVIDENT, ALLOWED, ENOUGH = 1.25, 1.5, 1000.0
PLACED_WELL = 0.0055  # of `window.tail`: deviation of edges that hardly change what is learnt


class Held(NamedTuple):
    """A voltage that hardly changes: its mean and that of its current, of late, and what they say of R."""

    held_level: Scalar  # voltage of the first sample
    held_voltage: Scalar
    held: Scalar = 0.0  # samples so far
    held_current: Scalar = 0.0
    held_drift: Scalar = 0.0  # last current less its mean
    held_rate: Scalar = 0.0  # of the model's flux linkage [V]
    held_creep: Scalar = 0.0  # its mean
    held_resistance: Scalar = 0.0  # at the end of the last one that was long and large enough; or 0
    rest_current: Scalar = 0.0  # mean of the current since `window.tail`
    zero: Scalar = 0.0  # that of the last ones without voltage that were long enough
    voltage_zero: Scalar = 0.0  # voltage of the last one


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
    smoothed: Smoothed


@ports()
class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample; `command` is 0 where it is not wired."""

    time: Scalar
    voltage: Scalar = VOLTAGE
    current: Scalar = CURRENT
    command: Scalar = input_("1", "With option.command: a window ends where this changes; any number", is_optional=True)


@ports()
class Shown(NamedTuple):
    """Smoothed values of `smoothed_time`, or causal ones."""

    smoothed_published: Scalar = output(
        "1", "1: smoothed values of the sample at smoothed_time; 0: the causal ones, now", min=0.0, max=1.0
    )
    smoothed_time: Scalar = output("s", "Time of the sample that the smoothed values belong to", nominal=1e-2)
    smoothed_position: Scalar = output("m", "Smoothed position", nominal=1e-3)
    smoothed_velocity: Scalar = output("m/s", "Smoothed mean velocity since the sample before", nominal=0.5)
    smoothed_flux_linkage: Scalar = output("Wb", "Smoothed flux linkage", nominal=20e-3)


def _show_causal(at: Point, time: Scalar) -> Shown:
    """Nothing smoothed: the causal estimate, now."""
    return Shown(
        smoothed_published=0.0,
        smoothed_time=time,
        smoothed_position=at.position,
        smoothed_velocity=at.velocity,
        smoothed_flux_linkage=at.flux_linkage,
    )


@ports()
class Found(NamedTuple):
    """The `Device` in use by the causal estimate."""

    resistance: Scalar = output("Ohm", "Resistance R")
    eddy: Scalar = output("S", "Eddy currents g_e")
    gap_factor: Scalar = output("1", "Factor of the gap reluctance")
    knee: Scalar = output("A", "Knee b of the core")
    saturation: Scalar = output("Wb", "Flux linkage of saturation")
    hysteresis: Scalar = output("A", "Amplitude I_h of the hysteresis")
    mass: Scalar = output("kg", "Mass of the mover")
    rest_position: Scalar = output("m", "Position without spring force")
    viscous_damping: Scalar = output("N.s/m", "Viscous damping")
    core_reluctance: Scalar = output("1/H", "Reluctance R_c of the core without its knee, over N^2")
    gap_bend: Scalar = output("1", "Bend of the gap law, zero at both stops")


@ports()
class Certainty(NamedTuple):
    """Standard deviations of these after the last window; 0 of what is not learnt."""

    resistance_std: Scalar = output("Ohm", "Its standard deviation", min=0.0)
    eddy_std: Scalar = output("S", "Its standard deviation", min=0.0)
    gap_factor_std: Scalar = output("1", "Its standard deviation", min=0.0)
    knee_std: Scalar = output("A", "Its standard deviation", min=0.0)
    saturation_std: Scalar = output("Wb", "Its standard deviation", min=0.0)
    hysteresis_std: Scalar = output("A", "Its standard deviation", min=0.0)
    mass_std: Scalar = output("kg", "Its standard deviation", min=0.0)
    rest_position_std: Scalar = output("m", "Its standard deviation", min=0.0)
    viscous_damping_std: Scalar = output("N.s/m", "Its standard deviation", min=0.0)
    core_reluctance_std: Scalar = output("1/H", "Its standard deviation", min=0.0)
    gap_bend_std: Scalar = output("1", "Its standard deviation", min=0.0)


@ports()
class Operation(NamedTuple):
    """The last operation that was solved, and its window."""

    takeoff_time: Scalar = output("s", "Last sample at rest before the last motion that was solved", nominal=1e-2)
    landing_time: Scalar = output("s", "Its first landing; before any, that of the first sample", nominal=1e-2)
    impact_speed: Scalar = output("m/s", "Speed before that landing; 0 before any", min=0.0)
    bounces: Scalar = output("1", "Landings after the first one in the same window", min=0.0)
    windows: Scalar = output("1", "Windows solved so far", min=0.0)
    misfit: Scalar = output("1", "Cost of the last window over what noise and model error make", min=0.0)


@ports(feedthrough=Inputs._fields[1:])
class Outputs(NamedTuple):
    """Causal estimates at the sample, smoothed ones, the last operation, what was learnt."""

    position: Scalar = output("m", "Causal estimate of the position", nominal=1e-3)
    velocity: Scalar = output("m/s", "Its velocity", nominal=0.5)
    flux_linkage: Scalar = output("Wb", "Causal estimate of the flux linkage", nominal=20e-3)
    mode: Scalar = output("1", "1: at the lower stop, 2: moving, 3: at the upper stop", min=1.0, max=3.0)
    innovation: Scalar = output("A", "Measured current minus that of the causal estimate", nominal=1e-2)
    health: Health = part()
    shown: Shown = part()
    operation: Operation = part()
    found: Found = part()
    certainty: Certainty = part()
    voltage_offset: Scalar = output("V", "Offset of the voltage, by its rests", nominal=0.1)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, on the stop to which the spring pushes."""
    d, has_voltage = device(par), can_be_read(inputs.voltage, par.range_voltage)
    u = where(has_voltage, inputs.voltage, 0.0)
    at = point(0.0, 0.0, clip(d.rest, par.stop_lower, par.stop_upper), 0.0, u, model(par, d))
    state = State(
        last_command=inputs.command,
        causal=vector(at),
        believed=zeros(len(d)),
        held=Held(held_level=u, held_voltage=u),
        watch=Watch(noise=par.noise_current, is_driven=flag(drives(u, par))),
        follow=Follow(covariance=vector([0.0] * 9)),
        work=first_work(at, inputs.time, par),
        samples=Samples(
            newest=0.0, voltages=zeros(RING), currents=zeros(RING), weights=zeros(RING), commands=zeros(RING)
        ),
        smoothed=Smoothed(fluxes=zeros(RING), positions=zeros(RING)),
    )
    has_readings = has_voltage & _has_current(inputs, par)
    fine = health({LOST: not_(has_readings), UNLEARNT: is_unlearnt(state.watch, par)})
    return state, _outputs(
        at, d, 0.0, _show_causal(at, inputs.time), state.work.learnt, as_outputs(priors(par), par), fine, par
    )


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: it is read and kept, the window is worked on, the model follows, and all is judged and published."""
    told, now = par, _read(state, inputs, par)
    watch = listen(state.watch, state.samples, now.voltage, now.current, told)
    par = as_seen(watch, told)
    first = model(par, device(par))
    now = now._replace(
        has_current=now.has_current & not_(is_wild(state.samples, now.voltage, now.current, par)),
        relevance=relevance(now.voltage, now.current, load(state.believed, 0), state.work.learnt.doubt, par),
    )
    samples = _add_sample(state.samples, now, par)
    held = _hold(_forget_held(state.held, now.is_same_command, par), now.voltage, now.current + now.zero, par)
    # the window, (4) to (9)
    is_doubtful = is_strange(state.watch) | is_untold(watch, told)
    work, smoothed, news = _work(state, samples, held, is_doubtful, inputs.time, first, par)
    is_other = fabs(held.voltage_zero - state.held.voltage_zero) > SHIFTED * par.prior_voltage
    work = when(is_other, unlearn, work)
    # the causal estimate, (1) to (3)
    believed = when(news.is_other, lambda believed: put(believed, get(work.fit.device, START)), state.believed)
    m = with_device(first, Device(*get(believed, START)))
    before = Point(*state.causal)
    before = Point(*when(news.is_told, lambda _: vector(point(*before[:4], before.voltage, m)), state.causal))
    causal, covariance = _follow(state, now, before, work, news, is_set(watch.is_bouncing), m, par)
    at = Point(*causal)
    i_model = current(at, mean_of(before.voltage, now.voltage, m), m)
    innovation = where(now.has_current, now.current - i_model, 0.0)
    # what the innovation says: is the operation strange, is the current to be fed back (10)
    seen = _see(state, inputs, now, before, innovation)
    watch = watch_operation(watch, seen, at, work.learnt, m, par)
    is_unlikely = is_too_large(watch.surprise, work.learnt, par, of_noise=SETTLED_SHARE)
    is_suspect = is_unlikely & is_well_learnt(watch, work.learnt, par)
    work = work._replace(learnt=when(is_suspect, suspect, work.learnt))
    lasts = where(news.is_other, 0.0, state.follow.lasts)  # the innovations so far were those of another device
    follow = state.follow._replace(covariance=covariance, lasts=lasts)
    coil = partial(_coil, held, now.is_edge, watch, work.learnt, m, par)
    follow = decide(follow, is_set(watch.is_large), now.is_edge, coil, at, m)
    work = when(is_set(state.follow.is_on), lambda work: _drop_long(work, follow, par), work)
    # what is published
    work, shown = _publish(work, samples.newest, smoothed, at, inputs.time, par)
    fine = _health(now, work, watch, held, told, par)
    state = State(
        last_command=inputs.command,
        causal=causal,
        believed=believed,
        held=held._replace(held_rate=now.voltage - m.d.resistance * i_model),
        watch=watch,
        follow=follow,
        work=work,
        samples=samples,
        smoothed=smoothed,
    )
    known = get(work.learnt.deviations, START)
    outputs = _outputs(at, m.d, innovation, shown, work.learnt, known, fine, par)
    return state, outputs._replace(voltage_offset=held.voltage_zero)


class Sample(NamedTuple):
    """What was read; in place of a value that was lost, the last one."""

    voltage: Scalar
    current: Scalar  # less the zero of its sensor
    zero: Scalar  # which is this [A]
    last: Scalar  # current of the sample before
    jump: Scalar  # of the voltage
    has_voltage: Scalar
    has_current: Scalar  # neither lost nor wild
    is_edge: Scalar
    is_same_command: Scalar
    relevance: Scalar = 1.0  # of the current


def _read(state: State, inputs: Inputs, par: Parameters) -> Sample:
    """The readings, without those that are lost; whether a current is wild is not known yet."""
    last_voltage = Point(*state.causal).voltage
    has_voltage, has_current = can_be_read(inputs.voltage, par.range_voltage), _has_current(inputs, par)
    u = where(has_voltage, inputs.voltage - state.held.voltage_zero, last_voltage)
    zero = where(is_set(par.option_zero), state.held.zero, 0.0)
    last = load(state.samples.currents, state.samples.newest)
    return Sample(
        voltage=u,
        current=where(has_current, inputs.current - zero, last),
        zero=zero,
        last=last,
        jump=u - last_voltage,
        has_voltage=has_voltage,
        has_current=has_current,
        is_edge=drives(u - last_voltage, par),
        is_same_command=inputs.command == state.last_command,
    )


class News(NamedTuple):
    """What the work on the window says to the causal estimate."""

    has_caught_up: Scalar  # a pass is at the newest sample: the estimate is the pass
    is_other: Scalar  # the estimate has another device from now on
    is_told: Scalar  # since a result came so late that it counts before a pass has caught up


def _work(
    state: State, samples: Samples, held: Held, is_doubtful: Scalar, time: Scalar, first: Model, par: Parameters
) -> tuple[Work, Smoothed, News]:
    """A piece of the work on the window, (4) to (9); none while the current is fed back (10)."""
    window, before = state.work.window, Point(*state.causal)
    is_first = state.work.pass_start == PassStart.first
    work = state.work._replace(window=window._replace(is_doubtful=where(is_doubtful, 1.0, window.is_doubtful)))

    def resistance() -> Scalar:
        return where(held.held_resistance > 0.0, held.held_resistance, _settled_resistance(held, par))

    work, smoothed, has_caught_up = cond(
        is_set(state.follow.is_on),
        lambda: (wait(work, before, par), state.smoothed, False),
        lambda: work_on(work, samples, state.smoothed, before, resistance, time, first, par),
    )
    is_new = has_caught_up & not_(is_set(work.is_followed))
    is_told = _is_told_late(work, state.work.learnt)
    work = work._replace(is_followed=where(has_caught_up, 1.0, work.is_followed))
    return work, smoothed, News(has_caught_up, is_new | is_first | is_told, is_told)


def _follow(
    state: State, now: Sample, before: Point, work: Work, news: News, bounces: Scalar, m: Model, par: Parameters
) -> tuple[Array, Array]:
    """The next `Point`, by the model (1) to (3) or with the current fed back (10), and the covariance of the latter."""
    reading = Reading(
        voltage=now.voltage, current=now.current, counts=now.has_current & not_(now.is_edge), variance=1.0 / weight(par)
    )

    def open_loop() -> tuple[Array, Array]:
        bouncing = Bouncing(bounces, 0.5 * (now.last + now.current))
        at = cond(news.has_caught_up, lambda: work.walk.at, lambda: vector(advance(before, now.voltage, m, bouncing)))
        return at, state.follow.covariance

    return cond(is_set(state.follow.is_on), lambda: feed_back(before, state.follow, reading, m), open_loop)


def _see(state: State, inputs: Inputs, now: Sample, before: Point, innovation: Scalar) -> Seen:
    """What `watch_operation` takes of a sample."""
    return Seen(
        innovation=innovation,
        has_current=now.has_current,
        relevance=now.relevance,
        jump=now.jump,
        is_edge=now.is_edge,
        change=inputs.command - state.last_command,
        is_fed_back=is_set(state.follow.is_on),
        before=before,
    )


def _coil(held: Held, is_edge: Scalar, watch: Watch, learnt: Learnt, m: Model, par: Parameters) -> Coil:
    """What a held voltage says of the coil, and whether that explains the innovations."""
    i, creep, R = held.held_current, held.held_drift, _resistance(held, par)
    left = watch.surprise - i * (1.0 - R / m.d.resistance)  # what another resistance does not explain
    left = left - clip(left, where(creep < 0.0, creep, 0.0), where(creep > 0.0, creep, 0.0))  # nor where i goes to
    return Coil(
        is_edge=is_edge,
        pulls=fabs(i) > LARGE * par.noise_current,
        resistance=R,
        is_right=not_(is_too_large(left, learnt, par)),
    )


def _health(now: Sample, work: Work, watch: Watch, held: Held, told: Parameters, par: Parameters) -> Health:
    """The table of causes on the page."""
    is_changing = is_wandering(work.learnt) | (watch.evidence > ENOUGH)
    return health(
        {
            INNOVATION: (work.learnt.misfit >= par.health_limit) | is_strange(watch) | is_lost(work, par),
            LOST: not_(now.has_voltage & now.has_current),
            RESTARTED: work.learnt.given_up > 0.0,
            STILL: is_set(watch.is_still),
            OTHER: is_untypical(work.fit.q_prior, par) | (fabs(held.voltage_zero) > FAR * par.prior_voltage),
            UNTOLD: is_untold(watch, told),
            UNLEARNT: is_unlearnt(watch, par),
            CHANGING: is_changing & is_well_learnt(watch, work.learnt, par),
        }
    )


def _drop_long(work: Work, follow: Follow, par: Parameters) -> Work:
    """Where the current is no longer fed back, since the mover is on a stop, a long window is dropped."""
    is_back, longest = not_(is_set(follow.is_on) | is_set(follow.is_futile)), par.window_longest / par.sample_time
    age = where(is_back & (work.window.age > longest), count_kept(par), work.window.age)
    return work._replace(window=work.window._replace(age=age))


def _is_told_late(work: Work, before: Learnt) -> Scalar:
    """What a window has told is so late that the causal estimate does not wait for the next."""
    is_told, is_late = work.learnt.windows > before.windows, work.window.age > USUAL_EFFORT.later
    return is_told & is_late & (work.learnt.rejected < 1.0)


def _has_current(inputs: Inputs, par: Parameters) -> Scalar:
    return can_be_read(inputs.current, most_current(par.range_current, par.range_voltage, par.coil_resistance))


def _add_sample(before: Samples, now: Sample, par: Parameters) -> Samples:
    """The sample is kept; a current that was lost, or is at an edge, has no weight in (4)."""
    w = where(now.has_current & not_(now.is_edge), now.relevance * weight(par), 0.0)
    newest = where(before.newest < count_kept(par) - 1.0, before.newest + 1.0, 0.0)
    return Samples(
        newest=newest,
        voltages=store(before.voltages, newest, now.voltage),
        currents=store(before.currents, newest, now.current),
        weights=store(before.weights, newest, w),
        commands=store(before.commands, newest, flag(not_(now.is_same_command))),
    )


def _forget_held(held: Held, goes_on: Scalar, par: Parameters) -> Held:
    """With a command the resistance of a voltage that was held in the operation before is an old one."""
    return held._replace(held_resistance=where(goes_on | not_(is_set(par.option_command)), held.held_resistance, 0.0))


def _hold(before: Held, u: Scalar, i: Scalar, par: Parameters) -> Held:
    changes = fabs(u - before.held_level) > STEADY * fabs(before.held_level) + JUMP * par.noise_voltage
    share, rests = where(changes, 1.0, RECENT), _rests(before, par)
    return when(changes, lambda held: _change_level(held, u, par), before)._replace(
        held=where(changes, 0.0, before.held + 1.0),
        held_voltage=before.held_voltage + share * (u - before.held_voltage),
        held_current=before.held_current + share * (i - before.held_current),
        rest_current=before.rest_current + (LATE + 1.0) / (rests + LATE) * (i - before.rest_current),
        held_creep=before.held_creep + share * (before.held_rate - before.held_creep),
        held_drift=before.held_drift + share * (i - before.held_current - before.held_drift),
    )


def _change_level(before: Held, u: Scalar, par: Parameters) -> Held:
    """What the voltage that was held has told, when another one begins."""
    R, is_long = _settled_resistance(before, par), before.held >= par.window_tail / par.sample_time
    is_off, change = is_long & (fabs(before.held_voltage) < par.edge), before.rest_current - before.zero
    weight = (LATE + 1.0) / sqrt((2.0 * LATE + 1.0) * _rests(before, par))  # of the noise of a reading
    is_other = fabs(change) > ZEROED * weight * par.noise_current
    has_shifted = is_long & (fabs(before.held_voltage) < 2.0 * FAR * par.prior_voltage)
    return before._replace(
        held_level=u,
        held_resistance=where(R > 0.0, R, before.held_resistance),
        zero=before.zero + where(is_off, where(is_other, 1.0, MEAN) * change, 0.0),
        voltage_zero=before.voltage_zero + where(has_shifted, before.held_voltage, 0.0),
    )


def _rests(held: Held, par: Parameters) -> Scalar:
    """Samples of which the current at rest is the mean, from 1 on."""
    return clip(held.held - par.window_tail / par.sample_time, 1.0, LONGEST_REST)


def _resistance(held: Held, par: Parameters) -> Scalar:
    """Voltage over current, if both are held and large enough; else 0."""
    is_long = held.held >= par.window_tail / par.sample_time
    is_large = (fabs(held.held_current) > LARGE * par.noise_current) & (fabs(held.held_voltage) > par.edge)
    settled = where(is_set(par.option_further), SETTLED_WELL, SETTLED)
    is_settled = fabs(held.held_drift) < settled * fabs(held.held_current)
    through = held.held_current - where(is_set(par.option_zero), held.zero, 0.0)
    ratio = held.held_voltage / where(is_large, through, 1.0)
    return where(is_long & is_large & is_settled & (ratio > 0.0), ratio, 0.0)


def _settled_resistance(held: Held, par: Parameters) -> Scalar:
    """The same, if the flux linkage of the model is settled too: slow coils creep for long."""
    is_settled = fabs(held.held_creep) < CREEPING * fabs(held.held_voltage)
    return where(is_settled, _resistance(held, par), 0.0)


def _publish(
    work: Work, newest: Scalar, smoothed: Smoothed, now: Point, time: Scalar, par: Parameters
) -> tuple[Work, Shown]:
    """The next smoothed sample, if there is one; the velocity is the mean since the one before."""

    def publish() -> tuple[Scalar, Scalar, Shown]:
        oldest = where(work.shown >= newest, newest + count_kept(par) - work.shown, newest - work.shown) - 1.0
        late = where(par.publish_within > 0.0, oldest - par.publish_within / par.sample_time, 0.0)
        skipped = clip(-floor(-late), 0.0, work.ready - 1.0)
        before, spot = (_behind(work.shown + skipped + k, par) for k in (0.0, 1.0))
        z, age = load(smoothed.positions, spot), oldest - skipped
        shown = Shown(
            smoothed_published=1.0,
            smoothed_time=time - age * par.sample_time,
            smoothed_position=z,
            smoothed_velocity=(z - load(smoothed.positions, before)) / par.sample_time,
            smoothed_flux_linkage=load(smoothed.fluxes, spot),
        )
        return spot, work.ready - 1.0 - skipped, shown

    spot, left, shown = cond(work.ready > 0.0, publish, lambda: (work.shown, 0.0, _show_causal(now, time)))
    return work._replace(shown=spot, ready=left), shown


def _behind(spot: Scalar, par: Parameters) -> Scalar:
    """A place in the memory that may be beyond its end."""
    return where(spot < count_kept(par), spot, spot - count_kept(par))


def _outputs(
    at: Point, d: Device, innovation: Scalar, shown: Shown, learnt: Learnt, known: Array, fine: Health, par: Parameters
) -> Outputs:
    """The mode is that of the model; deviations of logarithms are relative."""
    mode = where(at.position <= par.stop_lower, 1.0, where(at.position >= par.stop_upper, 3.0, 2.0))
    sizes = [value if k < LOGARITHMS else 1.0 for k, value in enumerate(d)]
    stds = Certainty(*(size * std for size, std in zip(sizes, known)))
    return Outputs(
        position=at.position,
        velocity=at.velocity,
        flux_linkage=at.flux_linkage,
        mode=mode,
        innovation=innovation,
        health=fine,
        shown=shown,
        operation=Operation(*(getattr(learnt, name) for name in Operation._fields)),
        found=Found(*d),
        certainty=stds,
        voltage_offset=0.0,
    )


# The current, fed back while something else holds the mover (10).
#
# In open loop the model comes to a stop where a servo holds the mover.  An extended Kalman filter of (lambda, z, v)
# then goes on with the learnt model.  It begins if three conditions hold: the mean innovation has been too large for
# some time; a held voltage over its current is R, so that coil and sensor are right; a small error of R is not the
# reason. At first it hardly trusts the state, so that the first currents decide.  It ends at rest on a stop.
#
# It was no servo but a fault if the filter explains the currents no better, if a held voltage says that R is another
# one, or if no current is left to tell a position.  The model then runs in open loop until the next edge at least.


class Follow(NamedTuple):
    """The filter; its mean is the causal estimate."""

    covariance: Annotated[Array, Vector(9)]  # of flux linkage, position, velocity; row by row
    is_on: Scalar = 0.0  # flag: the current is fed back
    is_futile: Scalar = 0.0  # flag: it was, and that was no servo; until the next edge of the voltage
    lasts: Scalar = 0.0  # samples in a row with too large innovations, since an edge, or since it began or ended
    rests: Scalar = 0.0  # samples in a row on a stop


class Reading(NamedTuple):
    """What is measured, and how far the current counts."""

    voltage: Scalar
    current: Scalar
    counts: Scalar  # whether it does
    variance: Scalar  # of it


class Coil(NamedTuple):
    """What is seen of the coil at a sample."""

    is_edge: Scalar  # of the voltage
    pulls: Scalar  # whether there is current enough to tell a position
    resistance: Scalar  # by a held voltage, or 0
    is_right: Scalar  # whether that explains the innovations


def feed_back(before: Point, follow: Follow, reading: Reading, m: Model) -> tuple[Array, Array]:
    """The next `Point` and the covariance (10), by i = (g_e u + f) / (1 + R g_e) with the derivatives of f."""
    now = advance(before, reading.voltage, m)
    F, Q = _transition(before, reading.voltage, m), diagonal([square(FLUX) * m.T_s, 0.0, square(SPEED) * m.T_s])
    P = predict(matrix([follow.covariance[3 * k : 3 * k + 3] for k in range(3)]), F, Q)
    H = m.through * vector([now.mmf_slope, now.slope * now.flux_linkage, 0.0])
    innovation = reading.current - current(now, mean_of(before.voltage, reading.voltage, m), m)

    def correct() -> tuple[Array, Array]:
        prior = Gaussian(vector([now.flux_linkage, now.position, now.velocity]), P)
        (lam, z, v), cov = condition(prior, vector([innovation]), matrix([H]), vector([reading.variance]))
        hits = ((z <= m.lower) & (v < 0.0)) | ((z >= m.upper) & (v > 0.0))
        at = point(lam, now.hysteresis, clip(z, m.lower, m.upper), where(hits, 0.0, v), reading.voltage, m)
        return vector(at), vector([*cov[0], *cov[1], *cov[2]])

    return cond(reading.counts, correct, lambda: (vector(now), vector([*P[0], *P[1], *P[2]])))


def _transition(p: Point, voltage: Scalar, m: Model) -> Array:
    """Derivatives of `advance` by flux linkage, position and velocity; at rest on a stop the last two stay."""
    step = gain(p, electric(p, mean_of(p.voltage, voltage, m), m), m.T_s, m) * m.load
    _, _, curvature = gap(p.position, m.gap, m.d.gap, m.d.bend)
    lam, moves = p.flux_linkage, where(is_resting(p, m), 0.0, 1.0)
    by = vector([-p.slope * lam, -m.stiffness - 0.5 * curvature * square(lam), -m.d.damping]) / m.d.mass
    F = identity(3)
    F[0] = F[0] - step * vector([p.mmf_slope, moves * p.slope * lam, 0.0])
    F[1] = F[1] + moves * (0.5 * square(m.T_s) * by + vector([0.0, 0.0, m.T_s]))
    F[2] = F[2] + moves * m.T_s * by
    return F


def decide(before: Follow, is_large: Scalar, is_edge: Scalar, seen: Callable[[], Coil], now: Point, m: Model) -> Follow:
    """Whether it begins or ends after a sample; as long as the mean innovation is not too large, it does not begin."""

    def wait() -> Follow:
        return before._replace(is_futile=flag(is_set(before.is_futile) & not_(is_edge)), lasts=0.0)

    is_lasting = is_large & not_(is_edge)
    return cond(is_set(before.is_on) | is_lasting, lambda: _change(before, is_lasting, seen(), now, m), wait)


def _change(before: Follow, is_lasting: Scalar, coil: Coil, now: Point, m: Model) -> Follow:
    is_on, long = is_set(before.is_on), LASTING / m.T_s
    lasts = where(is_lasting, before.lasts + 1.0, 0.0)
    rests = where(is_between(now, m), 0.0, before.rests + 1.0)
    off = fabs(coil.resistance - m.d.resistance) / m.d.resistance
    is_other = (coil.resistance > 0.0) & (off > OTHER_COIL)
    fails = is_on & ((lasts >= long) | is_other | not_(coil.pulls))
    was_futile = is_set(before.is_futile) & not_(coil.is_edge)
    begins = (lasts >= long) & coil.pulls & (off < SAME_COIL) & not_(coil.is_right | is_on | was_futile)
    ends = fails | (is_on & (rests >= long))
    first = vector([std * std if j == k else 0.0 for j, std in enumerate(AT_FIRST) for k in range(3)])
    return Follow(
        covariance=when(begins, lambda _: first, before.covariance),
        is_on=flag((is_on & not_(ends)) | begins),
        is_futile=flag(fails | was_futile),
        lasts=where(begins | ends, 0.0, lasts),
        rests=where(begins, 0.0, rests),
    )


# What is noticed of the readings and of the device, now: noise, PWM, edges between samples, strange operations.


class Edge(NamedTuple):
    """The last edge of the voltage: it was somewhere between two samples, and the model has it in one place."""

    place: Scalar = 0.0  # from where the model has it [sampling periods]
    variance: Scalar = 0.0  # of that
    faded: Scalar = 0.0  # flux linkage by which the model is off now if it is a whole period off [Wb]


class Watch(NamedTuple):
    """What is noticed."""

    noise: Scalar  # standard deviation of the current, as it is seen; at least what was told [A]
    is_driven: Scalar = 0.0  # flag: a voltage has come
    switching: Scalar = 0.0  # share of samples at an edge soon after another, among those with a voltage or an edge
    since_edge: Scalar = 1e9  # samples since the voltage had an edge
    edge: Edge = Edge()
    spread: Scalar = ANYWHERE  # variance of the places of edges, of late
    surprise: Scalar = 0.0  # mean of the innovations, of late [A]
    is_large: Scalar = 0.0  # flag: it is too large now
    is_strange: Scalar = 0.0  # flag: it was too large in this operation, which begins with an edge of the voltage
    is_odd: Scalar = 0.0  # flag: it was too large in this operation to be fine
    is_moving: Scalar = 0.0  # flag: there was a motion in this operation
    is_proven: Scalar = 0.0  # flag: enough were explained when this operation began for it to be right without a sign
    suspicion: Scalar = 0.0  # operations that must be fine until one that was strange is forgotten
    was_commanded: Scalar = 0.0  # flag: the command has changed
    has_moved: Scalar = 0.0  # flag: there was a motion since then
    is_still: Scalar = 0.0  # flag: there was none between the two changes before
    is_bouncing: Scalar = 0.0  # flag: the mover bounces, and innovations do not count
    evidence: Scalar = 0.0  # that the innovations of many samples are not those of the device that was learnt


class Seen(NamedTuple):
    """A sample."""

    innovation: Scalar
    has_current: Scalar
    relevance: Scalar  # of the current
    jump: Scalar  # of the voltage
    is_edge: Scalar  # whether that is an edge
    change: Scalar  # of the command
    is_fed_back: Scalar  # whether the current was fed back
    before: Point  # the causal estimate of the sample before


def weight(par: Parameters) -> Scalar:
    """w^2 of a current: noise, and an error of the model that is the same over some samples."""
    return 1.0 / (square(par.noise_current) + SAME * square(par.model_error))


def relevance(u: Scalar, i: Scalar, R: Scalar, doubt: Scalar, par: Parameters) -> Scalar:
    """w^2 of a current over `weight`: less while the flux linkage changes, as far as eddy currents are in doubt.

    With `option.further` all count alike.
    """
    rate, rises = u - R * i, fabs(u) > fabs(R * i)
    error = doubt * where(rises, RISING, FALLING) * clip(par.prior_eddy, 0.0, UNKNOWN) * par.core_eddy * rate
    more = where(is_set(par.option_further), 0.0, SAME * weight(par) * square(error))
    return 1.0 / (1.0 + more)


def is_wild(before: Samples, u: Scalar, i: Scalar, par: Parameters) -> Scalar:
    """A current that is far from the line through the last two, although the voltage has not changed."""
    last, older, _ = _last(before.currents, before, par)
    is_far = square(i - 2.0 * last + older) * weight(par) > square(WILD)
    return is_far & _is_held(before, u, par.edge + JUMP * par.noise_voltage, par)


def listen(before: Watch, samples: Samples, u: Scalar, i: Scalar, par: Parameters) -> Watch:
    """The noise of the current, whether a voltage has come, and the share of close edges, with a new sample."""
    is_edge, is_driving = drives(u - load(samples.voltages, samples.newest), par), drives(u, par)
    is_close = is_edge & (before.since_edge * par.sample_time < par.window_tail)  # no operation is as short
    step = where(is_edge | is_driving, OFTEN * (flag(is_close) - before.switching), 0.0)
    return before._replace(
        noise=_noise(before.noise, samples, u, i, par),
        is_driven=where(is_driving, 1.0, before.is_driven),
        switching=before.switching + step,
        since_edge=where(is_edge, 0.0, before.since_edge + 1.0),
    )


def _noise(noise: Scalar, before: Samples, u: Scalar, i: Scalar, par: Parameters) -> Scalar:
    """The median of the third differences where the voltage has not changed, by steps: spikes do not move it far."""
    last, older, oldest = _last(before.currents, before, par)
    is_more = fabs(i - 3.0 * last + 3.0 * older - oldest) > MEDIAN * noise
    moved = noise * where(is_more, 1.0 + LEVELLING, 1.0 - LEVELLING)
    counts = _is_held(before, u, JUMP * par.noise_voltage, par) & (moved > par.noise_current)
    return where(counts, moved, noise)


def _last(memory: Array, samples: Samples, par: Parameters) -> list[Scalar]:
    """The three newest entries, the newest first."""
    return [load(memory, place(samples.newest, age, par)) for age in (0.0, 1.0, 2.0)]


def _is_held(before: Samples, u: Scalar, most: Scalar, par: Parameters) -> Scalar:
    """The voltage has changed by no more than this in each of the last three samples and this one."""
    voltages = [u, *_last(before.voltages, before, par)]
    is_held: Scalar = True
    for new, old in zip(voltages, voltages[1:]):
        is_held = (fabs(new - old) <= most) & is_held
    return is_held


def _is_pulsed(watch: Watch) -> Scalar:
    return watch.switching > PULSED


def as_seen(watch: Watch, par: Parameters) -> Parameters:
    """The noise that is seen where it is larger than what was told; under PWM the error of the model that it makes."""
    noise, minor = watch.noise, MINOR * par.core_hysteresis
    has_loops = _is_pulsed(watch) & is_set(par.option_mean) & (minor > par.model_error)
    return par._replace(
        noise_current=where(noise > TOLD_TOO_LOW * par.noise_current, noise, par.noise_current),
        model_error=where(has_loops, minor, par.model_error),
    )


def is_untold(watch: Watch, told: Parameters) -> Scalar:
    """Much more noise than was told, or PWM that is sampled."""
    return (watch.noise > TOO_NOISY * told.noise_current) | (_is_pulsed(watch) & not_(is_set(told.option_mean)))


def watch_operation(before: Watch, seen: Seen, now: Point, learnt: Learnt, m: Model, par: Parameters) -> Watch:
    """An operation whose innovations are too large is strange; only two that are fine, with motions, take that back."""
    between = is_between(now, m)
    is_known, by_place = learnt.explained >= _known(par), now.mmf_slope * m.through
    is_bouncing = bounces_on(before.is_bouncing, seen.before, now, m)
    is_lost = is_bouncing & seen.is_edge  # nobody knows where the mover is when the next operation begins
    counts = seen.has_current & not_(seen.is_edge | is_bouncing)
    new = when(seen.is_edge, lambda watch: _begin(watch, is_known, learnt), before)
    edge = _place_edge(before.edge, new.spread, seen, counts & not_(between), now, m, par)
    unexpected = sqrt(seen.relevance) * (seen.innovation - by_place * edge.faded * edge.place)
    surprise = before.surprise + where(counts, RECENT * (unexpected - before.surprise), 0.0)
    is_easy = (learnt.explained >= PRACTISED) & (fabs(now.flux_linkage) < LITTLE_FLUX * m.d.saturation)
    is_large = is_known & is_too_large(surprise, learnt, par, is_easy)
    is_other = is_set(par.option_command) & (fabs(seen.change) > 0.0)
    return new._replace(
        edge=edge,
        is_bouncing=flag(is_bouncing),
        surprise=surprise,
        evidence=where(counts & is_well_learnt(new, learnt, par), sum_up(new.evidence, surprise, par), new.evidence),
        is_large=flag(is_large),
        is_strange=where(is_large | is_lost | seen.is_fed_back, 1.0, new.is_strange),
        is_odd=where(is_too_large(surprise / FINE, learnt, par), 1.0, new.is_odd),
        is_moving=where(between, 1.0, new.is_moving),
        was_commanded=where(is_other, 1.0, before.was_commanded),
        has_moved=where(between, 1.0, where(is_other, 0.0, before.has_moved)),
        is_still=where(is_other, flag(is_set(before.was_commanded) & not_(is_set(before.has_moved))), before.is_still),
    )


def is_too_large(
    mean: Scalar, learnt: Learnt, par: Parameters, is_easy: Scalar = False, of_noise: float = 1.0
) -> Scalar:
    """Whether the mean of some innovations is more than a healthy device has; `is_easy`: the model has less error."""
    error = where(is_easy, EASY, 1.0) * par.model_error
    usual = sqrt(of_noise * square(par.noise_current) * (0.5 * RECENT + square(LEARNT)) + square(error))
    most, known = where(is_set(par.option_further), STRANGE_SOFT, STRANGE), _known(par)
    young = YOUNG / square(where(learnt.explained >= known, learnt.explained, known))
    return fabs(mean) > (1.0 + young) * most * usual


def sum_up(before: Scalar, mean: Scalar, par: Parameters) -> Scalar:
    """Evidence (13) with a new mean innovation; once it is enough it is as much again, and so lasts for a while."""
    usual = 0.5 * RECENT * square(par.noise_current) + square(EVIDENT * par.model_error)
    new = before + square(mean) / usual - ALLOWED
    return where((new > ENOUGH) & (before <= ENOUGH), 2.0 * ENOUGH, clip(new, 0.0, 2.0 * ENOUGH))


def _known(par: Parameters) -> Scalar:
    return where(is_set(par.option_further), KNOWN_SOFT, KNOWN)


def _begin(before: Watch, is_known: Scalar, learnt: Learnt) -> Watch:
    """An operation begins at an edge: the one before is judged, if it was one; how well edges are placed is learnt."""
    was_strange = is_set(before.is_strange)
    placed = PLACED * (square(before.edge.place) + before.edge.variance - before.spread)
    is_over = was_strange | is_set(before.is_moving)
    needed = where(learnt.explained > YOUNG, BOTH, 1.0)  # early ones are strange by what is yet to be learnt
    is_less = (before.suspicion > 0.0) & not_(is_set(before.is_odd))
    less = before.suspicion - flag(is_less)
    return before._replace(
        spread=before.spread + where(is_known & not_(was_strange), placed, 0.0),
        is_proven=flag(learnt.explained >= where(learnt.doubt > DOUBTED, DOUBTFUL, PROVEN)),
        is_strange=where(is_over, 0.0, before.is_strange),
        is_odd=where(is_over, 0.0, before.is_odd),
        is_moving=where(is_over, 0.0, before.is_moving),
        suspicion=where(is_over, where(was_strange, needed, less), before.suspicion),
    )


def _place_edge(before: Edge, spread: Scalar, seen: Seen, rests: Scalar, now: Point, m: Model, par: Parameters) -> Edge:
    """Kalman filter of the place of an edge, by the innovations at rest after it."""
    is_edge = seen.is_edge
    faded = where(is_edge, par.sample_time * seen.jump, before.faded * (1.0 - par.sample_time * m.load * now.mmf_slope))
    place, variance = where(is_edge, 0.0, before.place), where(is_edge, spread, before.variance)
    slope = faded * now.mmf_slope * m.through
    informs = where(rests, weight(par) * slope, 0.0)
    left = variance / (1.0 + informs * slope * variance)
    place = place + left * informs * (seen.innovation - slope * place)
    return Edge(clip(place, -0.5, 0.5), left, faded)


def is_well_learnt(watch: Watch, learnt: Learnt, par: Parameters) -> Scalar:
    """Whether a device is learnt so well that less tells a fault; not where edges are anywhere, which changes it, too.

    With `option.further` landings as soft as one likes leave much unlearnt.
    """
    is_placed = square(par.sample_time) * watch.spread < square(PLACED_WELL * par.window_tail)
    return is_set(learnt.is_settled) & is_placed & not_(_is_pulsed(watch) | is_set(par.option_further))


def is_strange(watch: Watch) -> Scalar:
    """Whether this operation is, or one was, and not two with a motion since then were fine."""
    return is_set(watch.is_strange) | (watch.suspicion > 0.0)


def is_unlearnt(watch: Watch, par: Parameters) -> Scalar:
    """A voltage has come, and too few motions were explained before this operation.

    With `option.further` windows are searched thoroughly from the first one on.
    """
    return is_set(watch.is_driven) & not_(is_set(watch.is_proven) | is_set(par.option_further))
