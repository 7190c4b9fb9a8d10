"""Identify, build, run and estimate from the command line."""

from __future__ import annotations

import re
import shutil
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from typer.testing import CliRunner

from gapsense._os.files import read_columns
from gapsense.cli import app
from gapsense.cosim import run
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.valve.model import simulate
from gapsense.studies.devices import VALVE

ROOT = Path(__file__).resolve().parents[2]
DT, REST, PERIODS, SAMPLES, ON = 50e-6, 10, 2, 320, 100
SCALES = '"stop.lower" = 0.0\n"stop.upper" = 0.9e-3\n"spring.rest" = 22.5e-3\n"gap.slope" = 2.7e10\n'
KNOWN = '[values]\n"coil.turns" = 1180\n"mover.mass" = 1.7e-3\n' + SCALES


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two operations of the valve with 1 mA of noise, and another one at 26 V."""
    folder = tmp_path_factory.mktemp("data")
    for name, volts, seed in (("fit", 30.0, 1), ("other", 26.0, 2)):
        k = np.arange(REST + PERIODS * SAMPLES + 1)
        applied = np.where((k > REST) & ((k - REST - 1) % SAMPLES < ON), volts, 0.0)
        result = simulate(VALVE, np.stack((applied, applied), axis=1), DT, np.full(k.size, 76.0))
        current = result.current + 1e-3 * np.random.default_rng(seed).standard_normal(k.size)
        mode = np.where(result.position <= 0.0, 1, np.where(result.position >= 0.9e-3, 3, 2))
        samples = zip(k, applied.tolist(), current.tolist(), mode)
        rows = [f"{1e3 * DT * j:.6g},{v!r},{i!r},{m}" for j, v, i, m in samples]
        text = "\n".join(["time [ms],voltage [V],current [A],mode [1]", *rows]) + "\n"
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
    (folder / "known.toml").write_text(KNOWN, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def identified(data):
    """Parameter set that the command has written, and what it printed."""
    command = ["identify", "fit.csv", "--parameters", "known.toml"]
    more = ["--validate", "other.csv", "--figure", "fit.png", "--voltage", "end", "--starts", "1"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(data)
        done = CliRunner().invoke(app, [*command, *more])
    assert (done.exit_code, done.stderr) == (0, "")
    return data / "valve.toml", done.stdout


def values(file: Path) -> dict[str, float]:
    lines = re.findall(r'^"?([\w.]+)"? = ([\d.e+-]+)', file.read_text("utf-8"), re.MULTILINE)
    return {name: float(text) for name, text in lines}


def test_identify_writes_a_parameter_set_and_says_how_certain_it_is(identified, data):
    file, printed = identified
    found = values(file)
    assert found["coil.turns"] == pytest.approx(1200.0, rel=5e-3)
    assert found["mover.mass"] == pytest.approx(1.6e-3, rel=0.06)
    assert found["coil.resistance"] == pytest.approx(76.0, rel=1e-3)
    assert 'assumed = ["stop.restitution"]' in file.read_text("utf-8") and "Assumed, neither given nor found" in printed
    for words in ("standard error", "Correlations", "Validation", "other", "`damping` is not identified", "1 of 1"):
        assert words in printed, printed
    told = " ".join(printed.split())
    assert "take the scale of the voltage, the scale of the current, `stop.lower`, `stop.upper`" in told
    assert "`--accuracy` puts what is known of them into the errors" in told
    assert (data / "fit.png").read_bytes().startswith(b"\x89PNG")


NAMES = ("drive_voltage", "solenoid_valve", "sensor", "semera", "integral_estimator", "ekf")  # of the scenario, and one


@pytest.mark.slow
def test_identified_set_builds_fmus_that_run_with_it(identified, data, gapsense, monkeypatch):
    monkeypatch.chdir(ROOT)
    file, _ = identified
    built = data / "built"
    assert gapsense("build", *NAMES, "--parameters", file, "--out", built).exit_code == 0
    expected = values(file)
    valve = {v.name: v.start for v in fmpy.read_model_description(str(built / "SolenoidValve.fmu")).modelVariables}
    assert {name: float(valve.get(name, expected[name])) for name in expected} == expected
    assert set(expected) - set(valve) == {"noise.voltage", "noise.current"}
    ekf = {v.name: v.start for v in fmpy.read_model_description(str(built / "Ekf.fmu")).modelVariables}
    assert float(ekf["mover.mass"]) == expected["mover.mass"] and float(ekf["gap.fringing"]) == 0.0
    assert float(ekf["noise.current"]) == expected["noise.current"] == pytest.approx(1e-3, rel=0.1)
    shutil.copytree(ROOT / "scenarios" / "semera_valve", data / "scenario")
    shutil.copy(file, data / "scenario" / "parameters" / "valve.toml")
    set_in_scenario = run(data / "scenario", fmus=built)
    text = (data / "scenario" / "scenario.toml").read_text("utf-8")
    text = text.replace('fmu = "SolenoidValve"\nparameters = ["parameters/valve.toml"]', 'fmu = "SolenoidValve"')
    (data / "scenario" / "scenario.toml").write_text(text, encoding="utf-8")
    by_start_values = run(data / "scenario", fmus=built)
    np.testing.assert_array_equal(by_start_values["valve.current"], set_in_scenario["valve.current"])
    assert by_start_values.parameters["valve.coil.turns"] == expected["coil.turns"]


def test_estimators_run_on_the_record(identified, data, gapsense, fmus, monkeypatch):
    monkeypatch.chdir(ROOT)
    options = ["--parameters", identified[0], "--fmus", fmus, "--figure", data / "e.png", "--out", data / "e.csv"]
    done = gapsense("estimate", data / "fit.csv", "--estimator", "ekf, integral_estimator,Semera", *options)
    assert (done.exit_code, done.stderr) == (0, "")
    found = read_columns(data / "e.csv")
    assert found["time"].size == REST + PERIODS * SAMPLES + 1
    assert '"voltage [V]","current [A]"' in (data / "e.csv").read_text("utf-8").partition("\n")[0]
    assert read_record(data / "e.csv").current.tolist() == found["current"].tolist()
    assert found["Semera.resistance"][-1] == pytest.approx(76.0, abs=0.5)
    assert found["Ekf.position"].min() < 0.05e-3 and found["Ekf.position"].max() > 0.85e-3
    assert (data / "e.png").read_bytes().startswith(b"\x89PNG")


def without_mode(data: Path) -> Path:
    lines = (data / "fit.csv").read_text("utf-8").splitlines()
    (data / "plain.csv").write_text("\n".join(line.rpartition(",")[0] for line in lines) + "\n", encoding="utf-8")
    return data / "plain.csv"


def test_missing_mode_is_said_and_what_to_do(data, gapsense, fmus, monkeypatch):
    monkeypatch.chdir(ROOT)
    plain = without_mode(data)
    done = gapsense("estimate", plain, "--estimator", "ertss,semera", "--fmus", fmus)
    assert done.exit_code == 2 and not done.stdout
    assert re.search(r"Ertss needs `mode`.*Add a column `mode \[1\]`.*choose an estimator.*Semera", done.stderr)
    every = gapsense("estimate", plain, "--fmus", fmus, "--figure", data / "p.png")
    assert every.exit_code == 1  # for estimators of other devices, without the parameters of this one
    assert "left out: Ekf needs `mode`" in every.stderr and "Semera" in every.stdout
    assert (data / "p.png").exists()
    assert "HybridEkf: its `health` is 0 most of the time" in every.stderr and "\nSemera:" not in every.stderr


RECORDS = Path(__file__).parents[1] / "identification" / "records"
WRONG = {
    "unknown model": (["identify", "fit.csv", "--model", "relay"], ["--model", "`relay`", "solenoid_valve"]),
    "no file": (["identify", "none.csv"], ["none.csv", "No such file"]),
    "wrong period": (["identify", "fit.csv", "--period", "0.02"], ["at its end", "--period"]),
    "unknown known": (["identify", "fit.csv", "--parameters", "bad.toml"], ["mover.mas", "`mover.mass`"]),
    "unknown convention": (["identify", "fit.csv", "--voltage", "mean"], ["--voltage", "trapezoid"]),
    "odd column": (["identify", "fit.csv", "--column", "u1"], ["--column", "QUANTITY=NAME"]),
    "odd quantity": (["identify", "fit.csv", "--column", "volts=u1"], ["volts", "`voltage`"]),
    "another device": (
        ["identify", RECORDS / "tube-150-raw.csv", "--model", "solenoid_valve", "--parameters", "known.toml"],
        ["tube-150-raw: its inductance is about 332.3 uH, that of the first guess", "`--parameters`"],
    ),
    "no period": (["identify", "fit.csv", "--period", "-1"], ["--period"]),
    "no number": (["inspect", "fit.csv", "--period", "nan"], ["--period"]),
    "no resistance": (["inspect", "fit.csv", "--resistance", "0"], ["--resistance"]),
    "odd decimal mark": (["identify", "fit.csv", "--decimal", "x"], ["--decimal", "`x`"]),
    "pushing driver": (["identify", "fit.csv", "--driver", "series=-1"], ["--driver", "`series=-1`"]),
    "negative accuracy": (["identify", "fit.csv", "--accuracy", "voltage=-1"], ["`voltage=-1`", "none negative"]),
    "odd offset": (["estimate", "fit.csv", "--offset", "current=nan"], ["--offset", "`current=nan`"]),
    "no FMUs": (["estimate", "fit.csv", "--estimator", "semera", "--fmus", "none"], ["no FMU", "Semera.fmu"]),
    "odd figure": (["identify", "fit.csv", "--figure", "x.bmp"], ["x.bmp", ".png"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_refused_in_sentences(data, gapsense, monkeypatch, case):
    arguments, words = WRONG[case]
    monkeypatch.chdir(data)
    Path("bad.toml").write_text('[values]\n"mover.mas" = 1.0\n', encoding="utf-8")
    out = ["--out", "not.toml"] if arguments[0] != "inspect" else []
    done = gapsense(*arguments, *out)
    assert done.exit_code == 2 and not done.stdout and not Path("not.toml").exists()
    assert all(word in done.stderr for word in words), done.stderr


READ = {
    "identify": (["fit.csv", "--out", "fit.csv"], "are written as .toml"),
    "its table": (["identify", "fit.csv", "--inductance", "x_law.csv", "--out", "x.toml"], "would replace `x_law.csv`"),
    "commission": (["fit.csv", "--parameters", "known.toml", "--assume", "--out", "fit.csv"], "written as .toml"),
    "gap-law": (["x_law.csv", "--turns", "1000", "--out", "x.toml"], "would replace `x_law.csv`"),
    "estimate": (["fit.csv", "--estimator", "semera", "--out", "fit.csv"], "would replace `fit.csv`"),
}


@pytest.mark.parametrize("case", READ)
def test_what_is_read_is_never_replaced(data, gapsense, monkeypatch, case):
    arguments, words = READ[case]
    monkeypatch.chdir(data)
    law = "gap [mm],inductance [mH]\n0.0,250\n0.2,180\n0.4,130\n0.6,105\n0.8,85\n0.9,80\n"
    Path("x_law.csv").write_text(law, encoding="utf-8")
    before = {file: file.read_bytes() for file in data.iterdir()}
    done = gapsense(*([] if case == "its table" else [case]), *arguments)
    assert done.exit_code == 2 and words in " ".join(done.stderr.split()), done.output
    assert {file: file.read_bytes() for file in data.iterdir()} == before


@pytest.fixture
def wrong(data):
    """The folder, with parameter sets of which one has a wrong name and the other wrong values."""
    (data / "bad.toml").write_text('[values]\n"mover.mas" = 1.0\n', encoding="utf-8")
    (data / "range.toml").write_text('[values]\n"mover.mass" = -1.0\ndamping = true\n', encoding="utf-8")
    return data


@pytest.mark.parametrize(
    ("estimator", "words"), [("kalman", ["`kalman`", "Semera"]), ("semera", ["`mover.mas`", "`mover.mass`"])]
)
def test_estimate_refuses_wrong_names(wrong, gapsense, fmus, monkeypatch, estimator, words):
    monkeypatch.chdir(ROOT)
    known = ["--parameters", wrong / "bad.toml"] if estimator == "semera" else []
    done = gapsense("estimate", wrong / "fit.csv", "--estimator", estimator, *known, "--fmus", fmus)
    assert done.exit_code == 2 and all(word in done.stderr for word in words), done.stderr


@pytest.mark.parametrize(
    ("component", "file", "words"),
    [
        ("semera", "bad.toml", ["`mover.mas`", "`mover.mass`"]),
        ("ekf", "range.toml", ["Ekf: `mover.mass` is -1.0;", "Ekf: `damping` is true;"]),
    ],
)
def test_build_refuses_wrong_names_and_values(wrong, gapsense, monkeypatch, component, file, words):
    monkeypatch.chdir(ROOT)
    done = gapsense("build", component, "--parameters", wrong / file, "--out", wrong / "x")
    assert done.exit_code == 2 and not (wrong / "x").exists(), done.output
    assert all(word in done.stderr for word in words), done.stderr


def test_gap_table_of_a_parameter_set_travels_in_the_fmus(data, gapsense, monkeypatch):
    (data / "tables").mkdir()
    shutil.copy(ROOT / "fmus" / "solenoid_valve" / "fringing_19.csv", data / "tables" / "mine.csv")
    text = '[values]\n"gap.law" = "table"\n"gap.file" = "tables/mine.csv"\n'
    (data / "table.toml").write_text(text, encoding="utf-8")
    names = ("solenoid_valve", "ekf", "semera")
    monkeypatch.chdir(data)
    done = gapsense("build", *names, "--parameters", "table.toml", "--out", "tabled")
    assert (done.exit_code, done.stderr) == (0, "")
    for name in ("SolenoidValve", "Ekf"):
        description = fmpy.read_model_description(str(data / "tabled" / f"{name}.fmu"))
        start = {v.name: v.start for v in description.modelVariables}
        assert (start["gap.law"], start["gap.file"]) == ("table", "mine.csv")
        with zipfile.ZipFile(data / "tabled" / f"{name}.fmu") as archive:
            assert archive.read("resources/mine.csv") == (data / "tables" / "mine.csv").read_bytes()
            assert not [n for n in archive.namelist() if n.endswith(".py") and str(data).encode() in archive.read(n)]


def test_driver_is_taken_out_of_fit_and_validation_and_noted_in_the_file(data, gapsense, tmp_path):
    files = [data / "fit.csv", "--validate", data / "other.csv", "--parameters", data / "known.toml"]
    options = ["--voltage", "end", "--starts", "1", "--forms", "plain", "--driver", "series=2"]
    result = gapsense("identify", *files, *options, "--out", tmp_path / "valve.toml")
    assert result.exit_code in (0, 1) and "series, while on" in result.output
    text = (tmp_path / "valve.toml").read_text("utf-8")
    assert "# Taken out of the recorded voltage and current: series 2 Ohm." in text
    assert values(tmp_path / "valve.toml")["coil.resistance"] < 75.0  # the rest of 76 Ohm, nearly


def test_resistance_of_another_voltage_than_the_coils_is_refused(data, gapsense, tmp_path):
    (tmp_path / "known.toml").write_text(KNOWN + '"coil.resistance" = 48\n', encoding="utf-8")
    options = ["--voltage", "end", "--starts", "1", "--forms", "plain", "--parameters", tmp_path / "known.toml"]
    result = gapsense("identify", data / "fit.csv", *options, "--out", tmp_path / "valve.toml")
    assert result.exit_code == 1 and "PWM sampled in step" in " ".join(result.output.split())


def written_as(folder, current):
    rows = [f"{DT * k:.6g},{30.0 if 10 < k < 110 else 0.0!r},{i!r}" for k, i in enumerate(current.tolist())]
    (folder / "record.csv").write_text("\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n", encoding="utf-8")


def test_a_current_that_no_coil_has_writes_no_file(gapsense, tmp_path):
    written_as(tmp_path, 1e300 * np.clip(np.minimum(np.arange(400) - 10, 300 - np.arange(400)), 0, 100) / 100.0)
    done = gapsense("identify", "record.csv", "--assume", "--out", "made.toml")
    assert done.exit_code == 2 and "`current` is 1e+300 A, at most 1e+06 A are expected" in " ".join(
        done.stderr.split()
    ), done.output
    assert not Path("made.toml").exists()


def test_estimates_of_white_noise_are_doubted(gapsense, fmus, tmp_path):
    rng = np.random.default_rng(1)
    rows = [f"{DT * k:.6g},{u!r},{i!r}" for k, (u, i) in enumerate(rng.standard_normal((2000, 2)).tolist())]
    text = "\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n"
    (tmp_path / "record.csv").write_text(text, encoding="utf-8")
    done = gapsense("estimate", "record.csv", "--estimator", "bounded_ukf", "--fmus", fmus)
    assert done.exit_code == 1 and "does not rise above its noise" in " ".join(done.stderr.split()), done.output
