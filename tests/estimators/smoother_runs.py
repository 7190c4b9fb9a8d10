"""The component `Ertss` sample by sample, and what it has published."""

from __future__ import annotations

from typing import Any

import numpy as np
from c_code import run
from valve_signals import T_S

from gapsense.estimators import ertss
from gapsense.estimators.motions import LENGTH
from gapsense.kernels.layout import names

SHOWN = ("position", "velocity", "flux_linkage", "position_std", "velocity_std")


def stepped(
    voltage: Any, current: Any, mode: Any, par: Any, debounce: float = 0.0, memory: float = LENGTH
) -> dict[str, np.ndarray]:
    """Outputs at samples 0, T_s, 2 T_s, ... for parameters of the filter."""
    columns = (np.arange(len(mode)) * T_S, voltage, current, mode, np.zeros(len(mode)))  # no resistance is wired
    found = run(ertss, np.column_stack(columns), ertss.Parameters(par, debounce, memory))
    return dict(zip(names(ertss.Outputs), found.T))


def published(found: dict[str, np.ndarray]) -> np.ndarray:
    """The samples that the smoothed values were about, in the order in which they came."""
    rows = found["smoothed_published"] == 1.0
    return np.rint(found["smoothed_time"][rows] / T_S).astype(int)


def assert_published(found: dict[str, np.ndarray], smoothed: Any, samples: np.ndarray) -> None:
    """These samples and no others were published, in this order, with the values of the record."""
    np.testing.assert_array_equal(published(found), samples)
    rows = found["smoothed_published"] == 1.0
    for name in SHOWN:
        expected = getattr(smoothed, name)[samples]
        scale = np.abs(expected).max(initial=0.0)
        np.testing.assert_allclose(found[f"smoothed_{name}"][rows], expected, rtol=1e-9, atol=1e-9 * scale)
