"""What does the runs of a sweep, a campaign or a test: FMUs, or vectors where these give the same bits."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gapsense.cosim.check import find_fmus, prepare
from gapsense.cosim.result.result import Result
from gapsense.cosim.run.ahead import ENGINES, FMU, NATIVE, VECTORS, likely_vectors
from gapsense.cosim.run.recording import Recording, Subject, Take, finish_recording
from gapsense.cosim.scenario.read import Source, scenario_file
from gapsense.problems import ScenarioError, suggest
from gapsense.shipped import NATIVE_FOLDER

if TYPE_CHECKING:
    from gapsense.vectors.engine import Vectors

LOG = logging.getLogger(__name__)


def refuse_unknown(engine: str) -> None:
    """Raise a ScenarioError for an engine that does not exist."""
    if engine not in ENGINES:
        raise ScenarioError([f"engine: `{engine}` found. {suggest(engine, ENGINES)}"])


def folder_of(engine: str, scenario: Source, fmus: str | Path | None) -> str | Path | None:
    """Folder of the FMUs, where it is chosen: that of the native ones, if these are to be run."""
    return find_fmus(scenario_file(scenario), NATIVE_FOLDER) if engine == NATIVE and fmus is None else fmus


def vectors_for(subject: Subject, engine: str) -> Vectors | None:
    """The scenario as vectors, if it is to run so and can; a word if vectors were asked for and it cannot."""
    if engine in (FMU, NATIVE):
        return None
    from gapsense.vectors.engine import Vectors, obstacle

    if why_not := obstacle(subject):
        if engine == VECTORS:
            LOG.warning("%s: runs with FMUs instead of vectors. %s", subject.scenario.path.name, why_not)
        return None
    return Vectors(subject)


def run_as_vectors(scenario: Source, variant: str | None, fmus: str | Path | None, engine: str) -> Result | None:
    """A run of a scenario as vectors; nothing if FMUs are to do it, also to say what it fails of."""
    if not likely_vectors(engine):
        return None
    subject = Subject(*prepare(scenario, variant, fmus))
    take, vectors = subject.make_take(), vectors_for(subject, engine)
    _, recording = next(vectors.record([take])) if vectors else (0, None)
    return result_of(subject, take, recording) if recording else None


def result_of(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of what vectors recorded, which says so."""
    result = finish_recording(subject, take, recording)
    return replace(result, run=replace(result.run, versions={**result.run.versions, "loop": VECTORS}))
