"""The commands of packages."""

from __future__ import annotations

import pytest
from packages import CHAIN, FMUS, SCENARIO, packed, structure
from typer.testing import CliRunner

from gapsense.cli import app


def gapsense(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "chain").mkdir()
    (tmp_path / "chain" / "scenario.toml").write_text(SCENARIO)
    return tmp_path


def test_a_package_is_written_and_read(folder, stock):
    done = gapsense("export-ssp", "chain", "--fmus", stock, "--out", "a.ssp", "--set", "gain.gain=5.0")
    assert (done.exit_code, done.output.strip()) == (0, "a.ssp written.")
    done = gapsense("import-ssp", "a.ssp", "--out", "mine")
    assert done.exit_code == 0 and "Go on with `gapsense run mine`." in done.output
    assert "gain = 5.0" in (folder / "mine" / "scenario.toml").read_text()
    assert gapsense("check", "mine").exit_code == 0


def test_what_is_left_out_is_told(folder, stock):
    packed(folder / "b.ssp", structure(CHAIN), stock, *FMUS)
    done = gapsense("import-ssp", "b.ssp", "--out", "mine", "--step", "0.2", "--method", "gauss-seidel")
    assert done.exit_code == 0 and "annotations of `org.openmodelica` are left out" in done.output
    assert 'method = "gauss-seidel"' in (folder / "mine" / "scenario.toml").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["export-ssp", "chain", "--out", "a.zip"], "the ending .ssp"),
        (["export-ssp", "nothing", "--out", "a.ssp"], "there is no such file"),
        (["import-ssp", "nothing.ssp", "--out", "mine"], "nothing.ssp"),
        (["import-ssp", "chain/scenario.toml", "--out", "mine"], "not a readable package"),
        (["import-ssp", "a.ssp", "--out", "chain"], "exists already"),
        (["import-ssp", "a.ssp", "--out", "mine", "--step", "0"], "base_step"),
    ],
)
def test_wrong_input_ends_with_2_and_a_sentence(folder, stock, arguments, words):
    packed(folder / "a.ssp", structure(CHAIN), stock, *FMUS)
    done = gapsense(*arguments, *(["--fmus", stock] if arguments[0] == "export-ssp" else []))
    assert done.exit_code == 2 and words in done.output.replace("\n", " ")
    assert not (folder / "mine").exists()
