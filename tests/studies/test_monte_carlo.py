"""The comparison of the estimators: its errors, its randomness, its workers, and a kill in the middle."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from wrong_models import filter_parameters

from gapsense.many import provenance as of
from gapsense.scenarios.soft_landing.batch import Tuning, Variant, Varied
from gapsense.scenarios.soft_landing.comparison import (
    ESTIMATORS,
    WIDTHS,
    compare,
    errors_of_chunk,
    estimates,
    plan_of,
    positions,
    squared_errors,
    trajectories,
)
from gapsense.scenarios.soft_landing.rts import motions, smooth_record
from gapsense.scenarios.soft_landing.setting import (
    CHUNK,
    chunks,
    drawn,
    errors,
    noise,
    noise_of_width,
    operation_of,
    perturbed,
    study_of,
    tuning,
)
from gapsense.scenarios.soft_landing.smoother_show import orderings
from gapsense.studies.runs import compute, number

SRC = Path(__file__).resolve().parents[2] / "src"
WORKER = """
import json, re, sys, time
from pathlib import Path
from gapsense.scenarios.soft_landing.comparison import errors_of_chunk
errors_of_chunk(*json.loads(Path(sys.argv[1]).read_text()))
print(time.process_time(), int(re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024)
"""
COMPARED, RUNS = [0.01, 0.02, 0.03, 0.05, 0.1], 19


@pytest.fixture(scope="module")
def compared(coarse):
    """By one worker, in one go."""
    return compare(coarse, COMPARED, RUNS, 1)


@pytest.mark.slow
def test_errors_are_those_of_the_scalar_kernel(coarse):
    """NRMSE (67) of two runs from `rts.smooth_record`, with the sums of the formula written out."""
    s, m, runs, width = coarse.samples, coarse.model, 2, 0.05
    tuned = tuning(noise_of_width(coarse.facts(), {"width": width, "runs": runs}), coarse)
    task = {"width": width, "chunk": 0, "runs": runs, "tuning": [*tuned]}
    found = np.array(errors_of_chunk(coarse.facts(), task)["squares"])
    varied = perturbed(m, width * errors(coarse.seed, 0, runs))
    current = s.current[:, None] + noise(coarse.seed, 0, runs, s.time.size, coarse.noise_current)
    z = (s.position - m.z_min) / m.l_z
    variants = {"ERTSS": Variant(), "ERTSS without e_i": Variant(0.0, 1.0), "ERTSS without e_F": Variant(1.0, 0.0)}
    smoothed = {
        name: [
            smooth_record(s.voltage, current[:, run], s.mode, filter_parameters(m, varied, run, tuned, variant))
            for run in range(runs)
        ]
        for name, variant in variants.items()
    }
    for name, each in {"EKF": smoothed["ERTSS"], **smoothed}.items():
        total = np.zeros((2, 2))
        for p in each:
            mean = (p.filtered if name == "EKF" else p.smoothed).mean
            for o, (first, landed) in enumerate(motions(s.mode)):
                for k in range(first, landed):
                    total[o, 0] += (mean[k, 0] - z[k]) ** 2
                    total[o, 1] += ((mean[k, 0] - mean[k, 1]) - (z[k] - z[k - 1])) ** 2
        np.testing.assert_allclose(found[ESTIMATORS.index(name)], total, rtol=1e-6)


def test_every_run_has_the_bits_that_it_has_alone(coarse):
    """All samples of both operations in scalar Python, with wide errors, and the sums over them."""
    study = coarse
    if plan_of(study).library is None:
        pytest.skip("no C compiler (cc, gcc, clang): numpy has a logarithm of its own")
    tuned = Tuning(1.94e-5, 1.2e-3, 21e-3, 2e-3)
    varied, measured = drawn(study, 0.3, 0, 9)
    found, z = squared_errors(study, varied, measured, tuned), positions(study.samples, study.model).tolist()
    for run in (8,):
        sums = np.zeros((len(ESTIMATORS), 2, 2))
        alone = Varied(*(float(value[run]) for value in varied)), measured[:, run].tolist()
        for name, k, row in estimates(study, *alone, tuned):
            at = sums[ESTIMATORS.index(name), operation_of(study.samples, k)]
            at += (row[0] - z[k]) ** 2, ((row[0] - row[1]) - (z[k] - z[k - 1])) ** 2
        np.testing.assert_array_equal(found[..., run], sums)


def test_numbers_do_not_depend_on_how_many_runs_are_computed_together(coarse):
    varied, measured = drawn(coarse, 0.1, 0, 19)
    tuned = Tuning(1.94e-5, 1.2e-3, 21e-3, 2e-3)
    whole = squared_errors(coarse, varied, measured, tuned)
    part = squared_errors(coarse, Varied(*(value[3:14] for value in varied)), measured[:, 3:14], tuned)
    np.testing.assert_array_equal(part, whole[..., 3:14])


def test_comparison_divides_by_the_reference(coarse, compared):
    s, m, at = coarse.samples, coarse.model, COMPARED.index(0.05)
    z = (s.position - m.z_min) / m.l_z
    task = {"width": 0.05, "chunk": 0, "runs": RUNS, "tuning": [*compared.tunings[at]]}
    squares = np.array(errors_of_chunk(coarse.facts(), task)["squares"])
    for o, (first, landed) in enumerate(motions(s.mode)):
        k = np.arange(first, landed)
        below = np.array([np.sum(z[k] ** 2), np.sum((z[k] - z[k - 1]) ** 2)])
        np.testing.assert_allclose(compared.nrmse[at, :, o], np.sqrt(squares[:, o] / (RUNS * below)), rtol=1e-12)


@pytest.mark.slow  # the killed run below also has two workers, and the numbers of one
def test_numbers_do_not_depend_on_the_workers(coarse):
    one, two = (compare(coarse, [0.01, 0.1], 5, workers) for workers in (1, 2))
    np.testing.assert_array_equal(one.nrmse, two.nrmse)
    assert one.worst == two.worst and one.tunings == two.tunings


def test_random_numbers_have_the_stated_distributions():
    e, v = errors(1, 0, 4000), noise(1, 0, 4000, 20, 2e-3)
    assert e.shape == (8, 4000) and v.shape == (20, 4000)
    assert -0.5 <= e.min() < -0.499 and 0.499 < e.max() <= 0.5
    np.testing.assert_allclose(e.mean(axis=1), 0.0, atol=0.02)  # (55) is centred on zero
    np.testing.assert_allclose(e.std(axis=1), 12.0**-0.5, rtol=0.05)
    assert abs(v.mean()) < 5e-5 and v.std() == pytest.approx(2e-3, rel=0.02)
    assert np.abs(np.corrcoef(np.vstack([e, v])) - np.eye(28)).max() < 0.08


def test_fewer_runs_are_the_first_of_more():
    np.testing.assert_array_equal(errors(1, 2, 5), errors(1, 2, 50)[:, :5])
    np.testing.assert_array_equal(noise(1, 2, 5, 30, 1.0), noise(1, 2, 50, 30, 1.0)[:, :5])
    for other in (errors(1, 3, 5), errors(2, 2, 5)):
        assert not np.any(other == errors(1, 2, 5))
    assert chunks(2 * CHUNK + 7) == [(0, CHUNK), (1, CHUNK), (2, 7)] and chunks(CHUNK) == [(0, CHUNK)]


def test_worst_run_is_the_one_that_is_drawn(coarse, compared):
    at = COMPARED.index(0.1)
    worst = compared.worst[at]
    drawn = trajectories(coarse, 0.1, compared.tunings[at], worst)
    s = coarse.samples
    z = (s.position - coarse.model.z_min) / coarse.model.l_z
    first, landed = motions(s.mode)[worst.operation]
    k = np.arange(first, landed)
    again = np.sqrt(np.sum((drawn["ERTSS"][k] - z[k]) ** 2) / np.sum(z[k] ** 2))
    assert again == pytest.approx(worst.nrmse, rel=1e-9)
    assert worst.nrmse >= compared.nrmse[at, ESTIMATORS.index("ERTSS"), worst.operation, 0]
    assert set(drawn) == set(ESTIMATORS) and np.all(np.isnan(drawn["EKF"][: first - 1]) | (first > 100))


def test_study_survives_json(coarse):
    again = study_of(json.loads(json.dumps(coarse.facts())))
    assert again.model == coarse.model and (again.seed, again.noise_current) == (coarse.seed, coarse.noise_current)
    for a, b in zip(again.samples, coarse.samples):
        np.testing.assert_array_equal(a, b)


COMPARE = """
import json, os, sys
from pathlib import Path
from gapsense.scenarios.soft_landing.comparison import compare
from gapsense.scenarios.soft_landing.setting import study_of
study = study_of(json.loads(Path(sys.argv[1]).read_text()))
end = lambda done, total: os._exit(9) if done == 3 else None
compare(study, json.loads(sys.argv[3]), int(sys.argv[4]), 2, Path(sys.argv[2]), end)
"""


@pytest.mark.slow
def test_killed_run_goes_on_without_computing_anything_twice(coarse, compared, tmp_path):
    """Before the kill with two workers, afterwards with one."""
    given, file = tmp_path / "study.json", tmp_path / "found.sqlite"
    given.write_text(json.dumps(coarse.facts()))
    command = [sys.executable, "-c", COMPARE, str(given), str(file), json.dumps(COMPARED), str(RUNS)]
    assert subprocess.run(command, env={**os.environ, "PYTHONPATH": str(SRC)}, check=False).returncode == 9
    with file.with_name("found.sqlite-wal").open("ab") as torn:
        torn.write(b"torn by the kill")
    done = kept(file)
    assert 3 <= done < 10
    found = compare(coarse, COMPARED, RUNS, 1, file)
    assert found.computed == 10 - done and compared.computed == 10
    np.testing.assert_array_equal(found.nrmse, compared.nrmse)
    assert found.worst == compared.worst and found.tunings == compared.tunings
    assert compare(coarse._replace(seed=2), [0.01], RUNS, 1, file).computed == 2
    assert compare(coarse, [0.01, 0.02], RUNS, 1, file).computed == 0


def kept(file: Path) -> int:
    """Tasks whose results are there."""
    with closing(sqlite3.connect(file)) as connection:
        return int(connection.execute("SELECT count(*) FROM runs").fetchone()[0])


def test_tasks_are_told_apart_by_their_content_only():
    assert number({"a": 1.0, "b": 2}) == number({"b": 2, "a": 1.0}) != number({"a": 1.0, "b": 3})


def test_changed_code_is_computed_again(coarse, tmp_path, monkeypatch):
    file, task = tmp_path / "found.sqlite", [{"width": 0.01, "runs": 2}]
    assert compute(noise_of_width, coarse.facts(), task, 1, file).computed == 1
    assert compute(noise_of_width, coarse.facts(), task, 1, file).computed == 0
    (tmp_path / "package").mkdir()
    monkeypatch.setattr(of, "PACKAGE", tmp_path / "package")
    assert compute(noise_of_width, coarse.facts(), task, 1, file).computed == 1


@pytest.mark.parametrize(
    ("widths", "runs", "workers"), [([], 5, 1), ([0.1], 0, 1), ([np.nan], 5, 1), ([-0.1], 5, 1), ([0.1], 5, 0)]
)
def test_senseless_comparisons_are_refused(coarse, widths, runs, workers):
    with pytest.raises(ValueError, match="Correct"):
        compare(coarse, widths, runs, workers)


@pytest.mark.slow  # the orderings of a run: tests/scenarios/test_soft_landing.py
def test_orderings_of_the_paper_come_out_in_few_runs(study):
    """As [RTS] states them; the parameter errors of 30 % are looked at in the slow test."""
    found = compare(study, [0.001, 0.1, 0.2], 40, 1)
    e = {name: found.nrmse[:, k] for k, name in enumerate(ESTIMATORS)}
    assert np.all(e["ERTSS"] < 0.5 * e["EKF"])
    assert np.all(e["ERTSS"][:2] < 0.6 * e["ERTSS without e_i"][:2])
    assert np.all(e["ERTSS without e_F"][0] < 0.2 * e["ERTSS"][0])
    assert np.all(e["ERTSS without e_F"][2] > 1.1 * e["ERTSS"][2])
    assert np.all(e["ERTSS"] < 0.5 * e["open loop"])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process's memory is read from /proc")
def test_a_chunk_takes_little_memory_and_time(study, tmp_path):
    """In a process of its own, as a worker computes it: what rusage tells holds for parents and other children too."""
    plan_of(study)
    tuned = compute(noise_of_width, study.facts(), [{"width": 0.1, "runs": CHUNK}], 1).results[0]
    task = {"width": 0.1, "chunk": 0, "runs": CHUNK, "tuning": [*tuning(tuned, study)]}
    (tmp_path / "task.json").write_text(json.dumps([study.facts(), task]))
    asked = [sys.executable, "-c", WORKER, str(tmp_path / "task.json")]
    told = subprocess.run(asked, env={**os.environ, "PYTHONPATH": str(SRC)}, capture_output=True, text=True, check=True)
    seconds, mebibytes = map(float, told.stdout.split())
    print(f"{seconds:.1f} s of CPU, {mebibytes:.0f} MiB")
    assert 20.0 < mebibytes < 2048.0
    assert 0.0 < seconds * 10_000 / CHUNK * len(WIDTHS) < 480.0  # those of Fig. 9


@pytest.mark.slow
def test_figure_9_in_full(study, tmp_path):
    found = compare(study, WIDTHS, 10_000, 2, tmp_path / "found.sqlite")
    print(*orderings(found), sep="\n")
    e = {name: found.nrmse[:, k] for k, name in enumerate(ESTIMATORS)}
    narrow = np.array(WIDTHS) <= 0.1
    assert np.all(e["ERTSS"] < e["EKF"])
    assert np.all(e["ERTSS"][narrow] < e["ERTSS without e_i"][narrow])
    assert np.all(e["ERTSS without e_F"][0] < e["ERTSS"][0])
    assert np.any(e["ERTSS without e_F"] > e["ERTSS"])
    assert np.all(e["ERTSS"] < e["open loop"])
