"""Work of `Mhe` on a window: passes of the model through its samples, and Gauss-Newton between them.

The cost of corrections q is sum w^2 (i - i_model)^2 + (q - q0)' Pi (q - q0), with the posterior of the window before as
arrival cost.  Phases: a pass with derivatives J of the current sums up H = sum w^2 J J' and g = sum w^2 J r; H + Pi is
inverted; a trial without derivatives must lower the cost, or the step is shortened; then comes another pass with
derivatives, or this was the last trial: the smoothed estimate.  The inverse then becomes the next Pi.  Work per sample
is bounded: `PACE` samples of a pass, or two pivots of an inverse.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

from gapsense.estimators.mhe_model import (
    Device,
    Model,
    Point,
    advance,
    corrected,
    current,
    derived,
    device,
    model,
    point,
)
from gapsense.linalg import deviation, diagonal, matrix, outer, pivot, vector
from gapsense.records import Array, Memory, Scalar, Vector, triangle, zeros
from gapsense.trace import clip, cond, fabs, load, log, loop, not_, square, store, where

if TYPE_CHECKING:
    from gapsense.estimators.mhe import Parameters

RING = 8192  # samples that are kept
PACE = 8  # of them that a pass takes in a step
N = 12  # corrections: the fields of `Device`, and the flux linkage at the start of the window
START = N - 1
USUAL, ALL = (0, 1, 2, 3, 4, 5, 6, 7, START), tuple(range(N))  # without damping, core and bend, or with them
PAIRS = triangle(N)
LOGARITHMS = 9  # the first ones
AT_REST, MOVING = 4.0, 4.0  # samples that derivatives and sums take at once
DERIVING, SOLVING, TRYING, RENEWING = 0.0, 1.0, 2.0, 3.0  # phases
# standard deviations of what a window adds to the corrections, fields of `Device`
DRIFT = (0.2e-2, 0.15e-2, 0.03e-2, 0.06e-2, 0.03e-2, 0.3e-2, 0.03e-2, 0.03e-2, 0.1e-2, 0.5e-2, 0.5e-2)
FIXED = 1e-6  # least standard deviation of a correction
FURTHER = (0.1, 0.2, 0.1)  # deviations of the last three before the first window
AT_START = 0.004  # deviation of the flux linkage at the start of a window, in lambda_sat
TRIES = 5.0  # passes with derivatives
SHORTENED, SHORTENINGS = 0.25, 3.0  # of a step whose trial is worse than what it left; the last one to nothing
LARGEST, FARTHEST = 0.7, 2.0  # step of a logarithm, and the logarithm itself: what no motion tells stays finite
LITTLE, GAIN, POOR, BAD = 0.03, 0.1, 1.0, 6.0  # of the cost that noise and model error make: see `_judged`
LATE = 400.0  # samples behind the end of a window after which no other pass with derivatives begins
REJECTED, DOUBT = 6.0, 0.25  # misfit from which nothing is learnt, and what is left of the information then
# where a search begins if nothing explains the currents: field of `Device`, and how many deviations off
STARTS = tuple((k, by) for by in (-1.0, 1.0, -2.0, 2.0) for k in (7, 2))
WITHIN = 0.75  # of the tail that must be left of it, or the motion has turned out to end later
JUMP = 0.03  # of R: a held voltage says better where to start

Kept = tuple[Scalar, ...]  # flux linkage and position of a sample


class Samples(NamedTuple):
    """What was measured."""

    newest: Scalar  # place of the newest sample in the memory
    voltages: Annotated[Array, Memory(RING)]
    currents: Annotated[Array, Memory(RING)]
    weights: Annotated[Array, Memory(RING)]  # w^2 of the currents; 0 where they do not count
    commands: Annotated[Array, Memory(RING)]  # 1: the command has changed


class Walk(NamedTuple):
    """A pass of the model through the window; samples are counted from its start."""

    done: Scalar
    at: Annotated[Array, Vector(10)]  # a `Point`
    mean: Scalar  # voltage of the last sampling period
    still: Scalar  # samples on a stop
    cost: Scalar
    counted: Scalar  # sum w^2
    pending: Scalar  # samples since the last derivatives
    residuals: Scalar  # sum w^2 r of these
    takeoff: Scalar  # last sample at rest before the first motion, or -1
    landing: Scalar  # the first one
    speed: Scalar
    landings: Scalar


class Learnt(NamedTuple):
    """The last window, and how well the corrections are known."""

    takeoff_time: Scalar
    landing_time: Scalar
    impact_speed: Scalar
    bounces: Scalar
    windows: Scalar  # so far
    misfit: Scalar  # cost over what noise and model error make
    given_up: Scalar  # windows since then that were not solved before the memory was full
    deviations: Annotated[Array, Memory(11)]


class Work(NamedTuple):
    """The window and the state of the work on it."""

    phase: Scalar
    begins: Scalar  # 1: a pass is to begin; 2: the very first one
    over: Scalar  # 1: the pass is at the end of the window
    turn: Scalar  # pivots done
    origin: Annotated[Array, Memory(5)]  # flux linkage, hysteresis, position, velocity, voltage at its start
    age: Scalar  # samples since then
    end: Scalar  # its last sample, or 0
    least: Scalar  # shortest length
    has_jumped: Scalar  # 1: it began again with the resistance of a held voltage
    has_grown: Scalar  # 1: it was made longer
    tries: Scalar
    shortenings: Scalar
    start: Scalar  # of `STARTS` that is tried, from 1 on; 0: none; -1: all were
    best: Scalar  # of them
    least_total: Scalar  # its cost
    q: Annotated[Array, Memory(12)]  # corrections
    q_prior: Annotated[Array, Memory(12)]
    change: Annotated[Array, Memory(12)]  # step that is tried
    total: Scalar  # cost at q
    promised: Scalar  # cost at q + change, if all were linear
    device: Annotated[Array, Memory(11)]  # `Device` of the pass
    follows: Scalar  # 1: the causal estimate has it too
    walk: Walk
    summed: Scalar  # sum w^2 up to the last derivatives
    tangents: Annotated[Array, Memory(48)]  # row by row
    normal: Annotated[Array, Memory(78)]  # H, or what is being inverted; upper triangle
    gradient: Annotated[Array, Memory(12)]
    prior: Annotated[Array, Memory(78)]  # Pi
    ready: Scalar  # smoothed samples that are not published yet
    shown: Scalar  # place of the last one that was
    learnt: Learnt


def first_work(at: Point, time: Scalar, par: Parameters) -> Work:
    """The first window begins."""
    return Work(
        phase=DERIVING,
        begins=2.0,
        over=0.0,
        turn=0.0,
        origin=zeros(5),
        age=0.0,
        end=0.0,
        least=1.0,
        has_jumped=0.0,
        has_grown=0.0,
        tries=0.0,
        shortenings=0.0,
        start=0.0,
        best=0.0,
        least_total=0.0,
        q=zeros(N),
        q_prior=zeros(N),
        change=zeros(N),
        total=0.0,
        promised=0.0,
        device=zeros(START),
        follows=0.0,
        walk=_started(at, par),
        summed=0.0,
        tangents=zeros(4 * N),
        normal=zeros(len(PAIRS)),
        gradient=zeros(N),
        prior=zeros(len(PAIRS)),
        ready=0.0,
        shown=0.0,
        learnt=Learnt(time, time, 0.0, 0.0, 0.0, 0.0, 0.0, zeros(START)),
    )


def priors(par: Parameters) -> list[Scalar]:
    """Standard deviations of the corrections before the first window; any, of those that are not learnt."""
    usual = [getattr(par, f"prior_{name}") for name in Device._fields[: len(FURTHER) * -1]]
    further = [where(par.option_further > 0.0, s, 1.0) for s in FURTHER]
    return [*(where(s > FIXED, s, FIXED) for s in usual), *further]


def _start(par: Parameters) -> Scalar:
    """Standard deviation of the flux linkage at the start of a window."""
    return AT_START * par.core_saturation


def published(deviations: Sequence[Scalar], par: Parameters) -> list[Scalar]:
    """As outputs: what is not learnt has none."""
    return [s if k in USUAL else where(par.option_further > 0.0, s, 0.0) for k, s in enumerate(deviations)]


def _origin(at: Point) -> Array:
    return vector([at.flux_linkage, at.hysteresis, at.position, at.velocity, at.voltage])


def _started(at: Point, par: Parameters) -> Walk:
    is_on_stop = (at.position <= par.stop_lower) | (at.position >= par.stop_upper)
    return Walk(0.0, vector(at), at.voltage, where(is_on_stop, 1.0, 0.0), 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0)


def work_on(
    work: Work,
    samples: Samples,
    smoothed: tuple[Array, Array],
    causal: Point,
    held: Scalar,
    time: Scalar,
    par: Parameters,
) -> tuple[Work, tuple[Array, Array], Scalar]:
    """What is done with a new sample: the work, the memory of smoothed samples, and whether a pass has caught up.

    `causal` is the estimate of the sample before, `held` the resistance by a held voltage, or 0.
    """
    work = work._replace(age=work.age + 1.0)
    work = cond(work.age > RING - 2.0 * PACE, lambda: _given_up(work, causal), lambda: work)
    work = cond(work.begins > 1.0, lambda: _informed(work, causal, par), lambda: work)
    is_deriving = work.phase == DERIVING

    def passed() -> tuple[Work, tuple[Array, Array]]:
        return cond(
            work.begins > 0.0,
            lambda: (_begun(work, par), smoothed),
            lambda: cond(
                work.walk.done < work.age, lambda: _walked(work, samples, smoothed, par), lambda: (work, smoothed)
            ),
        )

    def concluded() -> Work:
        ended = work._replace(over=0.0)
        tried = lambda: cond(  # noqa: E731
            ended.start > 0.0, lambda: _sought(ended, par), lambda: _judged(ended, samples, time, par)
        )
        return cond(is_deriving, lambda: _derived(ended, held, par), tried)

    is_passing = (is_deriving | (work.phase == TRYING)) & (work.over < 1.0)
    work, smoothed = cond(
        is_passing, passed, lambda: (cond(work.over > 0.0, concluded, lambda: _turned(work, par)), smoothed)
    )
    return work, smoothed, (work.phase == DERIVING) & (work.begins < 1.0) & (work.walk.done >= work.age)


def _remembered(
    smoothed: tuple[Array, Array], trail: list[Kept], passed: Scalar, age: Scalar, samples: Samples
) -> tuple[Array, Array]:
    """The memory with the samples that a trial has passed; the last one is `age` samples old."""
    fluxes, positions = smoothed
    for k, (lam, z) in enumerate(trail):
        spot = where(passed > k, place(samples.newest, age + k), RING)
        fluxes, positions = store(fluxes, spot, lam), store(positions, spot, z)
    return fluxes, positions


def place(newest: Scalar, age: Scalar) -> Scalar:
    """Place in the memory of a sample that is so many samples old."""
    at = newest - age
    return where(at < 0.0, at + RING, at)


def get(memory: Array, size: int) -> Array:
    """A vector in memory."""
    return vector([load(memory, k) for k in range(size)])


def put(memory: Array, values: Iterable[Scalar]) -> Array:
    """The memory with a vector."""
    for k, value in enumerate(values):
        memory = store(memory, k, value)
    return memory


# windows and passes


def _given_up(work: Work, causal: Point) -> Work:
    """The memory is full before the window is solved: the next one begins where the causal estimate is."""
    learnt = work.learnt._replace(given_up=work.learnt.given_up + 1.0)
    known = put(work.q, [*get(work.q_prior, START), 0.0])
    return _opened(work._replace(origin=put(work.origin, _origin(causal)), age=1.0, q=known, ready=0.0, learnt=learnt))


def _opened(work: Work) -> Work:
    """A window begins at its origin."""
    known = put(work.q_prior, get(work.q, N))
    new = work._replace(q_prior=known, end=0.0, least=1.0, has_jumped=0.0, has_grown=0.0, tries=0.0, start=0.0)
    return _deriving(new)


def _deriving(work: Work) -> Work:
    """A pass with derivatives is next."""
    return work._replace(phase=DERIVING, begins=1.0, over=0.0)


def _informed(work: Work, causal: Point, par: Parameters) -> Work:
    """What is known before the first window."""
    deviations = priors(par)
    prior = diagonal([1.0 / square(s) for s in (*deviations, _start(par))])
    known = work.learnt._replace(deviations=put(work.learnt.deviations, published(deviations, par)))
    return work._replace(origin=put(work.origin, _origin(causal)), prior=_put(work.prior, prior), learnt=known)


def _begun(work: Work, par: Parameters) -> Work:
    """A pass begins."""
    is_trying = work.phase == TRYING
    q = vector([a + where(is_trying, b, 0.0) for a, b in zip(get(work.q, N), get(work.change, N))])
    d = corrected(device(par), q[:START])
    lam, h, z, v, u = get(work.origin, 5)
    at = point(lam + q[START], h, z, v, u, model(par, d))
    work = work._replace(begins=0.0, device=put(work.device, d), follows=0.0, walk=_started(at, par), summed=0.0)
    return cond(is_trying, lambda: work, lambda: _cleared(work))


def _cleared(work: Work) -> Work:
    """No sums; the derivatives at the start of the window."""
    return work._replace(
        tangents=put(work.tangents, [1.0 if k == 4 * START else 0.0 for k in range(4 * N)]),
        normal=put(work.normal, [0.0] * len(PAIRS)),
        gradient=put(work.gradient, [0.0] * N),
    )


def _walked(
    work: Work, samples: Samples, smoothed: tuple[Array, Array], par: Parameters
) -> tuple[Work, tuple[Array, Array]]:
    """Some samples more of a pass: derivatives where they are due, or the memory of smoothed samples."""
    m = model(par, Device(*get(work.device, START)))
    walk, trail, is_over = _some(work, samples, m, par)
    new, count, age = (
        work._replace(walk=walk, over=where(is_over, 1.0, 0.0)),
        walk.done - work.walk.done,
        work.age - walk.done,
    )
    return cond(
        work.phase == DERIVING,
        lambda: (cond(_is_full(walk), lambda: _summed(new, m, par), lambda: new), smoothed),
        lambda: (new, _remembered(smoothed, trail, count, age, samples)),
    )


def _some(work: Work, samples: Samples, m: Model, par: Parameters) -> tuple[Walk, list[Kept], Scalar]:
    """Samples of a pass, the last of them, the newest first, and whether the pass is at the end of the window.

    The first pass finds the end.
    """
    is_deriving, is_open = work.phase == DERIVING, work.end <= 0.0
    limit = where(is_open | (work.age < work.end), work.age, work.end)
    tail, longest = par.window_tail / par.sample_time, par.window_longest / par.sample_time

    def is_over(walk: Walk) -> Scalar:
        by_landing = (walk.takeoff >= 0.0) & (walk.still >= tail)
        spot = place(samples.newest, work.age - walk.done)
        ends = cond(par.option_command > 0.0, lambda: load(samples.commands, spot) > 0.0, lambda: by_landing)
        return (ends & (walk.done >= work.least)) | (walk.done >= longest)

    def one(walk: Walk, trail: list[Kept]) -> tuple[tuple[Walk, list[Kept]], Scalar]:
        new = _visited(walk, work, samples, m)
        stop = (new.done >= limit) | (is_deriving & _is_full(new)) | cond(is_open, lambda: is_over(new), lambda: False)
        return (new, [(new.at[0], new.at[2]), *trail[:-1]]), stop

    start = [(work.walk.at[0], work.walk.at[2])] * PACE
    walk, trail = loop(PACE, one, (work.walk, start))
    return walk, trail, cond(is_open, lambda: is_over(walk), lambda: walk.done >= work.end)


def _is_full(walk: Walk) -> Scalar:
    """Whether derivatives are due: after some samples, and at a landing."""
    return (walk.still == 1.0) | (walk.pending >= where(walk.still > 0.0, AT_REST, MOVING))


def _visited(walk: Walk, work: Work, samples: Samples, m: Model) -> Walk:
    """The next sample."""
    before, spot = Point(*walk.at), place(samples.newest, work.age - walk.done - 1.0)
    u, i, w = (load(memory, spot) for memory in (samples.voltages, samples.currents, samples.weights))
    at, mean = advance(before, u, m), 0.5 * (before.voltage + u)
    r = i - current(at, mean, m)
    is_on_stop = (at.position <= m.lower) | (at.position >= m.upper)
    new = walk._replace(
        done=walk.done + 1.0,
        at=vector(at),
        mean=mean,
        still=where(is_on_stop, walk.still + 1.0, 0.0),
        cost=walk.cost + w * r * r,
        counted=walk.counted + w,
        pending=walk.pending + 1.0,
        residuals=walk.residuals + w * r,
    )
    return cond((new.still > 1.0) | (new.still + walk.still < 1.0), lambda: new, lambda: _event(walk, new, before, m))


def _event(walk: Walk, new: Walk, before: Point, m: Model) -> Walk:
    """The mover leaves a stop, or lands: after a share of the period, with its speed there."""
    lands = new.still > 0.0
    is_first = lands & (walk.landings < 1.0)
    free = m.T_s * (before.velocity + 0.5 * m.T_s * before.acceleration)
    share = clip((new.at[2] - before.position) / where(fabs(free) > 0.0, free, 1.0), 0.0, 1.0)
    speed = fabs(before.velocity + share * m.T_s * before.acceleration)
    return new._replace(
        takeoff=where(lands | (walk.takeoff >= 0.0), walk.takeoff, walk.done),
        landing=where(is_first, walk.done + share, walk.landing),
        speed=where(is_first, speed, walk.speed),
        landings=where(lands, walk.landings + 1.0, walk.landings),
    )


def _summed(work: Work, m: Model, par: Parameters) -> Work:
    """Derivatives at the sample that the pass has come to, and the sums of the normal equations."""
    walk = work.walk
    weight = walk.counted - work.summed

    def summed(which: tuple[int, ...]) -> tuple[Array, Array, Array]:
        tangents, gradient = work.tangents, work.gradient
        T = matrix([[load(tangents, 4 * k + n) for n in range(4)] for k in which])
        T, J = derived(T, which, Point(*walk.at), walk.mean, walk.pending, walk.still > 0.0, m)
        for k, row, slope in zip(which, T, J):
            for n in range(4):
                tangents = store(tangents, 4 * k + n, row[n])
            gradient = store(gradient, k, load(gradient, k) + walk.residuals * slope)
        return tangents, _put(work.normal, _taken(work.normal, which) + outer(weight * J, J), which), gradient

    tangents, normal, gradient = cond(par.option_further > 0.0, lambda: summed(ALL), lambda: summed(USUAL))
    walk = walk._replace(pending=0.0, residuals=0.0)
    return work._replace(walk=walk, summed=walk.counted, tangents=tangents, normal=normal, gradient=gradient)


# Gauss-Newton


def _taken(memory: Array, rows: Sequence[int] = ALL) -> Array:
    """Some rows and columns of a symmetric matrix in memory."""
    return matrix([[load(memory, PAIRS.index((min(i, j), max(i, j)))) for j in rows] for i in rows])


def _put(memory: Array, A: Array, rows: Sequence[int] = ALL) -> Array:
    """The memory with these rows and columns."""
    for a, i in enumerate(rows):
        for b, j in enumerate(rows):
            if i <= j:
                memory = store(memory, PAIRS.index((i, j)), A[a, b])
    return memory


def swept(A: Array) -> Array:
    """A symmetric positive definite matrix with its first row and column swept, as the last ones.

    After as many turns as it has rows it is minus its inverse, with the rows in their old order.
    """
    p, row = pivot(A[0, 0]), A[0, 1:]
    rest = A[1:, 1:] - outer(row, row / p)
    return matrix([*([*r, x] for r, x in zip(rest, row / p)), [*(row / p), -1.0 / p]])


def _turned(work: Work, par: Parameters) -> Work:
    """Two pivots; after the last ones a trial, or the next window."""
    A = swept(swept(_taken(work.normal)))
    work = work._replace(normal=_put(work.normal, A), turn=work.turn + 2.0)
    return cond(
        work.turn < N,
        lambda: work,
        lambda: cond(work.phase == SOLVING, lambda: _solved(work, A, par), lambda: _renewed(work, A)),
    )


def _derived(work: Work, held: Scalar, par: Parameters) -> Work:
    """The normal equations are complete; but if a held voltage says that R is another one, all begins with that."""
    R = load(work.device, 0)
    off = log(where(held > 0.0, held, R) / R)
    work = work._replace(end=work.walk.done)

    def jumped() -> Work:
        q = clip(load(work.q, 0) + off, -FARTHEST, FARTHEST)
        return _deriving(work._replace(q=store(work.q, 0, q), has_jumped=1.0))

    again = (fabs(off) > JUMP) & (work.has_jumped < 1.0) & (work.tries < 1.0)
    return cond(again, jumped, lambda: _solving(work))


def _solving(work: Work) -> Work:
    """The arrival cost joins the normal equations."""
    Pi, d, gradient = _taken(work.prior), get(work.q, N) - get(work.q_prior, N), work.gradient
    pull = Pi @ d
    gradient = put(gradient, get(gradient, N) - pull)
    normal, total = _put(work.normal, _taken(work.normal) + Pi), work.walk.cost + d @ pull
    return work._replace(phase=SOLVING, turn=0.0, normal=normal, gradient=gradient, total=total)


def _solved(work: Work, inverse: Array, par: Parameters) -> Work:
    """The step of Gauss-Newton, no logarithm farther than `LARGEST`; one that promises little is not worth its pass."""
    gradient, farthest = get(work.gradient, N), 0.0
    full = -(inverse @ gradient)
    for x in full[:LOGARITHMS]:
        farthest = where(fabs(x) > farthest, fabs(x), farthest)
    share = where(farthest > LARGEST, LARGEST / where(farthest > LARGEST, farthest, 1.0), 1.0)
    promised = work.total - share * (2.0 - share) * (full @ gradient)
    steps = enumerate(zip(get(work.q, N), full))
    is_little = (work.tries >= 1.0) & (work.total - promised < LITTLE * _usual(work.walk, par))
    change = [_bounded(q, where(is_little, 0.0, share) * x, k) for k, (q, x) in steps]
    return work._replace(
        phase=TRYING,
        begins=where(is_little, 0.0, 1.0),
        over=where(is_little, 1.0, 0.0),
        change=put(work.change, change),
        promised=promised,
        shortenings=where(is_little, SHORTENINGS, 0.0),
        tries=work.tries + 1.0,
    )


def _bounded(q: Scalar, step: Scalar, k: int) -> Scalar:
    """The step, or what is left of it to the bounds of a logarithm."""
    return clip(q + step, -FARTHEST, FARTHEST) - q if k < LOGARITHMS else step


def _usual(walk: Walk, par: Parameters) -> Scalar:
    """Cost of a pass that noise and model error make."""
    counted = where(walk.counted > 0.0, walk.counted, 1.0)
    return 1.5 * (square(par.noise_current) + square(par.model_error)) * counted


def _judged(work: Work, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """A trial is at the end: a shorter step, another pass with derivatives, or the last word.

    It is that if the cost is what noise and model error make and came out as promised, or, where it is larger, nearly
    exactly so; but if the motion turned out to end later, or the cost is bad, the window is made longer once.
    """
    walk, unit = work.walk, _usual(work.walk, par)
    q = get(work.q, N) + get(work.change, N)
    d = q - get(work.q_prior, N)
    total = walk.cost + d @ (_taken(work.prior) @ d)
    missing, is_last = total - work.promised, work.shortenings >= SHORTENINGS
    is_good = fabs(missing) < where(walk.cost < POOR * unit, GAIN, LITTLE) * unit
    is_late = (work.age - work.end > LATE) & (walk.cost < REJECTED * unit)
    is_final = (is_good & (work.shortenings < 1.0)) | (work.tries >= TRIES) | is_late | is_last
    tail, is_bad = par.window_tail / par.sample_time, walk.cost > BAD * unit
    ends_later = (walk.takeoff < 0.0) | (walk.still < WITHIN * tail) | is_bad
    may_grow = (work.has_grown < 1.0) & (work.end < par.window_longest / par.sample_time)
    grows = (is_final | is_bad) & ends_later & may_grow & not_(is_late | (par.option_command > 0.0))

    def longer() -> Work:
        grown = work._replace(end=0.0, least=work.end + where(is_bad, tail, 1.0), tries=0.0, has_grown=1.0)
        return _deriving(cond(grows, lambda: grown, lambda: work)._replace(q=put(work.q, q)))

    is_better, is_lost = (total < work.total) | is_last, walk.cost > REJECTED * unit
    seeks = is_final & not_(grows) & is_lost & (work.start == 0.0) & (work.age < 0.5 * RING)
    return cond(
        is_better,
        lambda: cond(
            seeks,
            lambda: _seeking(work._replace(q=put(work.q, q), start=1.0, best=0.0, least_total=total), par),
            lambda: cond(
                is_final & not_(grows),
                lambda: _finished(work._replace(q=put(work.q, q)), walk.cost / unit, samples, time, par),
                longer,
            ),
        ),
        lambda: _shortened(work),
    )


def _offset(start: Scalar, par: Parameters) -> list[Scalar]:
    """Corrections of one of the `STARTS`."""
    deviations, offset = priors(par), [0.0] * N
    for n, (k, by) in enumerate(STARTS):
        offset[k] = where(start == n + 1.0, by * deviations[k], offset[k])
    return offset


def _seeking(work: Work, par: Parameters) -> Work:
    """A trial of one of the `STARTS`, from what was found."""
    return work._replace(change=put(work.change, _offset(work.start, par)), begins=1.0)


def _sought(work: Work, par: Parameters) -> Work:
    """The next of the `STARTS`; after the last one Gauss-Newton from the best, or a last trial where none is better."""
    d = get(work.q, N) + get(work.change, N) - get(work.q_prior, N)
    total = work.walk.cost + d @ (_taken(work.prior) @ d)
    is_best = total < work.least_total
    best, least = where(is_best, work.start, work.best), where(is_best, total, work.least_total)
    more = work._replace(best=best, least_total=least, start=work.start + 1.0)

    def chosen() -> Work:
        found = work._replace(q=put(work.q, get(work.q, N) + vector(_offset(best, par))), start=-1.0, begins=1.0)
        again = found._replace(phase=where(best > 0.0, DERIVING, TRYING), tries=0.0, shortenings=SHORTENINGS)
        return again._replace(change=put(work.change, [0.0] * N))

    return cond(work.start < len(STARTS), lambda: _seeking(more, par), chosen)


def _shortened(work: Work) -> Work:
    """A trial of a shorter step."""
    n = work.shortenings + 1.0
    change = where(n >= SHORTENINGS, 0.0, SHORTENED) * get(work.change, N)
    return work._replace(shortenings=n, change=put(work.change, change), begins=1.0)


def _finished(work: Work, misfit: Scalar, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """The smoothed estimate is ready; the posterior, wider by misfit and drift, is to become the next prior."""
    walk, T_s = work.walk, par.sample_time
    P = where(misfit > 1.0, misfit, 1.0) * -_taken(work.normal)
    since, has_landed, old = time - work.age * T_s, walk.landings > 0.0, work.learnt
    operation = (since + walk.takeoff * T_s, since + walk.landing * T_s, walk.speed, walk.landings - 1.0)
    deviations = published([deviation(P[k, k]) for k in range(START)], par)
    takeoff, landing, speed, bounces = (where(has_landed, new, last) for new, last in zip(operation, old))
    learnt = Learnt(
        takeoff,
        landing,
        speed,
        bounces,
        old.windows + 1.0,
        misfit,
        given_up=0.0,
        deviations=put(old.deviations, deviations),
    )
    for k, drift in enumerate(DRIFT):
        P[k, k] = P[k, k] + square(drift)
    P[START, :] = P[:, START] = 0.0
    P[START, START] = square(_start(par))
    finished = work._replace(
        origin=put(work.origin, _origin(Point(*walk.at))),
        age=work.age - work.end,
        shown=where(work.ready > 0.0, work.shown, place(samples.newest, work.age)),
        ready=work.ready + work.end,
        learnt=learnt,
    )
    return cond(
        misfit < REJECTED,
        lambda: finished._replace(phase=RENEWING, turn=0.0, normal=_put(work.normal, P), q=store(work.q, START, 0.0)),
        lambda: _rejected(finished),
    )


def _rejected(work: Work) -> Work:
    """The currents were not explained: the parameters stay what they were, a little less certain."""
    q, Pi = put(work.q, [*get(work.q_prior, START), 0.0]), _taken(work.prior)
    Pi[:START, :START] = DOUBT * Pi[:START, :START]
    return _opened(work._replace(q=q, prior=_put(work.prior, Pi)))


def _renewed(work: Work, inverse: Array) -> Work:
    """The next window begins."""
    return _opened(work._replace(prior=_put(work.prior, -inverse)))
