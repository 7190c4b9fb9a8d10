"""Every code block of every page runs, page by page, from top to bottom, in a folder of its own.

A block of TOML is checked; one without a title is laid over the last whole scenario, on the page or made by a command.
Python runs in one namespace per page, lines after `$` of a console block are commands. What they print must be what
the block, or the text block after Python, says; `...` stands for anything. Before a block, `<!-- file: NAME -->`
writes it first of all, `<!-- exit: CODE -->` tells how its commands end. `<!-- skip: REASON -->` does not run it: its
TOML is loaded, its Python compiled, and that its commands exist is tested in `test_commands.py`, as for all.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from sources import ROOT
from test_commands import SCENARIO
from typer.testing import CliRunner

from gapsense import Scenario, campaign
from gapsense.cli import app
from gapsense.cosim import check
from gapsense.cosim.document import Document
from gapsense.cosim.load import read_draft
from gapsense.tables import merged

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CODE = re.compile(r"```|~~~|<pre|^ {4}\S", re.MULTILINE)
ELSEWHERE = {  # pages that show code, and the tests of it
    "run-to-run.md": "test_commands.py",  # its commands run, its piece of a scenario is read
    "run-to-run-study.md": "test_commands.py",  # its commands exist; each takes minutes
}
SHOWING = [page for page in sorted((ROOT / "docs").glob("*.md")) if CODE.search(page.read_text(encoding="utf-8"))]
PAGES = [page for page in SHOWING if page.name not in ELSEWHERE]
LONG = ("campaigns.md", "measure-your-valve.md", "regression.md", "report.md", "ssp.md", "tutorial.md")
UNRUN = ("c", "console", "csv", "python", "sh", "text", "toml")  # kinds of blocks that need not run, with a reason
REFERENCE = "scenario-file.md"  # whose examples of single keys fit no one scenario: these are only loaded
FENCE = re.compile(r"^(?:<!-- (file|skip|exit): ([^\n]+) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
APART = {("pythonfmu", "build"), ("gapsense", "build")}  # not in a process that has run FMUs made with pythonfmu
SAME = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


class Block(NamedTuple):
    """A code block of a page: its language, its text, where it is, and the note before it."""

    kind: str
    text: str
    place: str
    note: str
    about: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    return [
        Block(found[3], found[4], f"{page.name}:{text.count(chr(10), 0, found.start()) + 1}", found[1], found[2])
        for found in FENCE.finditer(text)
    ]


class Reader:
    """Does what a reader of a page would do with its blocks."""

    def __init__(self) -> None:
        self.file, self.whole = Path("scenario.toml"), {}
        self.names: dict = {"__name__": "page"}
        self.printed = ""

    def toml(self, block: Block) -> None:
        data = tomllib.loads(block.text)
        if "scenario" in data:  # a study
            assert not campaign.check(block.about), block.place
            return
        if "title" in data and "components" in data:
            self.file, self.whole = Path(block.about if block.note == "file" else "scenario.toml"), data
        document = Document(self.file, merged(self.whole, data))
        problems = read_draft(document).problems if block.place.startswith(REFERENCE) else check(document)
        assert not problems, (block.place, problems)

    def python(self, block: Block) -> None:
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(block.text, block.place, "exec"), self.names)
        self.printed = printed.getvalue()

    def text(self, block: Block) -> None:
        """What the Python block before it has printed."""
        same(block.text, self.printed, block.place)

    def console(self, block: Block) -> None:
        for command, expected in re.findall(r"^\$ (.+)\n((?:[^$\n].*\n|\n)*)", block.text, re.MULTILINE):
            program, *arguments = shlex.split(command, comments=True)
            code, output = called(program, arguments)
            if arguments[0] == "new":
                self.file = Path(arguments[1], "scenario.toml")
                self.whole = tomllib.loads(self.file.read_text(encoding="utf-8"))
            assert code == (int(block.about) if block.note == "exit" else 0), (block.place, output)
            if expected.strip():
                same(expected, output, block.place)


def called(program: str, arguments: list[str]) -> tuple[int, str]:
    """Exit code and output of a command."""
    if (program, arguments[0]) in APART:
        command = [sys.executable, "-m", {"gapsense": "gapsense.cli"}.get(program, program), *arguments]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        return done.returncode, done.stdout
    assert program == "gapsense"
    result = CliRunner().invoke(app, arguments)
    return result.exit_code, result.output


def same(expected: str, found: str, place: str) -> None:
    assert doctest.OutputChecker().check_output(expected, found, SAME), f"{place}:\n{found}"


@pytest.fixture
def folder(tmp_path: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    monkeypatch.chdir(tmp_path)
    yield tmp_path


@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=[pytest.mark.slow] * (p.name in LONG)) for p in PAGES], ids=lambda page: page.name
)
def test_blocks_of_a_page_run_in_order(page, folder):
    reader, every = Reader(), blocks(page)
    assert every
    BEFORE.get(page.name, list)()
    for block in every:
        if block.note == "file":
            Path(block.about).parent.mkdir(exist_ok=True)
            Path(block.about).write_text(block.text, encoding="utf-8")
    for block in every:
        if block.note == "skip":
            unrun(block)
        elif block.note != "file" or "title =" in block.text:
            getattr(reader, block.kind)(block)


def unrun(block: Block) -> None:
    """What can be known of a block without running it."""
    assert block.kind in UNRUN and len(block.about.split()) > 2, block.place
    if block.kind == "toml":
        problems = read_draft(Document(Path("scenario.toml"), {**SCENARIO, **tomllib.loads(block.text)})).problems
        assert not [p for p in problems if "omponent" not in p], block.place  # which the piece does not have
    elif block.kind == "python":
        compile(block.text, block.place, "exec")


def test_pages_that_are_tested_elsewhere_show_code():
    assert set(ELSEWHERE) <= {page.name for page in SHOWING}
    assert all((Path(__file__).parent / test).is_file() for test in ELSEWHERE.values())


@pytest.mark.parametrize("code", ["```\nx\n```\n", "~~~\nx\n~~~\n", "    gapsense run x\n", "<pre>x</pre>\n"])
def test_code_is_found_and_must_have_a_kind(code, tmp_path):
    page = tmp_path / "new.md"
    page.write_text(f"# New\n\n{code}", encoding="utf-8")
    assert CODE.search(page.read_text(encoding="utf-8"))
    with pytest.raises(AssertionError):
        test_page_has_no_code_outside_of_blocks(page)


@pytest.mark.parametrize(
    "block", ["```python\nassert False\n```", "```toml\n[x\n```", "<!-- skip: for a reason -->\n```toml\n[x\n```"]
)
def test_block_that_is_wrong_fails(block, folder):
    page = folder / "new.md"
    page.write_text(f"{block}\n", encoding="utf-8")
    with pytest.raises((AssertionError, tomllib.TOMLDecodeError)):
        test_blocks_of_a_page_run_in_order(page, folder)


def record(file: Path, volts: float, seed: int) -> None:
    """Voltage and current of a valve, measured from rest on, as one would record them."""
    with Scenario("record", stop=80e-3, base_step=25e-6) as s:
        s.add("drive", "DriveVoltage", {"square.amplitude": volts, "square.delay": 2e-3}, enable=1.0, reference=0.0)
        s.add("valve", "SolenoidValve").add("sensor", "Sensor", seed=seed, step=2)
        s.connect("drive.voltage_mean", "valve.voltage", "sensor.voltage").connect("valve", "sensor")
        result = s.record("sensor.*_measured", decimation=2).run()
    columns = (result.times, result["sensor.voltage_measured"], result["sensor.current_measured"])
    head = "time [s],voltage [V],current [A]"
    np.savetxt(file, np.stack(columns, axis=1), delimiter=",", header=head, comments="")


def records() -> None:
    """What the page on measuring has its reader record."""
    record(Path("valve.csv"), 30.0, 3)
    for volts in (30.0, 24.0, 27.0):
        record(Path(f"valve_{volts:g}.csv"), volts, int(volts))
    Path("known.toml").write_text('[values]\n"stop.upper" = 0.9e-3\n', encoding="utf-8")


BEFORE = {"measure-your-valve.md": records}


def lines_of(page: str) -> list[str]:
    """Commands of a page, outside of blocks."""
    return re.findall(r"^ {4}(gapsense .*)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.slow
def test_commands_of_the_readme_run(folder):
    """But for what CI runs anyway: make, pip and pytest, the 200 seeds of `make demo`, the test of all scenarios."""
    shutil.copytree(ROOT / "scenarios", folder / "scenarios")
    record(folder / "valve.csv", 30.0, 1)
    record(folder / "other.csv", 26.0, 2)
    lines = lines_of("README.md")
    commands = [part.strip() for line in lines for part in line.split("&&")]
    commands = [c for c in commands if not c.startswith(("gapsense test", "gapsense sweep"))]
    assert len(commands) > 8
    for command in commands:
        if "scenarios/" in command:  # in a checkout, not where the example of that name has run
            shutil.rmtree("results", ignore_errors=True)
        code, output = called("gapsense", shlex.split(command)[1:])
        assert code == 0, (command, output)
    assert (folder / "build" / "mine" / "Semera.fmu").is_file()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_has_no_code_outside_of_blocks(page):
    rest = FENCE.sub("", page.read_text(encoding="utf-8"))
    assert not CODE.search(rest)
    assert all(block.kind for block in blocks(page))
