"""The solenoid valve as the model to be fitted, the records prepared for it, and the cost of [UKF] (24)-(25)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.actuators import solenoid_valve
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.causes import BESIDE, PLACE, Signals, apply_causes, edges, is_place, of_record
from gapsense.identification.least_squares import Matrix, finite
from gapsense.identification.measurements.low_pass import Filtered, LowPass, weights
from gapsense.identification.measurements.operations import Flux, Operation, coil, estimate, operations, trapezoid
from gapsense.identification.measurements.record import (
    Record,
    Vector,
    place_jumps,
    read_each,
    seen_ends,
    with_convention,
)
from gapsense.identification.measurements.signals import hidden, noise
from gapsense.identification.measurements.switching import Carrier, carrier, rises
from gapsense.identification.valve import lossy_valve
from gapsense.identification.valve.form import FACTOR, FILTER, Device, Form, replace_values
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Plan
from gapsense.kernels.lanes.kernels import Sample, columns_of, plan_steps
from gapsense.kernels.layout import flat
from gapsense.problems import InputError
from gapsense.report.table import quantity

JUMP = 0.1  # of the voltage, relative to its range
STEEP = 0.03  # the same, of its two halves, from which an interval takes two steps
WITHIN = 0.01  # the same of an edge that lies within an interval
SHORTEST = 0.02  # part of an interval that a step takes
EXACT = 1e-3  # of the largest current: the model is no better, whatever the noise
EARLY = {"end": -0.5, "start": 0.5}  # where an edge then lies, from the middle between two samples
ALIKE = 0.1  # samples between the places of edges that are no more than a delay
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


KERNELS = {module.Parameters: Kernel(module) for module in (solenoid_valve, lossy_valve)}  # by parameters
LOOKS = {par: itemgetter(*map(k.module.Outputs._fields.index, Trajectory._fields)) for par, k in KERNELS.items()}


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
    first: int = 0  # sample of the record with which it begins
    filtered: Filtered | None = None  # low-pass of both channels: what is measured of the model comes through it

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
    first = max(flux.operations[0].start - BESIDE, 0)  # earlier, since its edge may lie so
    shifted = [Operation(o.start - first, o.stop - first, o.held) for o in flux.operations]
    signals = (record.halves - flux.warmed[:, None], flux.per_sample, record.current, flux.flux_linkage)
    halves, resistance, current, flux_linkage = (samples[first:] for samples in signals)
    made = Experiment(
        dt=record.dt,
        halves=halves,
        resistance=resistance,
        current=current,
        flux_linkage=flux_linkage,
        operations=shifted,
        first=first,
        filtered=record.filtered,
    )
    made = with_resistance(made, resistance)  # with the flux linkage of its first samples
    if record.position is None or record.position_noise is None:
        return made, flux
    i = record.current  # the position is as certain as the current, each by its noise
    least = max(noise(i), hidden(i), EXACT * float(np.abs(i).max()))
    return made._replace(position=record.position[first:], amperes=least / record.position_noise), flux


def part(experiment: Experiment, operation: Operation) -> Experiment:
    """One operation."""
    names = ("halves", "resistance", "current", "flux_linkage", *["position"] * (experiment.position is not None))
    signals = {name: getattr(experiment, name)[operation.start : operation.stop + 1] for name in names}
    inside = [Operation(0, operation.stop - operation.start, operation.held)]
    return experiment._replace(**signals, operations=inside, first=experiment.first + operation.start)


def first_operation(experiment: Experiment) -> Experiment:
    """The first operation, from where the experiment begins."""
    return part(experiment, experiment.operations[0]._replace(start=0))


def charge(experiment: Experiment) -> float:
    """Sum of the current over all complete operations, the divisor of (23) [A]."""
    means = trapezoid(experiment.current)
    return float(sum(means[operation.balanced].sum() for operation in experiment.operations))


def mean_resistance(experiment: Experiment) -> float:
    """Resistance of all complete operations together, weighted by their charge as in (23) [Ohm]."""
    voltages = experiment.resistance * trapezoid(experiment.current)
    total = sum(voltages[operation.balanced].sum() for operation in experiment.operations)
    return float(total / charge(experiment))


def pooled_resistance(experiments: Sequence[Experiment]) -> float:
    """Resistance of several experiments together, likewise [Ohm]."""
    return float(np.average([mean_resistance(e) for e in experiments], weights=[charge(e) for e in experiments]))


def simulate(
    par: Device, halves: Vector, dt: float, resistance: Vector, filtered: Filtered | None = None
) -> Trajectory:
    """The model from rest on, at each sample; the resistance is that of the interval before it.

    Its current is that behind the low-pass of both channels, and that of the current alone, if there are any, without
    their mean delays.

    Where the voltage jumps within an interval, that is two steps: in saturation the flux follows so fast that
    the mean voltage alone would bias the parameters by up to 2 % at 50 us.
    """
    if filters := filters_of(par, dt, filtered):
        model = simulate(without_filter(par), _single(halves), 0.5 * dt, resistance.repeat(2))
        return Trajectory(behind(filters, model.current), model.flux_linkage[1::2], model.position[1::2])
    kernel, resistances = KERNELS[type(par)], resistance.tolist()
    step, look = kernel.scalar["step"], LOOKS[type(par)]
    course = follow(halves)
    constants = flat(par)[1:]  # the resistance is the first
    state, outputs = kernel.scalar["initial"]((0.0, 0.0, 0.0), (resistances[0], *constants))
    rows, voltages = [look(outputs)], course.mean.tolist()
    for k in range(1, len(voltages)):
        constant = (resistances[k], *constants)
        if course.is_jump[k]:
            for part, v in zip(course.parts[k].tolist(), course.voltages[k].tolist()):
                state, outputs = step(state, (k * dt, part * dt, v), constant)
        else:
            state, outputs = step(state, (k * dt, dt, voltages[k]), constant)
        rows.append(look(outputs))
    found = Trajectory(*np.array(rows).T)
    return found._replace(current=found.current + at_edges([par], course, resistance)[0])


class Course(NamedTuple):
    """Of the voltage, as a model steps through it."""

    is_jump: npt.NDArray[np.bool_]  # whether it jumps within each interval, which takes two steps then (n,)
    mean: Vector  # of each interval (n,) [V]
    parts: Vector  # two steps for each interval (n, 2)
    voltages: Vector  # during them (n, 2) [V]
    late: Vector  # by which it is higher just after each sample at an edge (n,) [V]


def follow(halves: Vector) -> Course:
    """The course of a voltage.

    Each interval is split at its middle, or where a jump from the level before it to that after it must be.
    """
    v, mean = np.pad(halves.reshape(-1), 2, mode="edge"), halves.mean(axis=1)
    before, after = v[1:-3:2], v[4::2]
    within, most = np.abs(halves[:, 1] - halves[:, 0]), np.ptp(halves)
    part, is_one = place_jumps((v[:-4:2], before), mean, (after, v[5::2]))
    is_one &= np.minimum(np.abs(halves[:, 0] - before), np.abs(halves[:, 1] - after)) < JUMP * np.abs(after - before)
    part = np.where(is_one, np.clip(part, SHORTEST, 1.0 - SHORTEST), 0.5)
    first = np.where(is_one, before, halves[:, 0])
    second, is_jump = (mean - part * first) / (1.0 - part), within > STEEP * most
    at = np.where(is_one, after, 0.5 * (halves[:, 1] + after))  # the samples: a slow edge goes on there
    return Course(
        is_jump=is_jump,
        mean=mean,
        parts=np.stack((part, 1.0 - part), axis=1),
        voltages=np.stack((first, second), axis=1),
        late=np.where(within < WITHIN * most, 0.0, at - np.where(is_jump, second, mean)),
    )


def at_edges(pars: Sequence[Device], course: Course, resistance: Vector) -> list[Vector | float]:
    """What is missing of the current of each model at the samples after an edge [A].

    Eddy currents follow the voltage at the sample, i = g_e u / (1 + R g_e) + ..., not the mean before it, which has
    some of the voltage before the edge.  What the voltage is after the edge the next interval tells.
    """
    lossy = [par for par in pars if isinstance(par, lossy_valve.Parameters)]
    if not lossy:
        return [0.0] * len(pars)
    return [course.late * par.core_eddy / (1.0 + par.coil_factor * resistance * par.core_eddy) for par in lossy]


def _single(halves: Vector) -> Vector:
    """Halves as intervals of their own, without a jump (2 n, 2)."""
    return np.asarray(halves.reshape(-1, 1).repeat(2, axis=1))


def filters_of(par: Device, dt: float, filtered: Filtered | None) -> list[LowPass]:
    """What the current of a model is measured through, in samples."""
    own = float(getattr(par, FILTER, 0.0)) / dt
    both = [filtered.low_pass] if filtered else []
    return [*both, LowPass(own)] if own > 0.0 else both


def without_filter(par: Device) -> Device:
    """The device whose current is measured as it is."""
    return replace_values(par, **{FILTER: 0.0}) if FILTER in par._fields else par


def behind(filters: Sequence[LowPass], x: Vector) -> Vector:
    """Half samples (2 n,) at the samples, behind low-passes without their mean delays (n,)."""
    for by in map(weights, filters):
        beyond = np.ones(by.size // 2)
        x = np.convolve(np.concatenate([x[0] * beyond, x, x[-1] * beyond]), by, mode="valid")  # np.pad takes far longer
    return x[1::2]


def simulate_experiment(par: Device, experiment: Experiment) -> Trajectory:
    """The model from the first operation of a record on."""
    return simulate(par, experiment.halves, experiment.dt, experiment.resistance, experiment.filtered)


def residuals(form: Form, points: Sequence[Vector], experiments: Sequence[Experiment]) -> Matrix:
    """Weighted residuals, current and flux linkage of each experiment (points, residuals); their squares make J."""
    return residuals_of([*map(form.at, points)], experiments)


def residuals_of(pars: Sequence[Device], experiments: Sequence[Experiment]) -> Matrix:
    """The same of some devices."""
    found = list[Matrix]()
    for e in experiments:
        models = simulate_batch(pars, e)
        positions = [model.position for model in models if model.position is not None]
        every = Response(np.stack([model.current for model in models]), np.stack(positions) if positions else None)
        found.append(weight(e, every))
    return finite(np.concatenate(found, axis=1))


def weight(experiment: Experiment, model: Response | Trajectory) -> Matrix:
    """The residuals of an experiment (..., residuals), of current, flux linkage and, where it is fitted, position.

    The signals of the model may have a row for each of several models (..., n), which takes a tenth of the time.
    """
    c_i, c_lam = experiment.weights()
    flux_linkage = integrate_flux(experiment, model.current)  # as the measured one, or the sampling would bias the fit
    parts = [c_i * (experiment.current - model.current), c_lam * (experiment.flux_linkage - flux_linkage)]
    if experiment.position is not None and model.position is not None:
        parts.append(c_i * experiment.amperes * (experiment.position - model.position))
    return np.concatenate(parts, axis=-1)


def balance(form: Form, ratios: Vector, experiment: Experiment, current: Vector | None = None) -> Experiment:
    """The experiment with resistances for which model and measurement have the same charge in every operation.

    The model obeys sum(v) = R integral(i*) over a period, so this is (23) without the error of the trapezoids. That
    error is 0.02 % of R for a valve sampled every 50 us, and would bias the other parameters by more than noise does.
    """
    modelled = simulate_currents([form.at(ratios)], experiment)[0] if current is None else current
    charges = [trapezoid(i) for i in (modelled, experiment.current)]
    scaled = with_resistance(experiment, experiment.resistance * form.factor(ratios))
    return with_factors(
        scaled, [charges[0][o.balanced].sum() / charges[1][o.balanced].sum() for o in experiment.operations]
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
    return changed._replace(flux_linkage=integrate_flux(changed, experiment.current))


def integrate_flux(experiment: Experiment, current: Vector) -> Vector:
    """Flux linkage of a current, or of each row of currents, by (21), from rest on [Wb]."""
    rates = experiment.halves.mean(axis=1) - experiment.resistance * trapezoid(current)
    rates[..., 0] = 0.0
    return np.asarray(experiment.dt * np.cumsum(rates, axis=-1))


RESISTANCE = "coil_resistance"  # the first parameter; it differs from interval to interval, not from run to run


def simulate_currents(pars: Sequence[Device], experiment: Experiment) -> list[Vector]:
    """Current of each model."""
    return [response.current for response in simulate_batch(pars, experiment)]


def simulate_batch(pars: Sequence[Device], experiment: Experiment) -> list[Response]:
    """What is fitted of each model; one after the other in scalar Python where no compiler is."""
    filters = [filters_of(par, experiment.dt, experiment.filtered) for par in pars]
    if any(filters):
        halves, R = _single(experiment.halves), experiment.resistance.repeat(2)
        fine = experiment._replace(dt=0.5 * experiment.dt, halves=halves, resistance=R, filtered=None)
        runs = simulate_batch([*map(without_filter, pars)], fine._replace(current=experiment.current.repeat(2)))
        return [
            Response(behind(by, run.current), None if run.position is None else run.position[1::2])
            for by, run in zip(filters, runs)
        ]
    kernel, with_position = KERNELS[type(pars[0])], experiment.position is not None
    halves, R = experiment.halves, experiment.resistance
    drive = drive_of(halves.tobytes(), R.tobytes(), experiment.dt)
    recorded = plan_of(kernel, drive.is_jump, drive.changes, with_position)
    if recorded.library is None:
        models = [simulate_experiment(par, experiment) for par in pars]
        return [Response(model.current, model.position if with_position else None) for model in models]
    entries = [*zip(*map(flat, pars))]  # each of all models
    numbers = iter(np.array([v for v in entries if not isinstance(v[0], list)], float)[:, None])
    given = (np.transpose(v) if isinstance(v[0], list) else next(numbers) for v in entries)
    columns: dict[str, Any] = dict(zip(columns_of(kernel), given))
    made = recorded.run(len(pars), **columns | drive.columns).reshape(R.size, -1, len(pars)).T
    currents = [run[0] + more for run, more in zip(made, at_edges(pars, drive.course, R))]
    return [Response(i, run[1] if with_position else None) for i, run in zip(currents, made)]


class Drive(NamedTuple):
    """Voltage and resistance of an experiment as the plan takes them."""

    course: Course
    is_jump: tuple[bool, ...]  # of each interval
    changes: tuple[bool, ...]  # of the resistance, likewise
    columns: dict[str, Vector]


@lru_cache(maxsize=64)  # a fit simulates few experiments many times
def drive_of(halves: bytes, resistance: bytes, dt: float) -> Drive:
    """That of the numbers in these bytes."""
    course, R = follow(np.frombuffer(halves).reshape(-1, 2)), np.frombuffer(resistance)
    early, late = dt * course.parts.T
    columns = dict(zip(("mean", "first", "second"), (course.mean, *course.voltages.T)))
    columns |= {"at": dt * np.arange(R.size), "early": early, "late": late, "whole": np.array([dt]), RESISTANCE: R}
    changes = np.diff(R, prepend=np.nan) != 0.0
    return Drive(course, tuple(course.is_jump.tolist()), tuple(changes.tolist()), columns)


@cache
def plan_of(kernel: Kernel, jump: tuple[bool, ...], changes: tuple[bool, ...], with_position: bool) -> Plan:
    """The plan of an experiment in which voltage and resistance jump in these intervals."""
    count, names = len(jump), kernel.module.Outputs._fields
    wanted = [names.index(name) for name in ("current", "position")[: 2 if with_position else 1]]
    samples = [Sample([(0.0, 0.0, 0.0)])]
    for k in range(1, count):  # two steps where the voltage jumps inside an interval, else one
        at = ("at", k)
        halves = [(at, ("early", k), ("first", k)), (at, ("late", k), ("second", k))]
        samples.append(Sample(halves if jump[k] else [(at, ("whole", 0), ("mean", k))], k if changes[k] else 0))
    sizes = dict.fromkeys((RESISTANCE, "at", "early", "late", "mean", "first", "second"), count)
    return plan_steps(kernel, {**sizes, "whole": 1}, samples, wanted)


UNKNOWN = float("nan")  # resistance, which these causes do not need


class First(NamedTuple):
    """First operation of a record."""

    record: Record
    experiment: Experiment
    start: int  # its first sample in the record
    resistance: float  # of the last operation by (23), before and after which a core is magnetised alike [Ohm]

    def of(self, form: Form) -> Experiment:
        """What a form is fitted to: with the other resistance where the core stays magnetised after the first one."""
        if FACTOR not in form.fitted:
            return self.experiment
        return with_resistance(self.experiment, np.full_like(self.experiment.resistance, self.resistance))


class Prepared(NamedTuple):
    """Records, and what is fitted to them."""

    records: Sequence[Record]
    experiments: list[Experiment]
    fluxes: list[Flux]
    raw: Sequence[Record]  # as they were read
    period: float | None = None
    convention: str = ""  # the voltage between samples; none: as the records have it

    @property
    def carriers(self) -> list[Carrier]:
        """PWM of records in which edges follow each other too fast for places of their own."""
        records = [r for r in self.records if not r.is_mean and len(edges(r.voltage)) < rises(r.voltage).size]
        return [found for r in records if (found := carrier(r, operations(r, self.period)))]

    @property
    def slow(self) -> str:
        """Sentence on edges that take their time, if they are read so; or none."""
        read = [r for r in self.records if r.slow and (r.is_filtered or self.convention == "slow")]
        return next((r.slow.describe(r.dt, r.is_filtered) for r in read if r.slow), "")

    @property
    def drive(self) -> Mapping[str, float]:
        """Values of the causes that are taken out of all records."""
        return {name: value for name, value in self.raw[0].drive.items() if not is_place(name)}

    @property
    def places(self) -> dict[str, float]:
        """Those of single edges, which belong to one record each."""
        every = [record.drive for record in self.raw]
        return {name: value for drive in every for name, value in drive.items() if is_place(name)}

    @property
    def is_alike(self) -> bool:
        """Whether places were sought and all edges lie alike: that is a delay."""
        return bool(self.places) and float(np.ptp([*self.places.values()])) < ALIKE

    @property
    def edges(self) -> list[str]:
        """Names of the places of all edges that are far enough from each other, from the first operation on."""
        unseen = [{k for k, part, _ in seen_ends(r.voltage, r.current) if part is None} for r in self.records]
        every = [(j, k) for j, record in enumerate(self.records) for k in edges(record.voltage, unseen[j])]
        return [f"{PLACE}{j}.{k}" for j, k in every if self.fluxes[j].operations[0].start < k]

    def readings(self, conventions: Sequence[str]) -> list[Prepared]:
        """The same with each voltage between samples that the edges of the first record allow."""
        return [prepare_all(read, self.period, name) for name, read in read_each(self.raw, conventions).items()]

    def move_causes(self, by: Mapping[str, float]) -> Prepared:
        """Move the causes by these values."""
        moved = list[Record]()
        for number, record in enumerate(self.raw):
            changed = {name: record.drive.get(name, 0.0) + x for name, x in of_record(by, number).items()}
            moved.append(record._replace(drive={**record.drive, **changed}))
        return prepare_all(moved, self.period, self.convention)

    def read_between(self, names: Sequence[str]) -> Prepared:
        """The same with sharp edges, all alike: as late as the delay, the reading and the places so far say."""
        found = self.places
        late = self.drive.get("delay", 0.0) / self.records[0].dt + EARLY.get(self.convention, 0.0)
        late += float(np.median([*found.values()])) if found else 0.0
        raw = [r._replace(drive={name: x for name, x in r.drive.items() if name != "delay"}) for r in self.raw]
        convention = "trapezoid" if self.convention in EARLY else self.convention
        by = {name: late - found.get(name, 0.0) for name in names}
        return self._replace(raw=raw, convention=convention).move_causes(by)

    @property
    def firsts(self) -> list[First]:
        """Their first operations."""
        every = zip(self.records, self.experiments, self.fluxes)
        return [
            First(record, first_operation(e), flux.operations[0].start, float(flux.resistances[-1]))
            for record, e, flux in every
        ]


def prepare_all(records: Sequence[Record], period: float | None, convention: str = "") -> Prepared:
    """Records with the voltage between samples that is named, or else as they have it."""
    read = [take_out_causes(record, convention, is_sharp=True) for record in records]
    experiments, fluxes = zip(*(prepare(record, period) for record in read))
    raw = [r._replace(are_edges_seen=one.are_edges_seen, slow=one.slow) for r, one in zip(records, read)]
    return Prepared(
        records=read, experiments=[*experiments], fluxes=[*fluxes], raw=raw, period=period, convention=convention
    )


def take_out_causes(record: Record, convention: str = "", is_sharp: bool = False) -> Record:
    """The record as the model is to explain it: with the voltage between its samples, and less what its driver takes.

    To be used once: the samples of its voltage stay what was recorded; but edges behind a low-pass may be made sharp.
    """
    read = with_convention(record, convention) if convention else record
    if is_sharp and read.filtered:
        samples, means = read.filtered.lacking(read.voltage.size)
        read = read._replace(voltage=read.voltage + samples, halves=read.halves + means)
    if not record.drive:
        return read
    after = apply_causes(Signals(read.halves, read.current, read.dt, UNKNOWN), record.drive)
    return read._replace(halves=after.halves, current=after.current)


FARTHEST = 10.0  # ratio of the inductances; the search stays within a factor of 5 of each parameter
THOUSANDS = 300.0  # likewise, from which a prefix of a unit is wrong
PROBE = 1e-6  # voltage [V] and time [s] that bring hardly any flux


def check_guess(known: Parameters, records: Sequence[Record], period: float | None = None) -> None:
    """Refuse records of a device that is another one than the guess; an InputError names them all."""
    guessed, problems = inductance(known), []
    for record in records:
        found = coil(record, operations(record, period)[0])[0]
        ratio = found / guessed
        if not 1.0 / FARTHEST < ratio < FARTHEST:
            said = f"{record.name}: its inductance is about {quantity(found, 'H')}, that of the first guess"
            said += f" {quantity(guessed, 'H')}: "
            if ratio < 0.0 or not 1.0 / THOUSANDS < ratio < THOUSANDS:
                said += "look at the units in the heads of its columns, and whether two are swapped. Or "
            problems.append(
                f"{said}it is another device, too far for the search. Give a guess with"
                " `--parameters`, `coil.turns` and `core.reluctance` above all, or see what `gapsense inspect` says."
            )
    if problems:
        raise InputError(problems)


def inductance(par: Parameters) -> float:
    """Of the valve at rest, without flux [H]."""
    halves, R = np.array([[0.0, 0.0], [PROBE, PROBE]]), np.full(2, par.coil_resistance)
    model = simulate(par, halves, PROBE, R)
    return float(model.flux_linkage[-1] / model.current[-1])
