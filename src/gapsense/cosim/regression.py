"""Regression test of scenarios: run, hold metrics against their bounds and trajectories against their baselines."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gapsense._os.files import unfit, unwritable, write_atomically, write_columns
from gapsense.cosim.result.compare import Comparison, compare, select_signals, thin_rows
from gapsense.cosim.result.result import TIME, Result
from gapsense.cosim.result.sidecar import read_sidecar
from gapsense.cosim.run.ahead import FMU, run_ahead
from gapsense.cosim.run.engines import folder_of, refuse_unknown, run_as_vectors
from gapsense.cosim.run.run import run
from gapsense.cosim.scenario.read import Document, Source, load, read_draft, scenario_file
from gapsense.cosim.scenario.records import Scenario
from gapsense.problems import FmuError, ScenarioError
from gapsense.tables import parse_toml, read_toml

HEADS = re.compile(r'"time( \[s\])?"(,"[A-Za-z_]\w*\.[^"\n]+")+$', re.MULTILINE)  # of a baseline
LOOKED_AT = 10**6  # characters
Report = Callable[[Sequence["Outcome"], "Outcome | None"], None]


@dataclass(frozen=True)
class Check:
    """One thing that was held against what is expected; `failure` says what is wrong, empty if nothing."""

    name: str
    failure: str = ""


@dataclass(frozen=True)
class Outcome:
    """What the test of a scenario, or of one of its variants, showed."""

    scenario: str
    path: Path
    variant: str | None
    checks: tuple[Check, ...]
    seconds: float
    result: Result | None = field(default=None, repr=False)
    comparison: Comparison | None = field(default=None, repr=False)  # with the baseline, if there is one
    remark: str = ""  # on the baseline

    @property
    def failures(self) -> list[Check]:
        """The checks that failed."""
        return [check for check in self.checks if check.failure]

    @property
    def passed(self) -> bool:
        """True if every check passed."""
        return not self.failures

    @property
    def interrupted(self) -> bool:
        """True if the run was ended by Ctrl-C."""
        return self.result is not None and self.result.interrupted


@dataclass(frozen=True)
class Update:
    """What a new baseline changes; `written` tells whether it was written."""

    file: Path
    changes: tuple[str, ...]
    written: bool
    interrupted: bool = False
    stated: str = ""  # sentence on the section of the scenario that was added

    def __str__(self) -> str:
        more = [self.stated] if self.stated else []
        if not self.changes:
            return "\n".join([f"{self.file}: nothing changes.", *more])
        end = "Written." if self.written else "Not written."
        return "\n".join([f"{self.file}:", *(f"  {change}" for change in self.changes), *more, end])


def find_scenarios(folder: str | Path) -> list[Path]:
    """Scenario files in a folder and the folders below it, sorted; a file or the name of an example is one."""
    folder = Path(folder)
    if not folder.is_dir() and (file := scenario_file(folder)).is_file():
        return [file]
    if not (files := sorted(folder.rglob("scenario.toml"))):
        raise ScenarioError([f"{folder}: there is no `scenario.toml` in this folder or below. Correct the path."])
    return files


def test_scenarios(
    folder: str | Path,
    fmus: str | Path | None = None,
    report: Report | None = None,
    isolation: str | None = None,
    engine: str = FMU,
) -> list[Outcome]:
    """Test every scenario in a folder, and each of its variants that has metrics or a baseline of its own.

    Parameters
    ----------
    folder : str or Path
        Folder with scenarios at any depth, or one scenario file.
    fmus : str or Path, optional
        Folder of the FMUs, as in `run`.
    report : callable, optional
        Called as each outcome comes, with that of every test, as failed where it has not ended, and with the new one;
        and before the first with none.
    isolation : str, optional
        As in `run`.
    engine : str
        As in `sweep`, but FMUs by default.

    Returns
    -------
    list of Outcome
        In the order run; it ends early after a Ctrl-C.
    """
    refuse_unknown(engine)
    outcomes: list[Outcome] = []
    due = [pending(path, variant, folder) for path in find_scenarios(folder) for variant in variants(path)]
    report = report or (lambda known, new: None)
    report(due, None)
    with run_ahead(again=True, engine=engine) if isolation == "process" else nullcontext():
        for k, outcome in enumerate(due, start=1):
            outcomes.append(test_scenario(outcome.path, outcome.variant, fmus, isolation, outcome.scenario, engine))
            report([*outcomes, *due[k:]], outcomes[-1])
            if outcomes[-1].interrupted:
                break
    return outcomes


test_scenarios.__test__ = False  # type: ignore[attr-defined]  # pytest: not a test


def variants(path: Path) -> tuple[str | None, ...]:
    """What there is to test of a scenario: itself, and its variants that have metrics or a baseline of their own."""
    scenario = read_draft(path).scenario
    return (None, *(scenario.tested if scenario else ()))


def pending(path: Path, variant: str | None, folder: str | Path) -> Outcome:
    """A test that has not ended: a failure, in case it never does.

    It is called after the way to the scenario's folder, for two may have one name.
    """
    home, folder = path.resolve().parent, Path(folder)
    inner = home.relative_to(folder.resolve()).as_posix() if folder.is_dir() else "."
    name = make_title(home.name if inner == "." else inner, variant)
    check = Check("run", "not tested: `test` was stopped before.")
    return Outcome(scenario=name, path=path, variant=variant, checks=(check,), seconds=0.0)


def make_title(name: str, variant: str | None) -> str:
    """Name a test of a scenario."""
    return f"{name}[{variant}]" if variant else name


def test_scenario(
    path: str | Path,
    variant: str | None = None,
    fmus: str | Path | None = None,
    isolation: str | None = None,
    name: str = "",
    engine: str = FMU,
) -> Outcome:
    """Run one scenario, known under a name, and check it; whatever goes wrong is in the outcome, nothing is raised."""
    path, begin = scenario_file(path), perf_counter()
    name = name or make_title(path.resolve().parent.name, variant)
    outcome = partial(Outcome, name, path, variant)
    try:
        scenario = load(path, variant)
        by_vectors = run_as_vectors(path, variant, fmus, engine)
        result = by_vectors or run(path, variant, folder_of(engine, path, fmus), isolation=isolation)
    except (ScenarioError, FmuError, OSError) as error:
        return outcome((Check("run", str(error)),), perf_counter() - begin)
    is_held = scenario.baseline.file.is_file() and not result.interrupted
    comparison = compare(result, scenario.baseline) if is_held else None
    found = tuple(checks(scenario, result, comparison))
    unstated = "" if scenario.baseline.declared else ", which no `[baseline]` names: its loss would go unnoticed"
    remark = f"compared with {scenario.baseline.file.name}{unstated}" if comparison else "no baseline"
    return outcome(found, perf_counter() - begin, result=result, comparison=comparison, remark=remark)


test_scenario.__test__ = False  # type: ignore[attr-defined]  # pytest: not a test


def checks(scenario: Scenario, result: Result, comparison: Comparison | None) -> Iterator[Check]:
    """The run itself, every metric, and the baseline if the scenario declares one or its file exists."""
    if result.interrupted:
        yield Check("run", f"interrupted at t = {result.times[-1]:.9g} s.")
        return
    yield Check("run")
    for name, measured in result.metrics.items():
        yield Check(f"metric {name}", "" if measured.passed else f"{measured}: outside its bounds.")
    baseline = scenario.baseline
    if comparison:
        yield Check("baseline", "\n".join(comparison.sentences))
    elif baseline.declared:
        yield Check("baseline", f"there is no file `{baseline.file}`. `gapsense baseline --write` makes it.")


def update_baseline(
    scenario: str | Path,
    variant: str | None = None,
    fmus: str | Path | None = None,
    write: bool = False,
    isolation: str | None = None,
) -> Update:
    """Run a scenario, as `run` does, and say what a new baseline would change; write it only if told to."""
    read = load(scenario, variant)
    baseline = read.baseline
    if write:
        refuse_foreign(read)
    result = run(scenario, variant, fmus, isolation=isolation)
    if result.interrupted:
        return Update(baseline.file, ("the run was interrupted; a baseline needs a complete one.",), False, True)
    rows, names = thin_rows(result, baseline), select_signals(result, baseline)
    is_new = not baseline.file.is_file()
    changes = [f"new: {len(names)} signals, {rows.times.size} rows."] if is_new else compare(result, baseline).sentences
    if write and changes:
        columns = {"time": rows.times, **{name: rows.signals[name] for name in names}}
        write_atomically(baseline.file, lambda file: write_columns(file, columns, {**TIME, **result.units}))
    stated = state_baseline(scenario, variant) if write else ""
    return Update(baseline.file, tuple(changes), write and bool(changes), stated=stated)


def refuse_foreign(scenario: Scenario) -> None:
    """Raise a ScenarioError if the baseline would be written outside of the scenario's folder, or over something else.

    A baseline is known by its first line.
    """
    file, folder = scenario.baseline.file, scenario.path.parent.resolve()
    place = f"{scenario.path.name}, baseline.file"
    try:
        inner = file.resolve().relative_to(folder)
    except ValueError:
        raise ScenarioError(
            [f"{place}: `{file}` is not below `{folder}`, where a baseline is written. Correct the path."]
        ) from None
    problem = next((f"`{part}` {why}" for part in inner.parts if (why := unfit(part))), "")
    if not problem and file.suffix != ".csv":
        problem = f"`{inner}` does not end in `.csv`"
    elif not problem and file.resolve() in {other.resolve() for other in scenario.files}:
        problem = f"`{inner}` is a file that the scenario reads"
    elif not problem and (os.path.lexists(file) and not is_baseline(file)):
        problem = f"`{inner}` exists and is not a baseline"
    elif not problem and not file.parent.is_dir():
        problem = f"there is no folder `{file.parent}`"
    elif not problem and (why := unwritable(file)):
        problem = f"`{inner}` cannot be written: {why}"
    if problem:
        raise ScenarioError([f"{place}: {problem}, so no baseline can be written there. Choose another name."])


def is_baseline(file: Path) -> bool:
    """True for a file that begins as a baseline does: a time, and signals of components. A result has a side-car."""
    if not file.is_file() or read_sidecar(file):
        return False
    with file.open(encoding="utf-8", errors="replace") as opened:
        return HEADS.match(opened.read(LOOKED_AT)) is not None


def state_baseline(scenario: Source, variant: str | None) -> str:
    """Add `[baseline]` to a scenario that has none; returns what was added, or what the user has to add.

    Without this section nobody would notice that a baseline is gone.
    """
    path = scenario_file(scenario)
    data = None if isinstance(scenario, Document) else read_toml(path, [])
    own = data["variants"][variant] if data and variant else data
    if own is None or "baseline" in own or (load(scenario, variant).baseline.declared and "metrics" in own):
        return ""
    head = f"[variants.{variant}.baseline]" if variant else "[baseline]"
    text = path.read_text(encoding="utf-8").rstrip("\n")
    name = f"baseline.{variant}.csv" if variant else "baseline.csv"  # so that no other variant uses it
    text = f'{text}\n\n{head}  # `gapsense test` fails without it\nfile = "{name}"\n'
    if parse_toml(text) is None:
        return f"{path}: add a table `{head}`, so that `gapsense test` fails if the baseline is lost."
    write_atomically(path, lambda file: print(text, end="", file=file))
    return f"{path}: `{head}` added, so that `gapsense test` fails if the baseline is lost."


# JUnit XML, which every CI system reads: one suite per scenario, one case per check.


def write_junit(outcomes: Sequence[Outcome], path: str | Path) -> None:
    """Write outcomes as a JUnit file, complete or not at all."""
    root = Element("testsuites", {"name": "gapsense", **counts(outcomes)})
    for outcome in outcomes:
        name, time = outcome.scenario, f"{outcome.seconds:.3f}"
        suite = SubElement(root, "testsuite", {"name": name, **counts([outcome]), "time": time})
        for index, check in enumerate(outcome.checks):  # the whole time counts for the first, the run
            case = SubElement(suite, "testcase", classname=name, name=check.name, time="0.000" if index else time)
            if check.failure:
                text = "".join(c if c >= " " or c in "\n\t" else " " for c in check.failure)  # what XML allows
                SubElement(case, "failure", message=text.splitlines()[0]).text = text
    indent(root)
    text = '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
    write_atomically(Path(path), lambda file: print(text, end="", file=file))


def counts(outcomes: Sequence[Outcome]) -> dict[str, str]:
    """Number of checks, and of those that failed."""
    failures = sum(len(outcome.failures) for outcome in outcomes)
    return {"tests": str(sum(len(outcome.checks) for outcome in outcomes)), "failures": str(failures)}
