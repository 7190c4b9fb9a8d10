"""A scenario run through FMUs, and its kernels called in a plain loop, give the same bits.

The loop knows nothing of gapsense.cosim: it reads the scenario file with a TOML parser and lets each component step
when it is due, in the order of the file, which in these scenarios is that of the wiring.
"""

from __future__ import annotations

import fnmatch
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gapsense.cosim import Master, prepare, run, run_once
from gapsense.fmi.components import find_components, kernel_of, load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.tables import column_name, read_table
from gapsense.kernels.layout import fields

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("semera_valve", "semera_relay", "profiles", "soft_landing")
VALVE, RELAY, PROFILES, SOFT_LANDING = (ROOT / "scenarios" / name for name in NAMES)
CASES = [
    (VALVE, None),
    (VALVE, "literal"),
    (VALVE, "gated"),
    (RELAY, None),
    pytest.param(PROFILES, None, marks=pytest.mark.slow),
    pytest.param(PROFILES, "thresholds", marks=pytest.mark.slow),
    pytest.param(SOFT_LANDING, None, marks=pytest.mark.slow),
]
FOLDERS = {load_component(folder).name: folder for folder in find_components(ROOT / "fmus")}


def toml(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def overlaid(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """`base` with the values of `over`, table by table."""
    both = {k: overlaid(base[k], v) for k, v in over.items() if isinstance(v, dict) and isinstance(base.get(k), dict)}
    return {**base, **over, **both}


def read(folder: Path, variant: str | None) -> dict[str, Any]:
    """Content of a scenario file with a variant laid over it."""
    data = toml(folder / "scenario.toml")
    return overlaid(data, data["variants"][variant]) if variant else data


def flat_parameters(component: Component, folder: Path, names: list[str], values: dict[str, Any]) -> list[Any]:
    """Parameters in the order of the kernel's record, from start values and `values`."""
    by_field: dict[str, Any] = {}
    for port in component.of("parameter"):
        value = values.get(port.name, port.start)
        if port.columns:
            columns = read_table(folder / value, port.columns)
            by_field |= {f"{port.field}_{column_name(c)}": column for c, column in zip(port.columns, columns)}
        else:
            by_field[port.field] = float(port.choices.index(value) if port.choices else value)
    return [by_field[name] for name in names]


class Part:
    """One component: its kernel, its parameters, its share of the values, its own steps."""

    def __init__(self, name: str, scenario: dict[str, Any], folder: Path) -> None:
        entry, self.name = scenario["components"][name], name
        self.component = load_component(FOLDERS[entry["fmu"]])
        kernel = kernel_of(self.component)
        self.initial, self.advance = kernel.scalar["initial"], kernel.scalar["step"]
        inputs = list(fields(kernel.module.Inputs))
        self.clock = [n for n in inputs if n in ("time", "dt")]
        assert inputs[: len(self.clock)] == self.clock
        self.inputs = [p.name for p in self.component.of("input")]
        self.outputs = [p.name for p in self.component.of("output")]
        self.step, self.offset = entry.get("step", 1), entry.get("offset", 0)
        values: dict[str, Any] = {}
        for file in entry.get("parameters", ()):
            values |= toml(folder / file)["values"]
        values |= entry.get("set", {})
        values |= {"seed": scenario["seeds"][name]} if name in scenario["seeds"] else {}
        self.par = flat_parameters(
            self.component, FOLDERS[self.component.name], list(fields(kernel.module.Parameters)), values
        )
        is_sampled = any(p.name == "sample_time" for p in self.component.ports)
        self.period = values.get("sample_time") if is_sampled else None
        self.state: Any = None

    def begin(self, time: float, inputs: list[float]) -> list[float]:
        self.state, outputs = self.initial(self.with_clock(time, 0.0, inputs), self.par)
        return outputs

    def go(self, time: float, dt: float, inputs: list[float]) -> list[float]:
        self.state, outputs = self.advance(self.state, self.with_clock(time, dt, inputs), self.par)
        return outputs

    def with_clock(self, time: float, dt: float, inputs: list[float]) -> list[float]:
        return [*({"time": time, "dt": dt}[name] for name in self.clock), *inputs]


def by_hand(folder: Path, variant: str | None) -> dict[str, np.ndarray]:
    """Every input and output at every base step: Gauss-Seidel, time by multiplication, whole numbers of steps."""
    scenario = read(folder, variant)
    experiment = scenario["experiment"]
    start, base = experiment["start"], experiment["base_step"]
    count = round((experiment["stop"] - start) / base)
    parts = [Part(name, scenario, folder) for name in scenario["components"]]
    sources = scenario["connect"]
    now: dict[str, float] = dict(scenario["inputs"])

    def taken(part: Part) -> list[float]:
        for name in (f"{part.name}.{i}" for i in part.inputs):
            now[name] = now[sources[name]] if name in sources else now[name]
        return [now[f"{part.name}.{i}"] for i in part.inputs]

    def given(part: Part, outputs: list[float]) -> None:
        now.update({f"{part.name}.{o}": value for o, value in zip(part.outputs, outputs)})

    for part in parts:
        given(part, part.begin(start + part.offset * base, taken(part)))
    rows = [dict(now)]
    for k in range(1, count + 1):
        for part in parts:
            if k > part.offset and (k - part.offset) % part.step == 0:
                current_time, step_size = start + (k - part.step) * base, part.step * base
                given(part, part.go(current_time + step_size, part.period or step_size, taken(part)))
        rows.append(dict(now))
    return {name: np.array([row[name] for row in rows]) for name in now}


@pytest.mark.parametrize(("folder", "variant"), CASES)
def test_run_through_fmus_equals_the_kernels_called_in_a_plain_loop(fmus, folder, variant):
    expected, result = by_hand(folder, variant), run(folder, variant, fmus)
    patterns, every = read(folder, variant)["record"]["signals"], read(folder, variant)["record"].get("decimation", 1)
    expected = {name: np.ascontiguousarray(values[::every]) for name, values in expected.items()}
    recorded = {n for n in expected if any(fnmatch.fnmatchcase(n, p) for p in patterns)}
    assert set(result.signals) == recorded
    for name, values in result.signals.items():
        assert np.array_equal(values, expected[name]), f"{name}: row {np.argmax(values != expected[name])}"
        assert values.tobytes() == expected[name].tobytes(), f"{name}: signs of zeros"


def test_the_plain_loop_does_something():
    values = by_hand(VALVE, None)
    assert {1.0, 2.0, 3.0} == set(values["valve.mode"])
    assert np.ptp(values["semera.resistance"]) > 0.1
    assert values["valve.position"].size == 4043


def bits(result: Any) -> dict[str, bytes]:
    return {"time": result.times.tobytes(), **{name: values.tobytes() for name, values in result.signals.items()}}


def test_two_runs_give_the_same_bits(fmus):
    assert bits(run(VALVE, None, fmus)) == bits(run(VALVE, None, fmus))


def test_run_after_reset_equals_a_fresh_run(fmus):
    with Master(*prepare(VALVE, None, fmus)) as master:
        swept = [bits(run_once(master, shift)) for shift in (0, 3, 0)]
    assert swept[0] == swept[2] == bits(run(VALVE, None, fmus))
    assert swept[1] == bits(run(VALVE, None, fmus, seed_shift=3))
    assert swept[1] != swept[0]
