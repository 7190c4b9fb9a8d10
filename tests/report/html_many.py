"""Sweeps and campaigns made by hand, so that what a report shows of them is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gapsense.cosim.scenario.records import Block, Plan, Port
from gapsense.many import sweep as sweep_table
from gapsense.many.columns import Columns, contents
from gapsense.many.result import FORMAT, KEY
from gapsense.many.store import Store
from gapsense.many.sweep import Sweep

ABOUT: dict[str, Any] = {
    "title": "By hand",
    "description": "Nobody ran it.",
    "scenario": "demo[cold]",
    "variant": "cold",
    "source": "demo/scenario.toml",
    "seeds": {"sensor": 5},
    "has_random_events": False,
    "versions": {"gapsense": "0"},
    "labels": {"miss": ["Errors", "position error"], "noise": ["Errors", "noise"]},
    "bounds": {"miss": [0.0, 2e-3], "noise": ["-inf", 9.0]},
    "settings": {},
    "decided_by": {"all": "ab" * 32},
}
FACTORS = {
    "valve.r": ("double", "Ohm"),
    "valve.n": ("int64", ""),
    "valve.mode": ("string", ""),
    "valve.on": ("bool", ""),
}
METRICS = {"miss": "m", "noise": "", "never": "A"}


def values(run: int) -> dict[str, Any]:
    """Parameters of a run; a text that looks like a number is one of them."""
    return {
        "valve.r": 70.0 + run % 7,
        "valve.n": run % 3,
        "valve.mode": ("fast", "1")[run % 2],
        "valve.on": run % 4 == 0,
    }


def metrics(count: int) -> dict[str, np.ndarray]:
    """Metrics of some runs: the error follows the resistance, and of one the value is missing."""
    runs = np.arange(count)
    error = 1e-4 * (runs % 7) ** 2 + 1e-6 * runs / count
    error[3:4] = np.nan
    return {"miss": error, "noise": np.random.default_rng(3).normal(size=count), "never": np.full(count, np.nan)}


def made_sweep(folder: Path, count: int = 30, failed: int = 4, **about: Any) -> Path:
    """The table of a sweep, of which one run failed."""
    good = [run for run in range(count) if run != failed]
    grid = {name: tuple(values(run)[name] for run in good) for name in FACTORS}
    own = {name: column[good] for name, column in metrics(count).items()}
    units = {**{name: unit for name, (_, unit) in FACTORS.items()}, **METRICS}
    made = Sweep(tuple(good), own, {failed: "valve: stuck."}, count, False, None, units, grid)
    folder.mkdir(exist_ok=True)
    (folder / "demo").mkdir(exist_ok=True)
    told = {**ABOUT, "runs": count, "points": count, **about}
    plan = Plan((Block({Port(*name.split(".")): [values(run)[name] for run in range(count)] for name in FACTORS}),))
    sweep_table.save(made, told, plan, folder / "by_hand.csv")
    return folder / "by_hand.csv"


def made_campaign(folder: Path, count: int = 30, missing: int = 0, failed: int = 4, **about: Any) -> Path:
    """The folder of a campaign, of which one run failed and some are not done yet."""
    told = {**ABOUT, "study": "study.toml", "runs": count + missing, "points": count + missing, **about}
    own, texts = metrics(count), {"valve.mode": list(dict.fromkeys(values(run)["valve.mode"] for run in range(count)))}
    columns = Columns(FACTORS, {name: METRICS.get(name, "") for name in own}, texts=texts)
    with Store(folder / "campaign.sqlite", KEY) as store:
        store.describe({**told, "format": FORMAT, "columns": columns.facts()})
        for run in range(count):
            of_run = {name: None if np.isnan(column[run]) else float(column[run]) for name, column in own.items()}
            end = {"error": "valve: stuck."} if run == failed else {"metrics": of_run, "wall": 0.1}
            store.add(*contents(columns, [{"index": run, "shift": run, "values": values(run), **end}]))
    return folder
