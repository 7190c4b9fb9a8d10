"""Messages say what was meant, and show what was written as it was written."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense.cli import app, common
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
    assert code == 2 and "it is of the scenario" not in said and "`my_valve/scenario.toml`" in said


def test_report_on_a_record_does_not_say_run_again(folder):
    (folder / "valve.csv").write_text("time [s],voltage [V],current [A]\n0,0,0\n1e-3,1,0\n")
    code, said = gapsense("report", "valve.csv")
    assert code == 2 and "Run again" not in said and "gapsense inspect" in said


@pytest.mark.parametrize("name", ["mein Ventil", "it's", "a&b", "plain"])
def test_advised_command_can_be_copied(name):
    import shlex

    code, said = gapsense("new", name)
    assert code == 0
    advised = said.partition("Go on with `")[2].rpartition("`")[0]
    assert shlex.split(advised) == ["gapsense", "run", name]


@pytest.mark.parametrize("text", [":x:", "[red]a[/red]", ":warning: [bold]", "[/]", "a[1]", "`:smile:`", "[link=x]"])
def test_marks_are_shown_as_they_are(text, capsys, monkeypatch):
    for console in (common.out, common.err):
        with console.capture() as captured:
            table.show(console, text, table.table(text, (text,), [(text,)]))
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


def test_minimal_scenario_names_the_command_that_tells_start_values(folder):
    gapsense("new", "my_valve")
    text = (folder / "my_valve" / "scenario.toml").read_text()
    assert "gapsense info SolenoidValve" in text and "gapsense list" not in text
    code, said = gapsense("info", "SolenoidValve")
    assert code == 0 and "coil.resistance Ohm 76" in said
