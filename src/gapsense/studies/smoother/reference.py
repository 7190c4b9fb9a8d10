"""Reference states and process noise of the reduced model, [RTS] Sections IV-A and IV-C.

What the estimator's states would have to be for its model to give the samples of a simulated or measured cycle, and
what is then left of its transition from sample to sample.  For one model or for many at once, with wrong parameters.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from gapsense.estimators.reduced_model import Held, Model, current, gap_law, transition
from gapsense.estimators.rts import Floats
from gapsense.linalg import vector
from gapsense.records import Array, Scalar, Vector
from gapsense.studies.smoother.batch import Code, Variant, Varied, compiled, varied_model

BLOCK = 100  # runs at once: the arrays (runs, N) then stay in the cache


class Reference(NamedTuple):
    """States (47) of all samples: (N,), and the two errors (runs, N)."""

    position: Floats
    position_prev: Floats
    flux_linkage: Floats
    current_error: Floats
    force_error: Floats


def reference_states(samples: Any, varied: Varied, m: Model) -> Reference:
    """States of the reduced model that give the samples, (47).

    The current error is i - f_i*(z, lambda, 0) (47c); the force error is what the position of the next sample needs,
    m (z_next - f_z*(z, z_prev, lambda, 0, q)) / T_s^2 (47d), so that the position has no process noise.
    The samples, of SI units, are at multiples of T_s, and the mover rests at both ends of them.
    """
    z = (samples.position - m.z_min) / m.l_z
    before, after = np.append(z[0], z[:-1]), np.append(z[1:], z[-1])
    at = [z, before, after, samples.flux_linkage, samples.voltage, samples.current, samples.mode]
    e_i, e_F = _over_runs(_error_code(m), at, varied)
    return Reference(z, before, samples.flux_linkage, e_i, e_F)


def process_noise(samples: Any, varied: Varied, m: Model) -> Floats:
    """Diagonal (5,) of Q: mean of w^2 over runs and the whole cycle, contacts included, (59)-(60).

    The states are those of each run's own model, so that the positions have no noise; that of e_F is in (N m)^2.
    """
    count, total = np.atleast_1d(varied.m).size, np.zeros(5)
    for k in range(0, count, BLOCK):
        block = Varied(*(np.atleast_1d(value)[k : k + BLOCK] for value in varied))
        total += (transition_errors(samples, block, m) ** 2).sum(axis=(1, 2))
    return np.asarray(total / (count * (samples.time.size - 1)))


def transition_errors(samples: Any, varied: Varied, m: Model) -> Floats:
    """w_k = x_(k+1) - f(x_k, u_k) (59) of all states, runs and samples: (5, runs, N - 1)."""
    x = reference_states(samples, varied, m)
    now, held = [a[..., :-1] for a in x], (samples.voltage[:-1], samples.mode[:-1])
    with np.errstate(all="ignore"):
        predicted = _transition_code(m)(now, held, [np.atleast_1d(value)[:, None] for value in varied])
    return np.stack([a[..., 1:] - f for a, f in zip(np.broadcast_arrays(*x), predicted)])


def _over_runs(code: Code, at: list[Floats], varied: Varied) -> list[Floats]:
    """Results (runs, N) of generated code: the runs as a column beside the row of the samples."""
    columns = [np.atleast_1d(value)[:, None] for value in varied]
    blocks = [[value[k : k + BLOCK] for value in columns] for k in range(0, len(columns[0]), BLOCK)]
    with np.errstate(all="ignore"):
        return [np.concatenate(parts) for parts in zip(*(code(at, block) for block in blocks))]


class _At(NamedTuple):
    """A sample, its neighbours' positions and the inputs."""

    z: Scalar
    z_prev: Scalar
    z_next: Scalar
    lam: Scalar
    voltage: Scalar
    current: Scalar
    mode: Scalar


class _Errors(NamedTuple):
    current: Scalar
    force: Scalar


class _Input(NamedTuple):
    """u_k (21)."""

    voltage: Scalar
    mode: Scalar


class _State(NamedTuple):
    x: Annotated[Array, Vector(5)]


@cache
def _error_code(m: Model) -> Code:
    def errors(at: _At, varied: Varied) -> _Errors:
        model = varied_model(m, varied, Variant())
        x = vector([at.z, at.z_prev, at.lam, 0.0, 0.0])
        predicted = transition(x, Held(at.voltage, at.mode), model)[0]
        e_i = at.current - current(gap_law(at.z, model)[0], at.lam, 0.0, model)
        return _Errors(e_i, model.m * (at.z_next - predicted) / (model.T_s * model.T_s))

    return compiled(errors, at=_At, varied=Varied)


@cache
def _transition_code(m: Model) -> Code:
    def predicted(now: _State, held: _Input, varied: Varied) -> _State:
        return _State(transition(now.x, Held(*held), varied_model(m, varied, Variant())))

    return compiled(predicted, now=_State, held=_Input, varied=Varied)
