"""What a command is to write is looked at before it begins: no run, then a sentence that nothing could be saved."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

FILE, FOLDER = "file", "folder"
STUDY = 'title = "Two"\nscenario = "short"\n[grid]\n"drive.square.amplitude" = [24.0, 30.0]\n'
COMMANDS = {
    "run": (FOLDER, ["run", "short", "--out"]),
    "sweep": (FOLDER, ["sweep", "short", "--seeds", "2", "--out"]),
    "campaign": (FOLDER, ["campaign", "study.toml", "--out"]),
    "study": (FOLDER, ["study", "consistency", "--runs", "2", "--out"]),
    "build": (FOLDER, ["build", "Semera", "--out"]),
    "export-c": (FOLDER, ["export-c", "semera", "--out"]),
    "pictures": (FOLDER, ["test", "short", "--figures"]),
    "import-ssp": (FOLDER, ["import-ssp", "short.ssp", "--out"]),
    "junit": (FILE, ["test", "short", "--junit"]),
    "figure": (FILE, ["figure", "short", "--out"]),
    "cycle": (FILE, ["study", "reference-cycle", "--out"]),
    "identify": (FILE, ["identify", "sample_valve.csv", "--assume", "--out"]),
    "picture": (FILE, ["identify", "sample_valve.csv", "--assume", "--figure"]),
    "inspect": (FILE, ["inspect", "sample_valve.csv", "--figure"]),
    "estimate": (FILE, ["estimate", "sample_valve.csv", "--parameters", "sample_valve.toml", "--out"]),
    "soft-landing": (FILE, ["soft-landing", "--out"]),
    "compare": (FILE, ["compare", "a.csv", "b.csv", "--figure"]),
    "schema": (FILE, ["schema", "--out"]),
    "report": (FILE, ["report", "a.csv", "--out"]),
    "export-ssp": (FILE, ["export-ssp", "short", "--out"]),
}
ENDINGS = dict.fromkeys(("figure", "cycle", "picture", "inspect"), "x.png")


@pytest.fixture
def places(write, tmp_path):
    """Where nothing can be written, and why."""
    write()
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "text").write_text("mine", encoding="utf-8")
    (tmp_path / "loose").symlink_to(tmp_path / "nowhere")
    (tmp_path / "folder.png").mkdir()
    below = {
        Path("text", "deep"): "`text` is a file, a folder is expected",
        Path("loose"): "`loose` is a broken link, a folder is expected",
        Path("new", "n" * 300, "x"): "a name in it is longer than 255 bytes",
    }
    if sys.platform == "linux":
        below |= {Path("/proc", "nope"): "no new file can be made in `/proc`"}
    return below


def tree(folder):
    return sorted((path.relative_to(folder), path.is_file() and path.read_bytes()) for path in folder.rglob("*"))


def refused(done, why):
    assert done.exit_code == 2 and why in done.output, done.output
    assert done.output.count("\n") == 1 and done.output.endswith("Choose another place.\n"), done.output


@pytest.mark.parametrize("name", COMMANDS)
def test_place_where_nothing_can_be_written_is_refused_before_the_command_begins(gapsense, places, tmp_path, name):
    kind, words = COMMANDS[name]
    before = tree(tmp_path)
    for place, why in places.items():
        made = place / ENDINGS.get(name, "x")
        refused(gapsense(*words, place if kind is FOLDER else made), why)
    other = ("folder.png", "it is a folder, a file is expected") if kind is FILE else ("text", "is a file, a folder")
    refused(gapsense(*words, other[0]), other[1])
    assert tree(tmp_path) == before


def test_new_folder_that_cannot_be_made_is_refused(gapsense, places, tmp_path):
    before = tree(tmp_path)
    for place, why in places.items():
        refused(gapsense("new", place / "x"), why)
    assert gapsense("new", "text").output == "`text` exists already. Choose another name, or remove it.\n"
    assert tree(tmp_path) == before


@pytest.mark.skipif(sys.platform == "win32", reason="looks at /dev/null")
@pytest.mark.parametrize("words", [["test", "short", "--junit"], ["schema", "--out"], ["soft-landing", "--out"]])
def test_device_is_not_replaced_by_a_file(gapsense, places, words):
    refused(gapsense(*words, "/dev/null"), "it is a device, a file is expected")
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("ending", [".sqlite", ".csv", ".json"])
def test_sweep_looks_at_all_that_it_will_write(gapsense, write, fmus, tmp_path, ending):
    write()
    (tmp_path / "out" / f"short_sweep{ending}").mkdir(parents=True)
    done = gapsense("sweep", "short", "--seeds", "2", "--fmus", fmus, "--out", "out")
    refused(done, f"`out/short_sweep{ending}` cannot be written: it is a folder")


def test_baseline_looks_before_the_run(gapsense, write, fmus, tmp_path):
    folder = write()
    (folder / "baseline.csv").mkdir()
    done = gapsense("baseline", folder, "--write", "--fmus", fmus)
    assert done.exit_code == 2 and "so no baseline can be written there" in done.output, done.output


def test_check_and_default_folders_ask_for_nothing(gapsense, write, fmus, tmp_path):
    """What is not written may be missing."""
    write(("bounds = [0.0, 0.01]", "bounds = [0.0, 1.0]"))
    (tmp_path / "results").write_text("a file in the way of the default folder", encoding="utf-8")
    assert gapsense("run", "short", "--check", "--fmus", fmus).exit_code == 0
    assert gapsense("test", "short", "--fmus", fmus).exit_code == 0
    refused(gapsense("run", "short", "--fmus", fmus), "`results` is a file, a folder is expected")


def test_refused_scenario_leaves_no_folder(gapsense, write, fmus, tmp_path):
    write(("stop = 2e-3", "stop = -1.0"))
    for words in (["run", "short"], ["sweep", "short"], ["figure", "short"], ["test", "short"]):
        out = [] if words[0] == "test" else ["--out", "new/x.png" if words[0] == "figure" else "new"]
        assert gapsense(*words, "--fmus", fmus, *out).exit_code in (1, 2)
    assert not (tmp_path / "new").exists()
