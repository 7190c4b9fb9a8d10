"""Tables for the terminal."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from gapsense.cosim import Sweep, load
from gapsense.cosim.regression import Check, Outcome
from gapsense.fmi.ports import Component, Port
from gapsense.report import runs as tables
from gapsense.report.table import quantity, table, text
from gapsense.scenarios.semera_valve.measuring import percent
from gapsense.scenarios.semera_valve.show import run_tables

VALVE = Path(__file__).resolve().parents[2] / "scenarios" / "semera_valve"


def shown(table) -> str:
    """A table as the command line shows it in a log file."""
    console = Console(file=io.StringIO(), width=110, highlight=False, soft_wrap=True)
    console.print(table)
    return console.file.getvalue()


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (4.199e-3, "Ohm", "4.199 mOhm"),
        (1.244, "Ohm", "1.244 Ohm"),
        (1.136e-4, "Wb", "113.6 uWb"),
        (-5.022e-3, "H", "-5.022 mH"),
        (0.0, "V", "0 V"),
        (3e-9, "V", "0.003 uV"),
        (1500.0, "Ohm", "1500 Ohm"),
        (0.99999, "Ohm", "1 Ohm"),
        (9.99999e-4, "A", "1 mA"),
        (0.5, "1", "0.5"),
        (0.5, "", "0.5"),
        (float("nan"), "Ohm", "nan"),
        (float("inf"), "H", "inf H"),
        (1.75e-5, "m2", "1.75e-05 m2"),
        (1.6e-3, "kg", "0.0016 kg"),
        (0.25, "1/H", "0.25 1/H"),
    ],
)
def test_quantity_has_four_digits_and_a_prefix_where_one_is_possible(value, unit, text):
    assert quantity(value, unit) == text


@pytest.mark.parametrize(("share", "text"), [(2.512, "250"), (8.84e-5, "0.0088"), (0.204, "20"), (0.0, "0")])
def test_errors_of_measuring_have_no_exponent(share, text):
    assert percent(share) == text


def test_metrics_are_grouped_by_the_titles_of_the_scenario(valve):
    third, fourth = map(shown, tables.metrics(valve))
    assert third.startswith("Table III of [SEMERA]") and fourth.startswith("Table IV of [SEMERA]")
    assert third.count("SEMERA ") == fourth.count("SEMERA ") == 3
    for words in ("1.244 Ohm", "102.2 mH", "3.602 mWb"):
        assert words in third and words not in fourth


def test_metric_outside_its_bounds_is_red(valve):
    bad = {"m": replace(next(iter(valve.metrics.values())), value=9.0, bounds=(0.0, 1.0))}
    (table,) = tables.metrics(replace(valve, metrics=bad))
    assert [row.style for row in table.rows] == ["red"]
    assert "0 Ohm to 1 Ohm" in shown(table)


def swept(indices: tuple[int, ...]) -> Sweep:
    names = [metric.name for metric in load(VALVE).metrics]
    values = np.linspace(1e-3, 2e-3, len(indices))
    columns = {name: values for name in names} if indices else {}
    return Sweep(indices, columns, {}, 0, False, None, dict.fromkeys(names, "H"))


def test_sweep_shows_median_and_range_beside_what_was_published():
    third, fourth = map(shown, tables.sweep(load(VALVE), swept(tuple(range(21)))))
    assert third.startswith("Table III of [SEMERA]") and "21 seeds" in third
    assert "Table IV of [SEMERA]" in fourth
    row = next(line for line in third.splitlines() if line.startswith("  SEMERA l "))
    assert row.split()[2:] == ["102.2", "mH", "1", "mH", "1.5", "mH", "1.05", "mH", "1.95", "mH"]


def test_runs_of_other_swept_values_are_not_thrown_together():
    runs = tuple(range(6))
    several = replace(swept(runs), grid={"valve.damping": (0.2, 0.4, 0.8) * 2}, units={"valve.damping": "N.s/m"})
    text = shown(tables.sweep(load(VALVE), several)[0])
    rows = [line.split() for line in text.splitlines() if line.startswith("  SEMERA l ")]
    assert [row[2:5] for row in rows] == [["0.2", "N.s/m", "2"], ["0.4", "N.s/m", "2"], ["0.8", "N.s/m", "2"]]


def test_many_combinations_of_swept_values_are_cut_with_a_word():
    runs = tuple(range(50))
    text = shown(tables.sweep(load(VALVE), replace(swept(runs), grid={"drive.text": tuple(map(str, runs))}))[0])
    assert "38 more combinations are in the CSV" in text
    assert sum(line.startswith("  SEMERA l ") for line in text.splitlines()) == tables.MOST_GROUPS


def test_sweep_without_its_first_run_has_no_first_seed_and_without_any_no_table():
    table = tables.sweep(load(VALVE), swept((1, 2)))[0]
    assert "  -  " in shown(table)
    assert tables.sweep(load(VALVE), swept(())) == []


def test_brackets_in_names_are_shown(valve):
    metric = replace(next(iter(valve.metrics.values())), table="Currents [mA]", label="peak [red]")
    text = shown(tables.metrics(replace(valve, metrics={"m": metric}))[0])
    assert "Currents [mA]" in text and "peak [red]" in text
    component = Component("Coil", "a coil [bold]", "none", (Port("voltage", "input", "V", "Voltage"),))
    assert "a coil [bold]" in shown(tables.components([component], {"Coil"}))


def test_timing_shows_every_component_and_shares_below_the_whole(valve):
    text = shown(tables.timing(valve))
    assert all(name in text for name in valve.run.components)
    assert "real-time factor" in text and "median" in text and "longest" in text
    for t in valve.timing.values():
        assert 0.0 < t.median <= t.longest <= t.seconds and tables.three(1e6 * t.median) in text
    assert sum(t.seconds for t in valve.timing.values()) <= valve.wall


def test_times_have_three_digits_from_nanoseconds_to_seconds():
    found = [tables.three(value) for value in (0.0, 0.2216, 9.996, 52.34, 99.96, 750.4, 123456.7)]
    assert found == ["0.00", "0.22", "10.0", "52.3", "100", "750", "123457"]


def test_loop_in_python_is_told(valve):
    in_python, in_c = (replace(valve, run=replace(valve.run, versions={"loop": by})) for by in ("Python", "C"))
    assert "The loop in C cannot be loaded here" in " ".join(shown(tables.timing(in_python)).split())
    assert "loop" not in shown(tables.timing(in_c))


def test_outcome_has_a_line_for_each_failure():
    good = Outcome("a", VALVE, None, (Check("run"), Check("metric x")), 1.25)
    assert tables.outcome(good) == "passed  a  2 checks, 1.2 s"
    bad = Outcome("a[b]", VALVE, "b", (Check("run"), Check("metric x", "too large.")), 1.25)
    assert tables.outcome(bad) == "FAILED  a[b]  2 checks, 1.2 s\n  metric x: too large."


def test_observability_report_has_the_ranks_of_the_paper_and_shares_of_all_samples(valve):
    lines = text(*run_tables(valve)).splitlines()
    ranks = {line[:20].strip(): line.split()[-3:] for line in lines[4:8]}
    assert ranks["linear (33)-(35)"] == ["2", "2", "2"]
    assert ranks["quadratic"] == ["3", "3", "2"]
    assert ranks["constant"][0] != "3" and ranks["exponential"][2] != "3"
    shares = [float(line.split("%")[0].split()[-1]) for line in lines if line.endswith(" %") or "% of" in line]
    assert len(shares) == 4 and sum(shares) == pytest.approx(100.0, abs=0.3)


def test_observability_report_of_a_dead_coil_says_that_nothing_was_observable(valve):
    dead = {name: 0.0 * values[:200] for name, values in valve.signals.items()}
    printed = text(*run_tables(replace(valve, times=valve.times[:200], signals=dead)))
    assert "100.0 %" in printed and "longest" not in printed


WIDE = [f"{name} with a long heading / um" for name in ("closing", "opening", "landing", "worst")] * 2


def test_table_that_is_too_wide_is_shown_in_even_parts_with_the_first_column_again():
    made = table(
        "Errors [um]", ["filter", *WIDE], [["bounded filter", *8 * ["1000 (2000)"]], ["open loop", *8 * ["1"]]]
    )
    lines = text(made, width=80).splitlines()
    assert max(map(len, lines)) <= 80 and lines[0] == "Errors [um]"
    rows = [line.split() for line in lines if line.startswith("  bounded filter")]
    assert [len(row) for row in rows] == [10, 10]  # four columns of two words each
    assert sum("/ um" in line for line in lines) == 2  # a unit is not parted from its stroke
    (whole,) = (line for line in text(made, width=400).splitlines() if "bounded" in line)
    assert whole.count("1000 (2000)") == 8


def test_column_without_a_word_is_shown_in_a_narrow_console():
    made = table("", ("parameter", "value", "error", ""), [("a" * 10, "1" * 10, "2" * 10, "")])
    assert all(word in text(made, width=32) for word in ("parameter", "value", "1" * 10, "2" * 10))


@pytest.mark.parametrize("width", [60, 80])
def test_texts_are_wrapped_between_words_and_names_are_never_cut(width):
    names = ["ReluctanceActuator", "long_name_of_a_scenario"]
    made = table(
        "", ["name", "what it is"], [[name, "Actuator with hysteresis and more " * 3] for name in names], texts=2
    )
    shown = text(made, width=width)
    assert all(name in shown for name in names) and "\N{HORIZONTAL ELLIPSIS}" not in shown
    assert " ".join(shown.split()).count("hysteresis") == 6


def test_every_table_maker_of_a_run_fits_80_columns(valve):
    found = replace(
        next(iter(valve.metrics.values())), label="error of the inductance after the first landing", bounds=(0.0, 1.0)
    )
    for made in (*tables.metrics(replace(valve, metrics={"m": found})), tables.timing(valve)):
        assert max(map(len, text(made, width=80).splitlines())) <= 80
