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

from gapsense._os.workers import Progress
from gapsense.estimators.reduced_model import POSITION, POSITION_PREV, Held, Model, is_moving, observation, transition
from gapsense.estimators.rts import Floats
from gapsense.kernels.derivative import linearise

from .cycle import Samples, reference, sampled
from .models import nominal, unvaried
from .reference import reference_states

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
        for count, window in enumerate(windows(i, states, voltage, mode, m, scale), 1):
            if rank(window.matrix, tolerance) == STATES:
                return count
            if not np.vstack(window).any(axis=0).all():
                break
        return math.inf

    return np.array([needed(i) for i in range(mode.size)])
