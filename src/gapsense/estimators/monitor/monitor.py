"""Condition of a reluctance actuator, from what `Mhe` says of each operation: is it healthy, since when not, and why.

An operation lasts from one change of the command to the next.  Its profile are the mean innovations before the motion
that `Mhe` expects, in it, for some time after it, and in the rest (1).  An operation is strange if `Mhe` says so and
its profile is far from what is usual (2), or if it has no motion.  It and the next one, a closing and an opening before
`Mhe` has got used to it, make a fault.  Their profiles, and the learnt values that have moved since the baseline (3),
are compared with the signatures of causes, by direction (4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gapsense.estimators.monitor.records import (
    PHASES,
    VALUES,
    Baseline,
    Course,
    Evidence,
    Inputs,
    KeptMeans,
    KeptValues,
    Learnt,
    Moved,
    Operation,
    Outputs,
    Parameters,
    Phase,
    Profile,
    Since,
    State,
    Trend,
    Usual,
    Verdict,
)
from gapsense.estimators.monitor.signatures import CAUSES, COLDER, GRADUAL, SUDDEN, Signature, direction
from gapsense.estimators.readings import INNOVATION, can_be_read
from gapsense.kernels.elementary import exp, log
from gapsense.kernels.layout import Array, Scalar, blank
from gapsense.kernels.linalg import total, vector
from gapsense.kernels.trace import cond, fabs, flag, floor, is_set, not_, sqrt, square, when, where, where_each

FIRST = 6.0  # windows that only teach `Mhe`
GOOD = 1.5  # misfit below which a window has taught something
SETTLED = 2.0 / 3.0  # share of the windows of a baseline in which what `Mhe` learns still settles
SLOWEST = 0.5  # what eddy currents count of what they have moved
WANDER = 5.5  # reported deviations by which what is learnt of a healthy device wanders
LEAST = 1e-12  # of a size, a value or a deviation that is divided by
UNKNOWN = 1.0  # density of directions that are in no table
BACK = 0.065  # R, or a current, is back to what it was before a fault within this share
SAME = 1.0  # usual wanderings within which learnt values are what they were before a fault
DEAD = 0.1  # share of what `Mhe` expected in a closing, below which there was no current
TOLD = 0.5  # evidence with which a cause is given
QUICK, SLOW = 1.0 / 50.0, 1.0 / 500.0  # weights of a window in the means whose difference is the trend
PER = 1000.0  # operations to which a trend refers
HALF = 0.5  # usual sizes of a profile that are noise of each of its entries
ASIDE, BESIDE = 0.25, 2.0  # most of a profile that is not that of a cold coil: share of what is, and usual sizes
LATELY = 4.0  # operations of a kind of which usual currents are means
WARMER = next(s.entries for s in SUDDEN if s.cause == "contact")  # direction of the currents of a warmer coil
CURVED = 0.12  # share of what the temperature does that has another direction
NONE = vector([0.0] * len(CAUSES))


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Nothing is known, or the baseline of an earlier run."""
    baseline = _given_baseline(par)
    values = baseline.healthy
    state = State(
        baseline=baseline,
        usually=blank(Usual),
        operation=_begin(inputs, 0.0)._replace(is_commanded=0.0),
        course=blank(
            Course, verdict=where(baseline.taught >= par.learn_windows, Verdict.healthy, Verdict.learning), sound=values
        ),
        learnt=Learnt(
            solved=inputs.windows, values=values, quick=values, slow=values, wandering=vector([1.0] * VALUES)
        ),
        evidence=NONE,
        since=NONE - 1.0,
    )
    return state, _outputs(state)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample; one that is not of numbers, but for the current, is left out."""
    others = total(x for name, x in inputs._asdict().items() if name != "current")
    state = when(fabs(others) < math.inf, lambda state: _sample(state, inputs, par), state)
    return state, _outputs(state)


def _sample(state: State, inputs: Inputs, par: Parameters) -> State:
    """An operation that is over is judged, a new window is learnt from, the profile goes on."""
    is_over = not_(flag(inputs.command > 0.5) == state.operation.command)
    is_operation = is_over & is_set(state.operation.is_commanded)
    state = when(is_operation, lambda state: _judge(state, par), state)
    state = when(is_over, lambda state: state._replace(operation=_begin(inputs, state.operation.last)), state)
    has_solved = not_(inputs.windows == state.learnt.solved)
    state = when(has_solved, lambda state: _learn(state, inputs, par), state)
    return state._replace(operation=_go_on(state.operation, state.usually, inputs, par))


# an operation


def _begin(inputs: Inputs, last: Scalar) -> Operation:
    return blank(Operation, command=flag(inputs.command > 0.5), began=inputs.time, last=last, is_commanded=1.0)


def _go_on(before: Operation, usually: Usual, inputs: Inputs, par: Parameters) -> Operation:
    """The profile (1) with a sample more; not the one at the edge, nor what comes once `Mhe` feeds the current back."""
    moves, has_moved = (inputs.mode > 1.5) & (inputs.mode < 2.5), is_set(before.has_moved)
    i = where(can_be_read(inputs.current, math.inf), inputs.current, before.last)
    is_inside, is_again = before.age > 0.0, moves & (before.rested > 0.0)
    is_beyond = is_inside & _is_beyond(i - inputs.innovation, i, usually)
    is_known = not_(is_set(before.is_lost) | is_again | is_beyond)
    rested = where(moves | not_(has_moved), before.rested, before.rested + 1.0)
    rests = where(rested * par.sample_time > par.settle, float(Phase.held), float(Phase.landed))
    phase = where(moves, float(Phase.moving), where(has_moved, rests, float(Phase.before)))
    here = vector([where((phase == float(k)) & is_known & is_inside, 1.0, 0.0) for k in range(PHASES)])
    usual = _usual_phase(before.age, _half(usually.lengths, is_set(before.command)))
    there = vector([where((usual == float(k)) & is_inside, 1.0, 0.0) for k in range(PHASES)])
    return before._replace(
        sums=before.sums + inputs.innovation * here,
        counts=before.counts + here,
        charges=before.charges + i * there,
        samples=before.samples + there,
        last=i,
        age=before.age + 1.0,
        rested=rested,
        is_lost=flag(not_(is_known)),
        has_moved=flag(moves | has_moved),
        is_abnormal=where(_has_bit(inputs.health_causes, INNOVATION), 1.0, before.is_abnormal),
    )


def _is_beyond(expected: Scalar, i: Scalar, usually: Usual) -> Scalar:
    """Whether `Mhe` has more current than a closing ends with, and than there is: only fed back it does."""
    most, found = fabs(usually.currents[Phase.held]), fabs(expected) / (1.0 + BACK)
    return (most > 0.0) & (found > most) & (found > fabs(i))


def _usual_phase(age: Scalar, lengths: Array) -> Scalar:
    """The phase in which an operation of this age usually is."""
    phase, until = 0.0, 0.0
    for length in lengths[: PHASES - 1]:
        until = until + length
        phase = phase + where(age > until, 1.0, 0.0)
    return phase


def _has_bit(causes: Scalar, bit: float) -> Scalar:
    half = floor(causes / bit)
    return half - 2.0 * floor(0.5 * half) > 0.5


def _means(sums: Array, counts: Array) -> Array:
    return vector([s / where(n > 0.0, n, 1.0) for s, n in zip(sums, counts)])


def _judge(state: State, par: Parameters) -> State:
    """An operation is over."""
    operation, course = state.operation, state.course
    means, currents = _means(operation.sums, operation.counts), _means(operation.charges, operation.samples)
    is_closing, usual = is_set(operation.command), state.baseline.usual_size
    deviation = means - _half(state.baseline.usual, is_closing)
    size = _length(deviation) / where(usual > LEAST, usual, LEAST)  # (2)
    is_familiar = _is_familiar(state, currents, par)
    is_still, is_abnormal = not_(is_set(operation.has_moved)), is_set(operation.is_abnormal)
    is_strange = is_still | (is_abnormal & (size > par.limit_strange) & not_(is_familiar))
    is_calm = not_(is_abnormal | is_still | (course.verdict == Verdict.faulty))
    has_current = fabs(total(operation.charges)) > DEAD * fabs(total(operation.sums))
    course = course._replace(
        size=size,
        commands=course.commands + 1.0,
        motions=course.motions + operation.has_moved,
        quiet=where(is_strange | (size > par.limit_strange), 0.0, course.quiet + 1.0),
        familiar=where(is_familiar & not_(is_still), course.familiar + 1.0, 0.0),
        is_relearnt=where(is_abnormal, course.is_relearnt, 0.0),
        is_still=flag(is_still),
        is_dead=where(is_closing, flag((size > par.limit_strange) & not_(has_current)), course.is_dead),
    )
    state = when(is_calm, lambda state: _know(state, currents), state._replace(course=course))

    def learn() -> State:
        is_usual = not_(is_abnormal | is_still) & (state.baseline.taught > 0.0)
        taught = when(is_usual, lambda b: _teach(b, means, is_closing, par), state.baseline)
        profile = _with_half(course.profile, deviation, is_closing)
        return state._replace(baseline=taught, course=course._replace(profile=profile))

    def look() -> State:
        return _look(state, deviation, is_strange, par)

    return cond(course.verdict == Verdict.learning, learn, look)


def _know(state: State, currents: Array) -> State:
    """Usual operations with one more."""
    old, is_closing = state.usually, is_set(state.operation.command)
    closings, openings = old.closings_known + flag(is_closing), old.openings_known + flag(not_(is_closing))
    n = where(is_closing, closings, openings)
    share = where(n > LATELY, 1.0 / LATELY, 1.0 / n)
    lengths, known = _half(old.lengths, is_closing), _half(old.currents, is_closing)
    lengths = lengths + share * (state.operation.counts - lengths)
    usually = Usual(
        lengths=_with_half(old.lengths, lengths, is_closing),
        currents=_with_half(old.currents, known + share * (currents - known), is_closing),
        closings_known=closings,
        openings_known=openings,
    )
    return state._replace(usually=usually)


def _is_familiar(state: State, currents: Array, par: Parameters) -> Scalar:
    """Whether the current of an operation is that of usual ones (5), at the temperature that the coil may have."""
    usually, is_closing = state.usually, is_set(state.operation.command)
    known = _half(usually.currents, is_closing)
    off, warm = currents - known, _half(vector(WARMER), is_closing)
    along = (off @ warm) / (warm @ warm) * warm
    rest, noise = off - along, par.limit_strange * state.baseline.usual_size
    is_known = where(is_closing, usually.closings_known, usually.openings_known) >= LATELY
    is_same = _length(rest) < noise + CURVED * _length(along)
    return is_known & is_same & (fabs(off[-1]) < BACK * fabs(known[-1]) + noise)


def _look(state: State, deviation: Array, is_strange: Scalar, par: Parameters) -> State:
    """A known device: the second of two operations of which the first was strange tells whether it is a fault."""
    course, began = state.course, state.operation.began
    is_faulty = course.verdict == Verdict.faulty
    is_first = is_strange & not_(is_set(course.suspected)) & not_(is_faulty)
    is_second = is_set(course.suspected)
    profile = _with_half(course.profile, deviation, is_set(state.operation.command))
    course = course._replace(
        profile=where_each(is_faulty, course.profile, profile),
        suspected=flag(is_first),
        onset=where(is_first, began, course.onset),
        sound=where_each(is_first, state.learnt.quick, course.sound),
    )
    state = state._replace(course=course)
    state = when(is_second, lambda state: _decide(state, par), state)
    return when(is_faulty, _recover, state)


def _decide(state: State, par: Parameters) -> State:
    """The causes of a strange operation and the next one, unless a closing with a cold coil was all."""
    course, noise = state.course, state.baseline.usual_size
    was_closing = not_(is_set(state.operation.command))  # the first one
    profile = where_each(was_closing, _weigh_opening(course.profile), course.profile)
    evidence = where_each(is_set(course.is_still), _only("still"), _evidence(profile, SUDDEN, noise))
    evidence = where_each(is_set(course.is_dead), _only("open"), evidence)
    is_usual = (course.familiar > 0.0) | (course.size < par.limit_strange)
    is_cold = was_closing & _is_cold(course.profile, is_usual, noise)
    is_fault = is_set(course.is_still) | not_(is_cold)
    return when(is_fault, lambda state: _alarm(state, profile, evidence), state)


def _weigh_opening(profile: Array) -> Array:
    """Weigh the opening no more than the closing before it: `Mhe` may be lost in it."""
    closing, opening = profile[:PHASES], profile[PHASES:]
    most, found = _length(closing), _length(opening)
    return vector([*closing, *(where(found > most, most / (found + LEAST), 1.0) * opening)])


def _is_cold(profile: Array, is_usual: Scalar, noise: Scalar) -> Scalar:
    """A closing as with less resistance than in the operation before, after a rest, and such an opening or a usual one.

    In the rest of a closing `Mhe` may already know it.
    """
    closing = _is_along(profile[: len(COLDER)], COLDER, noise)
    return closing & (is_usual | _is_along(profile[PHASES:], [-x for x in WARMER[PHASES:]], noise))


def _is_along(found: Array, entries: Sequence[float], noise: Scalar) -> Scalar:
    """Whether a profile has a direction, but for noise and some more."""
    unit = vector(direction(entries))
    along = found @ unit
    return (along > 0.0) & (_square(found - along * unit) < square(ASIDE * along) + square(BESIDE * noise))


def _alarm(state: State, profile: Array, evidence: Array) -> State:
    course = state.course._replace(profile=profile, quiet=0.0, familiar=0.0)
    course = course._replace(verdict=float(Verdict.faulty), faults=course.faults + 1.0)
    return _with_evidence(state._replace(course=course), evidence, course.onset)


def _recover(state: State) -> State:
    """The device is healthy again: a closing and an opening were usual, and what is learnt, or their currents."""
    course, learnt = state.course, state.learnt
    off = learnt.values - course.sound
    is_back = (fabs(off[0]) < BACK) & (_length((off / learnt.wandering)[1:]) < SAME)
    is_learnt = (course.quiet >= 2.0) & is_back
    is_healthy = is_learnt | (course.familiar >= 2.0)

    def heal(state: State) -> State:
        course = state.course._replace(
            verdict=float(Verdict.healthy), passed=state.course.passed + 1.0, is_relearnt=flag(not_(is_learnt))
        )
        return _with_evidence(state._replace(course=course), NONE, 0.0)

    return when(is_healthy, heal, state)


# what is learnt


def _learn(state: State, inputs: Inputs, par: Parameters) -> State:
    """A window was solved."""
    state = state._replace(learnt=state.learnt._replace(solved=inputs.windows))
    is_good = (inputs.misfit < GOOD) & (inputs.windows > FIRST)
    return when(is_good, lambda state: _note(state, inputs, par), state)


def _note(state: State, inputs: Inputs, par: Parameters) -> State:
    """What a good window has taught goes into the baseline, or is compared with it (3)."""
    first = Inputs._fields.index("resistance")
    found, deviations = inputs[first : first + VALUES], inputs[first + VALUES : first + 2 * VALUES]
    values = vector([log(where(x > LEAST, x, LEAST)) for x in found])
    shares = vector([s / where(x > LEAST, x, LEAST) + LEAST for s, x in zip(deviations, found)])
    is_learning = state.course.verdict == Verdict.learning
    state = when(is_learning, lambda state: _lay(state, values, inputs, par), state)
    old, base = state.learnt, state.baseline.healthy
    is_first, begins = state.baseline.taught < 2.0, is_learning & not_(state.course.verdict == Verdict.learning)
    quick, slow = (
        where_each(begins, base, where_each(is_first, values, mean + share * (values - mean)))
        for mean, share in ((old.quick, QUICK), (old.slow, SLOW))
    )
    learnt = old._replace(values=values, wandering=WANDER * shares, quick=quick, slow=slow)
    state = state._replace(learnt=learnt)
    is_calm = (state.course.verdict == Verdict.healthy) | (state.course.verdict == Verdict.worn)
    is_lost = is_set(state.course.is_relearnt) | _has_bit(inputs.health_causes, INNOVATION)  # doubt hides wear
    return when(is_calm & not_(is_lost), lambda state: _wear_out(state, inputs.time, par), state)


def _lay(state: State, values: Array, inputs: Inputs, par: Parameters) -> State:
    """The baseline with a window more: the mean of those after which little settles."""
    old, n = state.baseline, state.baseline.taught + 1.0
    settled = n - SETTLED * par.learn_windows
    healthy = old.healthy + (values - old.healthy) / where(settled > 1.0, settled, 1.0)
    baseline = old._replace(taught=n, healthy=healthy)
    is_done = (n >= par.learn_windows) & (old.closings > 1.0) & (old.openings > 1.0)
    verdict = where(is_done, float(Verdict.healthy), float(Verdict.learning))
    return state._replace(baseline=baseline, course=state.course._replace(verdict=verdict))


def _teach(old: Baseline, means: Array, is_closing: Scalar, par: Parameters) -> Baseline:
    """The usual profile with an operation more, by Welford's method."""
    closings, openings = old.closings + flag(is_closing), old.openings + flag(not_(is_closing))
    n, before = where(is_closing, closings, openings), _half(old.usual, is_closing)
    after = before + (means - before) / n
    squares = old.squares + (means - before) @ (means - after)
    size = sqrt(squares / where(closings + openings > 2.0, closings + openings - 2.0, 1.0))
    return old._replace(
        usual=_with_half(old.usual, after, is_closing),
        closings=closings,
        openings=openings,
        squares=squares,
        usual_size=where(size < par.least_size, par.least_size, size),
    )


def _wear_out(state: State, time: Scalar, par: Parameters) -> State:
    """Learnt values that have moved too far, though no operation was strange."""
    moved = _drift(state)
    is_worn = _wear(moved) > par.limit_worn
    evidence = where_each(is_worn, _evidence(moved[1:], GRADUAL, 1.0), NONE)
    verdict = where(is_worn, float(Verdict.worn), float(Verdict.healthy))
    state = state._replace(course=state.course._replace(verdict=verdict))
    return _with_evidence(state, evidence, time)


def _drift(state: State) -> Array:
    """Learnt values since the baseline, in multiples of their usual wandering (3)."""
    return (state.learnt.values - state.baseline.healthy) / state.learnt.wandering


def _wear(moved: Array) -> Scalar:
    """Size of what has moved; the resistance does so with temperature, and eddy currents settle for longest."""
    return _length(vector([SLOWEST * moved[1], *moved[2:]]))


# causes


def _evidence(found: Array, signatures: tuple[Signature, ...], noise: Scalar) -> Array:
    """What speaks for each cause, by the distances of directions (4)."""
    length = _length(found) + LEAST
    causes: list[Scalar] = [0.0] * len(CAUSES)
    for cause, entries, spreads in signatures:
        off = found / length - vector(direction(entries))
        variances = [square(0.01 * spread) + square(HALF * noise / length) for spread in spreads]
        density = exp(-0.5 * total(x * x / v + log(v) for x, v in zip(off, variances)))
        causes[CAUSES.index(cause)] = causes[CAUSES.index(cause)] + density
    return vector(causes) / (total(causes) + UNKNOWN)


def _only(cause: str) -> Array:
    """Nothing speaks for another cause."""
    return vector([1.0 if c == cause else 0.0 for c in CAUSES])


def _with_evidence(state: State, evidence: Array, time: Scalar) -> State:
    """The causes with new evidence, and since when more than half speaks for each."""
    since = [where(new > TOLD, where(before >= 0.0, before, time), -1.0) for new, before in zip(evidence, state.since)]
    return state._replace(evidence=evidence, since=vector(since))


# profiles


def _half(profile: Array, is_closing: Scalar) -> Array:
    """That of a closing or of an opening."""
    return where_each(is_closing, profile[:PHASES], profile[PHASES:])


def _with_half(profile: Array, half: Array, is_closing: Scalar) -> Array:
    """A profile with another half."""
    closing, opening = profile[:PHASES], profile[PHASES:]
    return vector([*where_each(is_closing, half, closing), *where_each(is_closing, opening, half)])


def _square(x: Array) -> Scalar:
    return x @ x


def _length(x: Array) -> Scalar:
    return sqrt(_square(x))


# ports


def _given_baseline(par: Parameters) -> Baseline:
    """Baseline of an earlier run; none with fewer windows than make one."""
    is_whole = par.baseline_windows >= par.learn_windows
    usual, healthy = (vector([where(is_whole, x, 0.0) for x in given]) for given in (par.means, par.values))
    return Baseline(
        taught=where(is_whole, par.baseline_windows, 0.0),
        usual_size=where(is_whole, par.baseline_size, 0.0),
        usual=usual,
        healthy=healthy,
    )


def _outputs(state: State) -> Outputs:
    course, learnt, baseline, moved = state.course, state.learnt, state.baseline, _drift(state)
    lag = 1.0 / SLOW - 1.0 / QUICK  # operations
    return Outputs(
        verdict=course.verdict,
        cause=total(where(x > TOLD, float(k), 0.0) for k, x in enumerate(state.evidence, 1)),
        onset=course.onset,
        faults=course.faults,
        passed=course.passed,
        commands=course.commands,
        motions=course.motions,
        strangeness=course.size,
        wear=_wear(moved),
        evidence=Evidence(*state.evidence),
        since=Since(*state.since),
        profile=Profile(*course.profile),
        moved=Moved(*moved),
        trend=Trend(*(PER / lag * (learnt.quick - learnt.slow))),
        baseline_windows=baseline.taught,
        baseline_size=baseline.usual_size,
        kept_means=KeptMeans(*baseline.usual),
        kept_values=KeptValues(*baseline.healthy),
    )
