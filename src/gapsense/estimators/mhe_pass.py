"""A pass of the model of `Mhe` through the samples of a window: currents, events, derivatives, normal equations."""

from __future__ import annotations

from gapsense.estimators.mhe_model import (
    Device,
    Model,
    Point,
    advance,
    corrected,
    current,
    derived,
    mean_of,
    point,
    with_device,
)
from gapsense.estimators.mhe_parameters import Parameters
from gapsense.estimators.mhe_records import (
    ALL,
    DERIVING,
    PAIRS,
    START,
    TRYING,
    USUAL,
    N,
    Samples,
    Walk,
    Work,
    get,
    get_matrix,
    place,
    put,
    put_matrix,
    started,
)
from gapsense.linalg import matrix, outer, vector
from gapsense.records import Array, Scalar
from gapsense.trace import clip, cond, fabs, floor, load, loop, not_, store, where

PACE = 7  # samples of a trial that are a piece of work
FASTEST = 64  # pieces in a step, at most
FAST = 16.0  # the same where the sample time says how many
AT_ONCE, SPAN = 4, 80e-6  # samples that derivatives and sums take at once, at most, and their time [s]
USUAL_TIME = 20e-6  # sample time at which one piece in a step suffices [s]
JUMP = 6.0 * 2.0**0.5  # noises of a voltage's change that are no edge
LARGE = 20.0  # noises that a current must have to say anything of the coil
Smoothed = tuple[Array, Array]  # memory of the flux linkages and positions of a trial


def begun(work: Work, m: Model, par: Parameters) -> Work:
    """A pass begins; `m` is the model of what is believed before the first window."""
    is_trying = work.phase == TRYING
    q = vector([a + where(is_trying, b, 0.0) for a, b in zip(get(work.q, N), get(work.change, N))])
    d = corrected(m.d, q[:START])
    lam, h, z, v, u = get(work.origin, 5)
    at = point(lam + q[START], h, z, v, u, with_device(m, d))
    work = work._replace(begins=0.0, device=put(work.device, d), follows=0.0, walk=started(at, par), summed=0.0)
    return cond(is_trying, lambda: work, lambda: _cleared(work))


def _cleared(work: Work) -> Work:
    """No sums; the derivatives at the start of the window."""
    return work._replace(
        tangents=put(work.tangents, [1.0 if k == 4 * START else 0.0 for k in range(4 * N)]),
        normal=put(work.normal, [0.0] * len(PAIRS)),
        gradient=put(work.gradient, [0.0] * N),
    )


def walked(work: Work, samples: Samples, smoothed: Smoothed, m: Model, par: Parameters) -> tuple[Work, Smoothed]:
    """Some samples more of a pass: with derivatives where they are due, or into the memory of smoothed samples."""
    m, pieces = with_device(m, Device(*get(work.device, START))), pace(par)

    def one(work: Work, smoothed: Smoothed, n: Scalar) -> tuple[tuple[Work, Smoothed, Scalar], Scalar]:
        work, smoothed = cond(
            work.phase == DERIVING,
            lambda: _followed(work, samples, smoothed, m, par),
            lambda: _tried(work, samples, smoothed, m, par),
        )
        is_enough = (work.over > 0.0) | (work.walk.done >= work.age) | (n >= pieces)
        return (work, smoothed, n + 1.0), is_enough

    work, smoothed, _ = loop(FASTEST, one, (work, smoothed, 1.0))
    return work, smoothed


def pace(par: Parameters) -> Scalar:
    """Pieces of a pass that a step may take: a step that comes later has more time."""
    by_time = clip(floor(par.sample_time / USUAL_TIME + 0.5), 1.0, FAST)
    return where(par.window_pace > 0.0, par.window_pace, by_time)


def _followed(work: Work, samples: Samples, smoothed: Smoothed, m: Model, par: Parameters) -> tuple[Work, Smoothed]:
    """Samples of a pass with derivatives; the first such pass finds the end of the window."""
    is_open = work.end <= 0.0
    limit = where(is_open | (work.age < work.end), work.age, work.end)
    tail, longest = par.window_tail / par.sample_time, par.window_longest / par.sample_time

    def is_over(walk: Walk) -> Scalar:
        by_landing = (walk.takeoff >= 0.0) & (walk.still >= tail)
        spot = place(samples.newest, work.age - walk.done)
        by_voltage = (walk.driven == 1.0) & (walk.takeoff < 0.0) & (walk.done > 0.5 * longest)  # after a rest
        ends = cond(
            par.option_command > 0.0, lambda: load(samples.commands, spot) > 0.0, lambda: by_landing | by_voltage
        )
        return (ends & (walk.done >= work.least)) | (walk.done >= longest)

    def one(walk: Walk, smoothed: Smoothed) -> tuple[tuple[Walk, Smoothed], Scalar]:
        new, weighted = _visited(walk, work, samples, m, par)
        new = new._replace(pending=walk.pending + 1.0, residuals=walk.residuals + weighted)
        kept = remembered(smoothed, new, work, samples)
        return (new, kept), (new.done >= limit) | _is_full(new, par) | cond(
            is_open, lambda: is_over(new), lambda: False
        )

    walk, smoothed = loop(AT_ONCE, one, (work.walk, smoothed))
    ends = cond(is_open, lambda: is_over(walk), lambda: walk.done >= work.end)
    new = work._replace(walk=walk, over=where(ends, 1.0, 0.0))
    return cond(_is_full(walk, par), lambda: _summed(new, m, par), lambda: new), smoothed


def _is_full(walk: Walk, par: Parameters) -> Scalar:
    """Whether derivatives are due: after some samples, and at a landing."""
    return (walk.still == 1.0) | (walk.pending >= clip(floor(SPAN / par.sample_time + 0.5), 1.0, float(AT_ONCE)))


def _tried(work: Work, samples: Samples, smoothed: Smoothed, m: Model, par: Parameters) -> tuple[Work, Smoothed]:
    """Samples of a trial."""
    limit = where(work.age < work.end, work.age, work.end)

    def one(walk: Walk, smoothed: Smoothed) -> tuple[tuple[Walk, Smoothed], Scalar]:
        new, _ = _visited(walk, work, samples, m, par)
        return (new, remembered(smoothed, new, work, samples)), new.done >= limit

    walk, smoothed = loop(PACE, one, (work.walk, smoothed))
    return work._replace(walk=walk, over=where(walk.done >= work.end, 1.0, 0.0)), smoothed


def _visited(walk: Walk, work: Work, samples: Samples, m: Model, par: Parameters) -> tuple[Walk, Scalar]:
    """The next sample, and w^2 r of it."""
    before, spot = Point(*walk.at), place(samples.newest, work.age - walk.done - 1.0)
    u, i, w = (load(memory, spot) for memory in (samples.voltages, samples.currents, samples.weights))
    at, mean = advance(before, u, m), mean_of(before.voltage, u, m)
    i_model = current(at, mean, m)
    r = i - i_model
    is_on_stop = (at.position <= m.lower) | (at.position >= m.upper)
    new = walk._replace(
        done=walk.done + 1.0,
        at=vector(at),
        mean=mean,
        still=where(is_on_stop, walk.still + 1.0, 0.0),
        driven=walk.driven + where(drives(u, par) | (fabs(i_model) > LARGE * par.noise_current), 1.0, 0.0),
        cost=walk.cost + w * r * r,
        counted=walk.counted + w,
    )
    is_plain = (new.still > 1.0) | (new.still + walk.still < 1.0)
    return cond(is_plain, lambda: new, lambda: _event(walk, new, before, m)), w * r


def drives(u: Scalar, par: Parameters) -> Scalar:
    """Whether a voltage, or a change of it, is more than what noise and a controller at rest make."""
    return fabs(u) > par.edge + JUMP * par.noise_voltage


def is_idle(walk: Walk) -> Scalar:
    """Neither voltage nor motion: the noise of the voltage would be all that such a window learns from."""
    return (walk.driven < 2.0) & not_(has_moved(walk))


def has_moved(walk: Walk) -> Scalar:
    """Whether there is a motion, or a part of one."""
    return (walk.takeoff >= 0.0) | has_landed(walk) | (walk.still < 1.0)


def has_landed(walk: Walk) -> Scalar:
    """Whether there is a landing."""
    return walk.landings > 0.0


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
        return tangents, put_matrix(work.normal, get_matrix(work.normal, which) + outer(weight * J, J), which), gradient

    tangents, normal, gradient = cond(par.option_further > 0.0, lambda: summed(ALL), lambda: summed(USUAL))
    walk = walk._replace(pending=0.0, residuals=0.0)
    return work._replace(walk=walk, summed=walk.counted, tangents=tangents, normal=normal, gradient=gradient)


def remembered(smoothed: Smoothed, walk: Walk, work: Work, samples: Samples) -> Smoothed:
    """The memory with the sample that a pass has come to."""
    (fluxes, positions), spot = smoothed, place(samples.newest, work.age - walk.done)
    return store(fluxes, spot, walk.at[0]), store(positions, spot, walk.at[2])
