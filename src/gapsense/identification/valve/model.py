"""The solenoid valve as the model to be fitted, and the cost of [UKF] (24)-(25)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.flux import Flux, estimate, trapezoid
from gapsense.identification.measurements.operations import Operation, hidden, noise, operations
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.valve.device import Device, kernel_of, seen
from gapsense.identification.valve.form import Form
from gapsense.kernels.layout import flat

JUMP = 0.1  # within an interval, relative to the range of the voltage
EXACT = 1e-3  # of the largest current: the model is no better, whatever the noise
CURRENT_WEIGHT, FLUX_WEIGHT = 10.0, 1.0  # (25)


class Trajectory(NamedTuple):
    """What the model does, at the samples of a record."""

    current: Vector  # i* [A]
    flux_linkage: Vector  # lambda* [Wb]
    position: Vector  # [m]


class Response(NamedTuple):
    """As much of it as is fitted."""

    current: Vector
    position: Vector | None = None


class Experiment(NamedTuple):
    """A record prepared for the fit: from its first operation on."""

    dt: float  # sampling period [s]
    halves: Vector  # voltage during the two halves of the interval before each sample (n, 2) [V]
    resistance: Vector  # of the interval before each sample [Ohm]
    current: Vector  # measured [A]
    flux_linkage: Vector  # integrated from measurements [Wb]
    operations: list[Operation]  # complete ones, which have a resistance of their own
    position: Vector | None = None  # measured [m], where it is fitted
    amperes: float = 0.0  # of its residual: noise of the current over that of the position [A/m]

    @property
    def size(self) -> int:
        """Number of its weighted residuals."""
        return self.current.size * (2 if self.position is None else 3)

    def weights(self) -> tuple[float, float]:
        """Square roots of c_i and c_lambda, (25)."""
        largest = np.abs(self.current).max(), np.abs(self.flux_linkage).max()
        return float(np.sqrt(CURRENT_WEIGHT) / largest[0]), float(np.sqrt(FLUX_WEIGHT) / largest[1])


def prepare(record: Record, period: float | None = None) -> tuple[Experiment, Flux]:
    """Experiment of a record, and the resistances and the flux linkage that it rests on."""
    flux = estimate(record, operations(record, period))
    first = flux.operations[0].start
    shifted = [Operation(a - first, b - first) for a, b in flux.operations]
    signals = (record.halves, flux.per_sample, record.current, flux.flux_linkage)
    halves, resistance, current, flux_linkage = (samples[first:] for samples in signals)
    made = Experiment(
        dt=record.dt,
        halves=halves,
        resistance=resistance,
        current=current,
        flux_linkage=flux_linkage,
        operations=shifted,
    )
    return _with_position(made, record, first), flux


def _with_position(experiment: Experiment, record: Record, first: int) -> Experiment:
    """The experiment with the position, if it is to be fitted: as certain as the current, each by its noise."""
    if record.position is None or record.position_noise is None:
        return experiment
    i = record.current
    least = max(noise(i), hidden(i), EXACT * float(np.abs(i).max()))
    return experiment._replace(position=record.position[first:], amperes=least / record.position_noise)


def part(experiment: Experiment, operation: Operation) -> Experiment:
    """One operation."""
    cut, (first, last) = slice(operation.start, operation.stop + 1), operation
    names = ("halves", "resistance", "current", "flux_linkage")
    signals = {name: getattr(experiment, name)[cut] for name in names}
    signals["position"] = None if experiment.position is None else experiment.position[cut]
    return experiment._replace(**signals, operations=[Operation(0, last - first)])


def shortened(experiment: Experiment) -> Experiment:
    """The first operation."""
    return part(experiment, experiment.operations[0])


def charge(experiment: Experiment) -> float:
    """Sum of the current over all complete operations, the divisor of (23) [A]."""
    means = trapezoid(experiment.current)
    return float(sum(means[operation.inside].sum() for operation in experiment.operations))


def mean_resistance(experiment: Experiment) -> float:
    """Resistance of all complete operations together, weighted by their charge as in (23) [Ohm]."""
    voltages = experiment.resistance * trapezoid(experiment.current)
    total = sum(voltages[operation.inside].sum() for operation in experiment.operations)
    return float(total / charge(experiment))


def pooled_resistance(experiments: Sequence[Experiment]) -> float:
    """Resistance of several experiments together, likewise [Ohm]."""
    return float(np.average([mean_resistance(e) for e in experiments], weights=[charge(e) for e in experiments]))


def simulate(par: Device, halves: Vector, dt: float, resistance: Vector) -> Trajectory:
    """The model from rest on, at each sample; the resistance is that of the interval before it.

    Where the voltage jumps within an interval, its halves are two steps: in saturation the flux follows so fast that
    the mean voltage alone would bias the parameters by up to 2 % at 50 us.
    """
    kernel, voltages, resistances = kernel_of(par), halves.mean(axis=1).tolist(), resistance.tolist()
    step, look = kernel.scalar["step"], seen(kernel)
    is_jump = jumps(halves)
    constants = flat(par)[1:]  # the resistance is the first
    state, outputs = kernel.scalar["initial"]((0.0, 0.0, 0.0), (resistances[0], *constants))
    rows = [look(outputs)]
    for k in range(1, len(voltages)):
        constant = (resistances[k], *constants)
        if is_jump[k]:
            for v in halves[k].tolist():
                state, outputs = step(state, (k * dt, 0.5 * dt, v), constant)
        else:
            state, outputs = step(state, (k * dt, dt, voltages[k]), constant)
        rows.append(look(outputs))
    return Trajectory(*np.array(rows).T)


def jumps(halves: Vector) -> npt.NDArray[np.bool_]:
    """Whether the voltage jumps within each interval."""
    return np.asarray(np.abs(halves[:, 1] - halves[:, 0]) > JUMP * np.ptp(halves))


def simulated(par: Device, experiment: Experiment) -> Trajectory:
    """The model from the first operation of a record on."""
    return simulate(par, experiment.halves, experiment.dt, experiment.resistance)


def residuals(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Vector:
    """Weighted residuals, current and flux linkage of each experiment; their squares add up to the cost J."""
    par = form.at(ratios)
    return np.concatenate([weighted(e, simulated(par, e)) for e in experiments])


def weighted(experiment: Experiment, model: Response | Trajectory) -> Vector:
    """The residuals of an experiment, of current, flux linkage and, where it is fitted, position."""
    c_i, c_lam = experiment.weights()
    flux_linkage = integrated(experiment, model.current)  # as the measured one, or the sampling would bias the fit
    parts = [c_i * (experiment.current - model.current), c_lam * (experiment.flux_linkage - flux_linkage)]
    if experiment.position is not None and model.position is not None:
        parts.append(c_i * experiment.amperes * (experiment.position - model.position))
    return np.concatenate(parts)


def balanced(form: Form, ratios: Vector, experiment: Experiment, current: Vector | None = None) -> Experiment:
    """The experiment with resistances for which model and measurement have the same charge in every operation.

    The model obeys sum(v) = R integral(i*) over a period, so that this is (23) without the error of the trapezoids:
    0.02 % of R for a valve sampled every 50 us, which would bias the other parameters by more than noise does.
    """
    modelled = simulated(form.at(ratios), experiment).current if current is None else current
    charges = [trapezoid(i) for i in (modelled, experiment.current)]
    scaled = with_resistance(experiment, experiment.resistance * form.factor(ratios))
    return with_factors(
        scaled, [charges[0][o.inside].sum() / charges[1][o.inside].sum() for o in experiment.operations]
    )


def with_factors(experiment: Experiment, factors: Sequence[float]) -> Experiment:
    """The experiment with the resistance of each operation multiplied by a factor."""
    R = experiment.resistance.copy()
    for operation, factor in zip(experiment.operations, factors):
        R[operation.inside] *= factor
    R[:1] = R[1]
    R[experiment.operations[-1].stop :] = R[experiment.operations[-1].stop]
    return with_resistance(experiment, R)


def with_resistance(experiment: Experiment, R: Vector) -> Experiment:
    """The experiment with other resistances, and the flux linkage that follows from them."""
    changed = experiment._replace(resistance=R)
    return changed._replace(flux_linkage=integrated(changed, experiment.current))


def integrated(experiment: Experiment, current: Vector) -> Vector:
    """Flux linkage of a current by (21), from rest on [Wb]."""
    rates = experiment.halves.mean(axis=1) - experiment.resistance * trapezoid(current)
    rates[0] = 0.0
    return np.asarray(experiment.dt * np.cumsum(rates))


def cost(residual: Vector) -> float:
    """J of (24), over all experiments."""
    return float(residual @ residual)
