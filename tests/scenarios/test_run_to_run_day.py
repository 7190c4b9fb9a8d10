"""A valve through a day: its rests, here with one of a minute."""

import csv
from pathlib import Path

import numpy as np
import pytest

from gapsense.cosim import run

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
DAY = SCENARIOS / "run_to_run_day"
REST, LONGER = 1.5, 59.0  # a time in the long rest, and by how much that gets longer [s]


def lengthened(folder):
    """The scenario with a minute's rest, without the events after that."""
    text = (DAY / "scenario.toml").read_text("utf-8").replace('"../', f'"{SCENARIOS.as_posix()}/')
    text = text[: text.index("[events.fault]")] + text[text.index("[record]") : text.index("[baseline]")]
    text = text.replace("stop = 2.61", "stop = 61.2").replace("decimation = 5", "decimation = 500")
    with (DAY / "day.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    moved = [[f"{float(t) + (LONGER if float(t) > REST else 0.0):.5f}", v] for t, v in rows]
    (folder / "parameters").mkdir()
    for name, content in (("scenario.toml", text), ("day.csv", "\n".join(",".join(row) for row in [head, *moved]))):
        (folder / name).write_text(content + "\n", "utf-8")
    (folder / "parameters" / "command.toml").write_text(
        (DAY / "parameters" / "command.toml").read_text("utf-8"), "utf-8"
    )
    return folder


@pytest.mark.slow
def test_first_operations_after_a_minute_are_as_soft_as_those_before(tmp_path, natives):
    result = run(lengthened(tmp_path), None, natives)  # which have the bits of the Python FMUs, in minutes less
    impact = np.asarray(result["actuator.impact_speed"])
    before, after = (impact[np.searchsorted(result.times, t)] for t in (1.0098, 61.03))
    assert 0.0 < after < 1.3 * before + 0.02
    assert np.all(np.asarray(result["controller.state"])[result.times > REST] == 2.0)
