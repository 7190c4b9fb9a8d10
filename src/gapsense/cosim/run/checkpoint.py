"""A run that saves itself now and then, and one that goes on from there with the same bits."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gapsense._os.files import write_atomically
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.result.sidecar import ELSEWHERE
from gapsense.cosim.run.recording import Recording, Take
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.records import Port, Scenario
from gapsense.problems import FmuError, ScenarioError

if TYPE_CHECKING:
    from gapsense.cosim.run.master import Master

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

    def save(self, master: Master, recording: Recording, done: int) -> None:
        """Write all that it takes to go on after `done` base steps."""
        states = {f"state_{part.component.name}": octets(part.instance.state()) for part in master.parts}
        said = {**recording.facts(), "messages": recording.messages + master.messages()}
        texts = [[*port, text] for port, text in master.texts.items()]
        about = {
            "format": FORMAT,
            "run": self.facts,
            "done": done,
            "recording": said,
            "texts": texts,
            "events": master.director.state(),
        }
        rows = {"data": recording.data[: recording.rows], "buffer": master.view}
        arrays = {"about": octets(json.dumps(about).encode()), **rows, **states}
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self.file, lambda file: np.savez(file.buffer, **arrays))  # type: ignore[arg-type]
        except OSError as error:
            cause = f"the checkpoint `{self.file}` cannot be written: {error.strerror}. Make room for it."
            raise FmuError("run", cause) from None

    def restore(self, master: Master, recording: Recording) -> int:
        """Bring a master that has just been initialised to where the checkpoint was written; the base step to do next.

        That is 0, the start, if the run does not go on from a checkpoint.
        """
        if not self.resume:
            return 0
        about, arrays = read(self.file)
        for part in master.parts:
            part.instance.restore(arrays[f"state_{part.component.name}"].tobytes())
            part.instance.messages.clear()  # of the initialization, which are in the checkpoint already
        master.view[:] = arrays["buffer"]
        master.texts.update((Port(*port), text) for *port, text in about["texts"])
        saved = about["recording"]
        recording.rows = saved["rows"]
        recording.data[: recording.rows] = arrays["data"]
        recording.messages = [(component, status, text) for component, status, text in saved["messages"]]
        recording.seconds[:], recording.calls[:] = saved["seconds"], saved["calls"]
        recording.warnings[:] = saved.get("warnings", recording.warnings)  # older ones have none
        recording.longest[:], recording.spread[:] = saved["longest"], saved["spread"]
        recording.wall += saved["wall"]
        recording.overruns, recording.lag = saved["overruns"], saved["lag"]
        for name in ("loops", "inverses", "inputs", "steps"):
            setattr(recording, name, saved.get(name, {}))
        master.director.restore(about["events"])
        return int(about["done"]) + 1


def octets(data: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Bytes as an array."""
    return np.frombuffer(data, dtype=np.uint8)


def read(file: Path) -> tuple[Facts, Mapping[str, Any]]:
    """What a checkpoint holds; raises ScenarioError if it is none."""
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
    facts = run_facts(scenario, descriptions, take)
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


def run_facts(scenario: Scenario, descriptions: Descriptions, take: Take) -> Facts:
    """What two runs must have in common for one to go on where the other was saved; of JSON."""
    facts = {
        "a scenario": deciding(scenario),
        "FMUs": {name: description.sha256 for name, description in descriptions.items()},
        "signals to record": take.columns,
        "seeds": dict(take.seeds),
        "values of the sweep": {str(port): value for port, value in take.values.items()},
    }
    known: Facts = json.loads(json.dumps(facts))
    return known
