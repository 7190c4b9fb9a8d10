"""Work of `Mhe` on a window: passes of the model through its samples, and Gauss-Newton between them.

The cost of corrections q is sum w^2 (i - i_model)^2 + (q - q0)' Pi (q - q0), with the posterior of the window before as
arrival cost.  Phases: a pass with derivatives J of the current sums up H = sum w^2 J J' and g = sum w^2 J r; H + Pi is
inverted; a trial without derivatives must lower the cost, or the step is shortened (or sought again with more on the
diagonal, by Levenberg and Marquardt, if `option.further` has it so); then comes another pass with derivatives, or this
was the last trial: the smoothed estimate.  The inverse then becomes the next Pi.  Work per sample is bounded:
`window.pace` pieces of a pass, or two pivots of an inverse.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gapsense.estimators.mhe_effort import effort, start_of
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
from gapsense.linalg import deviation, diagonal, swept, vector
from gapsense.records import Array, Scalar
from gapsense.trace import clip, cond, exp, fabs, load, log, not_, square, store, where

if TYPE_CHECKING:
    from gapsense.estimators.mhe import Parameters

LOGARITHMS = 9  # the first ones
# standard deviations of what a window adds to the corrections, fields of `Device`
DRIFT = (0.2e-2, 0.15e-2, 0.03e-2, 0.06e-2, 0.03e-2, 0.3e-2, 0.03e-2, 0.03e-2, 0.1e-2, 0.5e-2, 0.5e-2)
SHORTENED = 0.25  # of a step whose trial is worse than what it left
DAMPED = 0.03  # of the diagonal comes to it with the first such step, ten times as much with each one more
LARGEST, FARTHEST = 0.7, 2.0  # step of a logarithm, and the logarithm itself: what no motion tells stays finite
POOR = 2.0  # misfit of a window that goes before one that nothing explains, and what was learnt is wrong
LITTLE, BAD = 0.03, 6.0  # of the cost that noise and model error make: see `_verdict`
DOUBT, WIDEST = (
    0.25,
    4.0,
)  # what is left of the information after a window that taught nothing, down to `priors` so often
WITHIN = 0.75  # of the tail that must be left of it, or the motion has turned out to end later
NOTHING = -1.0  # instead of a start: none is better
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
    new = work._replace(q_prior=known, end=0.0, least=1.0, has_jumped=0.0, has_grown=0.0)
    return _deriving(new._replace(tries=0.0, start=0.0, searches=0.0))


def _deriving(work: Work) -> Work:
    """A pass with derivatives is next."""
    return work._replace(phase=DERIVING, begins=1.0, over=0.0)


def _informed(work: Work, causal: Point, par: Parameters) -> Work:
    """What is known before the first window."""
    prior = put_matrix(work.prior, _blind(par))
    known = work.learnt._replace(deviations=put(work.learnt.deviations, published(priors(par), par)))
    return work._replace(origin=put(work.origin, origin_of(causal)), prior=prior, learnt=known)


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
    return cond(again, jumped, lambda: _solving(work, par))


def _solving(work: Work, par: Parameters) -> Work:
    """The arrival cost joins the normal equations."""
    Pi, d, gradient = get_matrix(work.prior), get(work.q, N) - get(work.q_prior, N), work.gradient
    pull = Pi @ d
    gradient = put(gradient, get(gradient, N) - pull)
    whole, total = get_matrix(work.normal) + Pi, work.walk.cost + d @ pull
    known = work._replace(gradient=gradient, total=total, whole=put_matrix(work.whole, whole), tries=work.tries + 1.0)
    return _damped(known, 0.0, par)


def _damped(work: Work, n: Scalar, par: Parameters) -> Work:
    """A step is sought again, the n-th time: with more on the diagonal, but for the last one, which goes nowhere."""
    A, more = get_matrix(work.whole), damping(work, n, par)
    for k in range(N):
        A[k, k] = A[k, k] + more * A[k, k]
    return work._replace(phase=SOLVING, turn=0.0, normal=put_matrix(work.normal, A), shortenings=n)


def damping(work: Work, n: Scalar, par: Parameters) -> Scalar:
    """Share of the diagonal that comes to it when a step is sought for the n-th time again."""
    has_damping = (par.option_further > 0.0) & (n > 0.0) & (n < effort(work.learnt, par).retries)
    return where(has_damping, DAMPED * exp(log(10.0) * (n - 1.0)), 0.0)


def _solved(work: Work, par: Parameters) -> Work:
    """The step of Gauss-Newton; one that promises little is not worth its pass."""
    gradient, retries = get(work.gradient, N), effort(work.learnt, par).retries
    full = -(get_matrix(work.normal) @ gradient)
    promised = work.total - full @ gradient
    is_first, is_little = work.shortenings < 1.0, work.total - promised < LITTLE * usual(work.walk, par)
    is_little = is_first & (work.tries > 1.0) & is_little
    stays = is_little | (work.shortenings >= retries)
    steps = enumerate(zip(get(work.q, N), _limited(full, par)))
    change = [_bounded(q, where(stays, 0.0, x), k) for k, (q, x) in steps]
    return work._replace(
        phase=TRYING,
        begins=where(is_little, 0.0, 1.0),
        over=where(is_little, 1.0, 0.0),
        change=put(work.change, change),
        promised=promised,
        shortenings=where(is_little, retries, work.shortenings),
    )


def _limited(full: Array, par: Parameters) -> list[Scalar]:
    """The step: no logarithm goes farther than `LARGEST`, by a shorter step, or each by itself if more is learnt."""
    farthest: Scalar = 0.0
    for x in full[:LOGARITHMS]:
        farthest = where(fabs(x) > farthest, fabs(x), farthest)
    share = where(farthest > LARGEST, LARGEST / where(farthest > LARGEST, farthest, 1.0), 1.0)
    each = [clip(x, -LARGEST, LARGEST) for x in full]
    return [where(par.option_further > 0.0, one, share * x) for one, x in zip(each, full)]


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
    worth = effort(work.learnt, par)
    is_last, is_bad = work.shortenings >= worth.retries, misfit > worth.bad
    missing, late = total - work.promised, work.age - work.end
    surprise = where(late > worth.late, missing, fabs(missing))
    is_good, is_late = surprise < LITTLE * unit, late > where(is_bad, worth.latest, worth.later)
    is_final = (is_good & (work.shortenings < 1.0)) | (work.tries >= worth.tries) | is_late | is_last
    tail, longest = par.window_tail / par.sample_time, par.window_longest / par.sample_time
    ends_later = (walk.takeoff < 0.0) | (walk.still < WITHIN * tail) | is_bad
    may_grow = (work.has_grown < 1.0) & (work.end < longest) & not_(is_late | (par.option_command > 0.0))
    grows = (is_final | is_bad) & ends_later & may_grow
    may_seek = (work.start > NOTHING) & (work.searches < worth.searches) & (work.age < 0.5 * RING)
    seeks = is_final & not_(grows) & is_bad & may_seek
    return Verdict(total, misfit, (total < work.total) | is_last, is_final, grows, seeks)


def _judged(work: Work, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """After a trial: a shorter step, other starts, another pass with derivatives, or the end of the work."""
    found, tail = _verdict(work, par), par.window_tail / par.sample_time
    least = work.end + where(found.misfit > BAD, tail, 1.0)

    def moved() -> Work:
        return work._replace(q=put(work.q, get(work.q, N) + get(work.change, N)))

    def sought() -> Work:
        more = moved()._replace(start=1.0, best=0.0, least_total=found.total, searches=work.searches + 1.0)
        return _seeking(more, par)

    def again() -> Work:
        on = moved()
        return _deriving(
            cond(found.grows, lambda: on._replace(end=0.0, least=least, tries=0.0, has_grown=1.0), lambda: on)
        )

    def better() -> Work:
        is_done = found.is_final & not_(found.grows)
        return cond(is_done, lambda: _finished(moved(), found.misfit, samples, time, par), again)

    def worse() -> Work:
        n = work.shortenings + 1.0
        return cond(par.option_further > 0.0, lambda: _damped(work, n, par), lambda: _shortened(work, n, par))

    return cond(found.is_better, lambda: cond(found.seeks, sought, better), worse)


def _seeking(work: Work, par: Parameters) -> Work:
    """A trial of one of the starts, from what was found."""
    return work._replace(change=put(work.change, start_of(work.start, work.learnt, par)), begins=1.0)


def _sought(work: Work, par: Parameters) -> Work:
    """The next of the starts; after the last one Gauss-Newton from the best, or a last trial where none is better."""
    d = get(work.q, N) + get(work.change, N) - get(work.q_prior, N)
    total = work.walk.cost + d @ (get_matrix(work.prior) @ d)
    is_best = total < work.least_total
    best, least = where(is_best, work.start, work.best), where(is_best, total, work.least_total)
    more = work._replace(best=best, least_total=least, start=work.start + 1.0)

    def chosen() -> Work:
        q, retries = get(work.q, N) + vector(start_of(best, work.learnt, par)), effort(work.learnt, par).retries
        start = where(best > 0.0, 0.0, NOTHING)
        found = work._replace(q=put(work.q, q), start=start, begins=1.0, change=put(work.change, [0.0] * N))
        again = found._replace(phase=where(best > 0.0, DERIVING, TRYING), tries=0.0, shortenings=retries)
        has_damping = (par.option_further > 0.0) & not_(best > 0.0)  # of the inverse, which is to be the posterior
        return cond(has_damping, lambda: _damped(again, retries, par), lambda: again)

    return cond(work.start < effort(work.learnt, par).starts, lambda: _seeking(more, par), chosen)


def _shortened(work: Work, n: Scalar, par: Parameters) -> Work:
    """A trial of a shorter step, the n-th one, or of none."""
    change = where(n >= effort(work.learnt, par).retries, 0.0, SHORTENED) * get(work.change, N)
    return work._replace(shortenings=n, change=put(work.change, change), begins=1.0)


def _finished(work: Work, misfit: Scalar, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """The smoothed estimate is ready; the posterior, wider by misfit and drift, is to become the next prior."""
    wider = where(misfit > 1.0, misfit, 1.0) * (1.0 + damping(work, work.shortenings, par))
    P = wider * -get_matrix(work.normal)
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

    is_lost = (par.option_further > 0.0) & (work.learnt.misfit >= POOR)

    def rejected() -> Work:
        return cond(is_lost, lambda: _forgotten(finished, par), lambda: _rejected(finished, par))

    return cond(misfit < BAD, renewing, rejected)


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
    origin = cond(par.option_command > 0.0, lambda: _by_voltage(work.origin, par), lambda: work.origin)
    return _opened(work._replace(q=q, prior=put_matrix(work.prior, Pi), origin=origin))


def _by_voltage(origin: Array, par: Parameters) -> Array:
    """Where an operation must have ended: at the lower stop with a voltage, at that of the spring without one."""
    u = load(origin, 4)
    origin = store(origin, 2, where(fabs(u) > par.edge, par.stop_lower, par.stop_upper))
    return store(origin, 3, 0.0)


def _forgotten(work: Work, par: Parameters) -> Work:
    """Two windows in a row that were not explained: what was learnt is wrong, and it begins as at the start, now."""
    known = put(work.q, [0.0] * N)
    return _opened(work._replace(q=known, prior=put_matrix(work.prior, _blind(par)), age=RING))


def _blind(par: Parameters) -> Array:
    """Arrival cost before the first window."""
    return diagonal([1.0 / square(s) for s in (*priors(par), start_deviation(par))])


def _renewed(work: Work) -> Work:
    """The next window begins."""
    return _opened(work._replace(prior=put_matrix(work.prior, -get_matrix(work.normal))))
