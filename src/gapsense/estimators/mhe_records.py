"""What `Mhe` keeps of a window and of the work on it, and how vectors and matrices lie in its memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple

from gapsense.estimators.mhe_model import Device, Point
from gapsense.estimators.mhe_parameters import Parameters
from gapsense.linalg import matrix, vector
from gapsense.records import Array, Memory, Scalar, Vector, Whole, triangle, zeros
from gapsense.trace import load, store, where

RING = 8192  # samples that are kept
N = 12  # corrections: the fields of `Device`, and the flux linkage at the start of the window
START = N - 1
USUAL, ALL = (0, 1, 2, 3, 4, 5, 6, 7, START), tuple(range(N))  # without damping, core and bend, or with them
PAIRS = triangle(N)
DERIVING, SOLVING, TRYING, RENEWING = 0.0, 1.0, 2.0, 3.0  # phases
FIXED = 1e-6  # least standard deviation of a correction
MOST, FARTHEST = 6.0, 2.0  # deviations that a correction may have, and the largest correction
GUESSED = 3.0  # the same of eddy currents and hysteresis, of which only guesses are told
AT_START = 0.004  # deviation of the flux linkage at the start of a window, in lambda_sat


class Samples(NamedTuple):
    """What was measured."""

    newest: Annotated[Scalar, Whole(0, RING - 1)]  # place of the newest sample in the memory
    voltages: Annotated[Array, Memory(RING)]
    currents: Annotated[Array, Memory(RING)]
    weights: Annotated[Array, Memory(RING)]  # w^2 of the currents; 0 where they do not count
    commands: Annotated[Array, Memory(RING)]  # 1: the command has changed


class Walk(NamedTuple):
    """A pass of the model through the window; samples are counted from its start."""

    done: Annotated[Scalar, Whole(0, RING)]
    at: Annotated[Array, Vector(10)]  # a `Point`
    mean: Scalar  # voltage of the last sampling period
    still: Scalar  # samples on a stop
    driven: Scalar  # samples with a voltage, or with more current than noise makes
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
    rejected: Scalar  # windows in a row that nothing explained
    explained: Scalar  # windows with a motion that were
    deviations: Annotated[Array, Memory(11)]


class Work(NamedTuple):
    """The window and the state of the work on it."""

    walk: Walk
    learnt: Learnt
    origin: Annotated[Array, Memory(5)]  # flux linkage, hysteresis, position, velocity, voltage at its start
    q: Annotated[Array, Memory(12)]  # corrections
    q_prior: Annotated[Array, Memory(12)]
    change: Annotated[Array, Memory(12)]  # step that is tried
    device: Annotated[Array, Memory(11)]  # `Device` of the pass
    tangents: Annotated[Array, Memory(48)]  # row by row
    normal: Annotated[Array, Memory(78)]  # H, or what is being inverted; upper triangle
    gradient: Annotated[Array, Memory(12)]
    whole: Annotated[Array, Memory(78)]  # H + Pi
    prior: Annotated[Array, Memory(78)]  # Pi
    good: Annotated[Array, Memory(12)]  # corrections after the last good window
    good_prior: Annotated[Array, Memory(78)]  # and their Pi
    phase: Scalar = DERIVING
    begins: Scalar = 2.0  # 1: a pass is to begin; 2: the very first one
    over: Scalar = 0.0  # 1: the pass is at the end of the window
    turn: Scalar = 0.0  # pivots done
    age: Annotated[Scalar, Whole(0, RING)] = 0.0  # samples since its start
    end: Annotated[Scalar, Whole(0, RING)] = 0.0  # its last sample, or 0
    least: Scalar = 1.0  # shortest length
    has_jumped: Scalar = 0.0  # 1: it began again with the resistance of a held voltage
    has_grown: Scalar = 0.0  # 1: it was made longer
    lands: Scalar = 0.0  # 1: the mover has landed in the last pass with derivatives
    tries: Scalar = 0.0
    shortenings: Scalar = 0.0
    start: Scalar = 0.0  # of the starts that is tried, from 1 on; 0: none; -1: all were, none is better
    searches: Scalar = 0.0  # among them in this window
    best: Scalar = 0.0  # of them
    least_total: Scalar = 0.0  # its cost
    total: Scalar = 0.0  # cost at q
    promised: Scalar = 0.0  # cost after a whole step, if all were linear
    follows: Scalar = 0.0  # 1: the causal estimate has the device too
    doubt: Scalar = 0.0  # 1: the causal estimate was strange since it began
    summed: Scalar = 0.0  # sum w^2 up to the last derivatives
    ready: Annotated[Scalar, Whole(0, RING)] = 0.0  # smoothed samples that are not published yet
    shown: Annotated[Scalar, Whole(0, RING - 1)] = 0.0  # place of the last one that was


def first_work(at: Point, time: Scalar, par: Parameters) -> Work:
    """The first window begins; what is known before it comes into memory with the next sample."""
    n = len(PAIRS)
    learnt = Learnt(
        takeoff_time=time,
        landing_time=time,
        impact_speed=0.0,
        bounces=0.0,
        windows=0.0,
        misfit=0.0,
        given_up=0.0,
        rejected=0.0,
        explained=0.0,
        deviations=zeros(START),
    )
    vectors = (zeros(5), zeros(N), zeros(N), zeros(N), zeros(START))
    rest = (zeros(4 * N), zeros(n), zeros(N), zeros(n), zeros(n), zeros(N), zeros(n))
    return Work(started(at, par), learnt, *vectors, *rest)


def priors(par: Parameters) -> list[Scalar]:
    """Standard deviations of the corrections before the first window; any, of those that are not learnt."""
    given = [getattr(par, f"prior_{name}") for name in Device._fields]
    known = [where(s > FIXED, s, FIXED) for s in given]
    return [s if k in USUAL else where(par.option_further > 0.0, s, 1.0) for k, s in enumerate(known)]


def bounds(par: Parameters) -> list[Scalar]:
    """How far each correction may go: what is farther off than that is another device, or a fault."""
    most = Device(*[FARTHEST] * START)._replace(eddy=GUESSED, hysteresis=GUESSED)
    return [where(MOST * s < far, MOST * s, far) for s, far in zip(priors(par), most)]


def start_deviation(par: Parameters) -> Scalar:
    """Standard deviation of the flux linkage at the start of a window."""
    return AT_START * par.core_saturation


def published(deviations: Sequence[Scalar], par: Parameters) -> list[Scalar]:
    """As outputs: what is not learnt has none."""
    return [s if k in USUAL else where(par.option_further > 0.0, s, 0.0) for k, s in enumerate(deviations)]


def origin_of(at: Point) -> Array:
    """The numbers with which a window begins at a point."""
    return vector([at.flux_linkage, at.hysteresis, at.position, at.velocity, at.voltage])


def started(at: Point, par: Parameters) -> Walk:
    """A pass that begins at a point."""
    is_on_stop = (at.position <= par.stop_lower) | (at.position >= par.stop_upper)
    still = where(is_on_stop, 1.0, 0.0)
    return Walk(
        done=0.0,
        at=vector(at),
        mean=at.voltage,
        still=still,
        driven=0.0,
        cost=0.0,
        counted=0.0,
        pending=0.0,
        residuals=0.0,
        takeoff=-1.0,
        landing=0.0,
        speed=0.0,
        landings=0.0,
    )


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
