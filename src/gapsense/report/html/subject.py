"""What a report is about: a result, and its scenario if that is still the one that ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gapsense.cosim import Result, Scenario, read_result
from gapsense.cosim.result.compare import Difference, compare
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.read import REPORTED, load, other_kind
from gapsense.problems import InputError
from gapsense.report.html.many import Many, is_many, read_many

CHANGED = "changes"  # hash of values given by `--set`
ALONE = "there is no baseline, and signals are paired by their names."


@dataclass(frozen=True)
class Shown:
    """A result as a report shows it; `note` says why its scenario is not used, if it is not."""

    file: Path
    result: Result
    scenario: Scenario | None
    note: str

    @property
    def is_changed(self) -> bool:
        """True if values were laid over the scenario for this run, so that its baseline says nothing."""
        scenario, run = self.scenario, self.result.run
        is_other = scenario is not None and (dict(scenario.seeds) != dict(run.seeds) or is_point(scenario, self.result))
        return CHANGED in run.files or is_other


def is_point(scenario: Scenario, result: Result) -> bool:
    """True if a parameter that a sweep varies has another value than the scenario gives it, or may have."""
    given = ((str(port), scenario.components[port.component].values.get(port.variable)) for port in scenario.swept)
    return any(value is None or result.parameters.get(name) != value for name, value in given)


def read_all(files: Sequence[Path]) -> list[Shown | Many]:
    """Saved results, sweeps and campaigns; an InputError has the problems of all of them."""
    problems: list[str] = []
    found = [shown for file in files if (shown := read(file, problems))]
    if problems:
        raise InputError(problems)
    return found


def read(file: Path, problems: list[str]) -> Shown | Many | None:
    """One saved result, sweep or campaign; None if it is not, after noting why."""
    if sentence := other_kind(file, REPORTED) or no_result(file):
        problems.append(sentence)
        return None
    try:
        if is_many(file):
            return read_many(file)
        result = read_result(file)
    except InputError as error:
        problems.extend(error.problems)
        return None
    except OSError as error:
        problems.append(f"`{file}`: {error.strerror}. Correct the path; `gapsense run` writes results.")
        return None
    scenario, note = scenario_of(result)
    return Shown(file=file, result=result, scenario=scenario, note=note)


def no_result(file: Path) -> str:
    """Sentence on a folder that is no campaign, with what to do."""
    if not file.is_dir() or is_many(file):
        return ""
    return f"`{file}`: it is not a result. Name the CSV file of a run or of a sweep, or the folder of a campaign."


def scenario_of(result: Result) -> tuple[Scenario | None, str]:
    """The scenario that ran, or why it cannot be used: its metrics say what is compared, its baseline the tubes."""
    run = result.run
    if not run.source or not Path(run.source).is_file():
        return None, f"The scenario's file is not where it was: {ALONE}"
    try:
        scenario = load(run.source, run.variant)
    except (InputError, OSError):
        return None, f"The scenario can no longer be read: {ALONE}"
    now = {**Subject(scenario, {}).hashes(), **{name: run.files[name] for name in (CHANGED,) if name in run.files}}
    if now != dict(run.files):
        return None, f"The scenario has changed since it ran: {ALONE}"
    return scenario, ""


@dataclass(frozen=True)
class Regression:
    """What comparing with the baseline showed; `note` says why nothing was compared, if nothing was."""

    tubes: tuple[Difference, ...] = ()
    problems: tuple[str, ...] = ()
    note: str = ""


def regression(shown: Shown) -> Regression:
    """Tubes of all signals that the baseline covers, the worst first."""
    if shown.scenario is None:
        return Regression(note=shown.note)
    baseline, result = shown.scenario.baseline, shown.result
    if not baseline.file.is_file():
        return Regression(note="The scenario has no baseline; `gapsense baseline --write` makes one.")
    if shown.is_changed:
        return Regression(note="Not compared: this run has other values or seeds than the scenario's baseline.")
    if result.interrupted or result.failure:
        return Regression(note="Not compared: the run did not reach its end.")
    found = compare(result, baseline)
    return Regression((*found.failing, *found.within), tuple(found.sentences))
