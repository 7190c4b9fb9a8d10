"""Observability of the reduced model along a cycle, [RTS] Section IV-B: how many samples tell all of its state.

The outputs from sample i on, as functions of the state at i, have the Jacobian (50).  Its rows are H_k F_(k-1) ... F_i,
with H of the current (28) and on a stop also of the position; the past position counts as measured where the mover
rested the sample before (48).  Without noise the model follows from the state at i alone (49).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense._os.workers import Progress
from gapsense.actuators.motion import MOVING
from gapsense.estimators.reduced_model import POSITION, POSITION_PREV, Held, Model, is_moving, observation, transition
from gapsense.kernels.derivative import linearise
from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, stack
from gapsense.report.table import table

from .cycle import Samples, reference, sampled
from .reference import reference_states
from .rts import Floats
from .setting import nominal, unvaried

TOLERANCE = 1e-12
OTHERS = (1e-9, 1e-10, 1e-11, 1e-13, 1e-14)  # tolerances to compare with
STATES = 5


class Scales(NamedTuple):
    """What counts as one."""

    state: Floats  # (5,)
    current: float  # [A]


class Window(NamedTuple):
    """The outputs of samples i .. j, derived by the state at i."""

    matrix: Floats  # (rows, 5), scaled (50)
    transition: Floats  # (5, 5), scaled: what later rows are made of


class Observed(NamedTuple):
    """Samples of a cycle and how many each needs, by tolerance."""

    samples: Samples
    needed: dict[float, Floats]  # (N,) each


def along_reference_cycle(
    tolerances: tuple[float, ...] = (TOLERANCE, *OTHERS), progress: Progress = lambda done, total: None
) -> Observed:
    """The count (51) for every sample of the cycle of Fig. 5, with the reduced model of Table II."""
    m = nominal()
    full = sampled(reference(), m.T_s)
    x = reference_states(full, unvaried(m), m)
    states = np.column_stack([x.position, x.position_prev, x.flux_linkage, x.current_error[0], x.force_error[0]])
    s = Samples(*(column[:-1] for column in full))  # the last sample is the first of the next period
    found = {}
    for k, t in enumerate(tolerances):
        progress(k, len(tolerances))
        found[t] = samples_needed(states[:-1], s.current, s.voltage, s.mode, m, t)
    return Observed(s, found)


def scales(states: Floats, current: Floats) -> Scales:
    """Largest values along the cycle, for states (N, 5) and current (N,); 1 for what is zero all along."""
    largest = np.abs(states).max(axis=0)
    return Scales(np.where(largest > 0.0, largest, 1.0), float(np.abs(current).max()))


def windows(i: int, states: Floats, voltage: Floats, mode: Floats, m: Model, scale: Scales) -> Iterator[Window]:
    """The windows of samples that begin with `i`, one sample longer each; the cycle repeats."""
    x, F = states[i].tolist(), np.eye(STATES)
    rows = [] if is_moving(mode[i - 1]) else [np.eye(STATES)[POSITION_PREV]]  # (48)
    for k in range(i, i + mode.size):
        q, u = float(mode[k % mode.size]), float(voltage[k % mode.size])
        _, H = linearise(observation, x, m)
        rows.append(np.array(H, float)[0] * scale.state / scale.current @ F)
        if not is_moving(q):
            rows.append(F[POSITION])
        x, F_k = linearise(transition, x, Held(u, q), m)
        F = np.array(F_k, float) * scale.state / scale.state[:, None] @ F
        yield Window(np.array(rows), F)


def rank(matrix: Floats, tolerance: float = TOLERANCE) -> int:
    """Number of singular values above `tolerance` times the largest one."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > tolerance * values[0]))


def samples_needed(
    states: Floats, current: Floats, voltage: Floats, mode: Floats, m: Model, tolerance: float = TOLERANCE
) -> Floats:
    """Number of consecutive samples that make the state observable (51), for each sample; infinite where none do.

    Parameters
    ----------
    states : (N, 5) array
        Reference states (47), normalised.
    current, voltage, mode : (N,) array
        Samples of one period, of which the last is followed by the first.
    m : Model
        The reduced model.
    tolerance : float
        See `rank`.  It depends on the scaling, here by the largest values along the cycle.

    Notes
    -----
    A state is unobservable for good once a component of it changes neither an output so far nor the state now: then no
    later output depends on it.
    """
    scale = scales(states, current)

    def needed(i: int) -> float:
        """Samples until the states are observable; infinite if they never are."""
        for count, window in enumerate(windows(i, states, voltage, mode, m, scale), 1):
            if rank(window.matrix, tolerance) == STATES:
                return count
            if not np.vstack(window).any(axis=0).all():
                break
        return math.inf

    return np.array([needed(i) for i in range(mode.size)])


NEVER = 7.0  # where "infinite" is drawn
PUBLISHED = {2.0: "at rest", 5.0: "moving", np.inf: "the first sample after each landing"}


def counts(observed: Observed, tolerance: float = TOLERANCE) -> list[Table | str]:
    """How often each count comes, at rest and in motion, and what depends on the tolerance."""
    s, needed = observed.samples, observed.needed[tolerance]
    is_moving = s.mode == MOVING
    rows = []
    for count in np.unique(needed):
        times = (str(int(((needed == count) & chosen).sum())) for chosen in (~is_moving, is_moving))
        shown = "never" if np.isinf(count) else f"{count:g}"
        rows.append([shown, PUBLISHED.get(count, "in transitions"), *times])
    title = (
        "Samples that make the state observable (51); states and current scaled by their largest values in the cycle,\n"
        f"singular values above {tolerance:g} of the largest one count."
    )
    never = ", ".join(f"{1e3 * t:g} ms" for t in s.time[np.isinf(needed)])
    others = (
        f"tolerance {t:g}: {np.sum(other != needed)} of {needed.size} counts differ, "
        f"largest {other[np.isfinite(other)].max():g}"
        for t, other in observed.needed.items()
    )
    found = table(title, ["samples needed", "[RTS]", "at rest", "moving"], rows, texts=2)
    return [found, f"never observable: t = {never}\n", *others]


def figure(observed: Observed, tolerance: float = TOLERANCE) -> Figure:
    """Position and count over the reference cycle."""
    s, needed = observed.samples, observed.needed[tolerance]
    drawn, (position, count) = stack(
        "Observability along the reference cycle, as in Fig. 6 of [RTS]", ["position / mm", "samples needed"], [1, 2]
    )
    drawn.set_size_inches(9.0, 5.0)
    line(position, s.time, 1e3 * s.position, TRUE)
    is_never = np.isinf(needed)
    count.plot(1e3 * s.time[~is_never], needed[~is_never], ".", color=FIRST, markersize=4, label="observable")
    count.plot(1e3 * s.time[is_never], np.full(is_never.sum(), NEVER), "x", color=SECOND, label="never")
    count.set_yticks([1, 2, 3, 4, 5, NEVER], ["1", "2", "3", "4", "5", "never"])
    count.set_ylim(0.5, NEVER + 0.5)
    legend(count)
    return drawn
