"""Figs. 8 and 9 of [UKF]: what must come out of the studies."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import load
from gapsense.report.table import text
from gapsense.scenarios.bounded_ukf import errors as bounded_ukf
from gapsense.scenarios.bounded_ukf import show
from gapsense.scenarios.bounded_ukf.errors import HALF, NOISE, REST, SAMPLES, SCENARIO, VOLTAGES, WRONG, Errors
from gapsense.studies.runs import signals

ROBUST, PAPER, OPEN = "bounded UKF, robust", "bounded UKF, paper", "open loop"


@pytest.fixture(scope="module")
def wrong() -> dict[str, Errors]:
    """Resistance believed 5 % too large: the most dangerous error; the others right, then wrong by 5 %."""
    return bounded_ukf.parameters(0.05, (0.0, 0.05))


@pytest.fixture(scope="module")
def robust() -> Errors:
    """Of the robust tuning with the resistance right, the others wrong by 3 %, then by 5 %."""
    with pytest.MonkeyPatch.context() as patch:
        only(patch, ROBUST)
        return bounded_ukf.parameters(0.0, (0.03, 0.05))[ROBUST]


@pytest.fixture(scope="module")
def right() -> dict[str, Errors]:
    return bounded_ukf.noise(seeds=3)


def only(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Compute some of the filters only."""
    monkeypatch.setattr(bounded_ukf, "FILTERS", {name: bounded_ukf.FILTERS[name] for name in names})


@pytest.mark.slow
def test_robust_tuning_misses_no_landing_at_five_percent(wrong: dict[str, Errors], robust: Errors) -> None:
    assert wrong[ROBUST].missed.shape == (2, len(VOLTAGES), 64, 2)
    assert not wrong[ROBUST].missed.any()
    assert not robust.missed[1].any()


def test_robust_tuning_holds_where_it_was_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chosen at 24, 30 and 36 V with corners of 1 to 10 %; judged at 21, 27 and 33 V with errors anywhere within."""
    only(monkeypatch, ROBUST, OPEN)
    found = bounded_ukf.unseen(runs=40)
    closing, opening = (np.sqrt(np.mean(found[ROBUST].rmse[0, ..., part] ** 2)) for part in (0, 1))
    assert not found[ROBUST].missed[0].any()  # at 10 % one is, as by the open loop
    assert closing < 31e-6  # with 5 uWb and 20 nm: 32 um
    assert opening < 14e-6  # 18 um
    assert opening**2 < 0.15 * np.mean(found[OPEN].rmse[0, ..., 1] ** 2)


def test_opening_with_wrong_parameters(robust: Errors) -> None:
    """The voltages of the choice: 117 um before at 5 % and 36 V, 53 um at 3 %."""
    worst = robust.rmse.max(axis=(1, 2))
    assert worst[0, 1] < 36e-6 and worst[1, 1] < 72e-6
    assert worst[1, 0] < 26e-6


def test_tuning_of_the_paper_misses_some(wrong: dict[str, Errors]) -> None:
    assert wrong[PAPER].missed[1].sum() > 10


def test_filter_is_worth_it_with_wrong_parameters_and_not_with_right_ones(
    wrong: dict[str, Errors], right: dict[str, Errors]
) -> None:
    assert wrong[ROBUST].rmse[1].max() < wrong[OPEN].rmse[1].max()
    assert right[OPEN].rmse.mean() < 1.5 * right[ROBUST].rmse.mean()


def test_errors_grow_with_the_noise(right: dict[str, Errors]) -> None:
    for name in (ROBUST, PAPER, OPEN):
        assert np.all(np.diff(np.sqrt(np.mean(right[name].rmse ** 2, axis=(1, 2, 3)))) > 0.0)
    assert right[ROBUST].rmse[-1].max() < 60e-6


def test_a_run_of_the_study_is_that_of_the_fmus(wrong: dict[str, Errors], fmus: Path) -> None:
    """One combination of signs at 36 V."""
    run = 37
    signs = [*product((-1.0, 1.0), repeat=len(WRONG))][run]
    f = dict(zip(WRONG, (1.0 + 0.05 * s for s in signs)))
    f |= {"core.saturation": f["coil.turns"] / f["core.saturation"], "coil.resistance": 1.05}
    stds = NOISE * bounded_ukf.means((36.0,))[0]
    values = bounded_ukf.draw(36.0, stds, f)
    assert (
        values["ukf.noise.current"]
        == values["sensor.noise.current"]
        == pytest.approx(NOISE * 0.5 * 36.0 / 77.5, rel=0.02)
    )
    ((_, found),) = signals(SCENARIO, None, ["ukf.position", "valve.position"], [values], [1002], "fmu")
    assert found is not None and len(found) == SAMPLES
    error = np.diff(found[REST:], axis=1)
    for part, half in enumerate((error[:HALF], error[HALF:])):
        assert wrong[ROBUST].rmse[1, 2, run, part] == pytest.approx(np.sqrt(np.mean(half**2)), rel=1e-12)


def test_what_is_right_is_what_the_valve_of_the_scenario_has() -> None:
    components = load(SCENARIO, "exact").components
    for name in bounded_ukf.COMPONENTS:
        assert (
            components[name].values.items()
            >= {name: right for name, right in bounded_ukf.RIGHT.items() if name != "core.saturation"}.items()
        )
    assert components["valve"].values["coil.resistance"] == bounded_ukf.RIGHT["coil.resistance"]


def test_tables_name_every_filter(wrong: dict[str, Errors]) -> None:
    tables = (text(*show.parameter_tables(wrong, (0.0, 0.05), 0.05)), text(show.resistance_table({0.05: wrong}, 0.05)))
    for shown in tables:
        assert all(name in shown for name in bounded_ukf.FILTERS)
        assert max(map(len, shown.splitlines())) < 121
    assert "resistance wrong by +5 %" in tables[0] and "0 of 384" in tables[1]


@pytest.mark.slow
def test_command_draws_its_figure(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["study", "ukf-noise", "--seeds", "1", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "ukf_noise.png").stat().st_size > 10_000
    assert "36 V, opening" in done.output
