"""Every code block of the README and of every page runs, page by page, from top to bottom, in a folder of its own."""

from __future__ import annotations

import re
import shutil
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pages import FENCE, blocks, do, read
from sources import ROOT

from gapsense._os.native import ZIG, NativeError, zig_version
from gapsense.fmi.native.platforms import choose_platforms, compilers

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CODE = re.compile(r"```|~~~|<pre|^ {4}\S", re.MULTILINE)
DOCS = ROOT / "docs"
TEXTS = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md")), *sorted(ROOT.glob("fmus/*/page.md")))
PAGES = [page for page in TEXTS if CODE.search(page.read_text(encoding="utf-8"))]
LONG = (
    "README",
    "CONTRIBUTING",
    "campaigns",
    "estimators",
    "identification",
    "import",
    "index",
    "measure-your-valve",
    "native",
    "page",
    "python",
    "regression",
    "report",
)
LONG = (
    *LONG,
    "coupling",
    "firmware",
    "from-fem",
    "microcontrollers",
    "run-to-run",
    "run-to-run-study",
    "ssp",
    "tutorial",
)


@pytest.fixture
def folder(tmp_path: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)  # for those that a page starts
    yield tmp_path


@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=[pytest.mark.slow] * (p.stem in LONG)) for p in PAGES], ids=lambda page: page.name
)
def test_blocks_of_a_page_run_in_order(page, folder):
    assert blocks(page)
    BEFORE.get(page.name, list)()
    if page.name == "README.md":  # all others run in test_installed.py, by the installed package
        do([block for block in blocks(page) if block.note == "in"])
    else:
        read(page)


@pytest.mark.parametrize("code", ["```\nx\n```\n", "~~~\nx\n~~~\n", "    gapsense run x\n", "<pre>x</pre>\n"])
def test_code_is_found_and_must_have_a_kind(code, tmp_path):
    page = tmp_path / "new.md"
    page.write_text(f"# New\n\n{code}", encoding="utf-8")
    assert CODE.search(page.read_text(encoding="utf-8"))
    with pytest.raises(AssertionError):
        test_page_has_no_code_outside_of_blocks(page)


@pytest.mark.parametrize(
    "block",
    [
        "```python\nassert False\n```",
        "```toml\n[x\n```",
        "```console\n$ gapsense run nothing\n```",
        "```console\ngapsense list\n```",
        "```console\n$ gapsense list\nnothing\n```",
        "```console\n$ python --version &\n$ python -c 'import time; time.sleep(1)'\n```",
        "```sh\nfalse\ntrue\n```",
        "<!-- file: x.csv -->\n```csv\n1\n```",
        "```c\nint main;\n```",
    ],
)
def test_block_that_is_wrong_fails(block, folder):
    page = folder / "new.md"
    page.write_text(f"{block}\n", encoding="utf-8")
    with pytest.raises((AssertionError, AttributeError, tomllib.TOMLDecodeError)):
        test_blocks_of_a_page_run_in_order(page, folder)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_has_no_code_outside_of_blocks(page):
    rest = FENCE.sub("", page.read_text(encoding="utf-8"))
    assert not CODE.search(rest)
    assert all(block.kind for block in blocks(page))


def examples() -> None:
    """What a checkout has."""
    shutil.copytree(ROOT / "scenarios", "scenarios")


def records(**volts: float) -> None:
    """Records of a valve with a voltage each, as one would measure them; made as the page on identification does."""
    names: dict = {}
    exec(next(block.text for block in blocks(DOCS / "identification.md") if block.kind == "python"), names)
    for seed, (name, level) in enumerate(volts.items()):
        names["record"](f"{name}.csv", level, seed=seed)
        Path(f"{name}.json").unlink()
        columns = np.loadtxt(f"{name}.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2))
        head = "time [s],voltage [V],current [A]"
        np.savetxt(f"{name}.csv", columns, "%.9g", delimiter=",", header=head, comments="")
    Path("known.toml").write_text(
        next(block.text for block in blocks(DOCS / "identification.md") if block.kind == "toml")
    )


def address() -> None:
    """The usual one of a scheduler."""
    with socket.socket() as free:
        if not free.connect_ex(("127.0.0.1", 8786)):
            pytest.skip("a scheduler runs on this machine already")


def newcomer() -> None:
    """A fresh checkout, in an empty folder."""
    if shutil.which("make") is None:
        pytest.skip("no program `make`")
    Path("checkout").mkdir()
    for name in ("src", "fmus", "scenarios", "records"):
        shutil.copytree(ROOT / name, Path("checkout", name), ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copy(file, "checkout")


def compiler() -> None:
    try:
        compilers(*choose_platforms(["here"]))
    except NativeError as error:
        pytest.skip(f"no C compiler: {error}")


def zig() -> None:
    """What compiles a page, and what chooses its panels."""
    pytest.importorskip("bokeh")
    if zig_version() != ZIG:
        pytest.skip(f"no ziglang {ZIG}, which compiles pages")


def cc() -> None:
    if shutil.which("cc") is None:
        pytest.skip("no program `cc`")


def arm() -> None:
    """What builds programs for boards, and what emulates these."""
    if missing := [tool for tool in ("make", "arm-none-eabi-gcc", "qemu-system-arm") if shutil.which(tool) is None]:
        pytest.skip(f"{', '.join(missing)} not installed")


BEFORE = {
    "README.md": newcomer,
    "CONTRIBUTING.md": newcomer,
    "campaigns.md": address,
    "estimators.md": examples,
    "firmware.md": arm,
    "microcontrollers.md": cc,
    "native.md": compiler,
    "page.md": zig,
    "measure-your-valve.md": lambda: records(valve=30.0, valve_30=30.0, valve_24=24.0, valve_27=27.0),
}
