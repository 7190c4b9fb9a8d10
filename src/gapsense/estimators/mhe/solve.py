"""Work of `Mhe` on a window: passes of the model through its samples, and Gauss-Newton between them.

The cost (4) of corrections q is sum w^2 (i - i_model)^2 + (q - q0)' Pi (q - q0), with the posterior of the window
before as arrival cost.  A pass with derivatives J of the current sums up H = sum w^2 J J' and g = sum w^2 r J of (5).
With `option.further` a trial that is hardly the last one sums them up too, so that none is to follow, and ends where it
turns out worse.  Work per sample is bounded: `window.pace` pieces of a pass, or as many pairs of pivots of an inverse.

       a window opens <------------------------------------------------------+
              |                                                              |
              v                                                              |
   +----> DERIVING  a pass sums up (5)                                       |
   |          |-- a held voltage says another R: once again from the start   |
   |          |-- neither voltage nor motion: nothing is learnt ------------>+
   |          |-- losses were a guess: a look at the first currents, (5) of them, once again from the start
   |          v                                                              |
   |      SOLVING   pivots, then the step (5) <-- worse: damped (7) --+      |
   |          v                                                       |      |
   |      TRYING    a pass with the step <-- worse: a shorter one ----+      |
   |          |                          <-- bad: another start ------+      |
   |          +-------------------------------------------------------+      |
   +----------+-- not as predicted (6), or the window has to be longer       |
              |-- final, but the misfit (9) is too large: nothing is learnt->+
              v                                                              |
          RENEWING  pivots, then the prior of the next window (8) -----------+
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from gapsense.estimators.mhe.model import Model, Parameters, Point
from gapsense.estimators.mhe.window import (
    ANY,
    FARTHEST,
    LATER,
    LOOK,
    PACE,
    PAIRS,
    PRACTISED,
    PROVEN,
    START,
    Learnt,
    N,
    PassStart,
    Phase,
    Samples,
    Search,
    Smoothed,
    Walk,
    Window,
    Work,
    advance_pass,
    as_outputs,
    begin_pass,
    bounds,
    count_kept,
    get,
    get_matrix,
    has_landed,
    has_moved,
    is_idle,
    is_look,
    is_untaught,
    origin_of,
    pace,
    place,
    priors,
    put,
    put_matrix,
    start_deviation,
)
from gapsense.kernels.elementary import exp, log
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import deviation, diagonal, outer, sweep, total, vector
from gapsense.kernels.trace import clip, cond, fabs, flag, is_set, load, loop, not_, sqrt, square, store, when, where

LOGARITHMS = 9  # the first corrections are logarithms
# standard deviations of what an operation adds to the corrections, fields of `Device`; of R, what `WARMING` does
DRIFT = (0.2e-2, 0.15e-2, 0.03e-2, 0.06e-2, 0.03e-2, 0.3e-2, 0.03e-2, 0.03e-2, 0.1e-2, 0.5e-2, 0.5e-2)
RESTLESS = {6: 0.2e-2, 7: 0.3e-2, 8: 0.8e-2}  # the same of mass, rest, damping where more is learnt
# arrival cost of a change that is expected, and what comes to it until rest and damping may change as before the first
# window; core, gap and mass do not change suddenly, and R with time
EXPECTED, SURPRISING, SUDDEN = 2.0, 10.0, (7, 8)
AHEAD = (0, *SUDDEN)
# what an operation changes of these two and of R steadily: share of its mean that stays; deviation of what comes next
# over what is expected; over `RESTLESS`: what may be noise, the largest that counts, and a change that comes at once
LASTING, ABOUT, UNSTEADY, STEADY, AT_ONCE = 0.9, 6.0, 0.2, 2.0, 4.0
WARMING = 10e-3  # a coil warms and cools with time, up to the deviation before the first window [s]
SHORTENED, SHORTENED_UNTAUGHT = 0.25, 0.5  # of a step whose trial is worse than what it left
DAMPED = 0.03  # of the diagonal comes to it with the first such step, ten times as much with each one more
LARGEST = 0.7  # step of a logarithm
LOSSES = (1, 5)  # eddy currents and hysteresis, among the corrections
COST_TOLERANCE = 0.03  # difference of costs that does not matter, in the cost that noise and model error make
REJECT_MISFIT = 6.0  # from here on nothing is learnt from a window
REJECT_UNTAUGHT = 30.0  # the same of the first one with a landing: what it teaches is as uncertain
LOST_MISFIT = 2.0  # of a window that goes before one that nothing explains: what was learnt is wrong
GOOD_MISFIT = 1.5  # below it others may go back to what the window has taught
USUAL_MISFIT, WRONG_MISFIT = 0.7, 0.8  # largest one of a right model; the one from which its eddy currents are wrong
FADING = 0.9  # share of the doubt of them that a window leaves
WIDER = 6.0  # what comes to the factor of an early posterior for each misfit beyond the largest of a right model
FAR = 5.5  # deviations from what was told that a device of the type does not have
PATIENCE = 3.0  # windows in a row that nothing explains until it goes back
PROOF = 2.0  # windows, a closing and an opening, that must be explained after a new beginning: the first may be a fault
LONGER = 2.0  # times the usual backlog, where a window is made longer after a new beginning
WITHIN = 0.75  # of the tail that must be left of it, or the motion has turned out to end later
# changes of the corrections over the expected ones that are usual; their surplus: of one window at most, what is not
# usual, and the largest that is remembered; windows until a device can have settled
USUAL_CHANGE, ONE_SURPLUS, SURPLUS, MOST_SURPLUS, SETTLES = 1.7, 5.0, 8.0, 15.0, 16.0
JUMP = 0.03  # of R: a held voltage says better where to start

Starts = tuple[dict[int, float], ...]

# where a search begins if nothing explains the currents: fields of `Device`, and how many deviations off
STARTS: Starts = (
    *({k: by} for by in (-1.0, 1.0, -2.0, 2.0) for k in (7, 2)),
    *({1: 2.0}, {5: 1.0}, {1: 2.0, 5: 1.0}),  # more losses than told
)
# the same with `option.further`, in deviations of what is known by now
MORE_STARTS: Starts = (
    *({k: by} for by in (-1.0, 1.0, -2.0, 2.0) for k in (7, 2, 6)),
    *({2: by, 7: by} for by in (-1.0, 1.0)),
    *({k: by} for by in (-2.0, 2.0) for k in (8, 10)),
)
LEAST = 0.01  # of these deviations
WORSE = 2.0  # times the last misfit: a search is worth its time


class Effort(NamedTuple):
    """When a fit is good enough, or has taken too long."""

    tries: Scalar  # passes with derivatives
    retries: Scalar  # of a step that is worse than what it left; the last one goes nowhere
    # samples behind the end of a window after which a cost far below the predicted one is no reason for another pass
    # with derivatives, and after which there is none
    late: Scalar
    later: Scalar
    latest: Scalar  # the same for a bad fit
    bad: Scalar  # misfit with which a search begins
    starts: Scalar
    searches: Scalar  # among these
    backlog: Scalar  # samples that may wait behind a window that nothing explained; more are dropped
    promising: Scalar  # by how much of the misfit a step is to lower it that is hardly the last one


USUAL_EFFORT = Effort(
    tries=5.0,
    retries=3.0,
    late=140.0,
    later=300.0,
    latest=2000.0,
    bad=6.0,
    starts=float(len(STARTS)),
    searches=1.0,
    backlog=200.0,
    promising=ANY,
)
# after a window that nothing explained: the next one will hardly be
HASTY = USUAL_EFFORT._replace(tries=2.0, late=0.0, later=0.0, latest=0.0, searches=0.0)
# a window that was left too early makes the next ones worse: it is better to be late for some cycles
THOROUGH = Effort(
    tries=15.0,
    retries=5.0,
    late=2500.0,
    later=2500.0,
    latest=4000.0,
    bad=1.0,
    starts=float(len(MORE_STARTS)),
    searches=4.0,
    backlog=5000.0,
    promising=0.2,
)


def effort(learnt: Learnt, par: Parameters) -> Effort:
    """What a window is worth: more if more is learnt; a search that will find nothing, as the last one, is not."""
    bad = clip(WORSE * learnt.misfit, THOROUGH.bad, USUAL_EFFORT.bad)
    thorough = THOROUGH._replace(bad=bad)
    is_hopeless = (learnt.rejected > 0.0) & not_(is_untaught(learnt, par))
    usual = [where(is_hopeless, hasty, one) for hasty, one in zip(HASTY, USUAL_EFFORT)]
    return Effort(*(where(is_set(par.option_further), more, one) for one, more in zip(usual, thorough)))


def is_lost(work: Work, par: Parameters) -> Scalar:
    """Whether only another start may explain the window; with `option.further` a search is usual."""
    return (work.search.searches > 0.0) & not_(is_set(par.option_further))


def is_untypical(corrections: Array, par: Parameters) -> Scalar:
    """Whether some are too far from what was told for a device of the type."""
    is_far: Scalar = False
    for q, s in zip(get(corrections, START), priors(par)):
        is_far = (fabs(q) > FAR * s) | is_far
    return is_far


def is_wandering(learnt: Learnt) -> Scalar:
    """Whether windows one after another change the corrections more than noise and what is known allow."""
    return learnt.surplus > SURPLUS


def suspect(learnt: Learnt) -> Learnt:
    """An innovation that is unlikely is as much as one such window."""
    return learnt._replace(surplus=where(learnt.surplus < ONE_SURPLUS, ONE_SURPLUS, learnt.surplus))


# a sample


def work_on(
    work: Work,
    samples: Samples,
    smoothed: Smoothed,
    causal: Point,
    held: Callable[[], Scalar],
    time: Scalar,
    m: Model,
    par: Parameters,
) -> tuple[Work, Smoothed, Scalar]:
    """What is done with a new sample: the work, the memory of smoothed samples, and whether a pass has caught up.

    `causal` is the estimate of the sample before, `held` gives the resistance by a held voltage, or 0, `m` the model of
    what is believed before the first window.
    """
    work = work._replace(window=work.window._replace(age=work.window.age + 1.0))
    is_behind = (work.window.age > count_kept(par) - 2.0 * PACE) | _is_behind(work, par)
    work = when(is_behind, lambda work: _give_up(work, causal), work)
    work = when(work.pass_start == PassStart.first, lambda work: _with_prior(work, causal, par), work)
    is_deriving = work.phase == Phase.deriving
    is_passing = (is_deriving | (work.phase == Phase.trying)) & not_(is_set(work.pass_done))

    def go_on() -> tuple[Work, Smoothed]:
        return cond(
            work.walk.done < work.window.age,
            lambda: advance_pass(work, samples, smoothed, m, par),
            lambda: (work, smoothed),
        )

    def run_pass() -> tuple[Work, Smoothed]:
        is_new = not_(work.pass_start == PassStart.under_way)
        return cond(is_new, lambda: (begin_pass(work, m, par), smoothed), go_on)

    def conclude(work: Work) -> Work:
        work = work._replace(pass_done=0.0)
        return cond(
            is_deriving, lambda: _end_pass(work, held, samples, par), lambda: _end_trial(work, samples, time, par)
        )

    def calculate() -> Work:
        return cond(is_set(work.pass_done), lambda: conclude(work), lambda: _invert(work, par))

    work, smoothed = cond(is_passing, run_pass, lambda: (calculate(), smoothed))
    is_on = (work.phase == Phase.deriving) & (work.pass_start == PassStart.under_way)
    return work, smoothed, is_on & (work.walk.done >= work.window.age)


def _with_prior(work: Work, causal: Point, par: Parameters) -> Work:
    """What is known before the first window, which begins where the causal estimate is."""
    return work._replace(
        window=work.window._replace(origin=put(work.window.origin, origin_of(causal))),
        fit=work.fit._replace(prior=put_matrix(work.fit.prior, _blind(par))),
        good_prior=put_matrix(work.good_prior, _blind(par)),
        learnt=work.learnt._replace(deviations=put(work.learnt.deviations, as_outputs(priors(par), par))),
    )


def _blind(par: Parameters) -> Array:
    """Arrival cost Pi before the first window."""
    return diagonal([1.0 / square(s) for s in (*priors(par), start_deviation(par))])


def _is_behind(work: Work, par: Parameters) -> Scalar:
    """Whether more samples wait behind a window that nothing explained than are worth the work."""
    is_due = (work.phase == Phase.deriving) & not_(work.pass_start == PassStart.under_way)
    grows, is_untold = is_set(work.window.has_grown), is_untaught(work.learnt, par)
    is_new = is_due & (work.window.end <= 0.0) & not_(is_untold & grows)
    backlog = effort(work.learnt, par).backlog
    most = where(grows & (work.learnt.rejected < 0.0), LONGER * backlog, backlog)
    return is_new & (work.learnt.misfit >= REJECT_MISFIT) & (work.window.age > most)


def wait(work: Work, causal: Point, par: Parameters) -> Work:
    """No work while the current is fed back; what waits for too long is given up."""
    work = work._replace(window=work.window._replace(age=work.window.age + 1.0))
    return when(work.window.age > count_kept(par) - 2.0 * PACE, lambda work: _give_up(work, causal), work)


def _give_up(work: Work, causal: Point) -> Work:
    """The memory is full before the window is solved: the next one begins where the causal estimate is."""
    window, fit, learnt = work.window, work.fit, work.learnt
    return _open_window(
        work._replace(
            window=window._replace(origin=put(window.origin, origin_of(causal)), age=1.0, begins_loose=0.0),
            fit=fit._replace(q=put(fit.q, [*get(fit.q_prior, START), 0.0])),
            learnt=learnt._replace(given_up=learnt.given_up + 1.0),
            ready=0.0,
        )
    )


def _open_window(work: Work) -> Work:
    """A window begins at its origin, with q as what is known."""
    fit = work.fit
    window = work.window._replace(end=0.0, least=1.0, has_grown=0.0, has_jumped=0.0, is_doubtful=0.0, look=LOOK)
    fit = fit._replace(q_prior=put(fit.q_prior, get(fit.q, N)), tries=0.0)
    return _start_deriving(work._replace(window=window, fit=fit, search=Search()))


def _start_deriving(work: Work) -> Work:
    """A pass with derivatives is next."""
    return work._replace(phase=Phase.deriving, pass_start=PassStart.due, pass_done=0.0)


# DERIVING


def _end_pass(work: Work, held: Callable[[], Scalar], samples: Samples, par: Parameters) -> Work:
    """The normal equations are complete; but if a held voltage says that R is another one, all begins with that."""
    looks = is_look(work, par)
    work = work._replace(window=work.window._replace(end=where(looks, 0.0, work.walk.done)))
    R, told = load(work.fit.device, 0), held()
    off = log(where(told > 0.0, told, R) / R)
    jumps = (fabs(off) > JUMP) & not_(is_set(work.window.has_jumped) | looks) & (work.fit.tries < 1.0)

    def jump() -> Work:
        q = clip(load(work.fit.q, 0) + off, -bounds(par)[0], bounds(par)[0])
        fit = work.fit._replace(q=store(work.fit.q, 0, q))
        return _start_deriving(work._replace(fit=fit, window=work.window._replace(has_jumped=1.0)))

    def learn() -> Work:
        return cond(jumps, jump, lambda: _start_solving(work, par))

    return cond(is_idle(work.walk), lambda: _pass_idle(_leave_window(work, samples, par), par), learn)


def _start_solving(work: Work, par: Parameters) -> Work:
    """The arrival cost joins the normal equations (5); a held coil says what R is, and nothing of the others."""
    looks = work.window.end <= 0.0
    work = when(looks | not_(has_moved(work.walk)), lambda work: _keep(work, looks), work)
    fit = work.fit
    Pi, d = get_matrix(fit.prior), get(fit.q, N) - get(fit.q_prior, N)
    pull = Pi @ d
    fit = fit._replace(
        descent=put(fit.descent, get(fit.gradient, N) - pull),
        whole=put_matrix(fit.whole, get_matrix(fit.normal) + Pi),
        total=work.walk.cost + d @ pull,  # (4)
        lands=flag(has_landed(work.walk)),
        tries=fit.tries + 1.0,
    )
    return _damp(work._replace(fit=fit), 0.0, par)


def _keep(work: Work, looks: Scalar) -> Work:
    """The normal equations of R and of the flux linkage at the start only, or of losses."""
    fit, said = work.fit, [where(looks, float(k in LOSSES), float(k in (0, START))) for k in range(N)]
    normal = [x * said[i] * said[j] for x, (i, j) in zip(get(fit.normal, len(PAIRS)), PAIRS)]
    gradient = [x * counts for x, counts in zip(get(fit.gradient, N), said)]
    return work._replace(fit=fit._replace(normal=put(fit.normal, normal), gradient=put(fit.gradient, gradient)))


def _damp(work: Work, n: Scalar, par: Parameters) -> Work:
    """A step is sought the n-th time again: with more on the diagonal (7), but for the last one, which goes nowhere."""
    A, more = get_matrix(work.fit.whole), damping(work, n, par)
    for k in range(N):
        A[k, k] = A[k, k] + more * A[k, k]
    fit = work.fit._replace(inverse=put_matrix(work.fit.inverse, A), pivots_done=0.0, shortenings=n)
    return work._replace(phase=Phase.solving, fit=fit)


def damping(work: Work, n: Scalar, par: Parameters) -> Scalar:
    """Share mu (7) of the diagonal that comes to it when a step is sought for the n-th time again."""
    has_damping = is_set(par.option_further) & (n > 0.0) & (n < effort(work.learnt, par).retries)
    return where(has_damping, DAMPED * exp(log(10.0) * (n - 1.0)), 0.0)


def _pass_idle(work: Work, par: Parameters) -> Work:
    """Nothing was learnt, and only R is known less well: P + s e e' has the inverse Pi - s p p' / (1 + s p_0)."""
    before, fit = work.learnt, work.fit
    known = load(before.deviations, 0)
    s = clip(square(priors(par)[0]) - square(known), 0.0, _drifts(work, par)[0])
    Pi = get_matrix(fit.prior)
    Pi = Pi - outer(Pi[0], s / (1.0 + s * Pi[0, 0]) * Pi[0])
    wider = store(before.deviations, 0, sqrt(square(known) + s))
    fit = fit._replace(q=put(fit.q, [*get(fit.q_prior, START), 0.0]), prior=put_matrix(fit.prior, Pi))
    return _open_window(work._replace(fit=fit, learnt=before._replace(windows=before.windows + 1.0, deviations=wider)))


# SOLVING, RENEWING


def _invert(work: Work, par: Parameters) -> Work:
    """Some pivots, two at once; after the last ones a trial, or the next window."""
    fit = work.fit
    most = clip(fit.pivots_done + 2.0 * pace(par), 0.0, float(N))

    def two(inverse: Array, done: Scalar) -> tuple[tuple[Array, Scalar], Scalar]:
        return (put_matrix(inverse, sweep(sweep(get_matrix(inverse)))), done + 2.0), done + 2.0 >= most

    def pivot() -> Work:
        inverse, done = loop(N // 2, two, (fit.inverse, fit.pivots_done))
        return work._replace(fit=fit._replace(inverse=inverse, pivots_done=done))

    def use() -> Work:
        return cond(work.phase == Phase.solving, lambda: _start_trying(work, par), lambda: _renew(work, par))

    return cond(fit.pivots_done < N, pivot, use)


def _start_trying(work: Work, par: Parameters) -> Work:
    """The step (5) of Gauss-Newton; one that lowers the cost (6) by little is not worth its pass.

    If the window is only looked at, it begins again with the step, without a trial.
    """
    fit, looks = work.fit, work.window.end <= 0.0
    descent, worth = get(fit.descent, N), effort(work.learnt, par)
    full = -(get_matrix(fit.inverse) @ descent)  # (5)
    gain, usual = full @ descent, usual_cost(work.walk, par)
    is_little = (fit.shortenings < 1.0) & (fit.tries > 1.0) & (gain < COST_TOLERANCE * usual)
    is_last = fit.shortenings >= worth.retries
    promising = where(fit.shortenings > 0.0, COST_TOLERANCE, worth.promising)  # a damped one is not the last one
    steps = enumerate(zip(get(fit.q, N), _limit(full, looks, par)))
    most = [*bounds(par), FARTHEST]
    change = [clip(q + where(is_little | is_last, 0.0, x), -most[k], most[k]) - q for k, (q, x) in steps]
    begun = [q + where(looks, x, 0.0) for q, x in zip(get(fit.q, N), change)]
    return work._replace(
        phase=where(looks, Phase.deriving, Phase.trying),
        pass_start=where(is_little, PassStart.under_way, PassStart.due),
        pass_done=flag(is_little),
        window=work.window._replace(look=where(looks, LATER, 1.0) * work.window.look),
        fit=fit._replace(
            q=put(fit.q, begun),
            tries=where(looks, 0.0, fit.tries),
            change=put(fit.change, change),
            predicted_cost=fit.total - gain,  # (6)
            derives=flag((gain > promising * usual) & not_(is_last)),
            shortenings=where(is_little, worth.retries, fit.shortenings),
        ),
    )


def _limit(full: Array, looks: Scalar, par: Parameters) -> list[Scalar]:
    """The step: no logarithm goes farther than `LARGEST`, by a shorter step, or each by itself if more is learnt.

    At a look the same, but losses, in which currents are linear, go as far as these ask for.
    """
    farthest: Scalar = 0.0
    for x in full[:LOGARITHMS]:
        farthest = where(fabs(x) > farthest, fabs(x), farthest)
    share = where(farthest > LARGEST, LARGEST / where(farthest > LARGEST, farthest, 1.0), 1.0)
    each = [clip(x, -LARGEST, LARGEST) for x in full]
    for k in LOSSES:
        each[k] = where(looks & (full[k] > 0.0), log(1.0 + where(full[k] > 0.0, full[k], 0.0)), each[k])
    return [where(is_set(par.option_further) | looks, one, share * x) for one, x in zip(each, full)]


def usual_cost(walk: Walk, par: Parameters) -> Scalar:
    """Cost of a pass that noise and model error make: the denominator of the misfit (9)."""
    counted = where(walk.counted > 0.0, walk.counted, 1.0)
    return 1.5 * (square(par.noise_current) + square(par.model_error)) * counted


def _renew(work: Work, par: Parameters) -> Work:
    """The next window begins with Pi of (8); what a good one has taught is noted, unless the operation was strange."""
    fit = work.fit
    Pi = -get_matrix(fit.inverse)
    fits, is_doubtful = work.learnt.misfit < GOOD_MISFIT, is_set(work.window.is_doubtful)
    is_good = fits & (work.learnt.rejected >= 0.0) & not_(is_doubtful)
    return _open_window(
        work._replace(
            fit=fit._replace(prior=put_matrix(fit.prior, Pi)),
            good=when(is_good, lambda good: put(good, get(fit.q, N)), work.good),
            good_prior=when(is_good, lambda good: put_matrix(good, Pi), work.good_prior),
        )
    )


# TRYING


class Verdict(NamedTuple):
    """On a trial that is at the end of the window."""

    total: Scalar  # cost
    misfit: Scalar
    is_better: Scalar  # than what it came from, or the last way out
    is_final: Scalar  # no other trial is worth it
    grows: Scalar  # the window is made longer
    seeks: Scalar  # other starts are tried


def _end_trial(work: Work, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """A trial of a start, or of a step."""
    is_searching = work.search.start_index > 0.0
    return cond(is_searching, lambda: _compare_start(work, par), lambda: _judge(work, samples, time, par))


def _total(work: Work) -> Scalar:
    """Cost (4) of a trial."""
    fit = work.fit
    d = get(fit.q, N) + get(fit.change, N) - get(fit.q_prior, N)
    return work.walk.cost + d @ (get_matrix(fit.prior) @ d)


def _verdict(work: Work, par: Parameters) -> Verdict:
    """A trial is the last one if it came out nearly as predicted (6).

    But if the motion turned out to end later, or far off in any case, the window is made longer once.
    """
    walk, window, fit, search = work.walk, work.window, work.fit, work.search
    unit, worth = usual_cost(walk, par), effort(work.learnt, par)
    total, misfit = _total(work), walk.cost / unit
    loses = is_set(fit.lands) & not_(has_landed(walk)) & is_untaught(work.learnt, par)
    is_last, is_bad = fit.shortenings >= worth.retries, misfit > worth.bad
    missing, late = total - fit.predicted_cost, window.age - window.end
    surprise = where(late > worth.late, missing, fabs(missing))
    is_good, is_late = surprise < COST_TOLERANCE * unit, late > where(is_bad, worth.latest, worth.later)
    is_final = (is_good & (fit.shortenings < 1.0)) | (fit.tries >= worth.tries) | is_late | is_last
    tail, longest = par.window_tail / par.sample_time, par.window_longest / par.sample_time
    ends_later = (walk.takeoff < 0.0) | (walk.still < WITHIN * tail) | is_bad
    is_fixed = is_set(window.has_grown) | is_late | is_set(par.option_command) | (window.end >= longest)
    grows = (is_final | is_bad) & ends_later & not_(is_fixed)
    may_seek = (
        not_(is_set(search.search_done)) & (search.searches < worth.searches) & (window.age < 0.5 * count_kept(par))
    )
    return Verdict(
        total=total,
        misfit=misfit,
        is_better=((total < fit.total) & not_(loses)) | is_last,
        is_final=is_final,
        grows=grows,
        seeks=is_final & not_(grows) & is_bad & may_seek,
    )


def _judge(work: Work, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """After a trial: a shorter step, other starts, another pass with derivatives, or the end of the work."""
    found, tail = _verdict(work, par), par.window_tail / par.sample_time

    def take() -> Work:
        fit = work.fit
        return work._replace(fit=fit._replace(q=put(fit.q, get(fit.q, N) + get(fit.change, N))))

    def grow(work: Work) -> Work:
        least = work.window.end + where(found.misfit > REJECT_MISFIT, tail, 1.0)
        window = work.window._replace(end=0.0, least=least, has_grown=1.0)
        return work._replace(window=window, fit=work.fit._replace(tries=0.0))

    def search() -> Work:
        new = work.search._replace(
            start_index=1.0, best=0.0, least_total=found.total, searches=work.search.searches + 1.0
        )
        return _try_start(take()._replace(search=new), par)

    def go_on() -> Work:
        is_done = found.is_final & not_(found.grows)
        return cond(
            is_done,
            lambda: _finish(take(), found.misfit, samples, time, par),
            lambda: derive(_start_deriving(when(found.grows, grow, take()))),
        )

    def derive(work: Work) -> Work:
        is_known = is_set(work.fit.derives) & not_(found.grows)
        return work._replace(pass_start=where(is_known, PassStart.under_way, PassStart.due), pass_done=flag(is_known))

    def retry() -> Work:
        n = work.fit.shortenings + 1.0
        return cond(is_set(par.option_further), lambda: _damp(work, n, par), lambda: _shorten(work, n, par))

    return cond(found.is_better, lambda: cond(found.seeks, search, go_on), retry)


def _shorten(work: Work, n: Scalar, par: Parameters) -> Work:
    """A trial of a shorter step, the n-th one, or of none."""
    shortened = where(is_untaught(work.learnt, par), SHORTENED_UNTAUGHT, SHORTENED)
    share = where(n >= effort(work.learnt, par).retries, 0.0, shortened)
    fit = work.fit._replace(shortenings=n, change=put(work.fit.change, share * get(work.fit.change, N)))
    return work._replace(fit=fit, pass_start=PassStart.due)


def _try_start(work: Work, par: Parameters) -> Work:
    """A trial of one of the starts, from what was found."""
    change = start_of(work.search.start_index, work.learnt, par)
    fit = work.fit._replace(change=put(work.fit.change, change), derives=0.0)
    return work._replace(fit=fit, pass_start=PassStart.due)


def _compare_start(work: Work, par: Parameters) -> Work:
    """The next of the starts; after the last one Gauss-Newton from the best, or a last trial where none is better."""
    search, worth, total = work.search, effort(work.learnt, par), _total(work)
    is_best = total < search.least_total
    best, least = where(is_best, search.start_index, search.best), where(is_best, total, search.least_total)
    next_ = search._replace(start_index=search.start_index + 1.0, best=best, least_total=least)

    def choose() -> Work:
        fit, has_best = work.fit, best > 0.0
        found = work._replace(
            phase=where(has_best, Phase.deriving, Phase.trying),
            pass_start=PassStart.due,
            search=search._replace(start_index=0.0, search_done=flag(not_(has_best))),
            fit=fit._replace(
                q=put(fit.q, get(fit.q, N) + vector(start_of(best, work.learnt, par))),
                change=put(fit.change, [0.0] * N),
                tries=0.0,
                shortenings=worth.retries,
            ),
        )
        has_damping = is_set(par.option_further) & not_(has_best)  # of the inverse, which is to be the posterior
        return when(has_damping, lambda found: _damp(found, worth.retries, par), found)

    is_more = search.start_index < worth.starts
    return cond(is_more, lambda: _try_start(work._replace(search=next_), par), choose)


def start_of(n: Scalar, learnt: Learnt, par: Parameters) -> list[Scalar]:
    """Corrections of the start `n`, from 1 on; none of 0."""
    known = [where(s > LEAST, s, LEAST) for s in get(learnt.deviations, START)]
    both = zip(_start(n, STARTS, priors(par)), _start(n, MORE_STARTS, known))
    return [where(is_set(par.option_further), more, usual) for usual, more in both]


def _start(n: Scalar, starts: Starts, deviations: list[Scalar]) -> list[Scalar]:
    changes: list[Scalar] = [0.0] * N
    for index, start in enumerate(starts, 1):
        for k, by in start.items():
            changes[k] = where(n == float(index), by * deviations[k], changes[k])
    return changes


# the end of a window


def _finish(work: Work, misfit: Scalar, samples: Samples, time: Scalar, par: Parameters) -> Work:
    """The smoothed estimate is ready; what the window has taught is kept, and the next one begins where it ends."""
    forgets = is_set(par.option_further) & (work.learnt.misfit >= LOST_MISFIT)
    is_cut = work.window.end >= par.window_longest / par.sample_time  # no landing has ended it: it was no operation
    limit = where(is_untaught(work.learnt, par) & has_landed(work.walk), REJECT_UNTAUGHT, REJECT_MISFIT)
    most = where(is_cut & is_set(work.window.is_doubtful), GOOD_MISFIT, limit)
    told = _leave_window(work._replace(learnt=_tell(work, misfit, time, par)), samples, par)

    def reject() -> Work:
        return cond(forgets, lambda: _forget(told, par), lambda: _reject(told, par))

    return cond(misfit < most, lambda: _learn(told, misfit, par), reject)


def _leave_window(work: Work, samples: Samples, par: Parameters) -> Work:
    """The samples of the window can be published, and the next one begins where it ends."""
    window, origin = work.window, put(work.window.origin, origin_of(Point(*work.walk.at)))
    return work._replace(
        window=window._replace(origin=origin, age=window.age - window.end, begins_loose=work.walk.is_loose),
        shown=where(work.ready > 0.0, work.shown, place(samples.newest, window.age, par)),
        ready=work.ready + window.end,
    )


def _tell(work: Work, misfit: Scalar, time: Scalar, par: Parameters) -> Learnt:
    """What a window has told of its operation, if there was one."""
    walk, T_s, old = work.walk, par.sample_time, work.learnt
    since, lands = time - work.window.age * T_s, has_landed(walk)
    return old._replace(
        takeoff_time=where(lands, since + walk.takeoff * T_s, old.takeoff_time),
        landing_time=where(lands, since + walk.landing * T_s, old.landing_time),
        impact_speed=where(lands, walk.speed, old.impact_speed),
        bounces=where(lands, walk.landings - 1.0, old.bounces),
        windows=old.windows + 1.0,
        misfit=misfit,
        given_up=0.0,
    )


def _learn(work: Work, misfit: Scalar, par: Parameters) -> Work:
    """The posterior, wider by misfit and drift (8), is to become the next prior."""
    fit, old = work.fit, work.learnt
    posterior = -get_matrix(fit.inverse)
    P = _widening(misfit, old, par) * (1.0 + damping(work, fit.shortenings, par)) * posterior
    deviations = put(old.deviations, as_outputs([deviation(P[k, k]) for k in range(START)], par))
    d, Pi = get(fit.q, N) - get(fit.q_prior, N), get_matrix(fit.prior)
    changed = d @ (Pi @ d)
    change = (changed - EXPECTED) / SURPRISING
    share = where(is_set(par.option_further), square(clip(change, 0.0, 1.0)), 0.0)
    moved = flag(has_moved(work.walk))
    trends = _trends(old, d, moved, par)
    ahead = {k: moved * step for k, step in zip(AHEAD, _expected_change(trends))}
    for k, (s, variance) in enumerate(zip(priors(par), _drifts(work, par))):
        if k in SUDDEN:
            unsteady = square(ABOUT * ahead[k])
            most = where(unsteady > variance, unsteady, variance) + share * square(s)
        else:
            most = variance
        P[k, k] = P[k, k] + clip(square(s) - P[k, k], 0.0, most)
    P[START, :] = P[:, START] = 0.0
    P[START, START] = square(start_deviation(par))
    expected = float(N) - total(posterior[k] @ Pi[k] for k in range(N))  # of what the window changes (12)
    more = changed - USUAL_CHANGE * expected
    surplus = clip(old.surplus + where(more < ONE_SURPLUS, more, ONE_SURPLUS), 0.0, MOST_SURPLUS)
    settles = (moved > 0.0) & (old.explained >= SETTLES - 1.0) & (surplus <= 0.0)
    q = store(fit.q, START, 0.0)
    for k, step in ahead.items():
        q = store(q, k, load(q, k) + step)
    return work._replace(
        phase=Phase.renewing,
        fit=fit._replace(q=q, inverse=put_matrix(fit.inverse, P), pivots_done=0.0),
        learnt=old._replace(
            rejected=where(old.rejected < 0.0, old.rejected + moved, 0.0),
            explained=old.explained + moved,
            doubt=where(moved > 0.0, _doubt(misfit, old), old.doubt),
            deviations=deviations,
            surplus=where(moved > 0.0, surplus, old.surplus),
            resistance_trend=trends[0],
            rest_trend=trends[1],
            damping_trend=trends[2],
            is_settled=where(settles, 1.0, old.is_settled),
        ),
    )


def _widening(misfit: Scalar, before: Learnt, par: Parameters) -> Scalar:
    """Factor of the posterior: errors of the model are the same for long, and the first windows have large ones."""
    is_early = (before.explained < PROVEN) & not_(is_set(par.option_further))
    off = where(misfit > USUAL_MISFIT, misfit - USUAL_MISFIT, 0.0)
    return where(is_early, 1.0 + WIDER * off, where(misfit > 1.0, misfit, 1.0))


def _doubt(misfit: Scalar, before: Learnt) -> Scalar:
    """Of the eddy currents after a window: the largest of late, fading; a later misfit is that of a fault."""
    new, old = clip((misfit - USUAL_MISFIT) / (WRONG_MISFIT - USUAL_MISFIT), 0.0, 1.0), FADING * before.doubt
    return where((before.explained < PRACTISED) & (new > old), new, old)


def _trends(before: Learnt, d: Array, moved: Scalar, par: Parameters) -> list[Scalar]:
    """Means of late of what an operation changes of R, rest and damping, after one that came out d from what was ahead.

    A change that comes at once is none that goes on: the mean begins anew.  A held voltage tells R early.
    """
    old = (before.resistance_trend, before.rest_trend, before.damping_trend)
    means = []
    for k, mean, step in zip(AHEAD, old, _expected_change(old)):
        counts = is_set(par.option_ahead) & (moved > 0.0) & (before.explained >= (SETTLES if k in SUDDEN else PROVEN))
        most = STEADY * _restless(k)
        new = LASTING * mean + (1.0 - LASTING) * clip(step + d[k], -most, most)
        means.append(where(counts, where(fabs(d[k]) > AT_ONCE * _restless(k), 0.0, new), mean))
    return means


def _expected_change(trends: Sequence[Scalar]) -> list[Scalar]:
    """Change that the next operation is expected to make."""
    noise = [UNSTEADY * _restless(k) for k in AHEAD]
    return [mean - clip(mean, -most, most) for mean, most in zip(trends, noise)]


def _restless(k: int) -> float:
    """Deviation of what an operation adds to a correction where more is learnt."""
    return RESTLESS.get(k, DRIFT[k])


def _drifts(work: Work, par: Parameters) -> list[Scalar]:
    """Variances that come to the corrections, D of (8): to R with time, to the others with an operation."""
    warming = square(DRIFT[0]) * work.window.end * par.sample_time / WARMING
    usual = [where(is_set(par.option_further), _restless(k), drift) for k, drift in enumerate(DRIFT)]
    return [warming, *(where(has_moved(work.walk), square(drift), 0.0) for drift in usual[1:])]


def _reject(work: Work, par: Parameters) -> Work:
    """The currents were not explained: the parameters stay what they were.

    After some such windows in a row they go back to those of the last good window, and after as many more to what was
    known at the start; then in turn.  From there they go back at once, unless some windows were explained: the first
    may be that of a fault.  So they do from what no device of the type has.  As long as nothing was explained, the next
    window begins with what explains this one best.
    """
    window, fit, rejected = work.window, work.fit, work.learnt.rejected
    n = where((rejected < 0.0) | is_untypical(fit.q_prior, par), PATIENCE, rejected + 1.0)
    is_back, is_blind = n == PATIENCE, n >= 2.0 * PATIENCE

    def keep() -> tuple[Array, Array]:
        return get(fit.q_prior, START), get_matrix(fit.prior)

    def go_back() -> tuple[Array, Array]:
        return get(work.good, START), get_matrix(work.good_prior)

    def begin_again() -> tuple[Array, Array]:
        return vector([0.0] * START), _blind(par)

    q, Pi = cond(is_back, go_back, lambda: cond(is_blind, begin_again, keep))
    origin = when(is_set(par.option_command), lambda origin: _by_voltage(origin, par), window.origin)
    found, goes_on = get(fit.q, START), is_untaught(work.learnt, par) & has_landed(work.walk)
    work = _open_window(
        work._replace(
            window=window._replace(origin=origin),
            fit=fit._replace(q=put(fit.q, [*q, 0.0]), prior=put_matrix(fit.prior, Pi)),
            learnt=work.learnt._replace(rejected=where(is_blind, -PROOF, n)),
        )
    )
    start = [where(goes_on, a, b) for a, b in zip(found, q)]
    return work._replace(fit=work.fit._replace(q=put(work.fit.q, [*start, 0.0])))


def _by_voltage(origin: Array, par: Parameters) -> Array:
    """Where an operation must have ended: at the lower stop with a voltage, at that of the spring without one."""
    u = load(origin, 4)
    origin = store(origin, 2, where(fabs(u) > par.edge, par.stop_lower, par.stop_upper))
    return store(origin, 3, 0.0)


def unlearn(work: Work) -> Work:
    """Nothing is left of what was learnt from other readings, and it begins as at the start, now."""
    fit, nothing = work.fit, [0.0] * N
    trends = ("resistance_trend", "rest_trend", "damping_trend")
    fresh = dict.fromkeys(("rejected", "explained", "surplus", "is_settled", *trends), 0.0)
    return work._replace(
        phase=Phase.deriving,
        pass_start=PassStart.first,
        pass_done=0.0,
        window=Window(work.window.origin),
        fit=fit._replace(q=put(fit.q, nothing), q_prior=put(fit.q_prior, nothing), tries=0.0),
        learnt=work.learnt._replace(**fresh),
        good=put(work.good, nothing),
        search=Search(),
        ready=0.0,
    )


def _forget(work: Work, par: Parameters) -> Work:
    """Two windows in a row that were not explained: what was learnt is wrong, and it begins as at the start, now."""
    fit = work.fit
    return _open_window(
        work._replace(
            window=work.window._replace(age=count_kept(par)),
            fit=fit._replace(q=put(fit.q, [0.0] * N), prior=put_matrix(fit.prior, _blind(par))),
        )
    )
