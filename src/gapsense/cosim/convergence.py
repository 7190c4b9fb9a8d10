"""The error that a base step causes: the run is repeated with the step halved until its signals stop changing.

Only the exchange of values becomes finer. Sampled components keep their instants, because they do not approximate
anything.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TextIO

import numpy as np
from scipy.ndimage import binary_dilation

from gapsense._os.files import refuse_export, refuse_unwritable, seal, write_atomically, write_json
from gapsense.cosim.check import check_size, is_sampled, measured_file, memory, prepare, subject, within
from gapsense.cosim.fmu.descriptions import Description, Descriptions, Variable
from gapsense.cosim.result.compare import Rows, find_moved_edges
from gapsense.cosim.result.result import Result
from gapsense.cosim.run.run import run_prepared, set_isolation
from gapsense.cosim.scenario.read import Source
from gapsense.cosim.scenario.records import Component, Scenario, Vector, find_reached, recorded_signals
from gapsense.cosim.show import convergence_figure, convergence_text
from gapsense.problems import FmuError, ScenarioError, listing, suggest
from gapsense.shipped import is_installed

Progress = Callable[[int, int], None]
RUNS, LEAST_RUNS, MOST_RUNS = 6, 4, 16  # an order that is told takes two ratios of changes, and so four runs
TOLERANCE = 1e-3  # of the range of a signal
SETTLED = 0.1  # in the tolerance: a smaller change does not count
NOISE, DISCRETE, QUANTISED, RESTLESS = "noise", "discrete", "quantised", "its changes show no order"
ROUNDING = 1e-9  # of the range: changes below it tell nothing
RATIOS = 2  # of changes that have to give the same order
ORDERS, APART = (0.5, 8.0), 0.25  # orders that are credible, and by how much two in a row may differ
FINEST_QUANTUM = 2.0**-24  # in the range of a signal; converters are no finer
EDGE_ROWS = 1  # by which an edge may come earlier or later
EXPORTED = (".csv", ".json")


@dataclass(frozen=True)
class Tendency:
    """How a recorded signal changes as the base step is halved; errors and changes are in its unit.

    They are the greatest of all rows, but for rows next to an edge that has moved by no more than a row.
    """

    signal: str
    unit: str
    nominal: float
    range: float  # range in the finest run; the nominal value if that is nearly 0
    changes: tuple[float, ...]  # from each run to the next finer one
    errors: tuple[float, ...]  # of each run
    order: float | None  # observed; None where there is none
    step: float | None  # the longest base step [s] that keeps the tolerance; None if it is not known
    is_least: bool = False  # a longer step than `step` would do too
    at_edges: float = 0.0  # greatest difference at the step of the scenario where an edge comes a row earlier or later
    why: str = ""  # it does not converge

    @property
    def is_same(self) -> bool:
        """True if the step does not matter, but for rounding and next to edges."""
        return all(change <= ROUNDING * self.range for change in self.changes)

    @property
    def error(self) -> float:
        """Error at the step of the scenario."""
        return self.errors[0]

    @property
    def of_range(self) -> float:
        """Error at the step of the scenario as a share of the range."""
        return self.error / self.range

    @property
    def of_nominal(self) -> float:
        """The same as a share of the nominal value."""
        return self.error / self.nominal


@dataclass(frozen=True, repr=False)
class Convergence:
    """How large the coupling error of a scenario is; `print(found)` shows what `gapsense converge` prints."""

    scenario: str
    title: str
    steps: tuple[float, ...]  # base steps of the runs [s], that of the scenario first
    held: tuple[str, ...]  # components that keep their instants
    tolerance: float  # of the range
    signals: Mapping[str, Tendency]
    stopped: str = ""  # why there were no more runs, where signals still changed

    @property
    def judged(self) -> list[Tendency]:
        """Signals with an error, the largest share of the range first."""
        return sorted((t for t in self.signals.values() if not t.why), key=lambda t: -t.of_range)

    @property
    def others(self) -> list[Tendency]:
        """Signals that do not converge."""
        return [t for t in self.signals.values() if t.why]

    @property
    def beyond(self) -> list[Tendency]:
        """Signals whose error is beyond the tolerance at the step of the scenario."""
        return [t for t in self.judged if t.of_range > self.tolerance]

    @property
    def passed(self) -> bool:
        """True if the error of every signal that converges is within the tolerance, and there are such signals."""
        return bool(self.judged) and not self.beyond

    @property
    def step(self) -> float | None:
        """The longest step of the form `base_step / n` [s] that keeps the tolerance in all signals that converge."""
        known = [t.step for t in self.judged]
        if not known or None in known:
            return None
        return self.steps[0] / math.ceil(self.steps[0] / min(s for s in known if s) * (1.0 - 1e-9))

    def __str__(self) -> str:
        return convergence_text(self)

    def __repr__(self) -> str:
        return f"<Convergence {self.scenario!r}: {len(self.steps)} runs, {len(self.beyond)} signals beyond>"

    def plot(self) -> Any:
        """Figure of the errors over the base step."""
        return convergence_figure(self)

    def facts(self) -> dict[str, Any]:
        """All of it as JSON has it."""
        signals = {name: {**asdict(t), "error": t.error} for name, t in self.signals.items()}
        own = {"scenario": self.scenario, "steps": self.steps, "held": self.held, "tolerance": self.tolerance}
        told = {**own, "stopped": self.stopped, "passed": self.passed, "step": self.step, "signals": signals}
        return {name: plain(value) for name, value in told.items()}

    def export(self, file: str | Path) -> Path:
        """Write a row per signal to a CSV file, or all of it to a JSON file, as the name ends."""
        path = Path(file)
        refuse_export(path, *EXPORTED)
        write_atomically(path, lambda out: (write_json if path.suffix == ".json" else write_rows)(out, self.facts()))
        return path


def plain(value: Any) -> Any:
    """The same with texts in place of numbers that JSON does not have."""
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def write_rows(file: TextIO, facts: Mapping[str, Any]) -> None:
    """A row per signal, numbers in the unit that it states; what is not known is empty."""
    heads = ("signal", "unit", "nominal", "range", "order", "error", "at_edges", "step", "why")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["step [s]" if head == "step" else head for head in heads])
    writer.writerows([signal[head] for head in heads] for signal in facts["signals"].values())


def converge(
    scenario: Source,
    variant: str | None = None,
    fmus: str | Path | None = None,
    runs: int = RUNS,
    budget: float = math.inf,
    tolerance: float = TOLERANCE,
    keep: str | Collection[str] = (),
    write: bool = False,
    isolation: str | None = None,
    progress: Progress | None = None,
) -> Convergence:
    """Run a scenario with its base step halved again and again, and tell the error of each recorded signal.

    Parameters
    ----------
    scenario, variant, fmus : str or Path
        As in `run`.
    runs : int
        Runs at most, the first with the step of the scenario; at least 4.
    budget : float
        Wall time [s]: no run begins that would probably end later. The first 4 always run.
    tolerance : float
        Largest error that is allowed, as a share of the range of a signal.
    keep : str or collection of str
        Components that keep their instants beside those that have a `sample_time`.
    write : bool
        Write what was measured beside the scenario, so that `check` and reports no longer remind of it.
    isolation : str, optional
        As in `run`.
    progress : callable, optional
        Called now and then with base steps done and base steps in all, of the run that is going on.

    Returns
    -------
    Convergence
        Observed order, error and longest step of each signal by its name; `passed` is False where an error is beyond
        the tolerance.

    Raises
    ------
    ScenarioError
        The scenario or an option is wrong.
    FmuError
        A component fails, also with a step that is shorter than that of the scenario.
    """
    keep = (keep,) if isinstance(keep, str) else keep
    read, descriptions = prepare(scenario, variant, fmus)
    refuse(read, runs, budget, tolerance, keep, write)
    wired = record_wires(read)
    for problem in check_size(wired, runs * len(recorded_signals(wired, descriptions)), memory()):
        raise ScenarioError([f"{read.path.name}, {problem} All runs are kept: fewer `--runs` need less, too."])
    held = frozenset(n for n, c in read.components.items() if is_sampled(c, descriptions[n])) | {*keep}
    if held >= {*read.components}:
        told = "every component is sampled or kept: no exchange could be finer, and there is nothing to measure"
        raise ScenarioError([f"{read.path.name}: {told}. Leave out a `--keep`."])
    plan, begin = set_isolation(wired, isolation, None), perf_counter()
    judge = Judge(read, descriptions, held, tolerance)
    results = [once(plan, descriptions, progress)]
    if judge.random:
        judge.compare(results[0], once(judge.change_seeds(plan), descriptions, progress))
    stopped = ""
    while not (is_done := len(results) >= LEAST_RUNS and judge.is_done(results)) and len(results) < runs:
        if len(results) >= LEAST_RUNS and perf_counter() - begin + 2.0 * results[-1].wall > budget:
            stopped = f"the next run would go beyond the {budget:g} s of the budget"
            break
        results.append(once(halve_step(plan, held, len(results)), descriptions, progress))
    if not (is_done or stopped):
        stopped = f"{runs} runs were allowed"
    found = judge.conclude(results, stopped)
    if write:
        content = seal({"of": subject(read, descriptions), **found.facts()})
        write_atomically(measured_file(read), lambda file: write_json(file, content))
    return found


def refuse(scenario: Scenario, runs: int, budget: float, tolerance: float, keep: Collection[str], write: bool) -> None:
    """Raise a ScenarioError for options that make no sense, before a long run."""
    problems = [
        f"--keep: there is no component `{name}`. {suggest(name, scenario.components)}"
        for name in keep
        if name not in scenario.components
    ]
    if not LEAST_RUNS <= runs <= MOST_RUNS:
        problems.append(f"--runs: {runs} found, {LEAST_RUNS} to {MOST_RUNS} expected. Correct the number.")
    if not budget > 0.0:
        problems.append(f"--budget: {budget:g} s found, a time above 0 expected. Correct it.")
    if not 0.0 < tolerance < 1.0:
        problems.append(f"--tolerance: {tolerance} found, a share of the range between 0 and 1 expected. Correct it.")
    if scenario.experiment.step_control is not None:
        remedy = "Compare with a run in which it is smaller, or leave it out."
        problems.append(f"experiment.step_control: steps follow it, and not `base_step`. {remedy}")
    if write and (scenario.settings or not scenario.path.is_file()):
        problems.append("--write: it is for a scenario as its file is. Save it, and leave out --set.")
    if write and is_installed(scenario.path):
        problems.append(
            f"{scenario.called} came with Gapsense. Copy it first: `gapsense new mine --like {scenario.called}`."
        )
    if problems:
        raise ScenarioError(problems)
    if write:
        refuse_unwritable(measured_file(scenario))


# Runs with a finer base step.


def record_wires(scenario: Scenario) -> Scenario:
    """Record what goes along the wires of a scenario too, and drop what a run costs beside that."""
    wires = tuple(str(c.source) for c in scenario.connections)
    record = replace(scenario.record, signals=(*scenario.record.signals, *wires))
    return replace(scenario, record=record, metrics=(), experiment=replace(scenario.experiment, pace=None))


def halve_step(scenario: Scenario, held: Collection[str], times: int) -> Scenario:
    """Halve the base step of a scenario so many times; rows, and steps of what is held, are where they were."""
    n = 2**times
    experiment = scenario.experiment
    return replace(
        scenario,
        experiment=replace(experiment, base_step=experiment.base_step / n, count=experiment.count * n),
        record=replace(scenario.record, decimation=scenario.record.decimation * n),
        components={
            name: replace(c, step=c.step * n if name in held else c.step, offset=c.offset * n)
            for name, c in scenario.components.items()
        },
    )


def once(scenario: Scenario, descriptions: dict[str, Description], progress: Progress | None) -> Result:
    """One run, complete."""
    try:
        result = run_prepared(scenario, descriptions, progress=progress)
    except FmuError as error:
        raise error.adding(f"This run has a base step of {scenario.experiment.base_step:.9g} s.") from error
    if result.interrupted:
        raise KeyboardInterrupt
    return result


# What the runs show.


class Judge:
    """What the runs of a scenario say of its signals."""

    def __init__(self, scenario: Scenario, descriptions: Descriptions, held: frozenset[str], tolerance: float) -> None:
        self.scenario, self.descriptions, self.held, self.tolerance = scenario, descriptions, held, tolerance
        self.known = recorded_signals(record_wires(scenario), descriptions)
        self.random = [name for name in scenario.components if name not in held and descriptions[name].is_random] + [
            name for name, event in scenario.events.items() if event.enabled and event.is_random
        ]
        self.noisy: frozenset[str] = frozenset()  # signals that depend on their random numbers

    def change_seeds(self, scenario: Scenario) -> Scenario:
        """Give other seeds to all that would draw other random numbers with a finer step."""

        def other(name: str, component: Component) -> Component:
            """The component with another seed, which its FMU accepts."""
            variable = self.descriptions[name].variables["seed"]
            given = scenario.seeds.get(name, component.values.get("seed", variable.start))
            seed = int(given or 0) + 1
            return replace(component, values={**component.values, "seed": seed if within(seed, variable) else seed - 2})

        return replace(
            scenario,
            components={n: other(n, c) if n in self.random else c for n, c in scenario.components.items()},
            seeds={name: seed for name, seed in scenario.seeds.items() if name not in self.random},
            events={n: replace(e, seed=e.seed + 1) if n in self.random else e for n, e in scenario.events.items()},
        )

    def compare(self, first: Result, other: Result) -> None:
        """Note the signals that are not the same with other seeds: their random numbers would differ in each run."""
        rows = min(first.times.size, other.times.size)
        self.noisy = frozenset(
            n for n in first.signals if not np.array_equal(first[n][:rows], other[n][:rows], equal_nan=True)
        )

    def is_done(self, results: Sequence[Result]) -> bool:
        """True if more runs would tell nothing new of any signal that may converge."""

        def is_known(t: Tendency) -> bool:
            return t.order is not None or t.signal in self.noisy or self.has_stopped(t.changes, t.range)

        return all(map(is_known, self.tendencies(results)))

    def has_stopped(self, changes: Sequence[float], scale: float) -> bool:
        """True if a signal has changed so little that the tolerance does not notice."""
        return changes[-1] <= SETTLED * self.tolerance * scale

    def conclude(self, results: Sequence[Result], stopped: str) -> Convergence:
        """Conclude from all results how each signal tends."""
        own = recorded_signals(self.scenario, self.descriptions)
        found = self.explain(self.tendencies(results), results)
        return Convergence(
            scenario=self.scenario.name,
            title=results[0].run.title,
            steps=tuple(r.base_step for r in results),
            held=tuple(n for n in self.scenario.components if n in self.held),
            tolerance=self.tolerance,
            signals={t.signal: t for t in found if t.signal in own},
            stopped=stopped,
        )

    def tendencies(self, results: Sequence[Result]) -> list[Tendency]:
        """Each signal, also those of wires, with the reasons that it has itself."""
        rows = min(r.times.size for r in results)  # a component may have ended a run
        ratios = self.ratios(results, rows)
        return [
            self.tendency(name, [r[name][:rows] for r in results], results[0], ratios.get(component_of(name), RATIOS))
            for name in self.known
        ]

    def ratios(self, results: Sequence[Result], rows: int) -> dict[str, int]:
        """How many ratios of changes show an order in a component, where they are not as many as usually.

        What switches at base steps comes earlier or later by parts of one, whose first ratios may agree by chance.
        """
        switching = [n for n, v in self.known.items() if is_discrete(v, [r[n][:rows] for r in results])]
        moved = {component_of(n) for n in switching for r in results if (r[n][:rows] != results[-1][n][:rows]).any()}
        wires = self.scenario.connections
        more = {name: RATIOS + 1 for source in moved for name in (source, *find_reached(source, wires))}
        return {**more, **dict.fromkeys(self.moved_events(results), MOST_RUNS)}

    def tendency(self, name: str, values: Sequence[Vector], first: Result, ratios: int) -> Tendency:
        """One signal: values of each run at the rows at which its component has just stepped."""
        stepped, about = first.stepped(name)[: values[0].size], first.about[name]
        values = [v[stepped] for v in values] if stepped.any() else [*values]
        last = values[-1]
        scale = float(np.ptp(last[np.isfinite(last)])) if np.isfinite(last).any() else 0.0
        scale = scale if scale > ROUNDING * about.nominal else about.nominal
        changes = tuple(greatest(a, b) for a, b in zip(values, values[1:]))
        is_same = all(change <= ROUNDING * scale for change in changes)
        switches = is_discrete(self.known[name], values)
        order = None if name in self.noisy or switches or is_same else estimate_order(changes, ROUNDING * scale, ratios)
        errors, allowed = errors_of(values, changes, order), self.tolerance * scale
        why = ""
        if name in self.noisy:
            why = f"{NOISE}: {listing(self.random)} would draw other random numbers with another step"
        elif switches and not is_same:
            coarsest, finer = (int((v != last).sum()) for v in (values[0], values[-2]))
            found = f"{coarsest} of {last.size} rows differ at the step of the scenario, {finer} at the finest but one"
            why = f"{DISCRETE}: {found}"
        elif order is None and not self.has_stopped(changes, scale):
            unit = quantum(last)
            why = f"{QUANTISED}: its values are {unit:.4g} apart, and some come one earlier or later" if unit else ""
            numbers = ", ".join(f"{change:.3g}" for change in changes[-RATIOS - 2 :])
            why = why or f"{RESTLESS}: {numbers} {about.unit}".rstrip()
        steps = [first.base_step / 2**k for k in range(len(values))]
        step, is_least = (None, False) if why else longest(steps, errors, order, allowed, self.limit(len(values)))
        moved = apart(values[0], last)[find_excused(values[0], last)]
        return Tendency(
            signal=name,
            unit=about.unit,
            nominal=about.nominal,
            range=scale,
            changes=changes,
            errors=errors,
            order=order,
            step=step,
            is_least=is_least,
            at_edges=float(moved[np.isfinite(moved)].max(initial=0.0)),
            why=why,
        )

    def limit(self, runs: int) -> float:
        """The longest base step [s] that is spoken of: what sampled components allow, and no farther than the runs."""
        held = [self.scenario.components[name] for name in self.held]
        grid, farthest = math.gcd(*(n for c in held for n in (c.step, c.offset))), 2 ** (runs - 1)
        return float(self.scenario.experiment.base_step * (min(grid, farthest) if held else farthest))

    def explain(self, found: Iterable[Tendency], results: Sequence[Result]) -> Iterator[Tendency]:
        """Yield signals; one that does not settle may follow another, or an event that comes at another base step."""
        known, rows = {t.signal: t for t in found}, min(r.times.size for r in results)
        before, last = results[-2:]
        causes = {
            name: t.why.partition(":")[0]
            for name, t in known.items()
            if t.why and not t.why.startswith(RESTLESS) and (before[name][:rows] != last[name][:rows]).any()
        }
        moving = self.moved_events(results)
        for tendency in known.values():
            if not tendency.why.startswith(RESTLESS):
                yield tendency
                continue
            component = component_of(tendency.signal)
            if event := moving.get(component):
                yield replace(tendency, why=f"event: `{event}` comes at another base step")
            elif cause := self.cause(component, causes, {n for n, t in known.items() if t.why}):
                yield replace(tendency, why=f"follows `{cause}`: {causes[cause]}")
            else:
                yield tendency

    def cause(self, component: str, causes: Mapping[str, str], restless: Collection[str]) -> str:
        """The nearest signal upstream that still changes and says why, on a way along signals that do not converge."""
        level, seen = {component}, {component}
        while level:
            wires = [str(c.source) for c in self.scenario.connections if c.target.component in level]
            if signal := next((name for name in wires if name in causes), ""):
                return signal
            level = {component_of(name) for name in wires if name in restless} - seen
            seen |= level
        return ""

    def moved_events(self, results: Sequence[Result]) -> Mapping[str, str]:
        """Events of which the runs tell other times, by the components that they act on."""
        told = [{(span.name, span.begin, span.end) for span in r.events} for r in results]
        names = {name for spans in told for name, *_ in spans ^ told[-1]}
        targets = {name: self.scenario.events[name].target.component for name in sorted(names)}
        wires = self.scenario.connections
        return {component: n for n, target in targets.items() for component in (target, *find_reached(target, wires))}


def component_of(signal: str) -> str:
    """Component that a signal is of."""
    return signal.partition(".")[0]


# What a signal does as the base step of its run is halved: its order, its limit, and how far it is off.


def is_discrete(variable: Variable, values: Iterable[Vector]) -> bool:
    """True for a signal that has whole numbers only, as modes and switches do."""
    return variable.type != "Real" or all(bool((v == np.round(v)).all()) for v in values)


def find_excused(values: Vector, reference: Vector) -> Rows:
    """Find rows where a signal differs only because an edge, or a gap of lost samples, comes a row earlier or later."""
    mine, theirs = np.isnan(values), np.isnan(reference)
    near = [binary_dilation(rows) for rows in (mine, theirs, ~mine, ~theirs)]  # rows, and those next to them
    gap = (mine != theirs) & np.logical_and.reduce(near)
    found: Rows = find_moved_edges(values, reference, 0.0, EDGE_ROWS) | gap
    return found


def greatest(values: Vector, reference: Vector, limit: Vector | None = None) -> float:
    """Greatest difference that no edge excuses, to the reference or to the limit of all runs."""
    difference = apart(values, reference if limit is None else limit)
    return float(np.where(find_excused(values, reference), 0.0, difference).max(initial=0.0))


def apart(values: Vector, reference: Vector) -> Vector:
    """Difference at each row: none where both are lost samples, infinite where one is."""
    with np.errstate(invalid="ignore"):
        difference = np.abs(values - reference)
    return np.where(np.isnan(values) & np.isnan(reference), 0.0, np.where(np.isnan(difference), np.inf, difference))


def estimate_order(changes: Sequence[float], rounding: float, ratios: int = 2) -> float | None:
    """Estimate order p at which changes fall as 2^-p, from the last ones above rounding; None if they tell two orders.

    An order is believed if so many ratios in a row give nearly the same.
    """
    counted = [change for change in changes if change > rounding][-ratios - 1 :]
    if len(counted) <= ratios:
        return None
    found = [math.log2(a / b) for a, b in zip(counted, counted[1:])]
    is_one = max(found) - min(found) <= APART and ORDERS[0] <= min(found) and max(found) <= ORDERS[1]
    return sum(found) / ratios if is_one else None


def errors_of(values: Sequence[Vector], changes: Sequence[float], order: float | None) -> tuple[float, ...]:
    """Error of each run: against the limit by Richardson, or against the finest run with what it still changed by."""
    last = values[-1]
    if order is None:
        return (*(greatest(v, last) + changes[-1] for v in values[:-1]), changes[-1])
    limit = last + (last - values[-2]) / (2.0**order - 1.0)
    return (*(greatest(v, last, limit) for v in values[:-1]), changes[-1] / (2.0**order - 1.0))


def longest(
    steps: Sequence[float], errors: Sequence[float], order: float | None, allowed: float, limit: float
) -> tuple[float | None, bool]:
    """The longest step [s] with no more than the allowed error, and whether a longer one would do too.

    Beyond the runs it is found by the order, but no farther below the finest than that is below the first.
    """
    first = next((k for k, error in enumerate(errors) if error <= allowed), None)
    if order is None:  # nothing is known of what no run has had
        return (None, False) if first is None else (steps[first], first == 0)
    if first is None:
        step = steps[-1] * (allowed / errors[-1]) ** (1.0 / order)
        return (step if step >= steps[-1] ** 2 / steps[0] else None), False
    error = max(errors[first], ROUNDING * allowed)
    if first:  # between two runs
        slope = math.log2(errors[first - 1] / error)
        return steps[first - 1] * (allowed / errors[first - 1]) ** (1.0 / slope), False
    step = steps[0] * (allowed / error) ** (1.0 / order)
    return min(step, limit), step > limit


def quantum(values: Vector) -> float:
    """By how much neighbouring values of a signal differ if all are whole multiples of it apart; else 0."""
    gaps = np.diff(np.unique(values))
    if gaps.size < 2:
        return 0.0
    least = float(gaps.min())
    if least < FINEST_QUANTUM * float(gaps.sum()):
        return 0.0
    ratios = gaps / least
    return least if bool((np.abs(ratios - np.round(ratios)) < 1e-3).all()) else 0.0
