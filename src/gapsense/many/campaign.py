"""Run a campaign: what is not in its folder yet, here or on a cluster, and every run goes to the folder as it ends."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import PART, fingerprint, write_atomically
from gapsense._os.workers import Progress
from gapsense.cosim.run.ahead import AUTO, VECTORS, runs_ahead
from gapsense.cosim.run.engines import refuse_unknown
from gapsense.cosim.scenario.read import CAMPAIGN_FILE as FILE
from gapsense.many.execute import complete, processors
from gapsense.many.prepare import Prepared, prepare, scenario_of
from gapsense.many.provenance import provenance, sources
from gapsense.many.result import FORMAT, KEY, Campaign, is_older, older, read_campaign
from gapsense.many.store import DAMAGED, ERRORS, LOCK, Store, alone
from gapsense.problems import InputError, ScenarioError, require_package

STUDY = "study.toml"  # the copy of the study


def campaign(
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
    if scheduler:
        require_package("distributed")
    with nullcontext() if scheduler else runs_ahead(count, engine, scenario_of(study)):
        prepared = prepare(study, fmus, engine)
        folder = Path(out) if out is not None else Path("results") / prepared.study.path.stem
        about = about_of(prepared, folder)
        refuse_foreign(folder)
        folder.mkdir(parents=True, exist_ok=True)
        with alone(folder / FILE), Store(folder / FILE, KEY) as store:
            refuse_other(folder, store.about, about)
            store.describe(about)
            text = prepared.study.path.read_text("utf-8")
            write_atomically(folder / STUDY, lambda file: file.writelines([text]))
            if retry:
                store.forget(store.runs(ERRORS).tolist())
            done = complete(prepared.many, store, count, engine, scheduler, progress)
    return replace(read_campaign(folder), computed=done.computed, interrupted=done.interrupted, engine=done.engine)


def about_of(prepared: Prepared, folder: Path) -> dict[str, Any]:
    """What a folder says of its runs."""
    study, many = prepared.study, prepared.many
    package = {"the sources of Gapsense": fingerprint(sources()), "the version of numpy": np.__version__}
    return {
        "format": FORMAT,
        **provenance(many.scenario, folder),
        "title": study.title,
        "description": study.description,
        "study": study.path.name,
        "runs": len(many.plan),
        "points": many.plan.points,
        "decided_by": {**prepared.facts, **package},
        "columns": many.columns.facts(),
    }


def refuse_foreign(folder: Path) -> None:
    """Raise an InputError for a folder with something else than a campaign of this version."""
    if is_older(folder):
        raise InputError([f"{older(folder)} Name another folder with `--out`."])
    files = [file for file in folder.iterdir() if file.suffix not in (PART, LOCK)] if folder.is_dir() else []
    is_own = (folder / FILE).is_file() or all(f.name == STUDY or f.name.startswith(DAMAGED) for f in files)
    if not is_own:
        raise InputError([f"{folder}: it holds something other than a campaign. Name another folder with `--out`."])


def refuse_other(folder: Path, old: Mapping[str, Any] | None, new: Mapping[str, Any]) -> None:
    """Raise an InputError if the runs in a folder are of something else. More seeds are no other campaign."""
    told, decided_by = (old or new)["decided_by"], new["decided_by"]
    if changed := [name for name, value in decided_by.items() if told.get(name) != value]:
        found = f"{folder / FILE}: it belongs to another campaign, {' and '.join(changed)} changed since"
        raise InputError([f"{found}. Name another folder with `--out`, or remove this one."])
