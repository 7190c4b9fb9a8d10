"""Work of `Mhe` on a window: passes of the model through its samples, and Gauss-Newton between them.

The cost of corrections q is sum w^2 (i - i_model)^2 + (q - q0)' Pi (q - q0), with the posterior of the window before as
arrival cost.  Phases: a pass with derivatives J of the current sums up H = sum w^2 J J' and g = sum w^2 J r; H + Pi is
inverted; a trial without derivatives must lower the cost, or the step is shortened; then comes another pass with
derivatives, or this was the last trial: the smoothed estimate.  The inverse then becomes the next Pi.  Work per sample
is bounded: `PACE` samples of a pass, or two pivots of an inverse.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gapsense.estimators.mhe_model import Model, Point
from gapsense.estimators.mhe_pass import PACE, Smoothed, begun, walked
from gapsense.estimators.mhe_records import (
    DERIVING,
    RENEWING,
    RING,
    SOLVING,
    START,
    TRYING,
    Learnt,
    N,
    Samples,
    Walk,
    Work,
    get,
    get_matrix,
    origin_of,
    place,
    priors,
    published,
    put,
    put_matrix,
    start_deviation,
)
from gapsense.linalg import deviation, diagonal, matrix, outer, pivot, vector
from gapsense.records import Array, Scalar
from gapsense.trace import clip, cond, fabs, load, log, not_, square, store, where

if TYPE_CHECKING:
    from gapsense.estimators.mhe import Parameters

LOGARITHMS = 9  # the first ones
# standard deviations of what a window adds to the corrections, fields of `Device`
DRIFT = (0.2e-2, 0.15e-2, 0.03e-2, 0.06e-2, 0.03e-2, 0.3e-2, 0.03e-2, 0.03e-2, 0.1e-2, 0.5e-2, 0.5e-2)
TRIES = 5.0  # passes with derivatives
SHORTENED, SHORTENINGS = 0.25, 3.0  # of a step whose trial is worse than what it left; the last one to nothing
LARGEST, FARTHEST = 0.7, 2.0  # step of a logarithm, and the logarithm itself: what no motion tells stays finite
LITTLE, BAD = 0.03, 6.0  # of the cost that noise and model error make: see `_verdict`
# samples behind the end of a window after which a cost far below the promised one is no reason for another pass with
# derivatives, and after which there is none
LATE, LATER = 140.0, 300.0
DOUBT, WIDEST = (
    0.25,
    4.0,
)  # what is left of the information after a window that taught nothing, down to `priors` so often
# where a search begins if nothing explains the currents: field of `Device`, and how many deviations off
STARTS = tuple((k, by) for by in (-1.0, 1.0, -2.0, 2.0) for k in (7, 2))
WITHIN = 0.75  # of the tail that must be left of it, or the motion has turned out to end later
JUMP = 0.03  # of R: a held voltage says better where to start


def work_on(
    work: Work,
    samples: Samples,
    smoothed: Smoothed,
    causal: Point,
    held: Scalar,
    time: Scalar,
    m: Model,
    par: Parameters,
) -> tuple[Work, Smoothed, Scalar]:
    """What is done with a new sample: the work, the memory of smoothed samples, and whether a pass has caught up.

    `causal` is the estimate of the sample before, `held` the resistance by a held voltage, or 0, `m` the model of
    what is believed before the first window.
    """
    work = work._replace(age=work.age + 1.0)
    work = cond(work.age > RING - 2.0 * PACE, lambda: _given_up(work, causal), lambda: work)
    work = cond(work.begins > 1.0, lambda: _informed(work, causal, par), lambda: work)
    is_deriving = work.phase == DERIVING

    def passed() -> tuple[Work, Smoothed]:
        return cond(
            work.begins > 0.0,
            lambda: (begun(work, m, par), smoothed),
            lambda: cond(
                work.walk.done < work.age, lambda: walked(work, samples, smoothed, m, par), lambda: (work, smoothed)
            ),
        )

    def concluded() -> Work:
        ended = work._replace(over=0.0)

        def tried() -> Work:
            is_searching = ended.start > 0.0
            return cond(is_searching, lambda: _sought(ended, par), lambda: _judged(ended, samples, time, par))

        return cond(is_deriving, lambda: _derived(ended, held, par), tried)

    is_passing = (is_deriving | (work.phase == TRYING)) & (work.over < 1.0)
    work, smoothed = cond(
        is_passing, passed, lambda: (cond(work.over > 0.0, concluded, lambda: _turned(work, par)), smoothed)
    )
    return work, smoothed, (work.phase == DERIVING) & (work.begins < 1.0) & (work.walk.done >= work.age)


def _given_up(work: Work, causal: Point) -> Work:
    """The memory is full before the window is solved: the next one begins where the causal estimate is."""
    learnt = work.learnt._replace(given_up=work.learnt.given_up + 1.0)
    known = put(work.q, [*get(work.q_prior, START), 0.0])
    return _opened(
        work._replace(origin=put(work.origin, origin_of(causal)), age=1.0, q=known, ready=0.0, learnt=learnt)
    )


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
    prior = diagonal([1.0 / square(s) for s in (*deviations, start_deviation(par))])
    known = work.learnt._replace(deviations=put(work.learnt.deviations, published(deviations, par)))
    return work._replace(origin=put(work.origin, origin_of(causal)), prior=put_matrix(work.prior, prior), learnt=known)


def swept(A: Array) -> Array:
    """A symmetric positive definite matrix with its first row and column swept, as the last ones.

    After as many turns as it has rows it is minus its inverse, with the rows in their old order.
    """
    p, row = pivot(A[0, 0]), A[0, 1:]
    rest = A[1:, 1:] - outer(row, row / p)
    return matrix([*([*r, x] for r, x in zip(rest, row / p)), [*(row / p), -1.0 / p]])


def _turned(work: Work, par: Parameters) -> Work:
    """Two pivots; after the last ones a trial, or the next window."""

    def turned() -> Work:
        A = swept(swept(get_matrix(work.normal)))
        return work._replace(normal=put_matrix(work.normal, A), turn=work.turn + 2.0)

    def inverted() -> Work:
        return cond(work.phase == SOLVING, lambda: _solved(work, par), lambda: _renewed(work))

    return cond(work.turn < N, turned, inverted)


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
    Pi, d, gradient = get_matrix(work.prior), get(work.q, N) - get(work.q_prior, N), work.gradient
    pull = Pi @ d
    gradient = put(gradient, get(gradient, N) - pull)
    normal, total = put_matrix(work.normal, get_matrix(work.normal) + Pi), work.walk.cost + d @ pull
    return work._replace(phase=SOLVING, turn=0.0, normal=normal, gradient=gradient, total=total)


def _solved(work: Work, par: Parameters) -> Work:
    """The step of Gauss-Newton, no logarithm farther than `LARGEST`; one that promises little is not worth its pass."""
    gradient, farthest = get(work.gradient, N), 0.0
    full = -(get_matrix(work.normal) @ gradient)
    for x in full[:LOGARITHMS]:
        farthest = where(fabs(x) > farthest, fabs(x), farthest)
    share = where(farthest > LARGEST, LARGEST / where(farthest > LARGEST, farthest, 1.0), 1.0)
    promised = work.total - full @ gradient
    steps = enumerate(zip(get(work.q, N), full))
    is_little = (work.tries >= 1.0) & (work.total - promised < LITTLE * usual(work.walk, par))
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


def usual(walk: Walk, par: Parameters) -> Scalar:
    """Cost of a pass that noise and model error make."""
    counted = where(walk.counted > 0.0, walk.counted, 1.0)
    return 1.5 * (square(par.noise_current) + square(par.model_error)) * counted


class Verdict(NamedTuple):
    """On a trial that is at the end of the window."""

    total: Scalar  # cost
    misfit: Scalar
    is_better: Scalar  # than what it came from, or the last way out
    is_final: Scalar  # no other trial is worth it
    grows: Scalar  # the window is made longer
    seeks: Scalar  # other starts are tried


def _verdict(work: Work, par: Parameters) -> Verdict:
    """A trial is the last one if it came out nearly as promised.

    But if the motion turned out to end later, or far off in any case, the window is made longer once.
    """
    walk, unit = work.walk, usual(work.walk, par)
    d = get(work.q, N) + get(work.change, N) - get(work.q_prior, N)
    total, misfit = walk.cost + d @ (get_matrix(work.prior) @ d), walk.cost / unit
    is_last, is_bad = work.shortenings >= SHORTENINGS, misfit > BAD
    missing, late = total - work.promised, work.age - work.end
    surprise = where(late > LATE, missing, fabs(missing))
    is_good, is_late = surprise < LITTLE * unit, (late > LATER) & not_(is_bad)
    is_final = (is_good & (work.shortenings < 1.0)) | (work.tries >= TRIES) | is_late | is_last
    tail, longest = par.window_tail / par.sample_time, par.window_longest / par.sample_time
    ends_later = (walk.takeoff < 0.0) | (walk.still < WITHIN * tail) | is_bad
    may_grow = (work.has_grown < 1.0) & (work.end < longest) & not_(is_late | (par.option_command > 0.0))
    grows = (is_final | is_bad) & ends_later & may_grow
    seeks = is_final & not_(grows) & is_bad & (work.start == 0.0) & (work.age < 0.5 * RING)
    return Verdict(total, misfit, (total < work.total) | is_last, is_final, grows, seeks)


def _judged(work: Work, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """After a trial: a shorter step, other starts, another pass with derivatives, or the end of the work."""
    found, tail = _verdict(work, par), par.window_tail / par.sample_time
    least = work.end + where(found.misfit > BAD, tail, 1.0)

    def moved() -> Work:
        return work._replace(q=put(work.q, get(work.q, N) + get(work.change, N)))

    def sought() -> Work:
        return _seeking(moved()._replace(start=1.0, best=0.0, least_total=found.total), par)

    def again() -> Work:
        on = moved()
        return _deriving(
            cond(found.grows, lambda: on._replace(end=0.0, least=least, tries=0.0, has_grown=1.0), lambda: on)
        )

    def better() -> Work:
        is_done = found.is_final & not_(found.grows)
        return cond(is_done, lambda: _finished(moved(), found.misfit, samples, time, par), again)

    return cond(found.is_better, lambda: cond(found.seeks, sought, better), lambda: _shortened(work))


def offset(start: Scalar, par: Parameters) -> list[Scalar]:
    """Corrections of one of the `STARTS`."""
    deviations, offset = priors(par), [0.0] * N
    for n, (k, by) in enumerate(STARTS):
        offset[k] = where(start == n + 1.0, by * deviations[k], offset[k])
    return offset


def _seeking(work: Work, par: Parameters) -> Work:
    """A trial of one of the `STARTS`, from what was found."""
    return work._replace(change=put(work.change, offset(work.start, par)), begins=1.0)


def _sought(work: Work, par: Parameters) -> Work:
    """The next of the `STARTS`; after the last one Gauss-Newton from the best, or a last trial where none is better."""
    d = get(work.q, N) + get(work.change, N) - get(work.q_prior, N)
    total = work.walk.cost + d @ (get_matrix(work.prior) @ d)
    is_best = total < work.least_total
    best, least = where(is_best, work.start, work.best), where(is_best, total, work.least_total)
    more = work._replace(best=best, least_total=least, start=work.start + 1.0)

    def chosen() -> Work:
        found = work._replace(q=put(work.q, get(work.q, N) + vector(offset(best, par))), start=-1.0, begins=1.0)
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
    P = where(misfit > 1.0, misfit, 1.0) * -get_matrix(work.normal)
    learnt = _learnt(work, misfit, P, time, par)
    for k, drift in enumerate(DRIFT):
        P[k, k] = P[k, k] + square(drift)
    P[START, :] = P[:, START] = 0.0
    P[START, START] = square(start_deviation(par))
    finished = work._replace(
        origin=put(work.origin, origin_of(Point(*work.walk.at))),
        age=work.age - work.end,
        shown=where(work.ready > 0.0, work.shown, place(samples.newest, work.age)),
        ready=work.ready + work.end,
        learnt=learnt,
    )

    def renewing() -> Work:
        q = store(work.q, START, 0.0)
        return finished._replace(phase=RENEWING, turn=0.0, normal=put_matrix(work.normal, P), q=q)

    return cond(misfit < BAD, renewing, lambda: _rejected(finished, par))


def _learnt(work: Work, misfit: Scalar, P: Array, time: Scalar, par: Parameters) -> Learnt:
    """What a window has told: its operation, if there was one, and how certain the corrections are."""
    walk, T_s, old = work.walk, par.sample_time, work.learnt
    since, has_landed = time - work.age * T_s, walk.landings > 0.0
    return Learnt(
        takeoff_time=where(has_landed, since + walk.takeoff * T_s, old.takeoff_time),
        landing_time=where(has_landed, since + walk.landing * T_s, old.landing_time),
        impact_speed=where(has_landed, walk.speed, old.impact_speed),
        bounces=where(has_landed, walk.landings - 1.0, old.bounces),
        windows=old.windows + 1.0,
        misfit=misfit,
        given_up=0.0,
        deviations=put(old.deviations, published([deviation(P[k, k]) for k in range(START)], par)),
    )


def _rejected(work: Work, par: Parameters) -> Work:
    """The currents were not explained: the parameters stay what they were, a little less certain."""
    q, Pi = put(work.q, [*get(work.q_prior, START), 0.0]), get_matrix(work.prior)
    Pi[:START, :START] = DOUBT * Pi[:START, :START]
    for k, s in enumerate(priors(par)):
        Pi[k, k] = Pi[k, k] + (1.0 - DOUBT) / square(WIDEST * s)
    return _opened(work._replace(q=q, prior=put_matrix(work.prior, Pi)))


def _renewed(work: Work) -> Work:
    """The next window begins."""
    return _opened(work._replace(prior=put_matrix(work.prior, -get_matrix(work.normal))))
