"""The study of the hybrid Kalman filter, with few seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gapsense.cosim import load
from gapsense.fmi.components import load_component
from gapsense.report import plot as figures
from gapsense.report.table import text
from gapsense.scenarios.pot_magnet import deviations as study
from gapsense.scenarios.pot_magnet import show as drawings
from gapsense.shipped import SCENARIOS
from gapsense.studies.runs import overlaid, signals

FMUS = Path(__file__).resolve().parents[2] / "fmus"


@pytest.fixture(scope="module")
def found() -> Any:
    calls: list[tuple[int, int]] = []
    result = study.study(seeds=2, progress=lambda done, total: calls.append((done, total)))
    assert calls[-1][0] == calls[-1][1] and [done for done, _ in calls] == sorted(done for done, _ in calls)
    return result


def test_filters_of_the_scenario_know_the_magnet_of_the_paper() -> None:
    """Their parameter sets say what the start values of the components say."""
    ports = {port.name: port for port in load_component(FMUS / "hybrid_ekf").of("parameter")}
    scenario = load(study.SCENARIO)
    for tuning, name in study.FILTERS.items():
        believed = {**scenario.components[name].values}
        assert believed.pop("tuning", ports["tuning"].start) == tuning in ports["tuning"].choices
        assert believed == {name: ports[name].start for name in believed}
        assert {*study.WRONG, "coil.resistance_upper"} <= {*believed}
    starts = {port.name: port.start for port in load_component(FMUS / "pot_magnet").of("parameter")}
    assert scenario.components["magnet"].values.items() <= starts.items()


def test_draws_are_wrong_by_as_much_as_was_asked_and_the_same_at_every_level() -> None:
    drawn = study.draws("printed", 50, 0.05)
    believed = load(study.SCENARIO, "printed").components["robust"].values
    assert len(drawn) == 50 * len(study.LEVELS)
    for name in study.WRONG:
        factors = np.array([of[f"paper.{name}"] for of in drawn]).reshape(-1, 50) / believed[name]
        assert np.ptp(factors, axis=0).max() == 0.0 and 0.04 < np.abs(factors[0] - 1.0).max() <= 0.05
    assert all(of["robust.noise.current"] == of["sensor.noise.current"] for of in drawn)
    warm = [of["open_loop.coil.resistance_upper"] / of["open_loop.coil.resistance"] for of in drawn]
    assert warm == pytest.approx([believed["coil.resistance_upper"] / believed["coil.resistance"]] * len(drawn))


@pytest.mark.parametrize("variant", [None, "off"])
def test_one_run_has_the_bits_of_the_fmus(fmus: Path, variant: str | None) -> None:
    """The first seed at the lowest noise."""
    drawn, names = study.draws(variant, 1, 0.05)[:1], ["robust.position", "magnet.position", "magnet.mode"]
    scenario = overlaid(SCENARIOS / "pot_magnet", {"experiment": {"start": 0.49, "stop": 0.51}})
    ((_, by_vectors),) = signals(scenario, variant, names, drawn, [3])
    ((_, by_fmus),) = signals(scenario, variant, names, drawn, [3], "fmu")
    assert by_vectors is not None and by_fmus is not None
    np.testing.assert_array_equal(by_vectors, by_fmus)
    assert len(by_fmus) == 201 and np.ptp(by_fmus[:, 0]) > 0.0


@pytest.mark.slow
def test_what_must_come_out(found: Any) -> None:
    """Robust beats the open loop with wrong parameters and the published tuning in noise; the open loop is exact."""
    for step in study.STEPS:
        wrong, right = ({t: found[study.Case(step, m, t)] for t in study.FILTERS} for m in (0.05, 0.0))
        assert np.all(wrong["robust"].total[:4, 0] < 0.6 * wrong["none"].total[:4, 0])
        assert np.all(wrong["robust"].total[:4, 1] < wrong["none"].total[:4, 1])
        assert right["none"].total[0, 1] < 0.5e-6 and np.ptp(right["none"].total, axis=0).max() == 0.0
        assert right["paper"].total[:, 0] == pytest.approx(np.multiply(0.99, study.LEVELS), rel=0.05)
        assert right["robust"].wrong[-1].mean() < 0.02 < right["paper"].wrong[-1].mean()


@pytest.mark.slow
def test_numbers_and_figures_show_every_case(found: Any, tmp_path: Path) -> None:
    printed = text(*drawings.tables(found, "consistent", 2))
    assert printed.count("wrong mode / %") == len(found) == 12
    assert all(len(line) < 110 for line in printed.splitlines())
    for name, figure in (("time", drawings.over_time(found)), ("noise", drawings.over_noise(found))):
        assert len(figure.axes) == 16 and all(len(axis.lines) == 3 for axis in figure.axes)
        assert figures.save(figure, tmp_path / f"{name}.png").stat().st_size > 30_000


@pytest.mark.parametrize(("wrong", "words"), [
    ({"orientation": "upside down"}, "consistent or printed expected"), ({"seeds": 0}, "at least 1"),
    ({"mismatch": 1.0}, "below 1"), ({"mismatch": -0.1}, "from 0"),
])  # fmt: skip
def test_wrong_options_are_refused(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        study.study(**wrong)
