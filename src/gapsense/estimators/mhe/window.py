"""The window of `Mhe`: its samples, the records of the work on it, and a pass of the model through it.

A pass begins at the window's first sample with corrected parameters.  One with derivatives sums up the normal equations
(5), one without, as most trials are, only the cost (4).  Vectors and matrices lie in array memory, symmetric ones by
their upper triangle.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple

from gapsense.estimators.mhe.model import (
    Bouncing,
    Device,
    Model,
    Parameters,
    Point,
    advance,
    apply_corrections,
    current,
    differentiate,
    is_between,
    mean_of,
    point,
    with_device,
)
from gapsense.estimators.readings import is_edge
from gapsense.kernels.layout import Array, Choice, Memory, Scalar, Vector, Whole, triangle, zeros
from gapsense.kernels.linalg import matrix, outer, vector
from gapsense.kernels.trace import clip, cond, fabs, flag, floor, is_set, load, loop, not_, store, when, where

RING = 8192  # samples that are kept, at most
RINGED = Memory(RING, used="window_memory")
N = 12  # corrections: the fields of `Device`, and the flux linkage at the start of the window
START = N - 1
USUAL, ALL = (0, 1, 2, 3, 4, 5, 6, 7, START), tuple(range(N))  # without damping, core and bend, or with them
PAIRS = triangle(N)
FIXED = 1e-6  # least standard deviation of a correction
LOOSE = 13.0  # the same of damping, which dirt and wear change
MOST, FARTHEST = 6.0, 2.0  # deviations that a correction may have, and the largest correction
GUESSED = 3.0  # the same of eddy currents and hysteresis, of which only guesses are told
AT_START = 0.004  # deviation of the flux linkage at the start of a window, in lambda_sat
PACE = 7  # samples of a trial that are a piece of work, at most
FASTEST = 64  # pieces in a step, at most
FAST = 5.0  # the same where the sample time says how many
FEWEST, TRIED = 4.0, 250e-6  # samples of a trial that are a piece there, at least, and their time [s]
AT_ONCE, SPAN = 4, 80e-6  # samples that derivatives and sums take at once, at most, and their time [s]
USUAL_TIME = 20e-6  # sample time at which one piece in a step suffices [s]
GUESS = 1.0  # deviation before the first window from which eddy currents are but a guess
LARGE = 20.0  # noises that a current must have to say anything of the coil
UNSEEN = 0.15  # doubt of the eddy currents before the first window
PROVEN, DOUBTFUL = 4.0, 6.0  # motions that are explained before one without a sign is right; with other eddy currents
# motions that are explained, after which less is strange where there is little flux, and a misfit is that of a fault
PRACTISED = 10.0
ANY = 1e30  # cost that no pass has
LOOK, LATER = 20.0, 4.0  # samples with a voltage until the first look at an operation; times as many until the next


class Phase(Choice):
    """What is being done with the window; the drawing in `solve` shows how one follows another."""

    deriving, solving, trying, renewing = range(4)


class PassStart(Choice):
    """Whether a pass is under way, is to begin with this sample, or is the very first one."""

    under_way, due, first = range(3)


class Samples(NamedTuple):
    """What was measured."""

    newest: Annotated[Scalar, Whole(0, RING - 1)]  # place of the newest sample in the memory
    voltages: Annotated[Array, RINGED]
    currents: Annotated[Array, RINGED]
    weights: Annotated[Array, RINGED]  # w^2 of the currents; 0 where they do not count
    commands: Annotated[Array, RINGED]  # flag: the command has changed


class Smoothed(NamedTuple):
    """Samples of the last trial."""

    fluxes: Annotated[Array, RINGED]
    positions: Annotated[Array, RINGED]


class Window(NamedTuple):
    """The samples that are worked on, counted from its start."""

    origin: Annotated[Array, Memory(5)]  # flux linkage, hysteresis, position, velocity, voltage at its start
    age: Annotated[Scalar, Whole(0, RING)] = 0.0  # samples since its start
    end: Annotated[Scalar, Whole(0, RING)] = 0.0  # its last sample; 0 while it is open
    least: Scalar = 1.0  # shortest length
    has_grown: Scalar = 0.0  # flag: it was made longer
    has_jumped: Scalar = 0.0  # flag: it began again with the resistance of a held voltage
    is_doubtful: Scalar = 0.0  # flag: the causal estimate was strange, or the readings, since it began
    begins_loose: Scalar = 0.0  # flag: the mover bounces at its start
    look: Scalar = LOOK  # samples with a voltage after which it is looked at


class Walk(NamedTuple):
    """A pass of the model through the window; samples are counted from its start."""

    at: Annotated[Array, Vector(10)]  # a `Point`
    mean: Scalar  # voltage of the last sampling period
    still: Scalar  # samples on a stop
    done: Annotated[Scalar, Whole(0, RING)] = 0.0
    driven: Scalar = 0.0  # samples with a voltage, or with more current than noise makes
    cost: Scalar = 0.0  # sum w^2 r^2
    counted: Scalar = 0.0  # sum w^2
    pending: Scalar = 0.0  # samples since the last derivatives
    residuals: Scalar = 0.0  # sum w^2 r of these
    takeoff: Scalar = -1.0  # last sample at rest before the first motion, or -1
    landing: Scalar = 0.0  # the first one
    speed: Scalar = 0.0
    landings: Scalar = 0.0
    is_loose: Scalar = 0.0  # flag: it bounces since it has landed, and currents do not count


class Fit(NamedTuple):
    """Gauss-Newton on the window, (4) to (8)."""

    q: Annotated[Array, Memory(12)]  # corrections
    q_prior: Annotated[Array, Memory(12)]  # q_0
    change: Annotated[Array, Memory(12)]  # step that is tried
    device: Annotated[Array, Memory(11)]  # `Device` of the pass
    tangents: Annotated[Array, Memory(48)]  # derivatives of the state, row by row
    normal: Annotated[Array, Memory(78)]  # H
    gradient: Annotated[Array, Memory(12)]  # g
    whole: Annotated[Array, Memory(78)]  # H + Pi at q
    descent: Annotated[Array, Memory(12)]  # g - Pi (q - q_0) at q
    inverse: Annotated[Array, Memory(78)]  # what is being inverted
    prior: Annotated[Array, Memory(78)]  # Pi
    summed: Scalar = 0.0  # sum w^2 up to the last derivatives
    pivots_done: Scalar = 0.0
    lands: Scalar = 0.0  # flag: the mover lands at q
    derives: Scalar = 0.0  # flag: the trial is a pass with derivatives
    tries: Scalar = 0.0  # passes with derivatives
    shortenings: Scalar = 0.0  # of the step
    total: Scalar = 0.0  # cost at q
    predicted_cost: Scalar = 0.0  # after a whole step, if all were linear


class Search(NamedTuple):
    """Trials from fixed starts, where nothing else explains the currents."""

    start_index: Scalar = 0.0  # of the start that is tried, from 1 on; 0: none
    search_done: Scalar = 0.0  # flag: all were tried, and none is better
    searches: Scalar = 0.0  # in this window
    best: Scalar = 0.0  # index of the best start
    least_total: Scalar = 0.0  # its cost


class Learnt(NamedTuple):
    """The last window, and how well the corrections are known."""

    takeoff_time: Scalar
    landing_time: Scalar
    deviations: Annotated[Array, Memory(11)]
    impact_speed: Scalar = 0.0
    bounces: Scalar = 0.0
    windows: Scalar = 0.0  # so far
    misfit: Scalar = 0.0  # cost over what noise and model error make (9)
    given_up: Scalar = 0.0  # windows since then that were not solved before the memory was full
    rejected: Scalar = 0.0  # windows in a row that nothing explained; below 0: so many must be after a new beginning
    explained: Scalar = 0.0  # windows with a motion that were
    doubt: Scalar = UNSEEN  # whether the eddy currents of (1) are other ones, from 0 to 1
    surplus: Scalar = 0.0  # by which windows of late changed the corrections more than they should have
    is_settled: Scalar = 0.0  # flag: there was none once enough were explained
    resistance_trend: Scalar = 0.0  # mean of late of what an operation changes, with `option.ahead`
    rest_trend: Scalar = 0.0
    damping_trend: Scalar = 0.0


class Work(NamedTuple):
    """The window, and where the work on it stands."""

    phase: Scalar  # a `Phase`
    pass_start: Scalar  # a `PassStart`
    window: Window
    walk: Walk
    fit: Fit
    learnt: Learnt
    good: Annotated[Array, Memory(12)]  # corrections after the last good window
    good_prior: Annotated[Array, Memory(78)]  # and their Pi
    search: Search = Search()
    pass_done: Scalar = 0.0  # flag: the pass is at the end of the window
    is_followed: Scalar = 0.0  # flag: the causal estimate has the device of the pass
    ready: Annotated[Scalar, Whole(0, RING)] = 0.0  # smoothed samples that are not published yet
    shown: Annotated[Scalar, Whole(0, RING - 1)] = 0.0  # place of the last one that was


def first_work(at: Point, time: Scalar, par: Parameters) -> Work:
    """The first window begins; what is known before it comes into memory with the next sample."""
    n = len(PAIRS)
    return Work(
        phase=Phase.deriving,
        pass_start=PassStart.first,
        window=Window(origin=zeros(5)),
        walk=first_walk(at, par),
        fit=Fit(
            q=zeros(N),
            q_prior=zeros(N),
            change=zeros(N),
            device=zeros(START),
            tangents=zeros(4 * N),
            normal=zeros(n),
            gradient=zeros(N),
            whole=zeros(n),
            descent=zeros(N),
            inverse=zeros(n),
            prior=zeros(n),
        ),
        learnt=Learnt(takeoff_time=time, landing_time=time, deviations=zeros(START)),
        good=zeros(N),
        good_prior=zeros(n),
    )


def first_walk(at: Point, par: Parameters) -> Walk:
    """A pass that begins at a point."""
    is_on_stop = (at.position <= par.stop_lower) | (at.position >= par.stop_upper)
    return Walk(at=vector(at), mean=at.voltage, still=flag(is_on_stop))


# what is known before the first window


def priors(par: Parameters) -> list[Scalar]:
    """Standard deviations of the corrections before the first window; any, of those that are not learnt."""
    given = [getattr(par, f"prior_{name}") for name in Device._fields]
    known = [where(s > FIXED, s, FIXED) for s in given]
    return [s if k in USUAL else where(is_set(par.option_further), s, 1.0) for k, s in enumerate(known)]


def bounds(par: Parameters) -> list[Scalar]:
    """How far each correction may go: what is farther off than that is another device, or a fault."""
    most = Device(*[MOST] * START)._replace(damping=LOOSE)
    far = Device(*[FARTHEST] * START)._replace(eddy=GUESSED, hysteresis=GUESSED)
    return [where(m * s < f, m * s, f) for m, f, s in zip(most, far, priors(par))]


def start_deviation(par: Parameters) -> Scalar:
    """Standard deviation of the flux linkage at the start of a window."""
    return AT_START * par.core_saturation


def as_outputs(deviations: Sequence[Scalar], par: Parameters) -> list[Scalar]:
    """As outputs: what is not learnt has none."""
    return [s if k in USUAL else where(is_set(par.option_further), s, 0.0) for k, s in enumerate(deviations)]


# memory


def origin_of(at: Point) -> Array:
    """The numbers with which a window begins at a point."""
    return vector([at.flux_linkage, at.hysteresis, at.position, at.velocity, at.voltage])


def count_kept(par: Parameters) -> Scalar:
    """Samples that are kept: places of the memory that are used."""
    return clip(floor(par.window_memory), 1.0, float(RING))


def place(newest: Scalar, age: Scalar, par: Parameters) -> Scalar:
    """Place in the memory of a sample that is so many samples old."""
    at = newest - age
    return where(at < 0.0, at + count_kept(par), at)


def get(memory: Array, size: int) -> Array:
    """A vector in memory."""
    return vector([load(memory, k) for k in range(size)])


def put(memory: Array, values: Iterable[Scalar]) -> Array:
    """The memory with a vector."""
    for k, value in enumerate(values):
        memory = store(memory, k, value)
    return memory


def get_matrix(memory: Array, rows: Sequence[int] = ALL) -> Array:
    """Some rows and columns of a symmetric matrix in memory."""
    return matrix([[load(memory, PAIRS.index((min(i, j), max(i, j)))) for j in rows] for i in rows])


def put_matrix(memory: Array, A: Array, rows: Sequence[int] = ALL) -> Array:
    """The memory with these rows and columns."""
    for a, i in enumerate(rows):
        for b, j in enumerate(rows):
            if i <= j:
                memory = store(memory, PAIRS.index((i, j)), A[a, b])
    return memory


def remember(smoothed: Smoothed, walk: Walk, window: Window, samples: Samples, par: Parameters) -> Smoothed:
    """The memory with the sample that a pass has come to."""
    spot = place(samples.newest, window.age - walk.done, par)
    return Smoothed(store(smoothed.fluxes, spot, walk.at[0]), store(smoothed.positions, spot, walk.at[2]))


# a pass


def begin_pass(work: Work, m: Model, par: Parameters) -> Work:
    """A pass begins with the corrections q, and a trial with a step more; `m` has the device that was told."""
    fit, is_trying = work.fit, work.phase == Phase.trying
    q = vector([a + where(is_trying, b, 0.0) for a, b in zip(get(fit.q, N), get(fit.change, N))])
    d = apply_corrections(m.d, q[:START])
    lam, h, z, v, u = get(work.window.origin, 5)
    at = point(lam + q[START], h, z, v, u, with_device(m, d))
    fit = fit._replace(device=put(fit.device, d), summed=0.0)
    return work._replace(
        pass_start=PassStart.under_way,
        is_followed=0.0,
        walk=first_walk(at, par)._replace(is_loose=work.window.begins_loose),
        fit=when(derives(work), _clear_sums, fit),
    )


def _clear_sums(fit: Fit) -> Fit:
    """No sums; the derivatives at the start of the window."""
    return fit._replace(
        tangents=put(fit.tangents, [1.0 if k == 4 * START else 0.0 for k in range(4 * N)]),
        normal=put(fit.normal, [0.0] * len(PAIRS)),
        gradient=put(fit.gradient, [0.0] * N),
    )


def advance_pass(work: Work, samples: Samples, smoothed: Smoothed, m: Model, par: Parameters) -> tuple[Work, Smoothed]:
    """Some samples more of a pass: with derivatives where they are due, or into the memory of smoothed samples."""
    m, pieces = with_device(m, Device(*get(work.fit.device, START))), pace(par)

    def one(work: Work, smoothed: Smoothed, n: Scalar) -> tuple[tuple[Work, Smoothed, Scalar], Scalar]:
        work, smoothed = cond(
            derives(work),
            lambda: _derive(work, samples, smoothed, m, par),
            lambda: _try(work, samples, smoothed, m, par),
        )
        is_enough = is_set(work.pass_done) | (work.walk.done >= work.window.age) | (n >= pieces)
        return (work, smoothed, n + 1.0), is_enough

    work, smoothed, _ = loop(FASTEST, one, (work, smoothed, 1.0))
    return work, smoothed


def pace(par: Parameters) -> Scalar:
    """Pieces of a pass that a step may take: more if samples are farther apart, but no step is to last for long."""
    by_time = clip(floor(par.sample_time / USUAL_TIME + 0.5), 1.0, FAST)
    return where(par.window_pace > 0.0, par.window_pace, by_time)


def derives(work: Work) -> Scalar:
    """Whether a pass is one with derivatives."""
    return (work.phase == Phase.deriving) | is_set(work.fit.derives)


def _derive(work: Work, samples: Samples, smoothed: Smoothed, m: Model, par: Parameters) -> tuple[Work, Smoothed]:
    """Samples of a pass with derivatives; the first such pass finds the end of the window."""
    window, most = work.window, _most(work, par)
    is_open = window.end <= 0.0
    limit = where(is_open | (window.age < window.end), window.age, window.end)

    def one(walk: Walk, smoothed: Smoothed, _: Scalar) -> tuple[tuple[Walk, Smoothed, Scalar], Scalar]:
        new, weighted = _visit(walk, window, samples, m, par)
        new = new._replace(pending=walk.pending + 1.0, residuals=walk.residuals + weighted)
        kept = remember(smoothed, new, window, samples, par)
        is_over = (new.done >= window.end) | (new.cost > most)
        ends = cond(is_open, lambda: _ends(new, window, samples, par), lambda: is_over)
        return (new, kept, flag(ends)), (new.done >= limit) | _is_full(new, par) | ends

    walk, smoothed, ends = loop(AT_ONCE, one, (work.walk, smoothed, 0.0))
    work = work._replace(walk=walk, pass_done=where(is_look(work._replace(walk=walk), par), 1.0, ends))
    return when(_is_full(walk, par), lambda work: _add_sums(work, m, par), work), smoothed


def _most(work: Work, par: Parameters) -> Scalar:
    """Cost beyond which a pass need not go on: with `option.further`, that which a trial is to beat."""
    is_searching, least = work.search.start_index > 0.0, where(is_set(work.fit.derives), work.fit.total, ANY)
    beaten = where(is_searching, work.search.least_total, least)
    return where((work.phase == Phase.trying) & is_set(par.option_further), beaten, ANY)


def is_untaught(learnt: Learnt, par: Parameters) -> Scalar:
    """No window with a motion was explained so far, and the device may be far from the one told.

    With `option.further` the search is thorough anyway.
    """
    return (learnt.explained < 1.0) & not_(is_set(par.option_further))


def is_look(work: Work, par: Parameters) -> Scalar:
    """Whether the first operation is looked at before it ends: its first currents tell losses that were a guess."""
    is_due = (work.window.end <= 0.0) & (work.walk.driven >= work.window.look) & not_(has_landed(work.walk))
    is_first = is_untaught(work.learnt, par) & not_(work.learnt.rejected > 0.0)
    return is_due & is_first & (par.prior_eddy >= GUESS)


def _ends(walk: Walk, window: Window, samples: Samples, par: Parameters) -> Scalar:
    """Whether an open window ends here: at rest after a landing, at a voltage after a rest, or with the command."""
    tail, longest = par.window_tail / par.sample_time, par.window_longest / par.sample_time
    by_landing = (walk.takeoff >= 0.0) & (walk.still >= tail)
    spot = place(samples.newest, window.age - walk.done, par)
    by_voltage = (walk.driven == 1.0) & (walk.takeoff < 0.0) & (walk.done > 0.5 * longest)
    ends = cond(
        is_set(par.option_command), lambda: is_set(load(samples.commands, spot)), lambda: by_landing | by_voltage
    )
    return (ends & (walk.done >= window.least)) | (walk.done >= longest)


def _is_full(walk: Walk, par: Parameters) -> Scalar:
    """Whether derivatives are due: after some samples, and at a landing."""
    return (walk.still == 1.0) | (walk.pending >= clip(floor(SPAN / par.sample_time + 0.5), 1.0, float(AT_ONCE)))


def _try(work: Work, samples: Samples, smoothed: Smoothed, m: Model, par: Parameters) -> tuple[Work, Smoothed]:
    """Samples of a trial without derivatives."""
    window, most = work.window, _most(work, par)
    limit = where(window.age < window.end, window.age, window.end)
    by_time = clip(floor(TRIED / par.sample_time), FEWEST, float(PACE))
    piece = work.walk.done + where(par.window_pace > 0.0, float(PACE), by_time)
    limit = where(piece < limit, piece, limit)

    def one(walk: Walk, smoothed: Smoothed) -> tuple[tuple[Walk, Smoothed], Scalar]:
        new, _ = _visit(walk, window, samples, m, par)
        return (new, remember(smoothed, new, window, samples, par)), (new.done >= limit) | (new.cost > most)

    walk, smoothed = loop(PACE, one, (work.walk, smoothed))
    return work._replace(walk=walk, pass_done=flag((walk.done >= window.end) | (walk.cost > most))), smoothed


def _visit(walk: Walk, window: Window, samples: Samples, m: Model, par: Parameters) -> tuple[Walk, Scalar]:
    """The next sample, and w^2 r of it."""
    before, spot = Point(*walk.at), place(samples.newest, window.age - walk.done - 1.0, par)
    u, i, w = (load(memory, spot) for memory in (samples.voltages, samples.currents, samples.weights))
    last, bounces = load(samples.currents, place(samples.newest, window.age - walk.done, par)), is_set(walk.is_loose)
    at, mean = advance(before, u, m, Bouncing(bounces, 0.5 * (last + i))), mean_of(before.voltage, u, m)
    i_model = current(at, mean, m)
    r = i - i_model
    is_on_stop = not_(is_between(at, m))
    is_loose = bounces_on(walk.is_loose, before, at, m)
    w = where(is_loose, 0.0, w)
    is_driven = drives(u, par) | (fabs(i_model) > LARGE * par.noise_current)
    new = walk._replace(
        done=walk.done + 1.0,
        at=vector(at),
        mean=mean,
        still=where(is_on_stop, walk.still + 1.0, 0.0),
        driven=walk.driven + flag(is_driven),
        cost=walk.cost + w * r * r,  # (4)
        counted=walk.counted + w,
        is_loose=flag(is_loose),
    )
    is_plain = (new.still > 1.0) | (new.still + walk.still < 1.0)
    return when(not_(is_plain), lambda new: _note_event(walk, new, before, m), new), w * r


def _note_event(walk: Walk, new: Walk, before: Point, m: Model) -> Walk:
    """The mover leaves a stop, or lands: after a share of the period, with its speed there."""
    lands = new.still > 0.0
    is_first = lands & (walk.landings < 1.0)
    free = m.T_s * (before.velocity + 0.5 * m.T_s * before.acceleration)
    moved = clip(new.at[2], m.lower, m.upper) - before.position
    share = clip(moved / where(fabs(free) > 0.0, free, 1.0), 0.0, 1.0)
    speed = fabs(before.velocity + share * m.T_s * before.acceleration)
    return new._replace(
        takeoff=where(lands | (walk.takeoff >= 0.0), walk.takeoff, walk.done),
        landing=where(is_first, walk.done + share, walk.landing),
        speed=where(is_first, speed, walk.speed),
        landings=where(lands, walk.landings + 1.0, walk.landings),
    )


def _add_sums(work: Work, m: Model, par: Parameters) -> Work:
    """Derivatives J of the current at the sample that the pass has come to; H and g of (5) with them."""
    walk, fit = work.walk, work.fit
    weight, is_still, bounces = walk.counted - fit.summed, walk.still > 0.0, is_set(walk.is_loose)

    def add(which: tuple[int, ...]) -> tuple[Array, Array, Array]:
        tangents, gradient = fit.tangents, fit.gradient
        T = matrix([[load(tangents, 4 * k + n) for n in range(4)] for k in which])
        T, J = differentiate(T, which, Point(*walk.at), walk.mean, walk.pending, is_still, bounces, m)
        for k, row, slope in zip(which, T, J):
            for n in range(4):
                tangents = store(tangents, 4 * k + n, row[n])
            gradient = store(gradient, k, load(gradient, k) + walk.residuals * slope)
        return tangents, put_matrix(fit.normal, get_matrix(fit.normal, which) + outer(weight * J, J), which), gradient

    tangents, normal, gradient = cond(is_set(par.option_further), lambda: add(ALL), lambda: add(USUAL))
    return work._replace(
        walk=walk._replace(pending=0.0, residuals=0.0),
        fit=fit._replace(summed=walk.counted, tangents=tangents, normal=normal, gradient=gradient),
    )


# what a voltage or a pass is


def drives(u: Scalar, par: Parameters) -> Scalar:
    """Whether a voltage, or a change of it, is more than what noise and a controller at rest make."""
    return is_edge(u, par.edge, par.noise_voltage)


def bounces_on(bounced: Scalar, before: Point, at: Point, m: Model) -> Scalar:
    """Whether the mover comes back from a stop that it meets, or has and does not rest yet."""
    meets = is_between(before, m) & not_(is_between(at, m))
    return m.bounces & not_(at.velocity == 0.0) & (meets | is_set(bounced))


def is_idle(walk: Walk) -> Scalar:
    """Neither voltage nor motion: the noise of the voltage would be all that such a window learns from."""
    return (walk.driven < 2.0) & not_(has_moved(walk))


def has_moved(walk: Walk) -> Scalar:
    """Whether there is a motion, or a part of one."""
    return (walk.takeoff >= 0.0) | has_landed(walk) | (walk.still < 1.0)


def has_landed(walk: Walk) -> Scalar:
    """Whether there is a landing."""
    return walk.landings > 0.0
