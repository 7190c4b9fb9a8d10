"""Messages say what was meant, and show what was written as it was written."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense.cli import app, console
from gapsense.report import table


def gapsense(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exception is None or isinstance(done.exception, SystemExit)
    return done.exit_code, " ".join(done.output.split())


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", ["run", "check", "sweep", "figure", "baseline"])
def test_misspelt_scenario_is_guessed(command):
    code, said = gapsense(command, "semera_vlave")
    assert code == 2 and "Did you mean `semera_valve`?" in said
    gapsense("new", "my_valve")
    assert "Did you mean `my_valve`?" in gapsense(command, "my_vlave")[1]
    assert "Did you mean `my_valve/scenario.toml`?" in gapsense(command, "my_valve/scenario.tml")[1]


def test_misspelt_file_after_a_run_is_no_other_scenario():
    gapsense("new", "my_valve")
    assert gapsense("run", "my_valve")[0] == 0
    code, said = gapsense("run", "my_valve/scenario.tml")
    assert code == 2 and "it belongs to the scenario" not in said and "`my_valve/scenario.toml`" in said


@pytest.mark.parametrize("words", [["--variant", "warm", "--variant", "cold"], ["--out", "a", "--out", "b"]])
def test_option_given_twice_is_refused(words):
    code, said = gapsense("run", "semera_valve", *words)
    assert code == 2 and f"`{words[0]}`: given twice. Keep one." in said


def test_sweep_of_no_seed_is_told_alone():
    code, said = gapsense("sweep", "semera_valve", "--seeds", "0")
    assert (code, said) == (2, "seeds: 0 found, at least 1 expected. Correct it.")


def test_report_on_a_record_does_not_say_run_again(folder):
    (folder / "valve.csv").write_text("time [s],voltage [V],current [A]\n0,0,0\n1e-3,1,0\n")
    code, said = gapsense("report", "valve.csv")
    assert code == 2 and "Run again" not in said and "gapsense inspect" in said


OTHERS = {  # what there is, which command is right for it, and commands that it is not for
    "x_sweep.sqlite": ("gapsense report x_sweep.csv", "figure report compare run sweep inspect campaign"),
    "x_sweep.csv": ("gapsense report x_sweep.csv", "figure compare run check inspect campaign"),
    "x_sweep.json": ("x_sweep.csv", "figure report compare run inspect campaign"),
    "run.csv": ("gapsense figure run.csv", "run check campaign"),
    "mine.csv": ("gapsense inspect mine.csv", "figure report run campaign"),
    "out": ("gapsense report out", "figure run sweep compare"),
    "out/campaign.sqlite": ("gapsense report out", "figure report compare run inspect campaign"),
    "x.parquet": ("it is a Parquet file", "figure report compare run inspect campaign"),
    "my valve.fmu": ("gapsense info 'my valve.fmu'", "figure report compare run inspect campaign"),
    "study.toml": ("gapsense campaign study.toml", "figure report compare run check inspect"),
    "scenario.toml": ("gapsense run scenario.toml", "report compare inspect campaign"),
    "page.html": ("it is a picture or a page", "figure compare run inspect campaign"),
}


@pytest.mark.parametrize(("name", "command"), [(name, c) for name in OTHERS for c in OTHERS[name][1].split()])
def test_file_of_another_kind_is_named_with_the_right_command(folder, name, command):
    contents = {
        "x_sweep.json": '{"format": "gapsense sweep 1"}',
        "run.json": '{"format": "gapsense result 2"}',
        "study.toml": 'title = "s"\nscenario = "semera_valve"\n',
        "scenario.toml": 'title = "s"\n[components.a]\nfmu = "Sensor"\n',
        "mine.csv": "time [s],voltage [V],current [A]\n0,0,0\n1e-3,1,0\n",
    }
    (folder / "out" / "runs").mkdir(parents=True)
    for file in [*OTHERS, *contents]:
        if file != "out":
            (folder / file).write_text(contents.get(file, ""))
    code, said = gapsense(command, *(["mine.csv"] if command == "compare" else []), name)
    assert code == 2 and name in said, said
    assert OTHERS[name][0] in said and "TOML" not in said and len(said.split(". ")) == 2, said


@pytest.mark.parametrize("name", ["mein Ventil", "it's", "a&b", "plain"])
def test_advised_command_can_be_copied(name):
    import shlex

    code, said = gapsense("new", name)
    assert code == 0
    advised = said.partition("Go on with `")[2].rpartition("`")[0]
    assert shlex.split(advised) == ["gapsense", "run", name]


@pytest.mark.parametrize("text", [":x:", "[red]a[/red]", ":warning: [bold]", "[/]", "a[1]", "`:smile:`", "[link=x]"])
def test_marks_are_shown_as_they_are(text, capsys, monkeypatch):
    for each in console.consoles():
        with each.capture() as captured:
            table.show(each, text, table.table(text, (text,), [(text,)]))
        assert captured.get().count(text) == 4
    assert table.text(text) == text
    assert text in gapsense("run", text.replace("/", "|"))[1] or "/" in text


@pytest.mark.parametrize("value", [10**18, 2**63, 2**53 + 1])
def test_limit_of_whole_numbers_is_told(folder, value):
    gapsense("new", "my_valve")
    file = folder / "my_valve" / "scenario.toml"
    file.write_text(file.read_text().replace("sensor = 1\n", f"sensor = {value}\n"))
    code, said = gapsense("check", "my_valve")
    assert code == 2 and "seeds.sensor" in said and "at most 9007199254740992" in said


@pytest.mark.parametrize("value", [10**18, 2**63, 2**53 + 1])
def test_limit_of_whole_numbers_is_told_of_settings_too(folder, value):
    gapsense("new", "my_valve")
    code, said = gapsense("run", "my_valve", "--set", f"sensor.seed={value}")
    assert code == 2 and "sensor.seed" in said and "at most 9007199254740992" in said


@pytest.mark.parametrize("seeds", [10**7, 10**18, 2**63, 10**90])
def test_limit_of_the_seeds_of_a_sweep_is_told(folder, seeds):
    gapsense("new", "my_valve")
    code, said = gapsense("sweep", "my_valve", "--seeds", str(seeds))
    assert code == 2 and f"3 x {seeds} runs found, at most 10000000 expected" in said.replace("\n", "")


@pytest.mark.parametrize(
    "words",
    [
        ("sweep", "semera_valve", "--workers"),
        ("campaign", "run", "x.toml", "--workers"),
        ("study", "ukf-noise", "--seeds"),
        ("study", "hybrid-ekf", "--seeds"),
        ("study", "measuring", "--seeds"),
        ("study", "estimators", "--seeds"),
        ("study", "run-to-run", "--runs"),
        ("study", "run-to-run", "--seed"),
        ("study", "monte-carlo", "--runs"),
        ("identify", "sample_valve.csv", "--starts"),
        ("identify", "sample_valve.csv", "--seed"),
    ],
)
@pytest.mark.parametrize("value", [-1, 10**18, 2**63])
def test_limits_of_numbers_of_runs_are_told(words, value):
    code, said = gapsense(*words, value)
    assert code == 2 and re.search(rf"'{words[-1]}': Input should be (less|greater) than or equal to \d", said), said


@pytest.mark.parametrize("lists", [8, 20, 320])
def test_limit_of_the_combinations_of_a_sweep_is_told(folder, lists):
    gapsense("new", "my_valve")
    file = folder / "my_valve" / "scenario.toml"
    many = "".join(f'"valve.p{k}" = {[*range(10)]}\n' for k in range(lists))
    file.write_text(file.read_text().replace('"valve.damping" = [0.2, 0.4, 0.8]\n', many))
    for command in ("check", "run", "sweep"):
        code, said = gapsense(command, "my_valve")
        assert code == 2 and "sweep: 10 x 10" in said and "at most 10000000 expected" in said, said


def test_minimal_scenario_names_the_command_that_tells_start_values(folder):
    gapsense("new", "my_valve")
    text = (folder / "my_valve" / "scenario.toml").read_text()
    assert "gapsense info SolenoidValve" in text and "gapsense list" not in text
    code, said = gapsense("info", "SolenoidValve")
    assert code == 0 and "coil.resistance Ohm 76" in said
