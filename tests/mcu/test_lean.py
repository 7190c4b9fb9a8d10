"""The form of SEMERA with fewer operations is the same filter, and in float as near to the truth as in double."""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from host import ROOT

sys.path.append(str(ROOT / "tests" / "kernels"))
from c_code import build

from gapsense.estimators import semera, semera_lean
from gapsense.fmi.components import kernel_parameters
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat, names

Array = npt.NDArray[np.float64]
DT, OUTPUTS = 50e-6, len(names(semera.Outputs))
FLUX, QUALITY = 2, 3
LOOP = """
void run(int count, const real *inputs, const real *par, real *state, real *outputs)
{
    NAME_initial(state, 0, inputs, par, 0, 0, outputs);
    for (int k = 1; k < count; k++)
        NAME_step(state, 0, inputs + 2 * k, par, 0, 0, outputs + SIZE * k);
}
"""
CONDITIONS: dict[str, dict[str, Any]] = {
    "usual": {},
    "warming": {"warming": 0.01},
    "soft landing": {"is_soft": True},
    "cold coil": {"resistance": 55.0},
    "offset of the current": {"offset": 20e-3},
    "offset of the voltage": {"voltage_offset": 0.1},
    "rest": {"on": 1, "off": 10**6},
    "small current": {"volts": 1.0},
    "quiet": {"noise_current": 1e-5, "noise_voltage": 1e-4},
    "without noise": {"noise_current": 0.0, "noise_voltage": 0.0},
    "noisy": {"noise_current": 10e-3, "noise_voltage": 0.15},
}
TUNINGS: dict[str, dict[str, float]] = {
    "": {},
    "as printed": {"gate.decay": 0.0},
    "R": {"process.resistance_rate": 0.0},
}
# Times the error of double against the truth (rms): 1.022 was found; 1.049 with r taken for constant, where the
# printed form in float has up to 1.12.
NEAR = {"": 1.03, "as printed": 1.03, "R": 1.1}
WORST = 10.0  # times the largest error of the printed form against double, in either direction a matter of luck
FLOOR = 1e-6  # Wb, 1/20,000 of the largest: not worth a word


def record(
    count: int, seed: int, on: int = 400, off: int = 400, resistance: float = 77.5, warming: float = 0.0,
    volts: float = 30.0, is_soft: bool = False, offset: float = 0.0, voltage_offset: float = 0.0,
    noise_current: float = 1e-3, noise_voltage: float = 15e-3,
) -> tuple[Array, Array]:  # fmt: skip
    """Voltage and current of a coil whose inductance rises and falls with each operation, in float; flux linkage."""
    rng, k = np.random.default_rng(seed), np.arange(count)
    phase = k % (on + off)
    shape = np.clip(4.0 * phase / on, 0.0, 1.0) * np.where(2 * phase < on, 1.0, 0.6) if is_soft else 1.0
    u = np.where(phase < on, volts * shape, 0.0)
    lift = np.where(
        phase < on, np.clip(10.0 * phase / on - 3.0, 0.0, 1.0), 1.0 - np.clip((phase - 1.05 * on) / 20, 0, 1)
    )
    inductance = 0.05 + 0.2 * lift**2 * (3.0 - 2.0 * lift)
    gain = (1.0 + DT * resistance * (1.0 + warming * k * DT) / inductance).tolist()
    linkages = [0.0]
    for voltage, factor in zip((DT * u).tolist(), gain):
        linkages.append((linkages[-1] + voltage) / factor)
    current = np.array(linkages[1:]) / inductance
    noise = rng.normal(0.0, 1.0, (count, 2)) * [noise_voltage, noise_current] + [voltage_offset, offset]
    return (np.column_stack([u, current]) + noise).astype(np.float32).astype(float), inductance * current


class Runner:
    """A kernel in C, over a record at once."""

    def __init__(self, module: Any, folder: Path, single: bool) -> None:
        kernel, self.real = Kernel(module), np.float32 if single else np.float64
        text = kernel.c() + LOOP.replace("NAME", kernel.name).replace("SIZE", str(OUTPUTS))
        self.library = build(text, folder / kernel.name, single)

    def __call__(self, inputs: Array, par: Any) -> Array:
        arrays = [np.ascontiguousarray(a, self.real) for a in (inputs, flat(par), np.zeros(15))]
        outputs = np.zeros((len(inputs), OUTPUTS), self.real)
        self.library.run(len(inputs), *(ctypes.c_void_p(a.ctypes.data) for a in (*arrays, outputs)))
        return outputs.astype(float)


@pytest.fixture(scope="module")
def runners(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Runner]:
    folder = tmp_path_factory.mktemp("lean")
    return {
        "double": Runner(semera, folder, single=False),
        "lean, double": Runner(semera_lean, folder, single=False),
        "printed": Runner(semera, folder, single=True),
        "lean": Runner(semera_lean, folder, single=True),
    }


def test_in_double_it_is_the_same_filter(runners: dict[str, Runner]) -> None:
    (inputs, _), par = record(4000, seed=1), kernel_parameters(ROOT / "fmus" / "semera", {})
    printed, lean = runners["double"](inputs, par), runners["lean, double"](inputs, par)
    assert np.abs(printed[:, FLUX]).max() > 0.01
    assert np.all(np.abs(lean - printed) <= 1e-9 * np.maximum(np.abs(printed).max(axis=0), 1.0))


@lru_cache(1)  # one condition after the other, each with every tuning
def records(count: int, seeds: int, condition: str) -> list[tuple[Array, Array]]:
    return [record(count, seed, **CONDITIONS[condition]) for seed in range(seeds)]


def assert_near(runners: dict[str, Runner], tuning: str, records: list[tuple[Array, Array]]) -> None:
    par = kernel_parameters(ROOT / "fmus" / "semera", TUNINGS[tuning])
    found = [{form: runner(inputs, par) for form, runner in runners.items()} for inputs, _ in records]
    for outputs, (_, truth) in zip(found, records):
        is_used = outputs["double"][:, QUALITY] > 0.0
        wanted, have = (rms(outputs[form][:, FLUX][is_used] - truth[is_used]) for form in ("double", "lean"))
        assert have <= NEAR[tuning] * wanted + FLOOR
    printed, lean = (
        max(np.abs(outputs[form][:, FLUX] - outputs["double"][:, FLUX]).max() for outputs in found)
        for form in ("printed", "lean")
    )
    assert lean <= WORST * printed + FLOOR


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors.size else 0.0


@pytest.mark.parametrize("condition", ["usual", "without noise", "cold coil"])
def test_in_float_it_is_as_near_to_the_truth(runners: dict[str, Runner], condition: str) -> None:
    assert_near(runners, "", records(4000, 5, condition))


@pytest.mark.slow
@pytest.mark.parametrize("tuning", TUNINGS)
@pytest.mark.parametrize("condition", CONDITIONS)
def test_so_it_is_in_all_conditions(runners: dict[str, Runner], condition: str, tuning: str) -> None:
    assert_near(runners, tuning, records(40_000, 20, condition))


@pytest.mark.slow
@pytest.mark.parametrize("tuning", ["", "as printed"])
@pytest.mark.parametrize("condition", ["usual", "warming"])
def test_so_it_is_after_a_million_samples(runners: dict[str, Runner], condition: str, tuning: str) -> None:
    assert_near(runners, tuning, records(10**6, 2, condition))
