"""The study of the voltage profiles: estimates lined up with their samples, motions counted, errors, figures."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from gapsense.cosim import run, sweep
from gapsense.report import plot as figures
from gapsense.report.table import text
from gapsense.scenarios.profiles import experiment
from gapsense.scenarios.profiles import show as drawn
from gapsense.studies import drawer

FOLDER = Path(__file__).resolve().parents[2] / "scenarios" / "profiles"


@pytest.fixture(scope="module")
def fmus(natives):
    """Native ones, which have the bits of the Python ones in all scenarios: tests/native/test_scenarios.py."""
    return natives


@pytest.fixture(scope="module")
def first(fmus):
    """The first profile, whose motions are all published."""
    return run(FOLDER, None, fmus)


@pytest.fixture(scope="module")
def bouncing(fmus):
    """A profile that lands, returns and lands again before the smoother has published the first landing."""
    return run(FOLDER, None, fmus, point=12)


def test_smoothed_estimates_lie_at_the_samples_that_they_are_about(first):
    profile = experiment.line_up(first)
    assert profile.difference == 0.0
    assert [(m.operation, m.returns, m.published) for m in profile.motions] == [
        ("making", False, True),
        ("breaking", False, True),
    ]
    for m in profile.motions:
        rows = slice(m.first, m.landed)
        assert set(profile.mode[rows]) == {2.0}
        assert profile.mode[m.first - 1] != 2.0 != profile.mode[m.landed]
        error = np.abs(profile.estimates["ERTSS"].position - profile.true.position)[rows]
        filtered = np.abs(profile.estimates["EKF"].position - profile.true.position)[rows]
        assert error.max() < 0.5 * filtered.max()
        shifted = np.abs(np.roll(profile.estimates["ERTSS"].position, 5) - profile.true.position)[rows]
        assert error.mean() < shifted.mean()


def test_no_landing_cuts_off_what_is_published(bouncing):
    profile = experiment.line_up(bouncing)
    assert profile.difference == 0.0
    assert [m.returns for m in profile.motions if m.operation == "breaking"] == [False, True]
    assert all(m.published for m in profile.motions)
    for label in experiment.ESTIMATORS:
        assert all(np.isfinite(values).all() for values in profile.estimates[label])


def test_errors_are_those_of_the_samples_in_motion(first):
    profile = experiment.line_up(first)
    errors = experiment.errors([profile, profile])
    for operation, m in zip(experiment.OPERATIONS, profile.motions):
        assert errors.position["ERTSS", operation].size == 2 * (m.landed - m.first)
        true, estimated = first["actuator.position"][m.first], first["ekf.position"][m.first]
        assert errors.position["EKF", operation][0] == pytest.approx(abs(estimated - true) / 1e-3, abs=1e-12)
        speed = (first["actuator.position"][m.landed - 1] - first["actuator.position"][m.landed - 2]) / 20e-6
        expected = abs(first["ekf.velocity"][m.landed - 1] - speed) / 1e-3
        assert errors.velocity["EKF", operation][-1] == pytest.approx(expected, rel=1e-9)
    told = text(*drawn.summary([profile, profile], errors))
    assert "making: 2 motions from stop to stop, 1 of them different; 0 back" in told
    rows = [line.split() for line in told.splitlines()]
    median = f"{np.median(errors.velocity['ERTSS', 'breaking']):.4g}"
    assert median in next(row for row in rows[::-1] if row[:2] == ["breaking", "ERTSS"])


def test_no_motion_is_no_crash(first):
    profile = experiment.line_up(first)._replace(motions=[])
    errors = experiment.errors([profile])
    assert "nan" in text(*drawn.summary([profile], errors))
    drawn.trajectories([profile], "none")


@pytest.mark.slow
def test_figures_are_pictures(first, bouncing, tmp_path):
    profiles = [experiment.line_up(result) for result in (first, bouncing)]
    for name, figure in {
        "cycle": drawer("profiles")(first),
        "trajectories": drawn.trajectories(profiles, "x"),
        "boxes": drawn.boxes(experiment.errors(profiles), "x"),
    }.items():
        height, width = imread(figures.save(figure, tmp_path / f"{name}.png")).shape[:2]
        assert 900 < width < 1400 and 500 < height < 1300
    with pytest.raises(ValueError, match=r"`ekf.position`"):
        drawn.run_figure(type(first)(**{**vars(first), "signals": {"actuator.position": first["actuator.position"]}}))


@pytest.mark.slow
@pytest.mark.parametrize("variant", [None, "thresholds", "early"])
def test_smoother_is_better_than_the_filter_over_all_profiles(variant, fmus, tmp_path):
    from gapsense.cosim import read_result

    swept = sweep(FOLDER, variant=variant, fmus=fmus, out=tmp_path, keep=True)
    assert swept.indices == tuple(range(35)) and not swept.errors
    found = experiment.errors([experiment.line_up(read_result(file)) for file in swept.kept])
    for of_quantity in found:
        for operation in experiment.OPERATIONS:
            assert np.median(of_quantity["ERTSS", operation]) < np.median(of_quantity["EKF", operation])
