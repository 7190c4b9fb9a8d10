"""Records of reluctance actuators as people bring them: random devices, drives, beliefs that are wrong, instruments."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from c_code import fresh

from gapsense.actuators import reluctance_actuator
from gapsense.actuators.reluctance_actuator import Parameters
from gapsense.estimators.mhe import mhe
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.actuator import fit as problem
from gapsense.identification.measurements.prepare import subtract_offsets
from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.scenarios.estimators.parameters import VALVE
from gapsense.studies.devices import RTS_VALVE

FINE = 5e-6  # s; step of the device, and where edges may lie
CURRENT, POSITION = map(reluctance_actuator.Outputs._fields.index, ("current", "position"))
VARIED = (
    *("coil_resistance", "core_length", "core_area", "core_magnetization", "core_shape", "core_pinning"),
    *("core_eddy_conductance", "gap_slope", "gap_fringing", "mover_mass", "spring_stiffness", "spring_rest", "damping"),
)


class Drive(NamedTuple):
    """Pulses from rest on, and where the current goes."""

    volts: float = 30.0
    on: float = 10e-3  # s
    period: float = 20e-3  # s
    pulses: int = 4
    rest: float = 1.0e-3  # s
    clamp: float = 0.0  # voltage against which the current falls
    drop: float = 0.0  # of a freewheeling diode [V]
    carrier: float = 0.0  # period of PWM; 0: none [s]
    duty: float = 1.0
    peak: float = 0.0  # full voltage before it [s]


class Instruments(NamedTuple):
    """How voltage and current become numbers."""

    dt: float = 20e-6  # s
    offset: float = 0.0  # of the current [A]
    bits: int = 0  # of converters for 50 V and 0.5 A of both signs; 0: fine ones
    noise: float = 2e-3  # of the current [A]; that of the voltage is 15 V/A times that
    seed: int = 1


class Measured(NamedTuple):
    """A record, and what is not in it."""

    record: Record
    position: np.ndarray  # true one [m]


class Case(NamedTuple):
    """A device, what is believed of it, and how it is driven."""

    device: Parameters
    given: dict[str, float | str]  # a set for `Mhe`
    drive: Drive

    @property
    def known(self) -> mhe.Parameters:
        """What is believed."""
        return kernel_parameters(own("mhe"), self.given)


PULSES = {"volts": (24.0, 32.0)}
PWM = {"volts": (36.0, 48.0), "carrier": (100e-6, 400e-6), "duty": (0.65, 0.8)}
HOLD = {"volts": (40.0, 48.0), "carrier": (100e-6, 400e-6), "duty": (0.3, 0.5), "peak": (2e-3, 3e-3)}
CONDITIONS = {  # ranges and numbers of drives, instruments
    "clean": (PULSES, Instruments()),
    "offset of 5 mA": (PULSES, Instruments(offset=5e-3)),
    "8 bits": (PULSES, Instruments(bits=8)),
    "every 100 us": (PULSES, Instruments(dt=100e-6)),
    "PWM, clamp of 40 V": ({**PWM, "clamp": (40.0, 40.0)}, Instruments()),
    "peak and hold": (HOLD, Instruments()),
    "freewheeling diode": ({**PULSES, "drop": (0.7, 0.7)}, Instruments()),
    "offset, 8 bits, every 100 us": (PULSES, Instruments(offset=5e-3, bits=8, dt=100e-6)),
    "offset, 8 bits, PWM, clamp": ({**PWM, "clamp": (40.0, 40.0)}, Instruments(offset=5e-3, bits=8)),
}
OTHERS = (  # drives on which what was found is judged
    Drive(volts=27.0, on=8e-3, period=17e-3),
    Drive(volts=40.0, on=9e-3, period=19e-3, carrier=250e-6, duty=0.7, clamp=40.0),
    Drive(volts=33.0, on=6e-3, period=14e-3, drop=0.7),
)


def case(seed: int, condition: str = "clean") -> Case:
    """A device within 12 % of that of the benchmark, beliefs within 10 % of it, a drive."""
    rng = np.random.default_rng(seed)
    factors = {name: 1.0 + 0.12 * rng.uniform(-1.0, 1.0) for name in VARIED}
    device = RTS_VALVE._replace(**{name: getattr(RTS_VALVE, name) * factor for name, factor in factors.items()})
    ranges = {"on": (7e-3, 10e-3), "period": (16e-3, 22e-3), "rest": (0.8e-3, 2e-3), **CONDITIONS[condition][0]}
    return Case(
        device, believed(device, factors, rng), Drive(**{name: rng.uniform(*ends) for name, ends in ranges.items()})
    )


def believed(device: Parameters, factors: dict[str, float], rng: np.random.Generator) -> dict[str, float | str]:
    """What is known of a device within 10 %, and guesses of its losses; turns, stops and window are known."""
    iron = factors["core_area"] * factors["core_magnetization"]
    core = factors["core_length"] * factors["core_shape"] / iron
    near = {
        "gap.slope": device.gap_slope,
        "gap.fringing": device.gap_fringing,
        "coil.resistance": device.coil_resistance,
    }
    near |= {"mover.mass": device.mover_mass, "spring.stiffness": device.spring_stiffness, "damping": device.damping}
    near |= {"core.saturation": VALVE.saturation * iron, "core.reluctance": VALVE.core * core}
    near["spring.rest"] = device.spring_rest
    wrong = {name: value * (1.0 + 0.1 * rng.uniform(-1.0, 1.0)) for name, value in near.items()}
    stops = {"stop.lower": device.stop_lower, "stop.upper": device.stop_upper}
    guesses = {"core.eddy": 0.5e-3, "core.hysteresis": 5e-3, "core.turnover": 1.73e-3}
    known = {"sample_time": 20e-6, "coil.turns": device.coil_turns, "gap.law": "fringing"}
    return {**known, "gap.reluctance": 0.0, "gap.window": device.gap_window, **stops, **guesses, **wrong}


def run(device: Parameters, d: Drive) -> np.ndarray:
    """Voltage, current and position after each fine step."""
    return simulated(tuple(getattr(device, name) for name in VARIED), d)


@cache
def simulated(values: tuple[float, ...], d: Drive) -> np.ndarray:
    par, kernel = RTS_VALVE._replace(**dict(zip(VARIED, values))), fresh(reluctance_actuator)
    count, outputs = round((d.rest + d.pulses * d.period) / FINE), kernel.outputs
    kernel.call("initial", (0.0, 0.0, 0.0), par)
    rows, has_ended = [(0.0, 0.0, outputs[POSITION])], True
    for k in range(1, count + 1):
        t = (k - 0.5) * FINE - d.rest
        within = t % d.period
        is_on = t > 0.0 and within < d.on
        has_ended = not is_on and (has_ended or (rows[-1][1] < 1e-4 and rows[-1][0] < 0.0))
        is_off = d.carrier and within >= d.peak and within % d.carrier >= d.duty * d.carrier
        u = (-d.drop if is_off else d.volts) if is_on else 0.0 if has_ended else -(d.clamp or d.drop)
        kernel.call("step", (k * FINE, FINE, u), par)
        rows.append((u, outputs[CURRENT], outputs[POSITION]))
    return np.array(rows)


def measured(device: Parameters, d: Drive, instruments: Instruments, name: str = "made") -> Measured:
    """What the instruments make of it; the first sample is anywhere in a period."""
    rng, each = np.random.default_rng(instruments.seed), round(instruments.dt / FINE)
    voltage, current, position = run(device, d)[int(rng.integers(each)) :: each].T
    current = current + instruments.offset + instruments.noise * rng.standard_normal(current.size)
    voltage = voltage + 15.0 * instruments.noise * rng.standard_normal(voltage.size)
    if instruments.bits:
        steps = [2.0 * largest / 2**instruments.bits for largest in (50.0, 0.5)]
        voltage, current = (step * np.round(x / step) for x, step in zip((voltage, current), steps))
    values = {"time": np.arange(voltage.size) * instruments.dt, "voltage": voltage, "current": current}
    made = to_record(Columns(f"{name}.csv", np.arange(voltage.size) + 2, values))
    return Measured(subtract_offsets(made), position)


def errors(par: mhe.Parameters, device: Parameters, drives=OTHERS) -> list[float]:
    """RMS errors of the position [m] of the model of `Mhe` by itself, driven by the true voltage of other drives."""
    truths = [run(device, d) for d in drives]
    found = [problem.run(par._replace(sample_time=FINE), truth[:, 0].tolist())[:, 2] for truth in truths]
    return [float(np.sqrt(np.mean((z - truth[:, 2]) ** 2))) for z, truth in zip(found, truths)]
