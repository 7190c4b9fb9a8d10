"""A sweep gives the same numbers however it is done, and never computes a run twice."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gapsense
from gapsense.cosim import ScenarioError, load, read_result, run, sweep
from gapsense.ledger import Ledger

NOISE = """
title = "Noise"
[experiment]
stop = 10.0
base_step = 0.1
[components.noise]
fmu = "Noise"
[seeds]
noise = 10
[metrics.spread]
kind = "std"
signal = "noise.y"
"""


def test_numbers_do_not_depend_on_the_workers_and_equal_single_runs(write, fmus):
    path = write(NOISE)
    one, two = (sweep(path, 6, workers=n, fmus=fmus) for n in (1, 2))
    assert one.indices == two.indices == tuple(range(6))
    assert np.array_equal(one.metrics["spread"], two.metrics["spread"])
    alone = run(path, fmus=fmus, seed_shift=3)
    assert alone.parameters["noise.seed"] == 13
    assert alone.metrics["spread"].value == one.metrics["spread"][3]
    assert one.quantiles((0.0, 1.0))["spread"] == (min(one.metrics["spread"]), max(one.metrics["spread"]))


def test_restart_computes_only_what_is_missing(write, fmus, tmp_path):
    path, out, seen = write(NOISE), tmp_path / "out", []
    first = sweep(path, 4, out=out, fmus=fmus, progress=lambda done, total: seen.append((done, total)))
    assert (first.computed, seen[-1]) == (4, (4, 4))
    lines = (out / "demo_sweep.jsonl").read_text().splitlines(keepends=True)
    (out / "demo_sweep.jsonl").write_text("".join(lines[:2]) + lines[2][:40])  # as a kill leaves it
    second = sweep(path, 6, out=out, fmus=fmus)
    assert second.computed == 4
    assert np.array_equal(second.metrics["spread"][:4], first.metrics["spread"])
    assert sweep(path, 6, out=out, fmus=fmus).computed == 0
    assert (out / "demo_sweep.csv").read_text().splitlines()[0] == '"run","spread"'
    path.write_text(NOISE.replace("stop = 10.0", "stop = 20.0"))
    assert sweep(path, 2, out=out, fmus=fmus).computed == 2


COMPUTED = """
import sys
from gapsense.cosim import sweep
path, fmus, out = sys.argv[1:]
result = sweep(path, 2, fmus=fmus, out=out)
print(result.computed, *result.metrics["spread"])
"""


def test_changed_package_is_computed_again(write, fmus, tmp_path):
    package = tmp_path / "copy" / "gapsense"
    shutil.copytree(Path(gapsense.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))

    def swept() -> list[float]:
        command = [sys.executable, "-c", COMPUTED, write(NOISE), fmus, tmp_path / "out"]
        environment = {**os.environ, "PYTHONPATH": str(package.parent)}
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        return [float(word) for word in done.stdout.split()]

    computed, *old = swept()
    assert computed == 2
    assert swept() == [0, *old]
    metrics = package / "cosim" / "metrics.py"
    assert metrics.read_text().count("np.std(") == 1
    metrics.write_text(metrics.read_text().replace("np.std(", "2.0 * np.std("))
    assert swept() == [2, *(2.0 * value for value in old)]


def test_ledger_keeps_entries_of_others(tmp_path):
    file = tmp_path / "x.jsonl"
    for key in ("a", "b"):
        Ledger(file, key).append({"index": 1, "metrics": {"m": 1.0}})
    file.write_text(file.read_text() + '{"key": "a", "ind')
    Ledger(file, "a").append({"index": 2, "metrics": {}})
    assert sorted(Ledger(file, "a").read()) == [1, 2]
    assert sorted(Ledger(file, "b").read()) == [1]


FAULTY = NOISE + '[components.coil]\nfmu = "Faulty"\nset = { fault = "FAULT", at = 5.0 }\n[inputs]\n"coil.u" = 0.0\n'


def test_failed_runs_are_reported_not_hidden(write, fmus):
    result = sweep(write(FAULTY.replace("FAULT", "nan")), 3, fmus=fmus)
    assert result.indices == ()
    assert sorted(result.errors) == [0, 1, 2]
    assert "coil, t = 5 s" in result.errors[0]


ENDED = {
    "kill": "its process was ended by signal 9 (SIGKILL, Killed)",
    "exit": "its process ended with exit code 0",
    "hang": "no answer within 1 s, the limit, so its process was ended",
}


@pytest.mark.parametrize("fault", ENDED)
def test_run_that_ends_its_worker_is_an_error_and_the_others_are_computed(write, fmus, tmp_path, fault):
    text = FAULTY.replace('"FAULT"', '"FAULT", only = 11').replace("FAULT", fault)
    path = write(text.replace("stop = 10.0", "stop = 10.0\nstep_limit = 1.0").replace("= 10\n", "= 10\ncoil = 10\n"))
    result = sweep(path, 4, workers=1, fmus=fmus, out=tmp_path / "out")
    assert result.indices == (0, 2, 3)
    assert result.errors == {1: f"coil, t = 5 s (base step 51): {ENDED[fault]}, in its step."}
    assert sweep(path, 4, workers=1, fmus=fmus, out=tmp_path / "out").computed == 1  # that run is tried again


def test_sweep_without_seeds_is_refused(write, fmus):
    with pytest.raises(ScenarioError, match=r"there are none. Add `\[sweep\]` or `\[seeds\]`"):
        sweep(write(NOISE.replace("[seeds]\nnoise = 10\n", "")), 3, fmus=fmus)


def test_local_measure_is_refused(write, fmus):
    with pytest.raises(ValueError, match="top level of a module"):
        sweep(write(NOISE), 1, fmus=fmus, measure=lambda result: {})


MEASURE = """
import sys
sys.path.insert(0, FOLDER)
import spread_measure
from gapsense.cosim import sweep
print(sweep(PATH, 2, fmus=fmus, measure=spread_measure.largest).metrics["largest"].tolist())
"""


def test_measure_of_a_module_is_taken_along(write, fmus, python, tmp_path):
    (tmp_path / "spread_measure.py").write_text(
        'def largest(result):\n    return {"largest": result["noise.y"].max()}\n'
    )
    path = write(NOISE)
    done = python(MEASURE.replace("FOLDER", repr(str(tmp_path))).replace("PATH", repr(str(path))))
    expected = [float(run(path, fmus=fmus, seed_shift=shift)["noise.y"].max()) for shift in (0, 1)]
    assert done.stdout.strip() == str(expected), done


INTERRUPT = """
import os, signal
from gapsense.cosim import sweep
stop = lambda done, total: os.kill(os.getpid(), signal.SIGINT) if done == 2 else None
result = sweep(PATH, 50, out=OUT, fmus=fmus, progress=stop)
print(result.interrupted, len(result.indices) >= 2, len(result.indices) < 50)
"""


def test_ctrl_c_keeps_what_was_computed(write, fmus, python, tmp_path):
    path, out = write(NOISE), tmp_path / "out"
    done = python(INTERRUPT.replace("PATH", repr(str(path))).replace("OUT", repr(str(out))))
    assert done.stdout.split() == ["True", "True", "True"], done
    known = len((out / "demo_sweep.jsonl").read_text().splitlines())
    assert sweep(path, 8, out=out, fmus=fmus).computed == max(0, 8 - known)


def test_exit_is_clean_after_a_run(write, fmus, python):
    done = python(f"from gapsense.cosim import run\nrun({str(write(NOISE))!r}, fmus=fmus)\n")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


GRID = """
[components.source]
fmu = "Source"
[sweep]
"source.slope" = [1.0, 2.0, 3.0]
"source.inverted" = [false, true]
[metrics.end]
kind = "final"
signal = "source.y"
"""


def test_grid_runs_every_combination_in_a_stable_order(write, fmus, tmp_path):
    path, out = write(NOISE + GRID), tmp_path / "out"
    one, two = sweep(path, workers=1, fmus=fmus), sweep(path, 2, workers=2, fmus=fmus, out=out)
    assert (one.indices, two.indices) == (tuple(range(6)), tuple(range(12)))
    assert one.grid["source.slope"] == (1.0, 1.0, 2.0, 2.0, 3.0, 3.0)
    assert one.grid["source.inverted"] == (False, True) * 3
    assert one.metrics["end"] == pytest.approx([11.0, -11.0, 21.0, -21.0, 31.0, -31.0])
    for name in ("end", "spread"):
        assert np.array_equal(two.metrics[name][:6], one.metrics[name])
    assert np.array_equal(two.metrics["end"][6:], one.metrics["end"])
    assert len(set(two.metrics["spread"])) == 12  # no two runs have the same noise
    alone = run(path, fmus=fmus, seed_shift=9, point=3)
    assert (alone.metrics["spread"].value, alone.metrics["end"].value) == (two.metrics["spread"][9], -21.0)
    rows = (out / "demo_sweep.csv").read_text().splitlines()
    assert rows[0] == '"run","source.slope","source.inverted","spread","end"'
    assert rows[2].startswith("1.0,1.0,True,")
    assert run(path, fmus=fmus).metrics["end"].value == 1.0  # a plain run knows nothing of the grid


def test_grid_goes_on_where_it_was_and_more_seeds_keep_the_runs(write, fmus, tmp_path):
    path, out = write(NOISE + GRID), tmp_path / "out"
    assert sweep(path, out=out, fmus=fmus).computed == 6
    assert sweep(path, 3, out=out, fmus=fmus).computed == 12
    path.write_text((NOISE + GRID).replace("3.0]", "4.0]"))
    assert sweep(path, out=out, fmus=fmus).computed == 6


def test_grid_without_seeds_runs_once(write, fmus):
    path = write(GRID.replace("[components", 'title = "x"\n[experiment]\nstop = 1.0\nbase_step = 0.1\n[components'))
    assert sweep(path, fmus=fmus).computed == 6
    with pytest.raises(ScenarioError, match="2 runs of each combination would be the same"):
        sweep(path, 2, fmus=fmus)


def test_signals_are_kept_for_every_run(write, fmus, tmp_path):
    path, out = write(NOISE + GRID), tmp_path / "out"
    with pytest.raises(ScenarioError, match="nowhere"):
        sweep(path, fmus=fmus, keep=True)
    assert sweep(path, out=out, fmus=fmus).kept == ()
    swept = sweep(path, out=out, fmus=fmus, keep=True)
    assert (swept.computed, len(swept.kept)) == (6, 6)  # their metrics were known, their signals not
    swept.kept[4].unlink()
    again = sweep(path, out=out, fmus=fmus, keep=True)
    assert (again.computed, again.kept) == (1, swept.kept)
    kept = read_result(again.kept[4])
    alone = run(path, fmus=fmus, seed_shift=4, point=4)
    assert all(np.array_equal(kept[name], alone[name]) for name in alone.signals)
    assert [file.name for file in sorted(again.kept[0].parent.glob("*.csv"))] == [f"{k:05d}.csv" for k in range(6)]
    path.write_text(path.read_text().replace("3.0]", "4.0]"))
    other = sweep(path, out=out, fmus=fmus, keep=True)
    assert other.kept[0].parent != swept.kept[0].parent  # signals of another scenario are never taken for these


def test_files_of_a_grid_decide_the_result(write, fmus):
    path = write(NOISE + GRID.replace('"source.slope" = [1.0, 2.0, 3.0]', '"source.table.file" = ["a.toml", "b.toml"]'))
    for name in ("a", "b"):
        (path.parent / f"{name}.toml").write_text(name)
    scenario = load(path)
    assert [point for point in scenario.points()][2]["source", "table.file"] == str(path.parent / "b.toml")
    assert {file.name for file in scenario.files} == {"scenario.toml", "a.toml", "b.toml"}


def test_variant_changes_the_grid(write, fmus):
    text = NOISE + GRID + '[variants.steep.sweep]\n"source.slope" = [9.0]\n'
    assert sweep(write(text), variant="steep", fmus=fmus).grid["source.slope"] == (9.0, 9.0)


def test_rows_of_a_file_are_runs(write, fmus, tmp_path):
    text = NOISE + GRID.replace('"source.slope" = [1.0, 2.0, 3.0]', 'rows = "rows.csv"')
    path = write(text)
    (path.parent / "rows.csv").write_text('"source.slope","noise.sample_time"\n1.0,0.2\n7.0,0.1\n')
    swept = sweep(path, fmus=fmus)
    assert swept.grid == {
        "source.slope": (1.0, 1.0, 7.0, 7.0),
        "noise.sample_time": (0.2, 0.2, 0.1, 0.1),
        "source.inverted": (False, True, False, True),
    }
    assert swept.metrics["end"][0] != swept.metrics["end"][2]
    assert path.parent / "rows.csv" in load(path).files
    assert run(path, fmus=fmus, point=2).parameters["source.slope"] == 7.0


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "rows.csv: there is no such file. A CSV file of numbers"),
        ("source.slope\n1.0,2.0\n", "rows.csv, line 2: 2 values found, 1 expected"),
        ("source.slope\nsteep\n", "sweep.rows: could not convert"),
        ("source.slope\n", "rows.csv has no rows"),
        ("source.inverted\n1\n", "`source.inverted` is given in rows.csv and in `[sweep]` too"),
        ("source.slop\n1.0\n", "sweep.source.slop: unknown parameter `slop`. Did you mean `slope`?"),
        ("slope\n1.0\n", "`slope` found, `component.variable` expected"),
    ],
)
def test_wrong_rows_are_told(write, fmus, content, expected):
    path = write(NOISE + GRID.replace('"source.slope" = [1.0, 2.0, 3.0]', 'rows = "rows.csv"'))
    if content is not None:
        (path.parent / "rows.csv").write_text(content)
    with pytest.raises(ScenarioError) as caught:
        sweep(path, fmus=fmus)
    assert sum(expected in problem for problem in caught.value.problems) == 1, caught.value.problems
