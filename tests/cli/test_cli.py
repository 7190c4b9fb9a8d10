"""The command line: what it prints, what it writes, how it ends."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer

from gapsense.cli import app
from gapsense.cli.console import report_errors
from gapsense.cosim.run.loop import compiled
from gapsense.kernels.trace import TraceError
from gapsense.version import __version__

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = sorted(typer.main.get_command(app).commands)
PNG = b"\x89PNG\r\n\x1a\n"


# Help -----------------------------------------------------------------------------------------------------------------


def test_help_names_every_command_and_the_exit_codes(gapsense):
    done = gapsense("--help")
    assert done.exit_code == 0
    assert all(re.search(rf"^\W*{name}\b", done.output, re.MULTILINE) for name in COMMANDS)
    found = re.findall(r"^│ ([a-z-]+) +[A-Z]", done.output, re.MULTILINE)
    alone = [name for name in found if name not in ("campaign", "study")]  # groups stand at the end
    assert len(alone) > 20 and alone == sorted(alone)
    assert "130 interrupted" in " ".join(re.sub(r"[^\w\s]", " ", done.output).split())
    assert gapsense("-h").output == done.output


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_says_what_it_does_by_either_option(gapsense, command):
    done = gapsense(*command.split(), "--help")
    assert done.exit_code == 0
    assert f"gapsense {command}" in done.output or f" {command} " in done.output
    assert len(done.output.splitlines()) > 5
    assert gapsense(*command.split(), "-h").output == done.output


def test_version_is_that_of_the_package(gapsense):
    done = gapsense("--version")
    assert (done.exit_code, done.output) == (0, f"gapsense {__version__}\n")


def test_without_a_command_the_help_is_shown(gapsense):
    assert "Usage" in gapsense().output


@pytest.mark.parametrize(
    "arguments", [["runn"], ["run"], ["run", "x", "--colour", "red"], ["sweep", "x", "--seeds", "y"]]
)
def test_wrong_usage_is_wrong_input(gapsense, arguments):
    assert gapsense(*arguments).exit_code == 2


def test_kernel_that_cannot_be_traced_is_wrong_input(capsys):
    with pytest.raises(SystemExit) as end, report_errors():
        raise TraceError("kernel.py:3, in step: `if` on a traced value. Use where().")
    assert end.value.code == 2
    assert capsys.readouterr().err == "kernel.py:3, in step: `if` on a traced value. Use where().\n"


# Checkout -------------------------------------------------------------------------------------------------------------


def test_list_shows_components_and_scenarios(gapsense, monkeypatch):
    monkeypatch.chdir(ROOT / "docs")  # the checkout is found from below
    done = gapsense("list")
    assert done.exit_code == 0
    for name in ("SolenoidValve", "Semera", "semera_valve", "literal"):
        assert name in done.output


def test_list_names_what_comes_with_the_package_and_what_is_here(gapsense, write):
    write()
    write(("title", "titel"), folder="broken")
    done = gapsense("list")
    assert done.exit_code == 0
    names = re.findall(r"^  (\w+)", done.output.partition("Scenarios\n")[2], re.MULTILINE)
    assert {"semera_valve", "short", "broken"} <= set(names)


def test_list_cuts_no_name_at_80_columns(gapsense, write):
    lines = gapsense("list").output.splitlines()
    assert max(map(len, lines)) <= 80
    folders = [p.name for kind in ("fmus", "scenarios") for p in (ROOT / kind).iterdir() if p.is_dir()]
    first = {line.split()[0].lower().replace("_", "") for line in lines if line.strip()}
    assert {name.replace("_", "") for name in folders if name != "__pycache__"} <= first


def test_build_outside_a_checkout_writes_to_the_working_folder(process):
    building = process("from gapsense.cli import app; app()", "build", "sensor")  # in which no FMU was loaded
    assert building.wait() == 0, building.stderr.read()
    assert [p.as_posix() for p in Path().rglob("*.fmu")] == ["build/fmus/Sensor.fmu"]


def test_build_in_a_process_that_has_loaded_fmus_gives_the_same_fmu_and_harms_none(process, write, fmus):
    folder = write()
    code = f"""
from gapsense import cosim
from gapsense.cli import app
before = cosim.run({str(folder)!r}, fmus={str(fmus)!r})
assert app(["build", "sensor"], standalone_mode=False) == 0
after = cosim.run({str(folder)!r}, fmus={str(fmus)!r})
assert (before["sensor.current_measured"] == after["sensor.current_measured"]).all()
"""
    running = process(code)
    assert running.wait() == 0, running.stderr.read()
    assert Path("build", "fmus", "Sensor.fmu").read_bytes() == (fmus / "Sensor.fmu").read_bytes()


def test_example_runs_by_its_name_unless_there_is_a_scenario_of_that_name(gapsense, write, fmus):
    assert gapsense("check", "semera_valve", "--fmus", fmus).exit_code == 0
    Path("semera_relay").mkdir()
    assert gapsense("check", "semera_relay", "--fmus", fmus).exit_code == 0
    write(("title", "titel"), folder="semera_valve")
    assert "title: missing" in problems(gapsense("check", "semera_valve", "--fmus", fmus))[0]


# Checks ---------------------------------------------------------------------------------------------------------------


def problems(done) -> list[str]:
    """Lines on the error stream of a command that found wrong input: sentences, nothing else."""
    assert done.exit_code == 2, done.output
    assert not done.stdout
    lines = done.stderr.splitlines()
    assert all(line.endswith((".", "?")) for line in lines), lines
    return lines


def test_good_scenario_has_no_problems(gapsense, write, fmus):
    done = gapsense("check", write(), "--fmus", fmus)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "no problems" in done.stdout


WRONG = {
    "unknown key": ("\nstep = 2", "\nstepp = 2", ["components.sensor.stepp: unknown key", "`step`"]),
    "unknown variable": ('"valve.current"\nto', '"valve.curent"\nto', ["connections[2]", "`curent`", "`current`"]),
    "syntax": ("stop = 2e-3", "stop = = 2e-3", ["scenario.toml", "line 5"]),
    "unknown FMU": (
        '"SolenoidValve"',
        '"SolenoidValvee"',
        ["components.valve.fmu", "`SolenoidValve`", "gapsense build"],
    ),
    "not a number": ('waveform = "square" }', '"square.duty" = nan }', ["square.duty", "nan"]),
    "out of range": ('waveform = "square" }', '"square.duty" = 2.0 }', ["square.duty", "2.0", "0 to 1"]),
    "step and sample time": ("\nstep = 2", "\nstep = 3", ["components.sensor", "sample_time", "7.5e-05 s"]),
    "no whole number of steps": ("stop = 2e-3", "stop = 2.01e-3", ["80.4 steps"]),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("command", ["check", "run"])
def test_wrong_scenario_is_refused_in_one_sentence(gapsense, write, fmus, command, case):
    old, new, words = WRONG[case]
    lines = problems(gapsense(*command.split(), write((old, new)), "--fmus", fmus))
    assert len(lines) == 1
    assert all(word in lines[0] for word in words), lines
    assert not Path("results").exists()


def test_all_problems_come_at_once(gapsense, write, fmus):
    cases = [WRONG[name][:2] for name in ("unknown key", "unknown variable", "out of range")]
    lines = problems(gapsense("check", write(*cases), "--fmus", fmus))
    text = "\n".join(lines)
    assert len(lines) >= 3
    assert all(word in text for word in ("stepp", "curent", "square.duty"))


def test_missing_folder_of_fmus_is_named_for_every_component(gapsense, write):
    lines = problems(gapsense("check", write(), "--fmus", "nowhere"))
    assert len(lines) == 3
    assert all("nowhere" in line and "gapsense build" in line for line in lines)


@pytest.mark.parametrize("command", ["check", "run", "sweep", "figure", "baseline", "study observability", "test"])
def test_missing_scenario_is_named(gapsense, fmus, command):
    lines = problems(gapsense(*command.split(), "nowhere", "--fmus", fmus))
    assert len(lines) == 1 and "nowhere" in lines[0]


@pytest.mark.parametrize("command", ["check", "run", "sweep", "figure", "baseline", "study observability"])
def test_unknown_variant_is_named(gapsense, write, fmus, command):
    lines = problems(gapsense(*command.split(), write(), "--variant", "other", "--fmus", fmus))
    assert len(lines) == 1 and "`other`" in lines[0]


def test_folder_without_scenarios_is_refused(gapsense, fmus):
    Path("empty").mkdir()
    assert "no `scenario.toml`" in problems(gapsense("test", "empty", "--fmus", fmus))[0]


# Runs -----------------------------------------------------------------------------------------------------------------


def test_run_writes_csv_and_json_and_prints_tables(gapsense, write, fmus):
    done = gapsense("run", write(), "--fmus", fmus)
    assert (done.exit_code, done.stderr) == (0, "")
    for word in ("Errors", "current [mA]", "1 mA", "this run", "real-time factor", "sensor", "us per step"):
        assert word in done.stdout, word
    header, *rows = Path("results", "short.csv").read_text("utf-8").splitlines()
    assert header.startswith('"time [s]","drive.voltage [V]"') and len(rows) == 81
    side = json.loads(Path("results", "short.json").read_text("utf-8"))
    assert side["rows"] == 81 and not side["interrupted"] and side["metrics"]["current_error"]["unit"] == "A"
    assert sorted(p.name for p in Path("results").iterdir()) == ["short.csv", "short.json"]


LIMITED = """
import resource, sys
size = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
from gapsense.cli import app
app()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no limit of file sizes")
@pytest.mark.parametrize(
    ("size", "command", "file"),
    [
        (1000, ["run"], "gapsense-"),  # an FMU cannot be extracted
        pytest.param(500_000, ["run"], "gapsense-.*/rows", marks=pytest.mark.slow),
        (700_000, ["run"], "results/short.csv"),
        pytest.param(500_000, ["sweep", "--seeds", 2, "--signals"], "00000.csv", marks=pytest.mark.slow),
    ],
)
def test_file_that_cannot_be_written_is_named(process, write, fmus, size, command, file):
    path = write(("stop = 2e-3", "stop = 100e-3"))
    done = process(LIMITED, size, command[0], path, *command[1:], "--fmus", fmus)
    out, err = done.communicate(timeout=60)
    assert done.returncode == (2 if command[0] == "run" else 3), err
    assert ("us per step" in out) is (file == "results/short.csv")  # what was computed is shown
    assert re.search(rf"{file}[^ ]*`: File too large", err) and "Traceback" not in err
    assert command[0] == "sweep" or "(`ulimit -f`), or choose another folder" in err


STREAMS = "import sys\n{}\nfrom gapsense.cli import app\napp()"


@pytest.mark.skipif(sys.platform == "win32", reason="a pipe without a reader is another error there")
def test_result_is_saved_also_where_nobody_reads_what_is_shown(process, write, fmus):
    started = process(STREAMS.format(""), "run", write(), "--fmus", fmus)
    started.stdout.close()
    started.wait(timeout=60)
    assert "Traceback" not in started.stderr.read()
    assert sorted(p.name for p in Path("results").iterdir()) == ["short.csv", "short.json"]


def test_run_needs_no_error_stream(process, write, fmus):
    started = process(STREAMS.format("sys.stderr = None"), "run", write(), "--fmus", fmus)
    assert "81 rows" in started.communicate(timeout=60)[0]
    assert started.returncode == 0


def test_run_with_check_does_not_run(gapsense, write, fmus):
    assert gapsense("run", write(), "--check", "--fmus", fmus).exit_code == 0
    assert not Path("results").exists()


def test_metric_outside_its_bounds_fails_but_keeps_the_results(gapsense, write, fmus):
    done = gapsense("run", write(("bounds = [0.0, 0.01]", "bounds = [0.0, 1e-9]")), "--fmus", fmus)
    assert done.exit_code == 1
    assert re.fullmatch(r"outside its bounds: current_error = \S+ A, bounds 0 to 1e-09 A\n", done.stderr)
    assert Path("results", "short.csv").is_file()


def test_parameters_that_a_component_would_refuse_are_refused_before_the_run(gapsense, write, fmus):
    wrong = ('fmu = "Sensor"', 'fmu = "Sensor"\nset = { "contact.lower" = 1e-3 }')
    done = gapsense("run", write(wrong), "--fmus", fmus)
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 1
    assert "`contact.lower` is 0.001; expected less than `contact.upper` = 0.00085" in done.stderr
    assert not Path("results").exists()


def test_component_that_fails_in_mid_run_is_quoted_and_the_rows_before_are_kept(gapsense, write, fmus):
    wrong = ('waveform = "square" }', '"square.delay" = 1e-3, "square.amplitude" = 1e308 }')
    done = gapsense("run", write(wrong), "--fmus", fmus)
    assert done.exit_code == 3
    kept, told = done.stderr.splitlines()
    assert re.fullmatch(r"results/short.csv: 4\d rows from before the failure\.", kept)
    assert re.match(
        r"valve, t = 0\.001\d* s \(base step 4\d\): fmi2DoStep returned fmi2(Error|Fatal); the component says: ", told
    )
    side = json.loads(Path("results", "short.json").read_text("utf-8"))
    assert side["failure"] == told and side["rows"] == int(kept.split()[1])


def test_folder_that_cannot_be_made_is_named(gapsense, write, fmus):
    Path("taken").write_text("a file")
    done = gapsense("run", write(), "--fmus", fmus, "--out", "taken")
    assert done.exit_code == 2
    assert "`taken`" in done.stderr and len(done.stderr.splitlines()) == 1


# Sweeps ---------------------------------------------------------------------------------------------------------------


def test_sweep_goes_on_where_it_was(gapsense, write, fmus):
    arguments = ("sweep", write(), "--fmus", fmus, "--workers", 1)
    first = gapsense(*arguments, "--seeds", 2)
    assert first.exit_code == 0, first.output
    assert "2 runs, 2 of them computed now" in first.stdout
    again, more = gapsense(*arguments, "--seeds", 2), gapsense(*arguments, "--seeds", 3)
    assert "2 runs, 0 of them computed now" in again.stdout
    assert "3 runs, 1 of them computed now" in more.stdout
    for word in ("Errors, 3 seeds", "median", "5 %", "95 %", "first seed", "current [mA]"):
        assert word in more.stdout, word


@pytest.mark.parametrize("engine", ["fmu", "vectors"])
def test_sweep_in_which_every_run_fails_says_why(gapsense, write, fmus, engine):
    wrong = ('fmu = "SolenoidValve"', 'fmu = "SolenoidValve"\nset = { damping = 1e300 }')
    done = gapsense("sweep", write(wrong), "--fmus", fmus, "--seeds", 2, "--workers", 1, "--engine", engine)
    assert done.exit_code == 3
    assert [line[:13] for line in done.stderr.splitlines()] == ["run 0: valve,", "run 1: valve,"]
    how = ", as vectors" * (engine == "vectors")
    assert f"2 runs, 2 of them computed now{how}, 2 failed." in " ".join(done.stdout.split())


def test_sweep_says_where_the_loop_is_not_in_c(gapsense, write, fmus, monkeypatch):
    monkeypatch.setattr(compiled, "BINARY", Path("none.so"))
    done = gapsense("sweep", write(), "--fmus", fmus, "--seeds", 1, "--workers", 1, "--engine", "fmu")
    assert done.exit_code == 0 and done.stdout.count("The loop in C cannot be loaded here") == 1


def test_sweep_without_runs_or_seeds_is_refused(gapsense, write, fmus):
    assert "at least 1" in problems(gapsense("sweep", write(), "--fmus", fmus, "--seeds", 0))[0]
    seedless = write(("[seeds]\nsensor = 1", ""))
    assert "Add `[sweep]` or `[seeds]`" in problems(gapsense("sweep", seedless, "--fmus", fmus))[0]


# Figures --------------------------------------------------------------------------------------------------------------

FEW = ('"valve.*", "sensor.*_measured"', '"valve.current", "sensor.current_measured"')  # a figure has a row for each


def test_figure_is_a_png(gapsense, write, fmus):
    done = gapsense("figure", write(FEW), "--fmus", fmus)
    assert (done.exit_code, done.stderr) == (0, "")
    assert Path("results", "short.png").read_bytes()[:8] == PNG
    assert [p.name for p in Path("results").iterdir()] == ["short.png"]


def test_figure_of_a_saved_result_needs_no_run(gapsense, write, fmus, monkeypatch):
    gapsense("run", write(FEW), "--fmus", fmus)
    monkeypatch.setattr("gapsense.cosim.run", lambda *_, **__: pytest.fail("it ran"))
    done = gapsense("figure", "results/short.csv")
    assert done.exit_code == 0 and Path("results/short.png").read_bytes()[:8] == PNG
    assert "--set apply to a" in problems(gapsense("figure", "results/short.csv", "--set", "valve.damping=1"))[0]


def test_value_on_the_command_line_wins(gapsense, write, fmus):
    gapsense("run", write(), "--fmus", fmus, "--set", "valve.coil.resistance=50", "--set", "drive.waveform=step")
    file = Path("results/short_valve.coil.resistance=50_drive.waveform=step.json")
    parameters = json.loads(file.read_text("utf-8"))["parameters"]
    assert (parameters["valve.coil.resistance"], parameters["drive.waveform"]) == (50.0, "step")


@pytest.mark.parametrize("command", ["check", "run", "sweep", "figure"])
def test_wrong_value_on_the_command_line_is_told(gapsense, write, fmus, command):
    (line,) = problems(gapsense(command, write(), "--fmus", fmus, "--set", "valve.dampin=0.4"))
    assert "(from --set): unknown parameter `dampin`. Did you mean `damping`?" in line


@pytest.mark.parametrize("ending", ["jpg", "csv"])
def test_figure_of_another_ending_is_refused_before_the_run(gapsense, write, fmus, ending, monkeypatch):
    monkeypatch.setattr("gapsense.cosim.run", lambda *_, **__: pytest.fail("ran"))
    lines = problems(gapsense("figure", write(), "--fmus", fmus, "--out", f"x.{ending}"))
    assert len(lines) == 1 and f"`x.{ending}`" in lines[0] and ".svg" in lines[0]


def test_figure_that_there_is_none_of_is_refused(gapsense, write, fmus):
    lines = problems(gapsense("figure", write(("[experiment]", 'figure = "pie"\n[experiment]')), "--fmus", fmus))
    assert len(lines) == 1 and "`pie`" in lines[0] and "overview" in lines[0]


def test_figure_names_the_signals_it_lacks(gapsense, write, fmus):
    lines = problems(gapsense("figure", write(("[experiment]", 'figure = "semera"\n[experiment]')), "--fmus", fmus))
    assert len(lines) == 1 and "`semera.quality`" in lines[0] and "`valve.current`" not in lines[0]
    assert not Path("results").exists()


# Regression tests -----------------------------------------------------------------------------------------------------


def test_scenarios_are_tested_and_reported_as_junit(gapsense, write, fmus):
    write(folder="all/good")
    write(("bounds = [0.0, 0.01]", "bounds = [0.0, 1e-9]"), folder="all/bad")
    done = gapsense("test", "all", "--fmus", fmus, "--junit", "reports/junit.xml")
    assert done.exit_code == 1
    assert re.search(r"FAILED  bad .*\n  metric current_error: .*outside its bounds", done.stdout)
    assert "passed  good" in done.stdout and "1 passed, 1 failed" in done.stdout
    root = ElementTree.parse("reports/junit.xml").getroot()
    assert root.get("failures") == "1"
    assert {suite.get("name") for suite in root} == {"good", "bad"}


def test_scenarios_that_hold_pass(gapsense, write, fmus):
    done = gapsense("test", write(), "--fmus", fmus)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "1 passed, 0 failed" in done.stdout


def test_wrong_scenario_fails_the_test_with_its_problems(gapsense, write, fmus):
    done = gapsense("test", write(("\nstep = 2", "\nstepp = 2")), "--fmus", fmus)
    assert done.exit_code == 1
    assert "sensor.stepp: unknown key" in done.stdout


def test_sensitivity_of_a_baseline_is_shown_and_nothing_written(gapsense, write, fmus):
    baseline = '[baseline]\nrtol = {}\nsignals = ["valve.*"]\n[seeds]'
    sound = gapsense("baseline", write(("[seeds]", baseline.format("1e-6"))), "--fmus", fmus, "--sensitivity")
    assert (sound.exit_code, sound.stderr) == (0, "")
    for word in ("amplification", "valve.current", "valve.flux_linkage", "allowed"):
        assert word in sound.stdout
    folder = write(("[seeds]", baseline.format("1e-12")))
    beyond = gapsense("baseline", folder, "--fmus", fmus, "--sensitivity")
    assert beyond.exit_code == 1
    assert re.search(
        r"valve.current: it changes by \S+ A, allowed are \S+ A, first at t = \S+ s\. Leave", beyond.stderr
    )
    assert [p.name for p in folder.iterdir()] == ["scenario.toml"]


def test_baseline_is_shown_and_written_only_when_asked(gapsense, write, fmus):
    folder = write(FEW)
    shown = gapsense("baseline", folder, "--fmus", fmus)
    assert shown.exit_code == 0
    assert "new: " in shown.stdout and "Not written." in shown.stdout
    assert [p.name for p in folder.iterdir()] == ["scenario.toml"]
    written = gapsense("baseline", folder, "--fmus", fmus, "--write")
    assert written.exit_code == 0 and written.stdout.endswith("Written.\n")
    kept = (folder / "baseline.csv").read_bytes()
    assert "nothing changes" in gapsense("baseline", folder, "--fmus", fmus, "--write").stdout
    changed = gapsense("baseline", write(FEW, ('waveform = "square" }', '"square.amplitude" = 20.0 }')), "--fmus", fmus)
    assert changed.exit_code == 0 and "valve.current" in changed.stdout and "Not written." in changed.stdout
    assert (folder / "baseline.csv").read_bytes() == kept
    failed = gapsense("test", folder, "--fmus", fmus)
    assert failed.exit_code == 1 and "baseline: " in failed.stdout


# Observability --------------------------------------------------------------------------------------------------------


def test_observability_prints_ranks_and_counts(gapsense, write, fmus):
    done = gapsense("study", "observability", write(), "--fmus", fmus)
    assert (done.exit_code, done.stderr) == (0, "")
    assert re.search(r"^ +linear \(33\)-\(35\) +2 ", done.stdout, re.MULTILINE)
    assert "longest: " in done.stdout


def test_observability_needs_a_current_and_samples(gapsense, write, fmus):
    without = write(('"valve.*", ', ""), ("reference = ", "# reference = "), ('"rmse"', '"std"'))
    assert "no `current`" in problems(gapsense("study", "observability", without, "--fmus", fmus))[0]
    brief = write(("stop = 2e-3", "stop = 1e-4"))
    assert "at least 4" in problems(gapsense("study", "observability", brief, "--fmus", fmus))[0]


# Names ----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def same(write, tmp_path):
    """Two scenarios in folders of one name; the second drives with another voltage."""
    louder = ('waveform = "square" }', 'waveform = "square", "square.amplitude" = 40.0 }')
    return write(FEW, folder="A/same"), write(FEW, louder, folder="B/same")


OTHER = "it belongs to the scenario `../A/same/scenario.toml`, not to `../B/same/scenario.toml`. Choose another place"


@pytest.mark.parametrize(
    ("command", "files"),
    [
        (["run"], ["same.csv", "same.json"]),
        (["sweep", "--seeds", 1, "--workers", 1], ["same_sweep.csv", "same_sweep.json", "same_sweep.sqlite"]),
        (["figure"], ["same.png"]),
    ],
)
def test_scenarios_of_one_name_do_not_overwrite_one_another(gapsense, same, fmus, command, files):
    word, *options = command
    assert gapsense(word, same[0], *options, "--fmus", fmus).exit_code == 0
    before = {name: Path("results", name).read_bytes() for name in files}
    done = gapsense(word, same[1], *options, "--fmus", fmus)
    assert done.exit_code == 2 and not done.stdout and OTHER in done.stderr, done.output
    assert {p.name: p.read_bytes() for p in Path("results").iterdir()} == before
    assert gapsense(word, same[0], *options, "--fmus", fmus).exit_code == 0
    elsewhere = "other/same.png" if word == "figure" else "other"
    assert gapsense(word, same[1], *options, "--fmus", fmus, "--out", elsewhere).exit_code == 0


def test_results_that_moved_with_their_scenario_are_its_own(gapsense, write, fmus, tmp_path, monkeypatch):
    write(folder="first/place/same")
    monkeypatch.chdir(tmp_path / "first")
    assert gapsense("run", "place/same", "--fmus", fmus).exit_code == 0
    monkeypatch.chdir(tmp_path)
    Path("first").rename("second")
    monkeypatch.chdir(tmp_path / "second")
    assert gapsense("run", "place/same", "--fmus", fmus).exit_code == 0


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_file_that_is_no_result_is_not_overwritten(gapsense, write, fmus, ending):
    Path(f"short.{ending}").write_text("{}")
    done = gapsense("run", write(), "--fmus", fmus, "--out", ".")
    assert done.exit_code == 2 and "short.csv: this file exists and is not the result of a" in done.stderr
    assert Path(f"short.{ending}").read_text() == "{}"


def test_variant_is_no_other_scenario_of_that_name(gapsense, write, fmus):
    variant = ("[seeds]", "[variants.loud]\n[seeds]")
    assert gapsense("run", write(variant), "--variant", "loud", "--fmus", fmus).exit_code == 0
    done = gapsense("run", write(folder="short_loud"), "--fmus", fmus)
    assert done.exit_code == 2 and "results/short_loud.csv: it belongs to the scenario `../short" in done.stderr


def test_scenarios_of_one_name_are_told_apart_in_tests(gapsense, same, fmus, tmp_path):
    done = gapsense("test", ".", "--fmus", fmus, "--junit", "junit.xml")
    assert re.findall(r"passed  (\S+)", done.stdout) == ["A/same", "B/same"]
    suites = ElementTree.parse("junit.xml").getroot().findall("testsuite")
    assert [suite.get("name") for suite in suites] == ["A/same", "B/same"]
    assert "passed  same  " in gapsense("test", same[0], "--fmus", fmus).stdout
