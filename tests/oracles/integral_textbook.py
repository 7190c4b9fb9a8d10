"""Algorithm 2 of [SEMERA], with the reset before the first energised sample is added; uses nothing of the project."""

from __future__ import annotations

import numpy as np


def edges(u: np.ndarray, threshold: float) -> list[int]:
    """Samples at which the voltage has risen above the threshold."""
    return [k for k in range(1, len(u)) if u[k] > threshold and u[k - 1] <= threshold]


def online(
    u: np.ndarray, iota: np.ndarray, dt: float, r0: float, l0: float, lambda0: float, band: float, threshold: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resistance, inductance and flux linkage of every sample from 1 on.

    At a reset the ratio (47) counts only if the sum of the currents is outside `band` times the root of the count.
    """
    r, Su, Si, count = r0, 0.0, 0.0, 0
    found = []
    starts = set(edges(u, threshold))
    for k in range(1, len(u)):
        if k in starts:  # lines 10, 11
            if abs(Si) > band * np.sqrt(count):
                r = Su / Si
            Su, Si, count = 0.0, 0.0, 0
        Su, Si, count = Su + u[k], Si + iota[k], count + 1  # line 5
        flux_linkage = lambda0 + dt * (Su - r * Si)  # line 6
        is_high = abs(iota[k]) > band and abs(iota[k - 1]) > band  # line 7
        found.append((r, flux_linkage / iota[k] if is_high else l0, flux_linkage))
    return tuple(np.array(found).T)  # type: ignore[return-value]


def offline(
    u: np.ndarray, iota: np.ndarray, dt: float, r0: float, l0: float, lambda0: float, band: float, threshold: float
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Samples, resistance, inductance and flux linkage of every operation that has ended: first r, then the others."""
    bounds = [1, *edges(u, threshold)]
    operations = []
    r = r0
    for first, end in zip(bounds, bounds[1:]):
        k = np.arange(first, end)
        Si = np.sum(iota[k])
        r = np.sum(u[k]) / Si if abs(Si) > band * np.sqrt(len(k)) else r
        flux_linkage = lambda0 + dt * (np.cumsum(u[k]) - r * np.cumsum(iota[k]))
        is_high = (np.abs(iota[k]) > band) & (np.abs(iota[k - 1]) > band)
        inductance = np.where(is_high, flux_linkage / np.where(is_high, iota[k], 1.0), l0)
        operations.append((k, np.full(len(k), r), inductance, flux_linkage))
    return operations
