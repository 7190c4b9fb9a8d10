"""Steps of others that end otherwise than expected: an orderly end of the run, warnings, a time that does not fit."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import description2
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import FmuError, Master, prepare, read_result, run, run_once
from gapsense.cosim.run.loop import compiled

TEXT = """
title = "Ends"
[experiment]
stop = {stop}
base_step = 0.1
[components.other]
fmu = "Types{version}"
[components.a]
fmu = "Types{version}"
{isolation}
set = {{ end = 0.5, deed = {deed} }}
[components.last]
fmu = "Types{version}"
[metrics.level]
kind = "max"
signal = "a.level"
bounds = [0, 1]
{more}
"""
ENDS, SILENT, WARNS, EARLY, NO_TIME, BEFORE, BEYOND, AFTER = range(1, 9)


@pytest.fixture(params=["C", "Python"])
def loops(request, monkeypatch):
    if request.param == "Python":
        monkeypatch.setattr(compiled, "BINARY", Path("none.so"))


def written(write, version, deed, stop=1.0, isolation="", more="", name="demo", has_only_reals=False):
    """A scenario of three of them, the second of which does the deed."""
    text = TEXT.format(version=version, deed=deed, stop=stop, isolation=isolation, more=more)
    whole = [f"n{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")] + ["single"]
    others = {"flag": "true", "text": '"t"', "mode": 1, **dict.fromkeys(whole if version == 3 else ["n"], 1)}
    inputs = {"u": 1, **({} if has_only_reals else others)}
    lines = [f'"{c}.{key}" = {value}' for c in ("other", "a", "last") for key, value in inputs.items()]
    return write("\n".join([text, "[inputs]", *lines]), name)


APART = 'isolation = "process"'


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(("deed", "stop"), [(ENDS, 1.0), (ENDS, 0.5), (SILENT, 1.0), (AFTER, 1.0)])
@pytest.mark.parametrize("isolation", ["", APART])
def test_orderly_end_keeps_all_rows_and_is_told(write, foreign, loops, version, deed, stop, isolation):
    result = run(written(write, version, deed, stop, isolation), fmus=foreign)
    assert np.allclose(result.times, np.arange(6) / 10, atol=1e-12)
    assert np.allclose(result["a.level"], 0.9 ** np.arange(6)) and np.array_equal(
        result["last.level"], result["a.level"]
    )
    assert result.ended in result.run.remarks and not result.failure and not result.interrupted
    assert result.ended == f"`a` ended the run at t = 0.5 s, in an orderly way; `stop` is {stop:g} s."
    assert result.metrics["level"].passed and "ended by a component" in repr(result)


@pytest.fixture
def reals(foreign, tmp_path):
    """Folder with the FMU of FMI 2.0 that has Real variables only, so that C steps it."""
    head, body = description2().split("<ModelVariables>")
    rows = [f"{row}</ScalarVariable>" for row in body.split("</ModelVariables>")[0].split("</ScalarVariable>")]
    rows = [row for row in rows if "<Real " in row]
    outputs = '<Outputs><Unknown index="2"/><Unknown index="4"/></Outputs>'
    end = f"<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    with zipfile.ZipFile(foreign / "Types2.fmu") as source, zipfile.ZipFile(tmp_path / "Types2.fmu", "w") as target:
        target.writestr("modelDescription.xml", f"{head}<ModelVariables>{''.join(rows)}</ModelVariables>{end}")
        target.writestr("binaries/linux64/types2.so", source.read("binaries/linux64/types2.so"))
    return tmp_path


@pytest.mark.parametrize("isolation", ["", APART])
def test_what_c_steps_ends_and_warns_too(write, reals, loops, isolation):
    path = written(write, 2, ENDS, 1.0, isolation, has_only_reals=True)
    with Master(*prepare(path, None, reals)) as master:
        result, again = run_once(master), run_once(master)
    assert result.times.size == 6 and result.ended.startswith("`a` ended the run at t = 0.5 s")
    assert np.array_equal(result["last.level"], result["a.level"]) and result.timing["a"].calls == 5
    assert np.array_equal(result["a.level"], again["a.level"]) and again.ended == result.ended
    warned = written(write, 2, WARNS, 1.0, isolation, name="warned", has_only_reals=True)
    remarks = run(warned, fmus=reals).run.remarks
    assert remarks == ("`a` returned a warning from 10 of 10 steps; the last one says: careful.",)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("key", "rows"), [('method = "jacobi"', 6), ("pace = 20.0", 6), ('isolation = "process"', 6), ("start = 0.2", 4)]
)
def test_end_is_the_same_however_the_run_is_made(write, foreign, loops, version, key, rows):
    path = written(write, version, ENDS)
    path.write_text(path.read_text().replace("base_step", f"{key}\nbase_step"))
    result = run(path, fmus=foreign)
    assert result.times.size == rows and abs(result.times[-1] - 0.5) < 1e-12
    assert np.array_equal(result["last.level"], result["a.level"]) and result.ended.startswith("`a` ended the run at")


@pytest.mark.parametrize("deed", [ENDS, AFTER])
@pytest.mark.parametrize(("decimation", "rows"), [(2, 3), (5, 2), (3, 2)])
def test_end_between_two_rows_leaves_those_before(write, foreign, loops, deed, decimation, rows):
    path = written(write, 3, deed, more=f"[record]\ndecimation = {decimation}")
    result = run(path, fmus=foreign)
    assert np.allclose(result.times, np.arange(rows) * decimation / 10) and result.ended


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("isolation", ["", APART])
def test_end_within_a_step_has_no_row_of_another_time(write, foreign, loops, version, isolation):
    path = written(write, version, ENDS, 1.0, isolation)
    path.write_text(path.read_text().replace("end = 0.5", "end = 0.45"))
    result = run(path, fmus=foreign)
    assert result.times.size == 5 and result.ended.startswith("`a` ended the run at t = 0.45 s")


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("isolation", ["", APART])
def test_warning_of_every_step_is_told_once_with_its_count(write, foreign, loops, version, isolation):
    result = run(written(write, version, WARNS, 1.0, isolation), fmus=foreign)
    assert result.times.size == 11 and not result.ended
    assert result.run.remarks == ("`a` returned a warning from 10 of 10 steps; the last one says: careful.",)


@pytest.mark.parametrize(("deed", "time"), [(EARLY, "0.05"), (NO_TIME, "nan"), (BEFORE, "-0.1"), (BEYOND, "0.2")])
@pytest.mark.parametrize("isolation", ["", APART])
def test_time_that_is_not_the_end_of_the_step_fails_with_a_sentence(write, foreign, loops, deed, time, isolation):
    with pytest.raises(FmuError) as caught:
        run(written(write, 3, deed, 1.0, isolation), fmus=foreign)
    assert f"a, t = 0 s (base step 1): fmi3DoStep reported that it reached t = {time} s" in str(caught.value)
    assert caught.value.result.times.size == 1


@pytest.mark.parametrize("version", [2, 3])
def test_commands_take_an_orderly_end_for_no_failure(write, foreign, tmp_path, monkeypatch, version):
    monkeypatch.chdir(tmp_path)
    more = '[sweep]\n"a.gain" = [1.0, 2.0]\n[baseline]\nsignals = ["a.level"]'
    folder = str(written(write, version, ENDS, more=more).parent)

    def gapsense(*arguments):
        done = CliRunner().invoke(app, [*arguments, "--fmus", str(foreign)])
        return done.exit_code, " ".join(done.output.split())

    code, said = gapsense("run", folder)
    assert code == 0 and "`a` ended the run at t = 0.5 s" in said
    saved = tmp_path / "results" / "demo.csv"
    assert json.loads(saved.with_suffix(".json").read_text())["ended"] in read_result(saved).run.remarks
    assert read_result(saved).ended and read_result(saved).times[-1] == 0.5
    assert gapsense("baseline", folder, "--write")[0] == 0
    code, said = gapsense("test", folder)
    assert code == 0 and "note: `a` ended the run" in said
    code, said = gapsense("sweep", folder)
    assert code == 0 and "2 of 2 runs were ended by a component; run 0: `a` ended the run at t = 0.5 s" in said
    assert "2 of 2 runs were ended" in gapsense("sweep", folder)[1]  # from what is known


def test_campaign_tells_which_runs_a_component_has_ended(write, foreign, tmp_path):
    from gapsense import campaign
    from gapsense.report.campaigns import summary

    folder = written(write, 2, ENDS).parent
    study = folder / "study.toml"
    study.write_text(f'title = "Ends"\nscenario = "{folder}"\n[grid]\n"a.end" = [0.5, 5.0]\n')
    found = campaign(study, 1, tmp_path / "out", foreign)
    assert found.failed == 0 and [run for run, _ in found.ended(5)] == [0]
    assert found.column("ended").tolist() == ["`a` ended the run at t = 0.5 s, in an orderly way; `stop` is 1 s.", None]
    assert [line for line in summary(found) if isinstance(line, str)][-1].startswith("run 0: `a` ended the run")
