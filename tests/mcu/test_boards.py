"""Components on a Cortex-M3 and a Cortex-M4F under QEMU: the right numbers, at the cost that the page tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from board import BOARDS, Cost, build, cost, expected, missing_tools, run
from costs import BEGIN, BEGIN_OF_ALL, END, FOUR, PAGE, ROWS, Row, design_of, line, measured
from costs import EVERY as EVERY_ROW
from host import ROOT, played
from servo import served
from test_mhe_sampling import operated

from gapsense.embedded.design import make_design
from gapsense.embedded.export import memory
from records import in_scenario

# Largest instructions per step of Semera (mean) on each board, with four outputs and its parameters as constants; lean
AIMS = {False: {"Cortex-M3": 5600, "Cortex-M4F": 225}, True: {"Cortex-M3": 4700, "Cortex-M4F": 205}}
NEAR = 0.15  # compilers differ
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing_tools()), reason=f"{', '.join(missing_tools())} not installed"),
]


@pytest.mark.parametrize("board", BOARDS)
@pytest.mark.parametrize("name", ["semera", "hybrid_ekf", "sensor"])
def test_the_example_prints_there_what_it_prints_here(name: str, board: str, tmp_path: Path) -> None:
    design = make_design(ROOT / "fmus" / name, "float")
    here = played(design, tmp_path)
    program = build(design, tmp_path, BOARDS[board], "-Os", tmp_path / f"{name}_main.c", ("-I", str(tmp_path)))
    titles, *rows = run(program, BOARDS[board]).splitlines()
    assert titles.split(",") == [*design.kept["outputs"]]
    there = [[float(cell) for cell in row.split(",")] for row in rows]
    assert there == here if name != "sensor" else len(there) == len(here)  # whose noise is made with log, sin and cos


@pytest.fixture(
    scope="module", params=ROWS, ids=lambda row: f"{row.part}-{len(row.outputs)}-{row.is_baked}-{row.is_lean}"
)
def found(request: pytest.FixtureRequest) -> tuple[Row, dict[str, Cost]]:
    return request.param, {board: measured(request.param, board) for board in BOARDS}


def test_page_tells_what_is_measured(found: tuple[Row, dict[str, Cost]]) -> None:
    page = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0].splitlines()
    text = line(*found)
    head = text.split("|")[1:3]
    told = [row for row in page if row.split("|")[1:3] == head]
    assert len(told) == 1, f"{text}\nis not in {PAGE.name}. Run `python benchmarks/mcu.py --write`."
    for old, new in zip(numbers(told[0]), numbers(text), strict=True):
        assert abs(new - old) <= NEAR * old, f"{text}\nis\n{told[0]}\nin {PAGE.name}."


def numbers(text: str, cells: slice = slice(3, 9)) -> list[float]:
    """Instructions, flash, RAM and stack of a row."""
    return [float(word.replace(",", "")) for cell in text.split("|")[cells] for word in cell.replace(", ", " ").split()]


@pytest.mark.parametrize("part", ["drive", "stage", "sensor", "hybrid_ekf"])
def test_so_does_the_table_of_all_components(part: str) -> None:
    row = next(row for row in EVERY_ROW if row.part == part)
    found, page = measured(row, "Cortex-M7"), PAGE.read_text(encoding="utf-8").partition(BEGIN_OF_ALL)[2]
    told = next(text for text in page.splitlines() if text.startswith(f"| `{row.record().folder.name}` | float |"))
    mean, most = numbers(told, slice(5, 6))
    assert found.mean == pytest.approx(mean, rel=NEAR) and found.most == pytest.approx(most, rel=NEAR)
    assert f"| {found.memory:,} |" in told


def test_readme_tells_the_memory(found: tuple[Row, dict[str, Cost]]) -> None:
    row, costs = found
    assert {one.memory for one in costs.values()} == {memory(design_of(row))}


def test_float_is_near_double(found: tuple[Row, dict[str, Cost]]) -> None:
    row, costs = found
    for one in costs.values():
        error, largest = one.errors[row.watched]
        assert error <= 1e-3 * largest, one.errors


def test_semera_keeps_within_its_aim(found: tuple[Row, dict[str, Cost]]) -> None:
    row, costs = found
    if row.part != "semera" or row.outputs != FOUR or not row.is_baked:
        pytest.skip("the aim is for another row")
    assert all(costs[board].mean < aim for board, aim in AIMS[row.is_lean].items()), costs


def test_no_step_of_mhe_is_long_while_it_follows_a_servo(tmp_path: Path) -> None:
    """Not beyond five medians: neither where it begins to follow, nor where it learns from operations again."""
    design, (plant, first, last) = design_of(next(row for row in ROWS if row.part == "mhe")), served("steps")
    kept = np.r_[0:2050, first : first + 2500, last : last + 1050]  # two cycles, the servo, another cycle
    noise = np.random.default_rng(7).standard_normal((2, kept.size))
    measured = (plant.voltage[kept] + 30e-3 * noise[0], plant.current[kept] + 2e-3 * noise[1])
    rows = np.transpose([20e-6 * np.arange(kept.size), *measured, np.zeros(kept.size)])
    rows = rows.astype(np.float32).astype(float).tolist()
    position = np.array(expected(design, rows))[:, [*design.kept["outputs"]].index("position")]
    error = (position - plant.position[kept])[2550:4550]
    assert np.sqrt(np.mean(error**2)) < 60e-6  # 500 um where it does not follow
    found = cost(design, rows, "Cortex-M4F", tmp_path)
    assert found.most <= 5.0 * found.median, found


@pytest.mark.parametrize("micros", [50, 100])
def test_no_step_of_mhe_is_long_at_coarse_samples(micros: int, tmp_path: Path) -> None:
    """Not beyond five medians, by instructions; a step of 100 us had 7.1, 35 samples of a trial."""
    given, dt = next(row for row in ROWS if row.part == "mhe").record(), micros * 1e-6
    design = make_design(given.folder, "float", (), {**given.values, "sample_time": dt})
    plant, _ = operated(dt, False)
    noise = np.random.default_rng(1).standard_normal((2, 1000))
    measured = (plant.voltage[:1000] + 30e-3 * noise[0], plant.current[:1000] + 2e-3 * noise[1])
    rows = np.transpose([dt * np.arange(1000), *measured, np.zeros(1000)]).astype(np.float32).astype(float).tolist()
    found = cost(design, rows, "Cortex-M4F", tmp_path)
    assert found.most <= 5.0 * found.median, found


def test_no_step_of_mhe_is_long_in_the_loop_of_run_to_run(tmp_path: Path) -> None:
    """Not beyond five medians; it was six with the three pieces of a step without which windows came too late."""
    given = in_scenario("run_to_run", "mhe", variant="model")
    found = cost(make_design(given.folder, "float", (), given.values), given.rows, "Cortex-M4F", tmp_path)
    assert found.most <= 5.0 * found.median, found
