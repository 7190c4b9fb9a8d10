"""Plugin of pytest: every `scenario.toml` of Gapsense is collected, and each of its tested variants is a test."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from gapsense.cosim import Outcome

FILE = "scenario.toml"
MARKS = (r"^\s*\[\s*experiment\s*\]", r"^\s*base_step\s*=", r"^\s*\[\s*components\s*\.", r"^\s*fmu\s*=")
LARGEST = 10**7  # bytes of a file that is looked into


class FailedScenario(Exception):
    """What was tested is not as expected."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__("\n".join(f"{check.name}: {check.failure}" for check in outcome.failures))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of the plugin."""
    group = parser.getgroup("gapsense", "scenarios of Gapsense")
    group.addoption("--gapsense-fmus", metavar="FOLDER", type=Path, help="Folder of the FMUs of scenarios")
    group.addoption(
        "--gapsense-figures",
        metavar="FOLDER",
        type=Path,
        help="Draw signals that differ from a baseline, in this folder",
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """Collector of a scenario file; a file of that name which is something else is left alone."""
    if file_path.name != FILE or not is_scenario(file_path):
        return None
    return ScenarioFile.from_parent(parent, path=file_path)


def is_scenario(path: Path) -> bool:
    """True for a file that says what only our scenarios say; one that is no TOML counts by the words in it."""
    from gapsense.tables import read_toml

    try:
        if path.stat().st_size > LARGEST:
            return False
        data = read_toml(path, [])
        text = "" if data else path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    if data is None:
        return all(re.search(mark, text, re.MULTILINE) for mark in MARKS)
    experiment, components = data.get("experiment"), data.get("components")
    is_grid = isinstance(experiment, dict) and "base_step" in experiment
    return is_grid and isinstance(components, dict) and any("fmu" in c for c in components.values() if is_table(c))


def is_table(value: object) -> bool:
    """True for a table of TOML."""
    return isinstance(value, dict)


class ScenarioFile(pytest.File):
    """A scenario file; its tests are the scenario itself and each variant with metrics or a baseline of its own."""

    def collect(self) -> Iterator[ScenarioItem]:
        """Tests of the file."""
        from gapsense.cosim.regression import make_title, variants

        for variant in variants(self.path):
            name = make_title(self.path.parent.name, variant)
            yield ScenarioItem.from_parent(self, name=name, variant=variant)


class ScenarioItem(pytest.Item):
    """One scenario or variant: it is run, its metrics are held against their bounds, its signals to the baseline."""

    def __init__(self, variant: str | None = None, **more: Any) -> None:
        super().__init__(**more)
        self.variant = variant

    def runtest(self) -> None:
        """Run and check, in a process of its own, so that no component can end this one."""
        from gapsense.cosim import test_scenario

        fmus = self.config.getoption("--gapsense-fmus")
        outcome = test_scenario(self.path, self.variant, fmus, "process", self.name)
        if outcome.interrupted:
            raise KeyboardInterrupt
        if not outcome.passed:
            self.draw(outcome)
            raise FailedScenario(outcome)

    def draw(self, outcome: Outcome) -> None:
        """The picture of what differs, if there is something and a folder for it."""
        folder = self.config.getoption("--gapsense-figures")
        if folder is None or not (outcome.comparison and outcome.comparison.failing):
            return
        from gapsense.report import differences, plot

        name = re.sub(r"\W+", "_", self.nodeid.replace(f"/{FILE}::{self.path.parent.name}", "")).strip("_")
        file = folder / f"{name}.png"
        try:
            said = f"{plot.save(differences.figure(outcome.comparison, self.name), file)} written."
        except OSError as error:
            said = f"`{file}` cannot be written: {error.strerror}. Choose another folder."
        self.add_report_section("call", "picture", said)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The words of `gapsense test` where a check failed; where the plugin fails, where it does."""
        if isinstance(excinfo.value, FailedScenario):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """What the heading of a failure says."""
        return self.path, None, f"scenario {self.name}"
