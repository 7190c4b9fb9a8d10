"""`Ekf` and `Ertss` with a memory of e_i at rest find back from what the paper's random walk never forgets.

The plant has eddy currents and hysteresis.  The time constant of 0.66 ms is that of issue 9, measured there on square
waves with a resistance believed 2 % too large; 10 and 20 % and the single wrong samples were not used for it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from lossy_valve import HALF, START, T_S, believed, square_wave

from gapsense.estimators.ekf import process_noise, tuning
from gapsense.estimators.reduced_model import normalise_model
from gapsense.scenarios.soft_landing.rts import Estimates, smooth_record


class Errors(NamedTuple):
    """Root mean square errors of filter and smoother in motion [um], and of the filtered flux linkage [mWb]."""

    ekf: float
    ertss: float
    flux_linkage: float


def errors(par: Any, after: int = START + 2 * HALF, **changed: np.ndarray) -> Errors:
    """Errors from a time on, in samples of `T_S`, in a run with some of the measurements changed."""
    s = square_wave(par.sample_time)
    measured = s._replace(**changed)
    found = smooth_record(measured.voltage, measured.current, measured.mode, par)
    later = np.arange(s.mode.size) * par.sample_time >= after * T_S
    moving = later & (s.mode == 2.0)

    def rms(estimates: Estimates, name: str, where: np.ndarray) -> float:
        return float(np.sqrt(np.mean((getattr(estimates, name) - getattr(s, name))[where] ** 2)))

    position = (1e6 * rms(e, "position", moving) for e in (found.filtered, found.smoothed))
    return Errors(*position, 1e3 * rms(found.filtered, "flux_linkage", later))


def changed(name: str, sample: int, value: float) -> dict[str, np.ndarray]:
    """One measurement of the first cycle wrong."""
    values = getattr(square_wave(), name).copy()
    values[sample] = value
    return {name: values}


LANDED, HELD = START + 2 * HALF, START + 300  # at rest on the upper stop, held on the lower one


def test_a_resistance_believed_too_large_does_not_run_away() -> None:
    paper, found = (errors(believed(memory, resistance=1.02)) for memory in (0.0, None))
    assert paper.ekf > 300.0 and paper.ertss > 50.0 and paper.flux_linkage > 15.0  # 352 um, 54 um, 16.2 mWb
    assert found.ekf < 32.0 and found.ertss < 6.0 and found.flux_linkage < 0.85  # 29 um, 5.7 um, 0.77 mWb


@pytest.mark.parametrize(
    "wrong",
    [changed("mode", HELD, 3.0), changed("current", START + 120, 10.0), changed("current", START + 800, 10.0)],
    ids=["mode while held", "current in motion", "current at rest"],
)
def test_one_wrong_sample_is_forgotten_within_the_next_operation(wrong: dict[str, np.ndarray]) -> None:
    """By the memory alone: the current is taken as it comes."""
    taken = {"range_current": 1e9, "range_innovation": 0.0}
    pars = (believed(memory)._replace(**taken) for memory in (0.0, None))
    paper, found = (errors(par, after=LANDED + HALF, **wrong) for par in pars)
    assert paper.ekf > 300.0 and paper.ertss > 40.0 and paper.flux_linkage > 12.0
    assert found.ekf < 27.0 and found.ertss < 6.0 and found.flux_linkage < 0.85


def test_with_the_right_resistance_it_costs_little() -> None:
    paper, found = (errors(believed(memory)) for memory in (0.0, None))
    assert found.ekf < paper.ekf and found.ertss < 1.1 * paper.ertss and found.flux_linkage < paper.flux_linkage


@pytest.mark.slow
def test_the_tuning_holds_at_another_sampling_period() -> None:
    """The process noise is a rate: one of so much per sample has 137 um and 20 um here."""
    paper, found = (errors(believed(memory, sample_time=5e-6)) for memory in (0.0, None))
    assert paper.ekf < 70.0 and found.ekf < 6.0 and found.ertss < 1.2  # 65, 4.7 and 1.04 um


def test_process_noise_is_a_rate() -> None:
    fast, usual = (
        np.array(process_noise(normalise_model(p), tuning(p)), float) for p in (believed(sample_time=5e-6), believed())
    )
    np.testing.assert_allclose(4.0 * fast, usual, rtol=1e-15)
    par = believed()
    assert usual[2, 2] == par.process_flux_linkage**2 and usual[3, 3] == par.process_current_error**2


@pytest.mark.slow
def test_how_long_the_memory_may_be() -> None:
    """The longer it is, the smaller the error of the resistance that runs away again."""
    found = {(tau, r): errors(believed(tau, r)).flux_linkage for tau in (0.33e-3, 0.66e-3, 1.3e-3) for r in (1.1, 1.2)}
    assert found[0.66e-3, 1.1] < 2.5 < 14.0 < found[0.66e-3, 1.2]
    assert found[0.33e-3, 1.2] < 4.0 and found[1.3e-3, 1.1] > 14.0
