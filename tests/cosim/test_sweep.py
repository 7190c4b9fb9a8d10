"""A sweep gives the same numbers however it is done, and never computes a run twice."""

import os
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

import gapsense
from gapsense.cosim import ScenarioError, load, prepare, read_result, run, sweep
from gapsense.cosim.scenario.read import changed
from gapsense.many.provenance import bounds
from gapsense.many.sweep import is_table, key_of, read_sidecar
from gapsense.problems import InputError

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
    with closing(sqlite3.connect(out / "demo_sweep.sqlite")) as store:
        store.execute("DELETE FROM runs WHERE id & 0xFFFF IN (2, 3)")
        store.commit()
    second = sweep(path, 6, out=out, fmus=fmus)
    assert second.computed == 4
    assert np.array_equal(second.metrics["spread"][:4], first.metrics["spread"])
    assert sweep(path, 6, out=out, fmus=fmus).computed == 0
    assert (out / "demo_sweep.csv").read_text().splitlines()[0] == '"run","spread [V]"'
    path.write_text(NOISE.replace("stop = 10.0", "stop = 20.0"))
    assert sweep(path, 2, out=out, fmus=fmus).computed == 2


WORDS = {
    "title": ('title = "Noise"', 'title = "Much noise"\ndescription = "Words."\nfigure = "overview"'),
    "writing": ("stop = 10.0", "# the end\nstop = 1e1"),
    "bounds": ('kind = "std"', 'kind = "std"\nbounds = [0.0, 9.0]\nlabel = "sigma"\npublished = 1.0'),
    "baseline": ("[seeds]", "[baseline]\nrtol = 1.0\n[seeds]"),
    "variant": ("[seeds]", "[variants.other.seeds]\nnoise = 1\n[seeds]"),
    "pace": ("base_step", "pace = 1e9\nbase_step"),
}
NUMBERS = {
    "kind": ('kind = "std"', 'kind = "mean"'),
    "window": ('kind = "std"', 'kind = "std"\nafter = 1.0'),
    "step": ('fmu = "Noise"', 'fmu = "Noise"\nstep = 2'),
    "parameter": ('fmu = "Noise"', 'fmu = "Noise"\nset = { sample_time = 0.2 }'),
    "record": ("[seeds]", "[record]\ndecimation = 2\n[seeds]"),
    "seed": ("noise = 10", "noise = 11"),
}


@pytest.mark.parametrize(
    ("old", "new", "is_same"),
    [pytest.param(*texts, words is WORDS, id=name) for words in (WORDS, NUMBERS) for name, texts in words.items()],
)
def test_key_is_of_what_decides_the_numbers(write, fmus, old, new, is_same):
    before, after = (prepare(write(text), fmus=fmus) for text in (NOISE, NOISE.replace(old, new)))
    assert (key_of(*before, None) == key_of(*after, None)) is is_same


def test_other_words_compute_nothing_again(write, fmus, tmp_path):
    path, out = write(NOISE), tmp_path / "out"
    first = sweep(path, 2, out=out, fmus=fmus)
    path.write_text(NOISE.replace(*WORDS["title"]))
    again = sweep(path, 2, out=out, fmus=fmus)
    assert (first.computed, again.computed) == (2, 0)
    assert again.metrics["spread"].tolist() == first.metrics["spread"].tolist()


def test_content_of_a_file_decides_and_its_place_does_not(write, fmus):
    text = NOISE + GRID.replace('"source.slope" = [1.0, 2.0, 3.0]', '"source.table.file" = ["a.toml"]')
    here, there, other = (write(text, f) for f in ("here", "there", "other"))
    for path, content in ((here, "a"), (there, "a"), (other, "b")):
        (path.parent / "a.toml").write_text(content)
    keys = [key_of(*prepare(path, fmus=fmus), None) for path in (here, there, other)]
    assert keys[0] == keys[1] != keys[2]


def known(file):
    """Runs that are there."""
    if not file.is_file():
        return 0
    with closing(sqlite3.connect(file)) as store, suppress(sqlite3.OperationalError):  # it is being made
        return store.execute("SELECT count(*) FROM runs").fetchone()[0]
    return 0


TWO = """
import sys
from gapsense.cosim import sweep
print("ready", flush=True)
sys.stdin.readline()
print(sweep(PATH, 30, workers=1, out=OUT, fmus=fmus).computed)
"""


def test_two_sweeps_on_one_folder_compute_nothing_twice(write, fmus, start, tmp_path):
    out = tmp_path / "out"
    code = TWO.replace("PATH", repr(str(write(NOISE)))).replace("OUT", repr(str(out)))
    processes = [start(code) for _ in range(2)]
    for process in processes:
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        print("go", file=process.stdin, flush=True)
    outputs = [process.communicate(timeout=60) for process in processes]
    assert sorted(int(out) for out, _ in outputs) == [0, 30], outputs
    said = "".join(err for _, err in outputs)
    assert said == f"{out / 'demo_sweep.sqlite'}: another process is using it; waiting for its end.\n"


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A folder for temporary files, in place of the one that everybody has."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
def test_kill_leaves_neither_a_lock_nor_folders_for_long(write, fmus, start, temporary, tmp_path):
    path, out = write(NOISE.replace("stop = 10.0", "stop = 1000.0")), tmp_path / "out"
    first = start(TWO.replace("PATH", repr(str(path))).replace("OUT", repr(str(out))))
    print("go", file=first.stdin, flush=True)
    while not known(out / "demo_sweep.sqlite"):
        time.sleep(0.01)
    first.kill()
    first.wait()
    swept = sweep(path, 2, out=out, fmus=fmus)  # workers of the first one notice its end, and take their folders along
    assert (len(swept.indices), swept.computed < 2) == (2, True)
    end = time.monotonic() + 20.0
    while list(temporary.iterdir()) and time.monotonic() < end:
        time.sleep(0.05)
    assert not list(temporary.iterdir())


COMPUTED = """
import sys
from gapsense.cosim import sweep
path, fmus, out = sys.argv[1:]
result = sweep(path, 2, workers=1, fmus=fmus, out=out)
print(result.computed, *result.metrics["spread"])
"""


@pytest.mark.slow
def test_changed_package_is_computed_again(write, fmus, tmp_path):
    package = tmp_path / "copy" / "gapsense"
    shutil.copytree(Path(gapsense.__file__).parent, package)  # with what is compiled, which the times of files decide

    def swept() -> list[float]:
        command = [sys.executable, "-c", COMPUTED, write(NOISE), fmus, tmp_path / "out"]
        environment = {**os.environ, "PYTHONPATH": str(package.parent)}
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        return [float(word) for word in done.stdout.split()]

    computed, *old = swept()
    assert computed == 2
    assert swept() == [0, *old]
    metrics = package / "cosim" / "result" / "metrics.py"
    assert metrics.read_text().count("np.std(") == 1
    metrics.write_text(metrics.read_text().replace("np.std(", "2.0 * np.std("))
    assert swept() == [2, *(2.0 * value for value in old)]


def test_runs_of_others_stay_in_the_same_file(write, fmus, tmp_path):
    path, out = write(NOISE), tmp_path / "out"
    first = sweep(path, 2, out=out, fmus=fmus)
    path.write_text(NOISE.replace("stop = 10.0", "stop = 20.0"))
    assert sweep(path, 3, out=out, fmus=fmus).computed == 3
    path.write_text(NOISE)
    again = sweep(path, 2, out=out, fmus=fmus)
    assert again.computed == 0 and again.metrics["spread"].tolist() == first.metrics["spread"].tolist()


@pytest.fixture(scope="module")
def swept_noise(tmp_path_factory, fmus):
    """Scenario, metrics and store of a sweep of four runs."""
    folder = tmp_path_factory.mktemp("damage")
    (folder / "demo").mkdir()
    (folder / "demo" / "scenario.toml").write_text(NOISE)
    found = sweep(folder / "demo", 4, out=folder, fmus=fmus, workers=1)
    return folder, found.metrics["spread"].tolist(), (folder / "demo_sweep.sqlite").read_bytes()


@pytest.mark.parametrize("run", range(4))
def test_a_flipped_bit_of_a_run_costs_this_run_and_no_more(swept_noise, fmus, caplog, run):
    folder, expected, content = swept_noise
    damaged, place = bytearray(content), content.index(struct.pack("<d", expected[run]))
    damaged[place + run] ^= 1 << run
    (folder / "demo_sweep.sqlite").write_bytes(damaged)
    caplog.clear()
    again = sweep(folder / "demo", 4, out=folder, fmus=fmus, workers=1)
    assert again.metrics["spread"].tolist() == expected and again.computed == 1
    assert f"demo_sweep.sqlite: run {run} is damaged, and computed again." in caplog.text


def test_kept_signals_that_were_changed_are_told_and_computed_again(write, fmus, tmp_path, caplog):
    first = sweep(write(NOISE), 2, out=tmp_path / "out", fmus=fmus, keep=True)
    before = first.kept[1].read_bytes()
    first.kept[1].write_bytes(before[:-2] + (b"1\n" if before[-2:] != b"1\n" else b"2\n"))
    again = sweep(write(NOISE), 2, out=tmp_path / "out", fmus=fmus, keep=True)
    assert again.computed == 1 and again.kept[1].read_bytes() == before
    assert f"{first.kept[1]}: it is damaged, or was edited. Run 1 is computed again." in caplog.text


FAULTY = NOISE + '[components.coil]\nfmu = "Faulty"\nset = { fault = "FAULT", at = 5.0 }\n[inputs]\n"coil.u" = 0.0\n'


def test_failed_runs_are_reported_not_hidden(write, fmus):
    result = sweep(write(FAULTY.replace("FAULT", "nan")), 3, fmus=fmus)
    assert result.indices == ()
    assert sorted(result.errors) == [0, 1, 2]
    assert "coil, t = 5 s" in result.errors[0]


def test_table_of_a_sweep_tells_of_what_it_is_and_which_runs_failed(write, fmus, tmp_path):
    """In the file beside it, which no other table fits."""
    text = FAULTY.replace('"FAULT"', '"nan", only = 11').replace("= 10\n", "= 10\ncoil = 10\n")
    text = text.replace('kind = "std"', 'kind = "std"\nbounds = [0.5, inf]\nlabel = "sigma"\ntable = "Noises"')
    source = changed(write(text + '[sweep]\n"noise.sample_time" = [0.1, 0.2]\n'), ["coil.at=3.0"])
    swept = sweep(source, 2, out=tmp_path, fmus=fmus)
    table = tmp_path / "demo_sweep.csv"
    told = read_sidecar(table)
    assert (told["title"], told["scenario"], told["source"]) == ("Noise", "demo", "demo/scenario.toml")
    assert (told["runs"], told["points"], told["seeds"]) == (4, 2, {"noise": 10, "coil": 10})
    assert told["bounds"] == {"spread": [0.5, "inf"]} and bounds(told, "spread") == (0.5, np.inf)
    assert told["labels"] == {"spread": ["Noises", "sigma"]} and told["settings"] == {"coil.at": 3.0}
    assert told["factors"] == {"noise.sample_time": ["double", "s"]} and told["metrics"] == {"spread": "V"}
    failed = {"run": 1, "values": {"noise.sample_time": 0.2}, "error": swept.errors[1]}
    assert told["failed"] == [failed] and "t = 3 s" in swept.errors[1]
    assert {"all", "scenario.toml", "noise (Noise.fmu)"} <= {*told["decided_by"]} and is_table(table)
    table.write_text(table.read_text() + "\n")
    with pytest.raises(InputError, match=r"not the table that belongs to `demo_sweep\.json`\. Sweep again"):
        read_sidecar(table)


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
print(sweep(PATH, 2, workers=1, fmus=fmus, measure=spread_measure.largest).metrics["largest"].tolist())
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
result = sweep(PATH, 50, workers=1, out=OUT, fmus=fmus, progress=stop)
print(result.interrupted, len(result.indices) >= 2, len(result.indices) < 50)
"""


def test_ctrl_c_keeps_what_was_computed(write, fmus, python, tmp_path):
    path, out = write(NOISE), tmp_path / "out"
    done = python(INTERRUPT.replace("PATH", repr(str(path))).replace("OUT", repr(str(out))))
    assert done.stdout.split() == ["True", "True", "True"], done
    there = known(out / "demo_sweep.sqlite")
    assert there >= 2 and sweep(path, 8, out=out, fmus=fmus).computed == max(0, 8 - there)


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
    assert rows[0] == '"run","source.slope [V/s]","source.inverted","spread [V]","end [V]"'
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
    with pytest.raises(ScenarioError, match="no folder is given"):
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
    assert scenario.plan.point(2)["source", "table.file"] == str(path.parent / "b.toml")
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


def test_rows_hold_what_lists_hold(write, fmus):
    text = NOISE + GRID.replace('"source.slope" = [1.0, 2.0, 3.0]', 'rows = "rows/rows.csv"')
    path = write(text.replace('"source.inverted" = [false, true]\n', ""))
    (path.parent / "rows").mkdir()
    (path.parent / "rows" / "own.csv").touch()
    heads, *rows = "source.seed,source.inverted,source.shape,source.slope [V/s]", "3,true,up,1", "+4,False,down,2e0"
    (path.parent / "rows" / "rows.csv").write_text(
        "\n".join([heads + ",source.table.file", *(r + ",own.csv" for r in rows)])
    )
    own = str(path.parent / "rows" / "own.csv")
    swept = sweep(path, fmus=fmus)
    assert [[type(v), v] for v in swept.grid["source.seed"]] == [[int, 3], [int, 4]]
    assert swept.grid["source.inverted"] == (True, False)
    assert (swept.grid["source.shape"], swept.grid["source.table.file"]) == (("up", "down"), (own, own))
    assert swept.metrics["end"].tolist() == pytest.approx([-11.0, 21.0])
    assert Path(own) in load(path).files


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "rows.csv: No such file or directory. A CSV file with a column per parameter"),
        ("source.slope\n1.0,2.0\n", "rows.csv, line 2: 2 values found, 1 expected"),
        ("source.slope\n", "rows.csv has no rows"),
        ("source.inverted\n1\n", "`source.inverted` is given in rows.csv and in `[sweep]` too"),
        ("source.slop\n1.0\n2.0\n", "sweep.source.slop: unknown parameter `slop`. Did you mean `slope`?"),
        ("slope\n1.0\n", "`slope` found, `component.variable` expected"),
        ("noise.seed,source.slope,source.slope\n1,2,3\n", "line 1: columns 2 and 3 are both called `source.slope`"),
        ("source.slope [V/s],source.slope\n1,2\n", "line 1: columns 1 and 2 are both called `source.slope`"),
        (
            "source.slope\n1.0\nsteep\n",
            'source.slope (rows.csv, line 3, column 1): `slope` is `"steep"`, a value of type',
        ),
        ("source.slope\n1.0\ntrue\n", "(rows.csv, line 3, column 1): `slope` is `true`, a value of type Real"),
        ("source.slope\n1.0\nnan\n", "rows.csv, line 3, column 1 (`source.slope`): `nan` found, a finite number"),
        ("noise.sample_time,source.slope\n0.1,1\n0.1,\n", "rows.csv, line 3, column 2 (`source.slope`): `` found"),
        ("source.seed\n1\n1.5\n", "(rows.csv, line 3, column 1): `seed` is `1.5`, a value of type Integer"),
        ("source.slope [mV/s]\n1\n", "(rows.csv, line 1, column 1): it is in `mV/s`, `V/s` is expected, and nothing"),
        ("source.table.file\nnone.csv\n", "rows.csv, line 2, column 1 (`source.table.file`): there is no file"),
    ],
)
def test_wrong_rows_are_told(write, fmus, content, expected):
    path = write(NOISE + GRID.replace('"source.slope" = [1.0, 2.0, 3.0]', 'rows = "rows.csv"'))
    if content is not None:
        (path.parent / "rows.csv").write_text(content)
    with pytest.raises(ScenarioError) as caught:
        sweep(path, fmus=fmus)
    assert sum(expected in problem for problem in caught.value.problems) == 1, caught.value.problems
