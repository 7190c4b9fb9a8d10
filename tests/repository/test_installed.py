"""The wheel, built from the source archive and installed into an empty environment, works in any folder."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from sources import ROOT

pytestmark = pytest.mark.slow
BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"


def call(*words: object, cwd: Path) -> str:
    """Output of a command that knows nothing of this checkout."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "COLUMNS")}
    done = subprocess.run([str(w) for w in words], cwd=cwd, env=kept, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def archives(tmp_path_factory) -> tuple[Path, Path]:
    """The source archive, and the wheel that is made of it."""
    dist = tmp_path_factory.mktemp("dist")
    source = dist / call(sys.executable, "-c", BUILD, "build_sdist", dist, cwd=ROOT).split()[-1]
    with tarfile.open(source) as archive:
        archive.extractall(dist, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    unpacked = dist / source.name.removesuffix(".tar.gz")
    return source, dist / call(sys.executable, "-c", BUILD, "build_wheel", dist, cwd=unpacked).split()[-1]


@pytest.fixture(scope="module")
def gapsense(archives, tmp_path_factory):
    """The command of an environment that has the wheel; the packages that it needs are those of the tests."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, symlinks=os.name != "nt")
    python = home / ("Scripts" if os.name == "nt" else "bin") / "python"
    target = call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=home).strip()
    call(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", archives[1], cwd=home)
    others = [p for p in sys.path if Path(p).name == "site-packages"]
    Path(target, "others.pth").write_text("\n".join(others), encoding="utf-8")
    work = tmp_path_factory.mktemp("work")
    installed = Path(target, "gapsense")
    before = state(installed)
    yield lambda *words, cwd=work: call(python.with_name("gapsense"), *words, cwd=cwd), work, python
    assert state(installed) == before  # nothing was written into the package


def state(folder: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of all files but those that Python compiled."""
    files = (p for p in folder.rglob("*") if p.is_file() and p.suffix != ".pyc")
    return {p: (p.stat().st_size, p.stat().st_mtime_ns) for p in files}


def test_wheel_holds_components_examples_and_the_same_fmus(archives, fmus):
    with zipfile.ZipFile(archives[1]) as wheel:
        names = {name.partition("_shipped/")[2]: name for name in wheel.namelist()}
        folders = [ROOT / "fmus", ROOT / "scenarios", ROOT / "records"]
        mine = {p for f in folders for p in f.rglob("*") if p.is_file() and "__pycache__" not in p.parts}
        assert {p.relative_to(ROOT).as_posix() for p in mine} <= set(names)
        package = {p for p in (ROOT / "src" / "gapsense").rglob("*") if p.is_file() and p.suffix != ".pyc"}
        assert {p.relative_to(ROOT / "src").as_posix() for p in package} <= set(wheel.namelist())
        assert [f.name for f in fmus.glob("*.fmu") if wheel.read(names[f"build/fmus/{f.name}"]) != f.read_bytes()] == []
        assert not [name for name in names if "__pycache__" in name or name.startswith("tests")]


def test_installed_package_is_the_one_that_runs_and_has_the_sources_of_the_checkout(gapsense):
    _, work, python = gapsense
    show = (
        "from gapsense import shipped; from gapsense._os.files import fingerprint; "
        "from gapsense.many.provenance import sources; print(shipped.ROOT, fingerprint(sources()))"
    )
    (root, theirs), (_, ours) = (
        call(python, "-c", show, cwd=work).split(),
        call(sys.executable, "-c", show, cwd=ROOT / "src").split(),
    )
    assert root.endswith("_shipped") and theirs == ours


def test_everything_works_in_any_folder(gapsense):
    run, work, _ = gapsense
    assert "semera_valve" in run("list")
    assert "real-time factor" in run("run", "semera_valve")
    run("new", "my_valve")
    assert "no problems" in run("check", "my_valve")
    assert "2 passed, 0 failed" in run("test", "my_valve")
    run("sweep", "my_valve")
    run("figure", "my_valve")
    assert "linear (33)-(35)" in run("study", "observability")
    assert "Table II" in run("study", "reduced-fit")
    assert {p.name for p in work.iterdir()} == {"my_valve", "results"}


def test_blocks_of_the_readme_run(gapsense, tmp_path):
    """All but those that set up a checkout, by the installed package."""
    python = gapsense[2]
    text = re.sub(r"<!-- in: checkout -->\n```.*?```\n", "", (ROOT / "README.md").read_text("utf-8"), flags=re.DOTALL)
    page = tmp_path / "README.md"
    page.write_text(text, encoding="utf-8")
    folder = tmp_path / "work"
    folder.mkdir()
    reader = "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path; from pages import blocks, read"
    code = (
        f"{reader}; import gapsense; page = Path(sys.argv[2]); read(page); print(gapsense.__file__, len(blocks(page)))"
    )
    printed = call(python, "-c", code, ROOT / "tests" / "repository", page, cwd=folder).split()
    assert Path(printed[0]).is_relative_to(python.parents[1]) and int(printed[1]) >= 4


def test_scenarios_of_a_checkout_run(gapsense):
    """Those of the working folder, by the installed package; the README's blocks need no checkout."""
    run, work, _ = gapsense
    for name in ("fmus", "scenarios", "records"):
        shutil.copytree(ROOT / name, work / "checkout" / name)
    (work / "checkout" / "scenarios" / "semera_valve").rename(work / "checkout" / "scenarios" / "mine")
    assert "real-time factor" in run("run", "scenarios/mine", cwd=work / "checkout")


def test_built_fmus_of_the_working_folder_come_first(gapsense, fmus):
    run, work, _ = gapsense
    run("build", "sensor", "--out", "mine")
    assert (work / "mine" / "Sensor.fmu").read_bytes() == (fmus / "Sensor.fmu").read_bytes()
    rises = [(k * 5e-5, 24.0 * (k >= 20), 0.3 * (1.0 - 0.95 ** max(k - 20, 0))) for k in range(80)]
    rows = "".join(f"{t:g},{u:g},{i:.6f}\n" for t, u, i in rises)
    (work / "record.csv").write_text(f"time [s],voltage [V],current [A]\n{rows}")
    assert "Semera" in run("estimate", "record.csv", "--estimator", "semera")
