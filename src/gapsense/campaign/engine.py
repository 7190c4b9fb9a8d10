"""Run a campaign: what is not in its folder yet, here or on a cluster, and every run goes to the folder as it ends."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.checked import Entry, fingerprint
from gapsense._os.files import PART
from gapsense._os.workers import Executor, Local, Progress, work
from gapsense.campaign.columns import columns_of
from gapsense.campaign.prepare import Prepared, prepare
from gapsense.campaign.result import Campaign, read
from gapsense.campaign.store import MANIFEST, STUDY, Manifest, Store, put, read_manifest
from gapsense.campaign.task import asked, local_job
from gapsense.cosim.provenance import provenance
from gapsense.cosim.run.ahead import AUTO, FMU, VECTORS, sweep_ahead
from gapsense.cosim.run.engines import VectorExecutor, refuse_unknown, vector_executor
from gapsense.cosim.run.subject import Subject
from gapsense.ledger import alone, sources
from gapsense.problems import InputError, ScenarioError

LOCK = ".lock"


def run(
    study: str | Path,
    workers: int | None = None,
    out: str | Path | None = None,
    fmus: str | Path | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    progress: Progress | None = None,
    engine: str = AUTO,
) -> Campaign:
    """Run all runs of a study that are not in its folder yet.

    Parameters
    ----------
    study : str or Path
        Study file.
    workers : int, optional
        Processes here, by default one per processor; the numbers do not depend on it.
    out : str or Path, optional
        Folder of the result, by default `results/` and the name of the study file. What is in it is not run again.
    fmus : str or Path, optional
        Folder of the FMUs, as in `gapsense.run`.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers then do the runs: `"tcp://host:8786"`.
    retry : bool
        Run those again that failed.
    progress : callable, optional
        Called with runs done and runs in all.
    engine : str
        As in `gapsense.sweep`; what a scheduler's workers run are FMUs.

    Returns
    -------
    Campaign
        Complete, or after Ctrl-C as far as it came and marked `interrupted`.

    Raises
    ------
    ScenarioError
        If the study, its scenario or its FMUs are wrong, with all problems found.
    """
    count = workers or processors()
    refuse_unknown(engine)
    if scheduler and engine == VECTORS:
        raise ScenarioError(
            ["The workers of a Dask scheduler run FMUs, not vectors. Leave `scheduler` or `engine` out."]
        )
    with nullcontext() if scheduler else sweep_ahead(count, engine):
        prepared = prepare(study, fmus, engine)
        folder = Path(out) if out is not None else Path("results") / prepared.study.path.stem
        manifest = manifest_of(prepared, folder)
        beginning(folder, manifest)  # refuses before it leaves even a lock there
        with alone(folder / LOCK):
            store = Store(folder, beginning(folder, manifest))
            put(folder / STUDY, lambda file: file.write(prepared.study.path.read_bytes()))
            if retry:
                store.forget_failed()
            done = Work(prepared, store, progress)
            executor = executor_of(prepared, count, scheduler, done.left, engine)
            interrupted = done.by(executor)
    by = VECTORS if isinstance(executor, VectorExecutor) else FMU
    return replace(read(folder), computed=done.computed, interrupted=interrupted, engine=by)


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def executor_of(prepared: Prepared, workers: int, scheduler: str | None, left: int, engine: str) -> Executor:
    """Who does the runs."""
    if scheduler is None:
        job = local_job(prepared, workers)
        vectors = vector_executor(job, Subject(prepared.scenario, prepared.descriptions), engine) if left else None
        return vectors or Local(job, left)
    from gapsense.campaign.cluster import Cluster  # here, since it takes a while to load

    return Cluster(scheduler, prepared, left)


class Work:
    """The runs of a campaign that are left, and what becomes of them."""

    def __init__(self, prepared: Prepared, store: Store, progress: Progress | None) -> None:
        self.plan, self.store, self.progress = prepared.plan, store, progress or (lambda done, total: None)
        self.numbers = np.flatnonzero(~store.known(len(self.plan)))
        self.left, self.computed = len(self.numbers), 0

    def by(self, executor: Executor) -> bool:
        """Let an executor do them; true after a Ctrl-C."""
        self.progress(len(self.plan) - self.left, len(self.plan))
        try:
            is_interrupted = work(executor, map(int, self.numbers), self.left, self.keep)
        finally:
            self.store.fold()
        if not is_interrupted:
            self.store.compact()
        return is_interrupted

    def keep(self, came: Sequence[Entry]) -> None:
        """Write down what has come."""
        self.store.append([self.line(entry) for entry in came])
        self.computed += len(came)
        self.progress(len(self.plan) - self.left + self.computed, len(self.plan))

    def line(self, entry: Entry) -> dict[str, Any]:
        """Line of the journal for a run."""
        index = entry["index"]
        told, answer = asked(self.plan, index), {name: value for name, value in entry.items() if name != "index"}
        return {"run": index, "seed": told["shift"], "values": told["values"], **answer}


def manifest_of(prepared: Prepared, folder: Path) -> Manifest:
    """What a new folder will say of its runs."""
    study, scenario = prepared.study, prepared.scenario
    package = {"the sources of Gapsense": fingerprint(sources()), "the version of numpy": np.__version__}
    about = {
        **provenance(scenario, folder),
        "title": study.title,
        "description": study.description,
        "study": study.path.name,
        "runs": len(prepared.plan),
        "points": prepared.plan.points,
        "decided_by": {**prepared.facts, **package},
    }
    return Manifest(about, columns_of(prepared))


def beginning(folder: Path, new: Manifest) -> Manifest:
    """What is in a folder already, with the new words about it; an InputError if that is of something else.

    More seeds are no other campaign.
    """
    old = read_manifest(folder)
    if old is None:
        if folder.is_dir() and any(file.name not in (LOCK, STUDY) and file.suffix != PART for file in folder.iterdir()):
            raise InputError([f"{folder}: it holds something else than a campaign. Name another folder with `--out`."])
        return new
    told, decided_by = old.about["decided_by"], new.about["decided_by"]
    if changed := [name for name, value in decided_by.items() if told.get(name) != value]:
        found = f"{folder / MANIFEST}: it is of another campaign, {' and '.join(changed)} changed since"
        raise InputError([f"{found}. Name another folder with `--out`, or remove this one."])
    return replace(old, about=new.about)
