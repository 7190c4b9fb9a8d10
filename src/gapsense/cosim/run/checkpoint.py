"""A run that saves itself now and then, and one that goes on from there with the same bits."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense._os.files import write_atomically
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.result.sidecar import ELSEWHERE
from gapsense.cosim.run.recording import Take
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.records import Scenario
from gapsense.problems import FmuError, ScenarioError

FORMAT = "gapsense checkpoint 2"
Facts = dict[str, Any]


@dataclass(frozen=True)
class Checkpoint:
    """File in which a run saves itself, how often in simulated time [s], and whether it goes on from there.

    A run that is interrupted saves itself too.
    """

    file: Path
    every: float | None = None
    resume: bool = False


class Keeper(NamedTuple):
    """A checkpoint as the master uses it; `facts` tell its run from any other."""

    file: Path
    facts: Facts
    every: int  # base steps
    resume: bool

    def write(self, about: Facts, arrays: Mapping[str, Any]) -> None:
        """Write a run's facts, of JSON, and arrays, complete or not at all."""
        text = json.dumps({"format": FORMAT, "run": self.facts, **about}).encode()
        arrays = {"about": np.frombuffer(text, np.uint8), **arrays}
        try:
            write_atomically(self.file, lambda file: np.savez(file.buffer, **arrays))
        except OSError as error:
            cause = f"the checkpoint `{self.file}` cannot be written: {error.strerror}. Make room for it."
            raise FmuError("run", cause) from None

    def read(self) -> tuple[Facts, Mapping[str, Any]]:
        """The facts and arrays that were written."""
        return read(self.file)


def read(file: Path) -> tuple[Facts, Mapping[str, Any]]:
    """What a checkpoint holds; raises ScenarioError if the file is not a checkpoint."""
    if file.exists() and not file.is_file():
        raise ScenarioError([f"{file}: not a checkpoint. Start without `--resume`."])
    try:
        with np.load(file, allow_pickle=False) as opened:
            arrays = dict(opened)
        about = json.loads(arrays.pop("about").tobytes())
    except FileNotFoundError:
        raise ScenarioError([f"{file}: there is no checkpoint. Run with `--checkpoint` first."]) from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ScenarioError([f"{file}: not a checkpoint ({error}). Start without `--resume`."]) from None
    if about.get("format") != FORMAT:
        raise ScenarioError([f"{file}: `{about.get('format')}` found, `{FORMAT}` expected. Start without `--resume`."])
    return about, arrays


def is_checkpoint(file: Path) -> bool:
    """True for a file that has the parts of a checkpoint."""
    try:
        with zipfile.ZipFile(file) if file.is_file() else zipfile.ZipFile("") as archive:
            return "about.npy" in archive.namelist()
    except (OSError, zipfile.BadZipFile):
        return False


def keeper(checkpoint: Checkpoint, scenario: Scenario, descriptions: Descriptions, take: Take) -> Keeper:
    """The checkpoint of a run, checked: raises ScenarioError if the run cannot be saved or gone on with."""
    experiment, problems = scenario.experiment, []
    ratio = experiment.count if checkpoint.every is None else checkpoint.every / experiment.base_step
    if not ratio >= 1.0 - 1e-9:  # nor if it is no number
        problems.append(
            f"--checkpoint: {checkpoint.every:.9g} s found, at least `base_step` = {experiment.base_step:.9g} s"
            " expected. Give a longer time."
        )
    problems += [
        f"{scenario.path.name}, components.{name}.fmu: `{description.path.name}` cannot save its state"
        " (canGetAndSetFMUstate and canSerializeFMUstate), so the run has no checkpoints. Run it without them."
        for name, description in descriptions.items()
        if not description.can_save
    ]
    if os.path.lexists(checkpoint.file) and not checkpoint.resume and not is_checkpoint(checkpoint.file):
        problems.append(f"{checkpoint.file}: this file exists and is not a checkpoint. Remove it, or {ELSEWHERE}.")
    own = {  # what two runs must have in common for one to go on where the other was saved
        "a scenario": deciding(scenario),
        "FMUs": {name: description.sha256 for name, description in descriptions.items()},
        "signals to record": take.columns,
        "seeds": dict(take.seeds),
        "values of the sweep": {str(port): value for port, value in take.values.items()},
    }
    facts: Facts = json.loads(json.dumps(own))
    if checkpoint.resume:
        before = read(checkpoint.file)[0]["run"]
        problems += [
            f"{checkpoint.file}: it was saved with {what} other than now. Start without `--resume`."
            for what, value in facts.items()
            if before.get(what) != value
        ]
    if problems:
        raise ScenarioError(problems)
    file = checkpoint.file.absolute()  # components may go to other folders
    return Keeper(file, facts, round(min(ratio, experiment.count)), checkpoint.resume)
