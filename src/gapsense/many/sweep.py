"""Run a scenario over the grid of its `[sweep]` and over seeds; what has been computed once is not computed again.

Of n combinations, run i takes combination i mod n and adds i to every seed: no two runs have the same noise, and more
seeds leave the existing runs unchanged.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import refuse_unwritable
from gapsense._os.importable import facts
from gapsense._os.workers import Progress
from gapsense.cosim.check import prepare
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.result.result import Measure
from gapsense.cosim.result.sidecar import is_whole, refuse_other, relative
from gapsense.cosim.run.ahead import AUTO
from gapsense.cosim.run.engines import folder_of, refuse_unknown
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.read import OVER, Document, Source, scenario_file
from gapsense.cosim.scenario.records import MOST_RUNS, Scenario, product
from gapsense.many.ahead import runs_ahead
from gapsense.many.columns import ENDED, columns_of
from gapsense.many.execute import Done, complete
from gapsense.many.key import key
from gapsense.many.plan import Plan
from gapsense.many.provenance import provenance
from gapsense.many.store import ERRORS, SUFFIX, WORDS, Store, alone
from gapsense.many.sweep_table import Sweep, values
from gapsense.many.sweep_table import save as save_table
from gapsense.many.task import Many
from gapsense.many.worker import kept, thrifty
from gapsense.problems import ScenarioError

LOG = logging.getLogger(__name__)


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
        `"fmu"`: the FMUs; `"native"`: those in `build/native`; `"vectors"`: our own components without FMUs, many runs
        at once, with the same bits; `"auto"`: vectors where a C compiler is and all FMUs are ours, else the FMUs.

    Returns
    -------
    Sweep
    """
    refuse_unknown(engine)
    with nullcontext() if measure else runs_ahead(workers, engine, file_of(scenario)):
        read, descriptions = prepare(scenario, variant, folder_of(engine, scenario, fmus))
        seeds = (1 if read.swept else 200) if seeds is None else seeds
        refuse_senseless(read, seeds, workers, keep and out is None)
        file = None if out is None else Path(out) / f"{file_stem(read)}{SUFFIX}"
        if file is not None:
            refuse_unwritable(*(file.with_suffix(ending) for ending in (SUFFIX, ".csv", ".json")))
        own, plan = key_of(read, descriptions, measure), Plan((), seeds).over(read)
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
        about = {**provenance(read, file.parent), **of_sweep(Subject(read, descriptions), plan, own)}
        save_table(result, {**about, "settings": changes, "engine": done.engine}, plan, file.with_suffix(".csv"))
    return result


def file_of(scenario: Source) -> Path | None:
    """The file of a scenario that has one."""
    return None if isinstance(scenario, Document) else scenario_file(scenario)


def of_sweep(subject: Subject, plan: Plan, key: str) -> dict[str, Any]:
    """What was run, and hashes of what decides the numbers."""
    fmus = {f"{name} ({d.path.name})": d.sha256 for name, d in subject.descriptions.items()}
    return {"runs": len(plan), "points": plan.points, "decided_by": {"all": key, **subject.hashes(), **fmus}}


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
    if seeds < 1 or workers < 1:
        problems.append(f"{seeds} seeds and {workers} workers found, at least 1 of each expected.")
    if seeds * len(scenario.points()) > MOST_RUNS:
        asked_for = product((len(scenario.points()), seeds))
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


def file_stem(scenario: Scenario) -> str:
    """Name of the sweep's files, without suffix."""
    return "_".join(filter(None, (scenario.called, scenario.variant, "sweep")))


def key_of(scenario: Scenario, fmus: Mapping[str, Description], measure: Measure | None) -> str:
    """Key of all that decides the metrics of a run, besides its seed."""
    hashes = {name: description.sha256 for name, description in fmus.items()}
    return key([deciding(scenario), hashes, measure and facts(measure)])


def unusable(store: Store, many: Many) -> Iterator[int]:
    """Runs that are done again: those that failed, and those whose kept signals are gone or damaged, which is told."""
    yield from store.runs(ERRORS, len(many.plan)).tolist()
    if many.folder is None:
        return
    for run in store.runs(below=len(many.plan)).tolist():
        file = kept(many.folder, run)
        if not is_whole(file):
            yield run
            if file.is_file():
                LOG.warning("%s: it is damaged, or was edited. Run %d is computed again.", file, run)


def collect(many: Many, store: Store, done: Done) -> Sweep:
    """The sweep as it is in its store, in the order of the runs."""
    columns, plan = many.columns, many.plan
    errors = {run: error for run, error in store.texts(ERRORS) if run < len(plan)}
    words = {run: own for run, own in store.texts(WORDS) if run < len(plan)}
    data = np.concatenate(
        [np.empty(0, columns.record), *(np.frombuffer(b"".join(found), columns.record) for found in store.contents())]
    )
    runs = columns.array("run", data)
    is_wanted = (runs < len(plan)) & ~np.isin(runs, [*errors])
    indices = tuple(runs[is_wanted].tolist())
    further = dict.fromkeys(name for own in words.values() for name in own.get("metrics", ()))
    found = {name: columns.array(name, data[is_wanted]) for name in columns.metrics}
    found |= {
        name: np.array([words.get(run, {}).get("metrics", {}).get(name) for run in indices], dtype=np.float64)
        for name in further
    }
    points = [values(plan, run) for run in indices]
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
        kept=() if many.folder is None else tuple(kept(many.folder, run) for run in indices),
        engine=done.engine,
    )
