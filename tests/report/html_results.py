"""Small results made by hand, so that what a report shows of them is known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gapsense.cosim import Result
from gapsense.cosim.result.metrics import Measured
from gapsense.cosim.result.result import Run, Signal, Timing

UNITS = {"position": "m", "position_std": "m", "current": "A", "innovation": "A", "innovation_std": "A", "mode": "1"}
WIRES = ("drive.voltage -> plant.voltage", "plant.current -> filter.current", "filter.position -> drive.reference")


def made(rows: int = 401, signals: Mapping[str, np.ndarray] | None = None, **run: object) -> Result:
    """A plant and a filter on it; the filter is off by its noise and says so."""
    times = 1e-4 * np.arange(rows)
    signals = dict(signals if signals is not None else plain(times))
    about = {n: Signal(UNITS.get(n.partition(".")[2], "V"), 1e-3, "output") for n in signals}
    names = ("drive", "plant", "filter")
    facts = {"fmu": "Some.fmu", "guid": "{0}", "version": "1", "sha256": "ab" * 32, "step": 1, "offset": 0}
    told = Run(
        **{
            "title": "Made by hand",
            "scenario": "made",
            "variant": None,
            "method": "gauss-seidel",
            "start": 0.0,
            "stop": float(times[-1]),
            "base_step": 1e-4,
            "decimation": 1,
            "seeds": {"filter": 1},
            "components": {name: facts for name in names},
            "order": names,
            "delayed": (WIRES[2],),
            "files": {"scenario.toml": "cd" * 32},
            "versions": {"gapsense": "0", "loop": "C"},
            "wires": WIRES,
            "direct": (WIRES[1],),
            **run,
        }
    )
    metrics = {"rmse": Measured("rmse", 2.0, "m", (0.0, 1.0)), "free": Measured("free", 1.0, "m", None)}
    timing = {name: Timing(1e-3 * k, rows - 1, 2e-6 * k, 2.5e-4 * k) for k, name in enumerate(names, 1)}
    return Result(told, times, signals, about, {"plant.coil.resistance": 76.0}, timing, 0.01, metrics=metrics)


def plain(times: np.ndarray) -> dict[str, np.ndarray]:
    """Signals with a truth, an estimate with its deviation, an innovation and a mode."""
    position = 1e-3 * np.sin(200.0 * times)
    return {
        "plant.position": position,
        "plant.current": np.cos(200.0 * times),
        "filter.position": position + 1e-5,
        "filter.position_std": np.full(times.size, 2e-5),
        "filter.innovation": 1e-3 * np.sin(3e3 * times),
        "filter.innovation_std": np.full(times.size, 1e-3),
        "plant.mode": np.floor(times / times[-1] * 2.999) if times.size > 1 else 0.0 * times,
    }
