"""The study of the hybrid Kalman filter, with few seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gapsense.scenarios.pot_magnet import deviations as study
from gapsense.scenarios.pot_magnet import show as drawings

from gapsense.estimators import hybrid_ekf as kernel_module
from gapsense.fmi.components import load_component
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat
from gapsense.report import plot as figures
from gapsense.report.table import text
from gapsense.studies.devices import POT_MAGNET

FMUS = Path(__file__).resolve().parents[2] / "fmus"


@pytest.fixture(scope="module")
def found() -> Any:
    calls: list[tuple[int, int]] = []
    result = study.study(seeds=2, progress=lambda done, total: calls.append((done, total)))
    assert calls[-1][0] == calls[-1][1] and [done for done, _ in calls] == sorted(done for done, _ in calls)
    return result


def test_tuning_is_that_of_the_component() -> None:
    ports = {port.field: port for port in load_component(FMUS / "hybrid_ekf").of("parameter")}
    assert {n: v for n, v in study.NOMINAL._asdict().items() if not ports[n].choices} == {
        n: port.start for n, port in ports.items() if not port.choices
    }
    assert ports["tuning"].choices == study.TUNINGS
    starts = {port.field: port.start for port in load_component(FMUS / "pot_magnet").of("parameter")}
    assert {n: v for n, v in POT_MAGNET._asdict().items() if n != "orientation"} == {
        n: v for n, v in starts.items() if n != "orientation"
    }


def test_one_run_of_the_batch_is_a_run_of_the_kernel(found: Any) -> None:
    """The first seed at the lowest noise, without errors of the parameters."""
    run = study.truth(POT_MAGNET, True)
    one = study.deviations(run, POT_MAGNET, "robust", seeds=1)
    noise = study.LEVELS[0] * np.random.default_rng([study.NOISE, 0]).standard_normal(study.SAMPLES)
    par = [float(np.ravel(v)[0]) for v in study.believed(POT_MAGNET, np.zeros((1, 6)), np.array([1e-4]), "robust")]
    kernel = Kernel(kernel_module)
    step, rows = kernel.scalar["step"], []
    state, outputs = kernel.scalar["initial"]((0.0, float(run.states[0, 0] + noise[0])), tuple(par))
    for u, i in zip(run.voltage.tolist(), (run.states[:, 0] + noise).tolist()):
        if rows:
            state, outputs = step(state, (u, i), tuple(par))
        rows.append(outputs[:4])
    np.testing.assert_allclose(one.rmsd[0], np.abs(np.array(rows) - run.states), rtol=1e-6, atol=1e-12)
    assert len(par) == len(flat(kernel_module.Parameters(*par)))


@pytest.mark.slow
def test_what_must_come_out(found: Any) -> None:
    """Robust beats the open loop with wrong parameters and the published tuning in noise; the open loop is exact."""
    for step in study.STEPS:
        wrong, right = ({t: found[study.Case(step, m, t)] for t in study.TUNINGS} for m in (0.05, 0.0))
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
