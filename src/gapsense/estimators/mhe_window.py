"""Work of `Mhe` on a window: passes of the model through its samples, and Gauss-Newton between them.

The cost of corrections q is sum w^2 (i - i_model)^2 + (q - q0)' Pi (q - q0), with the posterior of the window before as
arrival cost.  Phases: a pass with derivatives J of the current sums up H = sum w^2 J J' and g = sum w^2 J r; H + Pi is
inverted; a trial without derivatives must lower the cost, or the step is shortened (or sought again with more on the
diagonal, by Levenberg and Marquardt, if `option.further` has it so); then comes another pass with derivatives, or this
was the last trial: the smoothed estimate.  The inverse then becomes the next Pi.  Work per sample is bounded:
`window.pace` pieces of a pass, or two pivots of an inverse.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.mhe_effort import effort, is_untaught, start_of
from gapsense.estimators.mhe_model import Model, Point
from gapsense.estimators.mhe_parameters import Parameters
from gapsense.estimators.mhe_pass import PACE, Smoothed, begun, has_landed, has_moved, is_idle, walked
from gapsense.estimators.mhe_records import (
    DERIVING,
    FARTHEST,
    PAIRS,
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
    bounds,
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
from gapsense.linalg import deviation, diagonal, outer, swept, vector
from gapsense.records import Array, Scalar
from gapsense.trace import clip, cond, exp, fabs, load, log, not_, sqrt, square, store, where

LOGARITHMS = 9  # the first ones
# standard deviations of what an operation adds to the corrections, fields of `Device`; of R, what `WARMING` does
DRIFT = (0.2e-2, 0.15e-2, 0.03e-2, 0.06e-2, 0.03e-2, 0.3e-2, 0.03e-2, 0.03e-2, 0.1e-2, 0.5e-2, 0.5e-2)
WARMING = 10e-3  # a coil warms and cools with time, up to the deviation before the first window [s]
SHORTENED, SHORTENED_UNTAUGHT = 0.25, 0.5  # of a step whose trial is worse than what it left
DAMPED = 0.03  # of the diagonal comes to it with the first such step, ten times as much with each one more
LARGEST = 0.7  # step of a logarithm
POOR = 2.0  # misfit of a window that goes before one that nothing explains, and what was learnt is wrong
LITTLE, BAD = 0.03, 6.0  # of the cost that noise and model error make: see `_verdict`
BAD_UNTAUGHT = 30.0  # the same of the first one with a landing: what it teaches is as uncertain as its misfit is large
GOOD = 1.5  # misfit of a window that others may go back to
PATIENCE = 3.0  # windows in a row that nothing explains until it goes back
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
    is_behind = (work.age > RING - 2.0 * PACE) | _is_behind(work, par)
    work = cond(is_behind, lambda: _given_up(work, causal), lambda: work)
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

        return cond(is_deriving, lambda: _derived(ended, held, samples, par), tried)

    is_passing = (is_deriving | (work.phase == TRYING)) & (work.over < 1.0)
    work, smoothed = cond(
        is_passing, passed, lambda: (cond(work.over > 0.0, concluded, lambda: _turned(work, par)), smoothed)
    )
    return work, smoothed, (work.phase == DERIVING) & (work.begins < 1.0) & (work.walk.done >= work.age)


def waits(work: Work, causal: Point) -> Work:
    """No work while the current is fed back; what waits for too long is given up."""
    work = work._replace(age=work.age + 1.0)
    return cond(work.age > RING - 2.0 * PACE, lambda: _given_up(work, causal), lambda: work)


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
    new = work._replace(q_prior=known, end=0.0, least=1.0, has_jumped=0.0, has_grown=0.0, doubt=0.0)
    return _deriving(new._replace(tries=0.0, start=0.0, searches=0.0))


def _deriving(work: Work) -> Work:
    """A pass with derivatives is next."""
    return work._replace(phase=DERIVING, begins=1.0, over=0.0)


def _informed(work: Work, causal: Point, par: Parameters) -> Work:
    """What is known before the first window."""
    prior, good_prior = (put_matrix(memory, _blind(par)) for memory in (work.prior, work.good_prior))
    known = work.learnt._replace(deviations=put(work.learnt.deviations, published(priors(par), par)))
    return work._replace(origin=put(work.origin, origin_of(causal)), prior=prior, good_prior=good_prior, learnt=known)


def _turned(work: Work, par: Parameters) -> Work:
    """Two pivots; after the last ones a trial, or the next window."""

    def turned() -> Work:
        A = swept(swept(get_matrix(work.normal)))
        return work._replace(normal=put_matrix(work.normal, A), turn=work.turn + 2.0)

    def inverted() -> Work:
        return cond(work.phase == SOLVING, lambda: _solved(work, par), lambda: _renewed(work))

    return cond(work.turn < N, turned, inverted)


def _derived(work: Work, held: Scalar, samples: Samples, par: Parameters) -> Work:
    """The normal equations are complete; but if a held voltage says that R is another one, all begins with that."""
    R = load(work.device, 0)
    off = log(where(held > 0.0, held, R) / R)
    work = work._replace(end=work.walk.done)

    def jumped() -> Work:
        q = clip(load(work.q, 0) + off, -bounds(par)[0], bounds(par)[0])
        return _deriving(work._replace(q=store(work.q, 0, q), has_jumped=1.0))

    def driven() -> Work:
        again = (fabs(off) > JUMP) & (work.has_jumped < 1.0) & (work.tries < 1.0)
        return cond(again, jumped, lambda: _solving(work, par))

    return cond(is_idle(work.walk), lambda: _idled(_passed(work, samples), par), driven)


def _solving(work: Work, par: Parameters) -> Work:
    """The arrival cost joins the normal equations; a coil that is held says what R is, and nothing of the others."""
    work = cond(has_moved(work.walk), lambda: work, lambda: _held_only(work))
    Pi, d, gradient = get_matrix(work.prior), get(work.q, N) - get(work.q_prior, N), work.gradient
    pull = Pi @ d
    gradient = put(gradient, get(gradient, N) - pull)
    whole, total = get_matrix(work.normal) + Pi, work.walk.cost + d @ pull
    known = work._replace(
        gradient=gradient,
        total=total,
        whole=put_matrix(work.whole, whole),
        lands=where(has_landed(work.walk), 1.0, 0.0),
        tries=work.tries + 1.0,
    )
    return _damped(known, 0.0, par)


def _held_only(work: Work) -> Work:
    """The normal equations of R and of the flux linkage at the start."""
    said = [k in (0, START) for k in range(N)]
    normal = [x if said[i] and said[j] else 0.0 for x, (i, j) in zip(get(work.normal, len(PAIRS)), PAIRS)]
    gradient = [x if counts else 0.0 for x, counts in zip(get(work.gradient, N), said)]
    return work._replace(normal=put(work.normal, normal), gradient=put(work.gradient, gradient))


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
    most = [*bounds(par), FARTHEST]
    change = [clip(q + where(stays, 0.0, x), -most[k], most[k]) - q for k, (q, x) in steps]
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
    loses = (work.lands > 0.0) & not_(has_landed(walk)) & is_untaught(work.learnt, par)
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
    return Verdict(
        total=total,
        misfit=misfit,
        is_better=((total < work.total) & not_(loses)) | is_last,
        is_final=is_final,
        grows=grows,
        seeks=seeks,
    )


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
    share = where(is_untaught(work.learnt, par), SHORTENED_UNTAUGHT, SHORTENED)
    change = where(n >= effort(work.learnt, par).retries, 0.0, share) * get(work.change, N)
    return work._replace(shortenings=n, change=put(work.change, change), begins=1.0)


def _finished(work: Work, misfit: Scalar, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """The smoothed estimate is ready; what the window has taught is kept, and the next one begins where it ends."""
    told = _passed(work._replace(learnt=_told(work, misfit, time, par)), samples)
    is_lost = (par.option_further > 0.0) & (work.learnt.misfit >= POOR)

    def rejected() -> Work:
        return cond(is_lost, lambda: _forgotten(told, par), lambda: _rejected(told, par))

    is_cut = work.end >= par.window_longest / par.sample_time  # no landing has ended it: what moved was no operation
    limit = where(is_untaught(work.learnt, par) & has_landed(work.walk), BAD_UNTAUGHT, BAD)
    most = where(is_cut & (work.doubt > 0.0), GOOD, limit)
    return cond(misfit < most, lambda: _explained(told, misfit, par), rejected)


def _passed(work: Work, samples: Samples) -> Work:
    """The samples of the window can be published, and the next one begins where it ends."""
    return work._replace(
        origin=put(work.origin, origin_of(Point(*work.walk.at))),
        age=work.age - work.end,
        shown=where(work.ready > 0.0, work.shown, place(samples.newest, work.age)),
        ready=work.ready + work.end,
    )


def _explained(work: Work, misfit: Scalar, par: Parameters) -> Work:
    """The posterior, wider by misfit and drift, is to become the next prior."""
    wider = where(misfit > 1.0, misfit, 1.0) * (1.0 + damping(work, work.shortenings, par))
    P, old = wider * -get_matrix(work.normal), work.learnt
    deviations = put(old.deviations, published([deviation(P[k, k]) for k in range(START)], par))
    for k, (s, variance) in enumerate(zip(priors(par), _drifts(work, par))):
        P[k, k] = P[k, k] + clip(square(s) - P[k, k], 0.0, variance)
    P[START, :] = P[:, START] = 0.0
    P[START, START] = square(start_deviation(par))
    explained = old.explained + where(has_moved(work.walk), 1.0, 0.0)
    learnt = old._replace(rejected=0.0, explained=explained, deviations=deviations)
    q = store(work.q, START, 0.0)
    return work._replace(phase=RENEWING, turn=0.0, normal=put_matrix(work.normal, P), q=q, learnt=learnt)


def _told(work: Work, misfit: Scalar, time: Scalar, par: Parameters) -> Learnt:
    """What a window has told of its operation, if there was one."""
    walk, T_s, old = work.walk, par.sample_time, work.learnt
    since, has_landed = time - work.age * T_s, walk.landings > 0.0
    return old._replace(
        takeoff_time=where(has_landed, since + walk.takeoff * T_s, old.takeoff_time),
        landing_time=where(has_landed, since + walk.landing * T_s, old.landing_time),
        impact_speed=where(has_landed, walk.speed, old.impact_speed),
        bounces=where(has_landed, walk.landings - 1.0, old.bounces),
        windows=old.windows + 1.0,
        misfit=misfit,
        given_up=0.0,
    )


def _drifts(work: Work, par: Parameters) -> list[Scalar]:
    """Variances that come to the corrections: to that of R with time, to the others with an operation."""
    warming = square(DRIFT[0]) * work.end * par.sample_time / WARMING
    return [warming, *(where(has_moved(work.walk), square(drift), 0.0) for drift in DRIFT[1:])]


def _idled(work: Work, par: Parameters) -> Work:
    """Nothing was learnt, and only R is known less well: P + s e e' has the inverse Pi - s p p' / (1 + s p_0)."""
    before = work.learnt
    known = load(before.deviations, 0)
    s = clip(square(priors(par)[0]) - square(known), 0.0, _drifts(work, par)[0])
    Pi = get_matrix(work.prior)
    Pi = Pi - outer(Pi[0], s / (1.0 + s * Pi[0, 0]) * Pi[0])
    wider = store(before.deviations, 0, sqrt(square(known) + s))
    learnt = before._replace(windows=before.windows + 1.0, deviations=wider)
    q = put(work.q, [*get(work.q_prior, START), 0.0])
    return _opened(work._replace(q=q, prior=put_matrix(work.prior, Pi), learnt=learnt))


def _rejected(work: Work, par: Parameters) -> Work:
    """The currents were not explained: the parameters stay what they were.

    After some such windows in a row they go back to those of the last good window, and after as many more to what was
    known at the start; then in turn.  As long as nothing was explained, the
    next window begins with what explains this one best.
    """
    n = work.learnt.rejected + 1.0
    is_back, is_blind = n == PATIENCE, n >= 2.0 * PATIENCE
    work = work._replace(learnt=work.learnt._replace(rejected=where(is_blind, 0.0, n)))
    origin = cond(par.option_command > 0.0, lambda: _by_voltage(work.origin, par), lambda: work.origin)

    def kept() -> tuple[Array, Array]:
        return get(work.q_prior, START), get_matrix(work.prior)

    def gone_back() -> tuple[Array, Array]:
        return get(work.good, START), get_matrix(work.good_prior)

    def blind() -> tuple[Array, Array]:
        return vector([0.0] * START), _blind(par)

    q, Pi = cond(is_back, gone_back, lambda: cond(is_blind, blind, kept))
    found, goes_on = get(work.q, START), is_untaught(work.learnt, par) & has_landed(work.walk)
    opened = _opened(work._replace(q=put(work.q, [*q, 0.0]), prior=put_matrix(work.prior, Pi), origin=origin))
    return opened._replace(q=put(opened.q, [*(where(goes_on, a, b) for a, b in zip(found, q)), 0.0]))


def _is_behind(work: Work, par: Parameters) -> Scalar:
    """Whether more samples wait behind a window that nothing explained than are worth the work."""
    grows = is_untaught(work.learnt, par) & (work.has_grown > 0.0)
    is_new = (work.phase == DERIVING) & (work.begins > 0.0) & (work.end <= 0.0) & not_(grows)
    return is_new & (work.learnt.misfit >= BAD) & (work.age > effort(work.learnt, par).backlog)


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
    """The next window begins; what a good one has taught is noted."""
    Pi = -get_matrix(work.normal)
    is_good = work.learnt.misfit < GOOD
    good = cond(is_good, lambda: put(work.good, get(work.q, N)), lambda: work.good)
    good_prior = cond(is_good, lambda: put_matrix(work.good_prior, Pi), lambda: work.good_prior)
    return _opened(work._replace(prior=put_matrix(work.prior, Pi), good=good, good_prior=good_prior))
