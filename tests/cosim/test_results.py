"""Results are written whole and read back the same; metrics and baselines say what they should."""

import errno
import json
import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapsense._os import files
from gapsense._os.files import read_columns, sha256, write_atomically
from gapsense.cosim import check, find_scenarios, read_result, run, test_scenarios, update_baseline, write_junit
from gapsense.cosim.result.metrics import KINDS, Measured
from gapsense.cosim.result.result import measure_all
from gapsense.cosim.scenario.records import Metric
from gapsense.problems import InputError

METRIC = '[metrics.{name}]\nkind = "{kind}"\nsignal = "{signal}"\n{more}\n'


def metric(name, kind, signal, more=""):
    return METRIC.format(name=name, kind=kind, signal=signal, more=more)


def test_result_reads_back_bit_for_bit(write, chain, fmus, tmp_path):
    text = (
        chain
        + metric("a", "mean", "lag.y", 'where = "gain.mode"')
        + metric("b", "final", "lag.y", "bounds = [-inf, 1]")
    )
    result = run(write(text), fmus=fmus)
    path = result.save(tmp_path / "deep" / "folder" / "run.csv")
    again = read_result(path)
    assert np.array_equal(result.times, again.times)
    assert all(np.array_equal(result[name], again[name]) for name in result.signals)
    assert (again.run, again.about, again.parameters) == (result.run, result.about, result.parameters)
    assert again.metrics["b"] == result.metrics["b"]
    assert math.isnan(again.metrics["a"].value)


def test_files_follow_the_conventions(write, chain, fmus, tmp_path):
    path = run(write(chain), fmus=fmus).save(tmp_path / "run")
    lines = path.read_text().splitlines()
    assert lines[0].startswith('"time [s]","source.y [V]","source.steps [1]","lag.u [V]"')
    assert len(lines) == 12
    sidecar = json.loads(path.with_suffix(".json").read_text(), parse_constant=pytest.fail)
    assert sidecar["signals"]["lag.y"] == {"unit": "V", "nominal": 10.0, "causality": "output"}
    assert sidecar["parameters"]["source.slope"] == 2.0
    assert len(sidecar["run"]["files"]["scenario.toml"]) == 64
    assert sidecar["interrupted"] is False


@pytest.fixture
def saved(write, chain, fmus, tmp_path):
    """Two results of different runs, and the file that the first of them is in."""
    first = run(write(chain), fmus=fmus)
    second = replace(first, signals={name: 2.0 * values for name, values in first.signals.items()}, wall=1.0)
    return first, second, first.save(tmp_path / "out" / "x.csv")


class FullDisk:
    """A file that takes some characters and then says that the disk is full."""

    def __init__(self, file, room):
        self.file, self.room = file, room

    def write(self, text):
        self.room -= len(text)
        if self.room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return self.file.write(text)


@pytest.mark.parametrize("name", ["write_columns", "write_json"])
def test_full_disk_leaves_the_old_result_whole(saved, monkeypatch, name):
    first, second, path = saved
    before = {file: file.read_bytes() for file in path.parent.iterdir()}
    written = getattr(files, name)
    monkeypatch.setattr(files, name, lambda file, *more: written(FullDisk(file, 100), *more))
    with pytest.raises(OSError, match=rf"No space left on device: '.*x\.{'csv' if 'columns' in name else 'json'}'"):
        second.save(path)
    assert {file: file.read_bytes() for file in path.parent.iterdir()} == before
    assert np.array_equal(read_result(path)["lag.y"], first["lag.y"])


TOO_LARGE = """
import resource
from gapsense.cosim import read_result
result = read_result(PATH)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
try:
    result.save(PATH)
except OSError as error:
    print(error.errno, error.filename)
"""


def test_too_large_file_is_told_by_name_and_leaves_the_old_one(saved, python):
    path = saved[2]
    before = {file: file.read_bytes() for file in path.parent.iterdir()}
    done = python(TOO_LARGE.replace("PATH", repr(str(path))))
    assert done.stdout.strip() == f"{errno.EFBIG} {path}", done
    assert {file: file.read_bytes() for file in path.parent.iterdir()} == before


@pytest.mark.parametrize("kept", [".csv", ".json"])
def test_mixture_of_two_runs_is_refused(saved, kept):
    _, second, path = saved
    old = path.with_suffix(kept).read_bytes()
    second.save(path)
    new = sha256(path)
    path.with_suffix(kept).write_bytes(old)  # as after a kill between the two
    hashes = sha256(path), new if kept == ".csv" else json.loads(old)["sha256"]
    with pytest.raises(ValueError, match=r"has the SHA-256 {}, x\.json expects {}.*Run again".format(*hashes)):
        read_result(path)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda file: file.unlink(), "x.json beside it is missing, damaged or not a side-car. Run again"),
        (lambda file: file.write_text("{"), "x.json beside it is missing, damaged or not a side-car. Run again"),
        (lambda file: file.write_text('{"format": "other"}'), "not a side-car. Run again"),
        (lambda file: file.write_text('{"format": "gapsense result 1"}'), "an old result, .* the hash.* Run again"),
    ],
)
def test_result_without_its_sidecar_is_refused(saved, change, expected):
    change(saved[2].with_suffix(".json"))
    with pytest.raises(ValueError, match=expected):
        read_result(saved[2])


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_flipped_bit_is_told_or_changes_nothing(saved, data):
    path, expected = saved[2], read_result(saved[2])
    file = data.draw(st.sampled_from([path, path.with_suffix(".json")]))
    whole = file.read_bytes()
    damaged, place = bytearray(whole), data.draw(st.integers(0, len(whole) - 1))
    damaged[place] ^= 1 << data.draw(st.integers(0, 7))
    file.write_bytes(damaged)
    try:
        found = read_result(path)
    except InputError as error:
        assert path.stem in str(error)
    else:  # blanks between the entries of the side-car
        assert file.suffix == ".json" and found.parameters == expected.parameters and found.metrics == expected.metrics
        assert found.run == expected.run and found.timing == expected.timing and found.events == expected.events
    finally:
        file.write_bytes(whole)


def test_sidecar_of_an_older_version_is_read(saved):
    beside, expected = saved[2].with_suffix(".json"), read_result(saved[2])
    data = json.loads(beside.read_text())
    del data["checksum"]
    beside.write_text(json.dumps({**data, "format": "gapsense result 2"}))
    assert read_result(saved[2]).parameters == expected.parameters
    beside.write_text(json.dumps({**data, "format": "gapsense result 3"}))
    with pytest.raises(InputError, match="missing, damaged"):
        read_result(saved[2])


def test_result_tells_its_scenario_from_where_it_is(saved, tmp_path):
    first, _, path = saved
    assert json.loads(path.with_suffix(".json").read_text())["run"]["source"] == "../demo/scenario.toml"
    assert read_result(path).run.source == first.run.source == str(tmp_path / "demo" / "scenario.toml")


def test_failed_write_keeps_the_old_file(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("old")

    def fail(file):
        file.write("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_unknown_signal_offers_the_nearest(write, chain, fmus):
    with pytest.raises(KeyError, match=r"Did you mean `lag\.y`"):
        run(write(chain), fmus=fmus)["lag.yy"]


def test_recording_selects_signals_and_rows(write, chain, fmus):
    text = chain + '[record]\nsignals = ["lag.y", "g*.u"]\ndecimation = 5\n'
    full, thin = run(write(chain), fmus=fmus), run(write(text), fmus=fmus)
    assert list(thin.signals) == ["lag.y", "gain.u"]
    assert np.array_equal(thin["lag.y"], full["lag.y"][::5])
    assert thin.stepped("lag.y").tolist() == [False, True, True]


def test_metric_kinds_on_known_numbers():
    error = np.array([3.0, -4.0, 0.0, 1.0])
    expected = {
        "rmse": math.sqrt(6.5),
        "max_abs": 4.0,
        "mean_abs": 2.0,
        "mean": 0.0,
        "std": math.sqrt(6.5),
        "final": 1.0,
        "min": -4.0,
        "max": 3.0,
        "increase": -2.0,
        "fraction": 0.75,
        "until_above": 0.1,
        "until_below": 0.2,
    }
    times = np.array([0.1, 0.2, 0.3, 0.4])
    plain = {name: kind for name, kind in KINDS.items() if kind.reference != "axis"}
    found = {name: kind.compute(error, *([times] if kind.takes_times else [])) for name, kind in plain.items()}
    assert found == pytest.approx(expected)


def test_metrics_of_curves_on_a_known_ellipse():
    angle = np.linspace(0.1, 0.1 + 4.0 * np.pi, 2000)  # twice around
    x, y = 3.0 * np.cos(angle), 2.0 * np.sin(angle) + 1.0
    assert KINDS["loop_area"].compute(y, x) == pytest.approx(2 * 6.0 * np.pi, rel=1e-4)
    assert KINDS["loop_area"].compute(y[::-1], x[::-1]) == pytest.approx(-2 * 6.0 * np.pi, rel=1e-4)
    assert KINDS["intercept"].compute(y, x) == pytest.approx((3.0 + 1.0) / 2.0, rel=1e-4)
    assert math.isnan(KINDS["intercept"].compute(y, x + 4.0))


def test_metric_of_a_curve_in_a_scenario(write, chain, fmus):
    area = 'kind = "loop_area"\nsignal = "gain.y"\nreference = "source.y"'  # their units differ, as they may
    result = run(write(chain + f"[metrics.area]\n{area}\n"), fmus=fmus)
    x, y = result["source.y"][1:], result["gain.y"][1:]
    area = sum((x[k] + x[k - 1]) * (y[k] - y[k - 1]) / 2.0 for k in range(x.size))  # from the last sample to the first
    assert result.metrics["area"].value == pytest.approx(area, rel=1e-12)
    assert area != 0.0
    assert result.metrics["area"].unit == f"{result.units['gain.y']}.{result.units['source.y']}"


def test_metrics_use_samples_windows_and_references(write, chain, fmus):
    slow = chain.replace('fmu = "Source"', 'fmu = "Source"\nstep = 2')
    text = slow + metric("held", "mean", "source.steps") + metric("end", "final", "source.y", "reference = 1.0")
    text += metric("window", "min", "source.y", "after = 0.2\nbefore = 0.8")
    text += metric("level", "max", "source.y", 'reference = "source.level"')
    text += metric("same", "rmse", "source.y", 'reference = "lag.u"\nbounds = [0.0, 0.0]')
    result = run(write(text), fmus=fmus)
    assert result.metrics["held"].value == 3.0  # 1, 2, 3, 4, 5: neither the initial value nor the held rows
    assert result.metrics["end"].value == 2.0
    assert result.metrics["window"].value == pytest.approx(1.8)  # t > 0.2 is strict, so 0.4 s
    assert result.metrics["level"].value == 2.0
    assert result.metrics["same"].passed


def measure(metric, result):
    return measure_all([metric], result)[metric.name]


def test_metric_of_samples_published_later(write, chain, fmus):
    plain = run(write(chain), fmus=fmus)
    late = np.roll(plain["source.y"], 2)  # at t, what `source.y` was at t - 0.2 s
    extra = {"source.late": late, "source.when": plain.times - 0.2, "source.valid": (plain.times > 0.15).astype(float)}
    result = replace(plain, signals={**plain.signals, **extra})
    about = Metric("m", "max_abs", "source.late", "source.y", where="source.valid", time="source.when")
    assert measure(about, result).value < 1e-12
    assert measure(replace(about, time=None), result).value == pytest.approx(0.4)
    assert math.isnan(measure(replace(about, where=None), result).value)  # there is no `source.y` before the start
    window = replace(about, kind="min", reference=None, after=0.1, before=0.4)
    assert measure(window, result).value == plain["source.y"][2]
    nothing = replace(about, where="source.steps", signal="source.steps", kind="min", reference=None, time=None)
    assert measure(nothing, result).value == 1.0


def test_signals_of_a_metric_are_checked(write, chain, fmus):
    text = chain + metric("a", "max", "lag.y", 'time = "lag.u"') + metric("b", "max", "lag.y", 'where = "lag.z"')
    found = check(write(text), fmus=fmus)
    assert len(found) == 2
    assert "metrics.a.time: `lag.u` is in V, s expected" in found[0]
    assert "metrics.b.where: unknown signal `lag.z`" in found[1]


def test_metric_without_samples_fails():
    assert not Measured("m", math.nan, "", (0.0, 1.0)).passed
    assert not Measured("m", math.nan, "", None).passed


def test_baseline_is_shown_then_written_then_compared(write, chain, fmus):
    path = write(chain + "[baseline]\n")
    missing = test_scenarios(path, fmus)[0]
    assert [check.name for check in missing.failures] == ["baseline"]
    shown = update_baseline(path, fmus=fmus)
    assert not shown.written
    assert not (path.parent / "baseline.csv").exists()
    assert "new: 7 signals, 11 rows" in str(shown)
    assert update_baseline(path, fmus=fmus, write=True).written
    assert str(update_baseline(path, fmus=fmus, write=True)).endswith("nothing changes.")
    assert test_scenarios(path, fmus)[0].passed


def changed_baseline(path, fmus, name, rows, by):
    update_baseline(path, fmus=fmus, write=True)
    file = path.parent / "baseline.csv"
    columns = read_columns(file)
    columns[name][rows] += by
    from gapsense._os.files import write_columns

    write_atomically(file, lambda f: write_columns(f, columns))


def test_difference_names_first_and_worst_point(write, chain, fmus):
    path = write(chain)
    changed_baseline(path, fmus, "lag.y", [3, 5], [1e-6, -0.5])
    failure = test_scenarios(path, fmus)[0].failures[0].failure
    assert "lag.y [V]: 2 of 11 rows differ from the baseline by more than 1e-08" in failure
    assert "first t = 0.3 s" in failure
    assert "worst t = 0.5 s" in failure


@pytest.mark.parametrize(
    ("tolerance", "by", "passes"),
    [
        ("rtol = 1e-3", 0.0099, True),  # of the nominal value, 10 V
        ("rtol = 1e-3", 0.0101, False),
        ("rtol = 0.0\natol = 0.5", 0.49, True),
        ('tolerances = { "lag.*" = { atol = 1.0 } }', 0.9, True),
        ('tolerances = { "gain.*" = { atol = 1.0 } }', 0.9, False),
        ('signals = ["gain.*"]', 0.0, True),
        ("rtol = 1e-3", math.nan, False),
    ],
)
def test_tolerance_follows_the_nominal_value(write, chain, fmus, tolerance, by, passes):
    path = write(f"{chain}[baseline]\n{tolerance}\n")
    name = "gain.y" if "signals" in tolerance else "lag.y"
    changed_baseline(path, fmus, name, [4], [by])
    assert test_scenarios(path, fmus)[0].passed is passes


def test_other_rows_and_signals_are_differences(write, chain, fmus):
    path = write(chain)
    update_baseline(path, fmus=fmus, write=True)
    path.write_text(chain + '[record]\nsignals = ["lag.y"]\n')
    assert "only in the baseline" in test_scenarios(path, fmus)[0].failures[0].failure
    path.write_text(chain.replace("stop = 1.0", "stop = 2.0"))
    assert "11 rows, the run has 21" in test_scenarios(path, fmus)[0].failures[0].failure
    path.write_text(chain.replace("stop = 1.0", "start = 1.0\nstop = 2.0"))
    assert "row 0 of the baseline is at 0 s, of the run at 1 s" in test_scenarios(path, fmus)[0].failures[0].failure


def test_all_scenarios_and_variants_are_tested_and_reported(write, chain, fmus, tmp_path):
    bounded = chain + metric("end", "final", "source.y", "bounds = [2.9, 3.1]")
    bounded += "[variants.steep]\ncomponents.source.set.slope = 4.0\nmetrics.end.bounds = [4.9, 5.1]\n[variants.idle]\n"
    write(bounded, "good")
    write(bounded.replace("2.9", "3.05"), "outside")
    write(bounded.replace("slope = 2.0", "slop = 2.0"), "wrong")
    outcomes = test_scenarios(tmp_path, fmus)
    passed = {outcome.scenario: outcome.passed for outcome in outcomes}
    assert passed == {
        "good": True,
        "good[steep]": True,
        "outside": False,
        "outside[steep]": True,
        "wrong": False,
        "wrong[steep]": False,
    }
    write_junit(outcomes, tmp_path / "report" / "junit.xml")
    root = ElementTree.parse(tmp_path / "report" / "junit.xml").getroot()
    assert (root.get("tests"), root.get("failures")) == ("10", "3")
    assert "outside its bounds" in root.find(".//testsuite[@name='outside']//failure").get("message")


def test_folder_without_scenarios_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"there is no `scenario\.toml`"):
        find_scenarios(tmp_path)
