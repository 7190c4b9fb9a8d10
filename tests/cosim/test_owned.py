"""A scenario writes in its own folder and below `--out`, and over nothing but what Gapsense has written."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import check, load, test_scenario
from gapsense.cosim.regression import variants
from gapsense.tables import parse_toml

SHIPPED = Path(__file__).parents[2] / "scenarios"
BASELINE = '[baseline]\nfile = "{}"\n'
OURS = "nobody else's"


def gapsense(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(done, *words: str) -> None:
    """The command has ended with a sentence."""
    assert done.exit_code == 2 and isinstance(done.exception, SystemExit), done.output
    assert all(word in done.output for word in words), done.output


@pytest.mark.parametrize(
    "name",
    ["../precious.txt", "../precious.csv", "{}/precious.csv", "inner/../../precious.csv", "notes.csv", "notes.txt"]
    + ["link.csv", "folder/precious.csv", "scenario.toml", "set.toml", "input.csv", "result.csv", "inner"]
    + ["no/such/folder.csv", "con.csv", "a:b.csv", "-x.csv", "a\\\\b.csv", "a\\u0000b.csv", "x" * 200 + ".csv", "new"],
)
def test_baseline_is_written_over_a_baseline_only(write, chain, fmus, tmp_path, name):
    text = chain.replace('fmu = "Lag"', 'fmu = "Lag"\nparameters = ["set.toml"]')
    text = text[: text.rindex("[[connections]]")] + '[inputs.gain.u]\nfile = "input.csv"\ncolumn = "a.b"\n'
    path = write(text + BASELINE.format(name.format(tmp_path.as_posix())), set="[values]\n")
    folder, precious = path.parent, tmp_path / "precious"
    (folder / "inner").mkdir()
    (folder / "input.csv").write_text('"time","a.b"\n0.0,1.0\n2.0,1.0\n')
    for file in (
        precious.with_suffix(".txt"),
        precious.with_suffix(".csv"),
        folder / "notes.csv",
        folder / "notes.txt",
    ):
        file.write_text(OURS)
    (folder / "link.csv").symlink_to(tmp_path / "precious.csv")
    (folder / "folder").symlink_to(tmp_path)
    (folder / "result.csv").write_text('"time","a.b"\n0.0,1.0\n')
    (folder / "result.json").write_text('{"format": "gapsense result 2"}')
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    refused(gapsense("baseline", path, "--write", "--fmus", fmus), "baseline.file")
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


@pytest.mark.parametrize("name", ["baseline.csv", "inner/my baseline.csv", "./b.csv", "inner/../b.csv"])
def test_baseline_below_the_scenario_is_written_again(write, chain, fmus, name):
    path = write(chain + BASELINE.format(name))
    (path.parent / "inner").mkdir()
    assert gapsense("baseline", path, "--write", "--fmus", fmus).exit_code == 0
    path.write_text(path.read_text().replace("slope = 2.0", "slope = 3.0"))
    assert gapsense("baseline", path, "--write", "--fmus", fmus).output.endswith("Written.\n")
    assert test_scenario(path, fmus=fmus).passed


WRONG_NAMES = [
    "../x",
    "/tmp/x",
    "a/b",
    "a b",
    "a:b",
    "a\\\\b",
    "-x",
    ".x",
    "a\\u0000b",
    "",
    "nul",
    "COM1",
    "x" * 200,
    "1x",
]


@pytest.mark.parametrize("name", WRONG_NAMES)
def test_names_of_variants_are_those_of_files(write, chain, fmus, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    path = write(f'{chain}[variants."{name}"]\ndescription = "x"\n[variants."{name}".metrics]\n')
    assert [problem for problem in check(path, fmus=fmus) if "a variant's name is" in problem]
    before = {*tmp_path.rglob("*")}
    for command in ("run", "sweep", "figure", "test"):
        done = gapsense(command, path, "--fmus", fmus)
        assert done.exit_code in (1, 2) and isinstance(done.exception, SystemExit)
    assert {*tmp_path.rglob("*")} == before


@pytest.mark.parametrize("command", ["run", "figure", "checkpoint", "report"])
def test_what_is_not_ours_is_not_overwritten(write, chain, fmus, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    path = write(chain)
    assert gapsense("run", path, "--fmus", fmus).exit_code == 0
    endings = {"run": "csv", "figure": "png", "checkpoint": "checkpoint", "report": "html"}
    file = Path(f"results/demo.{endings[command]}")
    file.write_text(OURS)
    words = {
        "run": ("run", path, "--fmus", fmus),
        "figure": ("figure", path, "--fmus", fmus),
        "checkpoint": ("run", path, "--fmus", fmus, "--checkpoint", "0.5"),
        "report": ("report", "results/demo.csv"),
    }
    if command == "run":
        file.with_suffix(".json").unlink()
    refused(gapsense(*words[command]), str(file))
    assert file.read_text() == OURS
    if command == "figure":
        refused(gapsense("figure", "results/demo.csv"), str(file))
    file.unlink()
    if command == "checkpoint":  # the FMUs of this scenario save nothing
        words[command] = words["run"]
    assert gapsense(*words[command]).exit_code == 0
    assert gapsense(*words[command]).exit_code == 0


@pytest.mark.parametrize("name", ["con", "nul.d", "end.", "x" * 300, "a\tb", "COM1"])
def test_new_refuses_names_that_are_none_elsewhere(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    refused(gapsense("new", name), "Choose another one")
    assert not [*tmp_path.iterdir()]


def test_new_leaves_folders_of_others_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".mine.part").mkdir()
    (tmp_path / ".mine.part" / "kept").touch()
    assert gapsense("new", "mine").exit_code == 0
    assert (tmp_path / ".mine.part" / "kept").exists()


@pytest.mark.parametrize("variant", [None, "steep"])
def test_baseline_that_was_written_and_is_gone_fails(write, chain, fmus, variant):
    path = write(f"{chain}[variants.steep.components.source.set]\nslope = 3.0\n")
    words = ("--variant", variant) if variant else ()
    done = gapsense("baseline", path, "--write", "--fmus", fmus, *words)
    assert done.exit_code == 0 and "added, so that `gapsense test` fails if the" in " ".join(done.output.split())
    assert "added" not in gapsense("baseline", path, "--write", "--fmus", fmus, *words).output
    name = f"baseline.{variant}.csv" if variant else "baseline.csv"
    done = gapsense("test", path, "--fmus", fmus)
    assert done.exit_code == 0 and f"compared with {name}" in done.output
    (path.parent / name).unlink()
    done = gapsense("test", path, "--fmus", fmus)
    assert done.exit_code == 1 and "there is no file" in done.output


def test_baseline_of_the_scenario_asks_for_none_of_its_variants(write, chain, fmus):
    more = '[metrics.m]\nkind = "max_abs"\nsignal = "lag.y"\n[variants.steep.metrics.m]\nbounds = [0.0, 9.0]\n'
    path = write(chain + more)
    assert gapsense("baseline", path, "--write", "--fmus", fmus).exit_code == 0
    assert gapsense("test", path, "--fmus", fmus).exit_code == 0
    assert gapsense("baseline", path, "--write", "--fmus", fmus, "--variant", "steep").exit_code == 0
    assert gapsense("test", path, "--fmus", fmus).output.count("compared with") == 2
    (path.parent / "baseline.steep.csv").unlink()
    assert gapsense("test", path, "--fmus", fmus).exit_code == 1


def test_section_that_cannot_be_added_is_told(write, chain, fmus):
    path = write(f"variants = {{ steep = {{ title = 'x' }} }}\n{chain}")
    done = gapsense("baseline", path, "--write", "--fmus", fmus, "--variant", "steep")
    assert done.exit_code == 0 and "add a table `[variants.steep.baseline]`" in " ".join(done.output.split())
    assert load(path).variants


def test_test_says_whether_there_is_a_baseline(write, chain, fmus):
    path = write(chain)
    assert "no baseline" in gapsense("test", path, "--fmus", fmus).output
    gapsense("baseline", path, "--write", "--fmus", fmus)
    path.write_text(chain)
    assert "which no `[baseline]` names" in " ".join(gapsense("test", path, "--fmus", fmus).output.split())


@pytest.mark.parametrize(
    "file", sorted(SHIPPED.glob("*/baseline*.csv")), ids=lambda file: f"{file.parent.name}-{file.stem}"
)
def test_each_shipped_baseline_is_stated(file, tmp_path):
    text = (file.parent / "scenario.toml").read_text(encoding="utf-8")
    variant = file.stem.partition(".")[2] or None
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    data = parse_toml(text)
    assert variant in variants(tmp_path / "scenario.toml")
    assert "baseline" in data or "baseline" in data["variants"][variant]
    assert load(file.parent, variant).baseline.declared
