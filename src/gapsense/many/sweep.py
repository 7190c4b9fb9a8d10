"""Run a scenario over the grid of its `[sweep]` and over seeds; what has been computed once is not computed again.

Of n combinations, run i takes combination i mod n and adds i to every seed: no two runs have the same noise, and more
seeds leave the existing runs unchanged.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.files import SEAL, Columns, facts_beside, is_sealed, refuse_unwritable, sha256, write_with_facts
from gapsense._os.importable import facts
from gapsense._os.workers import Progress
from gapsense.cosim.check import prepare
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.result.result import Measure
from gapsense.cosim.result.sidecar import is_whole, refuse_other, relative
from gapsense.cosim.run.ahead import AUTO, FMU, runs_ahead
from gapsense.cosim.run.engines import folder_of, refuse_unknown
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.read import OVER, Document, Source, scenario_file
from gapsense.cosim.scenario.records import MOST_RUNS, Plan, Scenario, product
from gapsense.cosim.show import pages
from gapsense.many.columns import ENDED, columns_of, kind
from gapsense.many.execute import Done, complete
from gapsense.many.provenance import key, provenance
from gapsense.many.store import ERRORS, SUFFIX, WORDS, Store, alone
from gapsense.many.worker import Many, signal_file, thrifty
from gapsense.problems import InputError, ScenarioError
from gapsense.tables import Value

LOG = logging.getLogger(__name__)
FORMAT = "gapsense sweep 1"
NEEDED = {SEAL, "sha256", "title", "scenario", "runs", "versions", "factors", "metrics", "failed"}
AGAIN = "Sweep again"


@dataclass(frozen=True, repr=False)
class Sweep:
    """Metrics over the runs of a sweep."""

    indices: tuple[int, ...]  # of the runs that succeeded
    metrics: Mapping[str, npt.NDArray[np.float64]]  # one value for each of `indices`; NaN where there were no samples
    errors: Mapping[int, str]  # what went wrong in the runs that failed
    computed: int  # runs done now; the others were known already
    interrupted: bool  # by Ctrl-C; start it again to go on
    file: Path | None  # the store of the runs, if a folder was given
    units: Mapping[str, str] = field(default_factory=dict)  # of the metrics and of the grid
    grid: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)  # `[sweep]`: a value for each of `indices`
    ended: Mapping[int, str] = field(default_factory=dict)  # runs that components ended in an orderly way
    kept: tuple[Path, ...] = ()  # signals recorded at each of `indices`, for `read_result`, if they were kept
    engine: str = FMU  # that did the runs that were computed now: `fmu` or `vectors`

    def quantiles(self, levels: Sequence[float] = (0.05, 0.5, 0.95)) -> dict[str, tuple[float, ...]]:
        """Quantiles of each metric over the runs, by default the median within the 5-95 % range."""
        return {name: tuple(np.quantile(values, levels).tolist()) for name, values in self.metrics.items()}

    def to_pandas(self) -> Any:
        """Values of the grid and metrics as a DataFrame of pandas, by run; units are in its `attrs["units"]`."""
        return pages().frame({**self.grid, **self.metrics}, "run", self.indices, self.units)

    def __repr__(self) -> str:
        failed = f", {len(self.errors)} failed" if self.errors else ""
        state = ", interrupted" if self.interrupted else ""
        return f"<Sweep: {len(self.indices)} runs{failed}{state}, {len(self.metrics)} metrics>"

    def _repr_html_(self) -> Any:
        return pages().of_sweep(repr(self), self.quantiles() if self.indices else {}, self.units)


def sweep(
    scenario: Source,
    seeds: int | None = None,
    variant: str | None = None,
    workers: int = 2,
    out: str | Path | None = None,
    fmus: str | Path | None = None,
    measure: Measure | None = None,
    progress: Progress | None = None,
    keep: bool = False,
    engine: str = AUTO,
) -> Sweep:
    """Run every combination of a scenario's `[sweep]` with `seeds` different seeds and collect the metrics.

    Parameters
    ----------
    scenario : str, Path or Document
        Scenario file, its folder, or its content; it must have `[sweep]` or `[seeds]`.
    seeds : int, optional
        Number of runs of each combination; by default 1, or 200 of a scenario without `[sweep]`.
    variant : str, optional
        Variant of the scenario.
    workers : int
        Number of processes; results do not depend on it.
    out : str or Path, optional
        Folder for `<scenario>_sweep.sqlite`, which has each run as soon as it is done, and a CSV at the end. If
        runs of the same scenario, FMUs and seed are in it already, they are taken from there.
    fmus : str or Path, optional
        Folder of the FMUs, as in `run`.
    measure : callable, optional
        Further metrics of a result: a function at the top level of a module, which the workers import.
    progress : callable, optional
        Called after each run with runs done and runs in all.
    keep : bool
        Keep the recorded signals of every run too, in a folder below `out`.
    engine : str
        `"fmu"`: the FMUs; `"native"`: those in `build/native`; `"vectors"`: Gapsense's own components without FMUs,
        many runs at once, bit-identical. `"auto"`: vectors if there is a C compiler and all FMUs are Gapsense's own,
        else the FMUs.
    """
    refuse_unknown(engine)
    file_of = None if isinstance(scenario, Document) else scenario_file(scenario)
    with nullcontext() if measure else runs_ahead(workers, engine, file_of):
        read, descriptions = prepare(scenario, variant, folder_of(engine, scenario, fmus))
        seeds = (1 if read.swept else 200) if seeds is None else seeds
        refuse_senseless(read, seeds, workers, keep and out is None)
        stem = "_".join(filter(None, (read.called, read.variant, "sweep")))
        file = None if out is None else Path(out) / f"{stem}{SUFFIX}"
        if file is not None:
            refuse_unwritable(*(file.with_suffix(ending) for ending in (SUFFIX, ".csv", ".json")))
        own, plan = key_of(read, descriptions, measure), Plan(read.plan.blocks, seeds)
        many = Many(
            scenario=read if measure or keep else thrifty(read),
            descriptions=descriptions,
            plan=plan,
            columns=columns_of(read, descriptions, plan),
            measure=measure,
            folder=file.with_suffix("") / own[:16] if keep and file else None,
        )
        with alone(file), Store(file, own) as store:
            store.describe({"source": source_of(store, read)})
            store.forget(unusable(store, many))
            done = complete(many, store, workers, engine, progress=progress)
            result = collect(many, store, done)
    if file is not None and not done.interrupted:
        changes = dict(scenario.changes) if isinstance(scenario, Document) else {}
        fmus_used = {f"{name} ({d.path.name})": d.sha256 for name, d in descriptions.items()}
        hashes = {"all": own, **Subject(read, descriptions).hashes(), **fmus_used}
        about = {**provenance(read, file.parent), "runs": len(plan), "points": plan.points, "decided_by": hashes}
        save(result, {**about, "settings": changes, "engine": done.engine}, plan, file.with_suffix(".csv"))
    return result


def source_of(store: Store, scenario: Scenario) -> str:
    """The scenario as a store names it; an InputError if runs of another one are there."""
    if store.file is None:
        return ""
    own = relative(str(scenario.path.resolve()), store.file.parent)
    for _, about in store.entries().values():
        refuse_other(store.file, about.get("source", own), own)
    return own


def refuse_senseless(scenario: Scenario, seeds: int, workers: int, homeless: bool) -> None:
    """Raise ScenarioError for a sweep that makes no sense."""
    problems = []
    wrong = {name: count for name, count in (("seeds", seeds), ("workers", workers)) if count < 1}
    problems += [f"{name}: {count} found, at least 1 expected. Correct it." for name, count in wrong.items()]
    if seeds * scenario.plan.points > MOST_RUNS:
        asked_for = product((scenario.plan.points, seeds))
        problems.append(f"seeds: {asked_for} runs found, at most {MOST_RUNS} expected. Take fewer seeds.")
    is_random = bool(scenario.seeds) or any(event.is_random for event in scenario.events.values())
    if not is_random and not scenario.swept:
        problems.append(
            f"{scenario.path.name}: a sweep varies parameters or seeds, and there are none. Add `[sweep]` or `[seeds]`."
        )
    if not is_random and scenario.swept and seeds > 1:
        problems.append(
            f"{scenario.path.name}, seeds: {seeds} runs of each combination would be the same. Add `[seeds]`."
        )
    for port in scenario.swept:
        component = scenario.components.get(port.component)
        if component and component.origin.get(port.variable) == OVER:
            problems.append(f"{OVER}, {port}: `[sweep]` gives it too. Keep one.")
    if homeless:
        problems.append("signals are to be kept, but no folder is given. Name one.")
    if problems:
        raise ScenarioError(problems)


def key_of(scenario: Scenario, fmus: Mapping[str, Description], measure: Measure | None) -> str:
    """Key of all that decides the metrics of a run, besides its seed."""
    hashes = {name: description.sha256 for name, description in fmus.items()}
    return key([deciding(scenario), hashes, measure and facts(measure)])


def unusable(store: Store, many: Many) -> Iterator[int]:
    """Runs that have to be done again: they failed, or their signals are gone or damaged, which is told."""
    yield from store.runs(ERRORS, len(many.plan)).tolist()
    if many.folder is None:
        return
    for run in store.runs(below=len(many.plan)).tolist():
        file = signal_file(many.folder, run)
        if not is_whole(file):
            yield run
            if file.is_file():
                LOG.warning("%s: it is damaged, or was edited. Run %d is computed again.", file, run)


def collect(many: Many, store: Store, done: Done) -> Sweep:
    """The sweep as it is in its store, in the order of the runs."""
    columns, plan = many.columns, many.plan
    errors, words = store.texts(ERRORS, len(plan)), store.texts(WORDS, len(plan))
    records = (np.frombuffer(b"".join(found), columns.record) for found in store.contents(below=len(plan)))
    data = np.concatenate([np.empty(0, columns.record), *records])
    runs = columns.array("run", data)
    is_wanted = ~np.isin(runs, [*errors])
    indices = tuple(runs[is_wanted].tolist())
    further = dict.fromkeys(name for own in words.values() for name in own.get("metrics", ()))
    found = {name: columns.array(name, data[is_wanted]) for name in columns.metrics}
    found |= {
        name: np.array([words.get(run, {}).get("metrics", {}).get(name) for run in indices], dtype=np.float64)
        for name in further
    }
    points = [plan.name_values(run) for run in indices]
    return Sweep(
        indices=indices,
        metrics=found if indices else {},
        errors=errors,
        computed=done.computed,
        interrupted=done.interrupted,
        file=store.file,
        units={name: unit for name, unit in columns.units.items() if name != "wall"},
        grid={str(port): tuple(point[str(port)] for point in points) for port in plan.ports},
        ended={run: own[ENDED] for run, own in words.items() if ENDED in own},
        kept=() if many.folder is None else tuple(signal_file(many.folder, run) for run in indices),
        engine=done.engine,
    )


# The table as a CSV file, and a JSON side-car with what it is a table of and which runs failed.


def save(result: Sweep, about: Mapping[str, Any], plan: Plan, path: Path) -> None:
    """Write both files, a row per run; `plan` is what the sweep goes through."""
    told = {**about, **sidecar(result, {run: plan.name_values(run) for run in result.errors})}
    grid = {name: np.array(column, dtype=object) for name, column in result.grid.items()}
    columns: Columns = {"run": np.array(result.indices, dtype=np.float64), **grid, **result.metrics}
    write_with_facts(path, columns, result.units, lambda digest: {**told, "sha256": digest})


def sidecar(result: Sweep, failed: Mapping[int, Mapping[str, Value]]) -> dict[str, Any]:
    """What is told of the columns of the table, and of the runs that are not in it, as JSON takes it."""
    units = result.units
    given = {name: [*column, *(own[name] for own in failed.values())] for name, column in result.grid.items()}
    return {
        "format": FORMAT,
        "factors": {name: [kind(column), units.get(name, "")] for name, column in given.items()},
        "metrics": {name: units.get(name, "") for name in result.metrics},
        "failed": [{"run": index, "values": failed[index], "error": error} for index, error in result.errors.items()],
    }


def is_table(path: Path) -> bool:
    """True for the CSV of a sweep, by what is beside it; also for one of an older version, by its name."""
    data = facts_beside(path)
    return path.suffix == ".csv" and (data.get("format") == FORMAT if data else path.stem.endswith("_sweep"))


def read_sidecar(path: Path) -> dict[str, Any]:
    """What is told beside the table `path`; an InputError if the two do not fit."""
    data = facts_beside(path)
    if not {*data} >= NEEDED:
        raise InputError([f"{path}: `{path.stem}.json` beside it is missing, or incomplete. {AGAIN}."])
    if not is_sealed(data):
        raise InputError([f"{path}: `{path.stem}.json` beside it is damaged, or was edited. {AGAIN}."])
    if sha256(path) != data.get("sha256"):
        raise InputError([f"{path}: it is not the table that belongs to `{path.stem}.json`. {AGAIN}."])
    return data
