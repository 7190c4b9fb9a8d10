"""Run a scenario over the grid of its `[sweep]` and over seeds; what has been computed once is not computed again.

Of n combinations, run i takes combination i mod n and adds i to every seed: no two runs have the same noise, and more
seeds leave the runs that are there as they are.
"""

from __future__ import annotations

import logging
import pickle
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.checked import Entry
from gapsense._os.importable import facts, importable_name
from gapsense._os.plain_files import refuse_unwritable
from gapsense._os.processes import Died, Marks
from gapsense._os.workers import Job, Progress, complete
from gapsense.cosim.events.event import unit_of_key
from gapsense.cosim.fmu.descriptions import Description, Descriptions
from gapsense.cosim.prepare import prepare
from gapsense.cosim.provenance import provenance
from gapsense.cosim.result.metrics import unit_of
from gapsense.cosim.result.result import Measure
from gapsense.cosim.result.sidecar import is_whole, refuse_other, relative
from gapsense.cosim.run.ahead import AUTO, FMU, VECTORS, sweep_ahead
from gapsense.cosim.run.apart import limit_of
from gapsense.cosim.run.engines import folder_of, refuse_unknown, vector_executor
from gapsense.cosim.run.recording import death
from gapsense.cosim.run.subject import Subject
from gapsense.cosim.run.worker import Runs, request, thrifty
from gapsense.cosim.scenario.changes import OVER
from gapsense.cosim.scenario.document import Document, Source
from gapsense.cosim.scenario.elements import Port
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.order import execution_order
from gapsense.cosim.scenario.records import MOST_RUNS, Points, Scenario, product
from gapsense.cosim.scenario.signals import recorded_signals
from gapsense.cosim.sweep_table import Sweep
from gapsense.cosim.sweep_table import save as save_table
from gapsense.ledger import Ledger, kept, key
from gapsense.problems import ScenarioError
from gapsense.tables import Value

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
        Processes; the numbers do not depend on it.
    out : str or Path, optional
        Folder for `<scenario>_sweep.jsonl`, one line per run as soon as it is done, and a CSV at the end. If
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
    with nullcontext() if measure else sweep_ahead(workers, engine):
        read, descriptions = prepare(scenario, variant, folder_of(engine, scenario, fmus))
        seeds = (1 if read.swept else 200) if seeds is None else seeds
        refuse_senseless(read, seeds, workers, keep and out is None)
        changes = scenario.changes if isinstance(scenario, Document) else {}
        return swept(Subject(read, descriptions), seeds, workers, out, measure, progress, keep, changes, engine)


def swept(
    subject: Subject,
    seeds: int,
    workers: int,
    out: str | Path | None,
    measure: Measure | None,
    progress: Progress | None,
    keep: bool,
    changes: Mapping[str, Any],
    engine: str,
) -> Sweep:
    """The runs of a sweep; `changes` are what was laid over the scenario."""
    read, descriptions = subject.scenario, subject.descriptions
    points = read.points()
    runs = range(seeds * len(points))
    file = None if out is None else Path(out) / f"{file_stem(read)}.jsonl"
    if file is not None:
        refuse_unwritable(*(file.with_suffix(ending) for ending in (".jsonl", ".csv", ".json")))
    ledger = Ledger(file, key_of(read, descriptions, measure), source_of(read, file))
    store = ledger.folder if keep else None
    runnable = read if measure or keep else thrifty(read)
    task = {
        "pickled": b64encode(pickle.dumps((runnable, descriptions))).decode(),
        "measure": measure and importable_name(measure),
        "keep": None if store is None else str(store.resolve()),
    }
    job = Job(
        prepare=Runs,
        task=task,
        workers=workers,
        guest=measure,
        on_worker_death=death_entry(read, descriptions),
        limit=limit_of(read),
        request=lambda i: asked(points, i),
    )
    with ledger.alone():
        known = {index: entry for index, entry in ledger.read().items() if index in runs and is_there(entry, store)}
        before = len(known)
        executor = None if before == len(runs) else vector_executor(job, Subject(runnable, descriptions), engine)
        interrupted = complete(job, runs, known, ledger, progress, executor)
        result = collect(known, len(known) - before, interrupted, file)
        result = replace(
            result,
            units=units_of(read, descriptions),
            grid=columns(read, result.indices),
            kept=() if store is None else tuple(kept(store, index) for index in result.indices),
            engine=VECTORS if executor else FMU,
        )
        if file is not None and not interrupted:
            about = {**provenance(read, file.parent), **of_sweep(subject, seeds, ledger.key), "settings": {**changes}}
            about["engine"] = result.engine
            save_table(result, about, points, file.with_suffix(".csv"))
    return result


def of_sweep(subject: Subject, seeds: int, key: str) -> dict[str, Any]:
    """What was run, and hashes of what decides the numbers."""
    fmus = {f"{name} ({d.path.name})": d.sha256 for name, d in subject.descriptions.items()}
    points = len(subject.scenario.points())
    return {"runs": seeds * points, "points": points, "decided_by": {"all": key, **subject.hashes(), **fmus}}


def asked(points: Points, index: int) -> dict[str, Any]:
    """What a worker is asked for run `index`."""
    return request(index, index, points[index % len(points)])


def death_entry(scenario: Scenario, descriptions: Descriptions) -> Callable[[Died, Marks], Entry]:
    """Function that makes an entry of a run that has ended its process."""
    order = execution_order(list(scenario.components), scenario.connections, descriptions).names
    return lambda died, marks: {"error": str(death(scenario, order, died, marks))}


def units_of(scenario: Scenario, fmus: Mapping[str, Description]) -> dict[str, str]:
    """Units of the metrics, and of the parameters that are swept."""
    signals = {name: signal.unit or "" for name, signal in recorded_signals(scenario, fmus).items()}
    swept = {str(port): unit_of_swept(port, scenario, fmus) for port in scenario.swept}
    return {**swept, **{metric.name: unit_of(metric, signals) for metric in scenario.metrics}}


def unit_of_swept(port: Port, scenario: Scenario, fmus: Mapping[str, Description]) -> str:
    """Unit of a parameter that is swept, or of the key of an event."""
    if port.component in fmus:
        return fmus[port.component].variables[port.variable].unit or ""
    name, _, key = port.variable.partition(".")
    return unit_of_key(key, scenario.events[name], fmus)


def source_of(scenario: Scenario, file: Path | None) -> str:
    """The scenario as its entries in the ledger name it; an InputError if those of another one are in the file."""
    if file is None:
        return ""
    own = relative(str(scenario.path.resolve()), file.parent)
    for entry in Ledger(file, "").entries()[0]:
        refuse_other(file, entry.get("source", own), own)
    return own


def is_there(entry: Entry, store: Path | None) -> bool:
    """True if a run is known, with its signals where they are kept; signals that are damaged are told."""
    if store is None or "metrics" not in entry:
        return "metrics" in entry
    file = kept(store, entry["index"])
    is_good = is_whole(file)
    if file.is_file() and not is_good:
        LOG.warning("%s: it is damaged, or was edited. Run %d is computed again.", file, entry["index"])
    return is_good


def columns(scenario: Scenario, indices: Sequence[int]) -> dict[str, tuple[Value, ...]]:
    """Values of the grid for some runs, by parameter."""
    points = scenario.points()
    return {str(port): tuple(points[index % len(points)][port] for index in indices) for port in scenario.swept}


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
        problems.append("signals are to be kept, but nowhere. Name a folder.")
    if problems:
        raise ScenarioError(problems)


def file_stem(scenario: Scenario) -> str:
    """Name of the sweep's files, without suffix."""
    return "_".join(filter(None, (scenario.called, scenario.variant, "sweep")))


def key_of(scenario: Scenario, fmus: Mapping[str, Description], measure: Measure | None) -> str:
    """Key of all that decides the metrics of a run, besides its seed."""
    hashes = {name: description.sha256 for name, description in fmus.items()}
    return key([deciding(scenario), hashes, measure and facts(measure)])


def collect(entries: Mapping[int, Entry], computed: int, interrupted: bool, file: Path | None) -> Sweep:
    """Sweep from its entries, in the order of the seeds whatever the order in which they were computed."""
    good = {index: entries[index]["metrics"] for index in sorted(entries) if "metrics" in entries[index]}
    names = dict.fromkeys(name for metrics in good.values() for name in metrics)
    columns = {name: np.array([metrics.get(name) for metrics in good.values()], dtype=np.float64) for name in names}
    errors = {index: entry["error"] for index, entry in sorted(entries.items()) if "error" in entry}
    ended = {index: entries[index]["ended"] for index in good if "ended" in entries[index]}
    return Sweep(
        indices=tuple(good),
        metrics=columns,
        errors=errors,
        computed=computed,
        interrupted=interrupted,
        file=file,
        ended=ended,
    )
