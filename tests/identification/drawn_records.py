"""Records in which all is drawn: device, losses, drive, instruments, and what is wrong with them, often several things.

Plants are a valve, alone or with eddy currents and hysteresis, `PlayActuator` and `PotMagnet`; strokes begin at 0.1 mm,
sampling periods at 10 us, converters at 8 bits.  There are two records of each.  A user knows stops, gap law, relaxed
gap and what an ohmmeter shows, and that a gain of the current may be off if it is.
"""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from c_code import fresh
from imperfect_records import lowpass
from scipy.signal import lfilter

import gapsense
from gapsense.actuators import play_actuator, pot_magnet
from gapsense.actuators.magnetics import MU_0
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.valve import lossy_valve
from gapsense.identification.valve.fit import POOR, ROUGH
from gapsense.studies.devices import VALVE

REST = 30  # samples before the first edge
OHMMETER = 0.05  # accuracy of the resistance that a user knows, the temperature included
FIELDS = {
    **{f"coil.{name}": f"coil_{name}" for name in ("resistance", "turns")},
    **{"core.reluctance": "core_reluctance", "core.saturation": "core_saturation"},
    **{"spring.stiffness": "spring_stiffness", "mover.mass": "mover_mass", "damping": "damping"},
}
WORDS = {  # what is wrong, and what is a right cause of a refusal; plants and drives likewise
    "pwm in step": "PWM",
    "current filtered": "filter|late|edges",
    "both filtered": "filter|edges",
    "late": "late|edges",
    "warm": "warm|resistance grows",
    "hum": "hum|mains",
    "drift": "drift|zero|offset",
    "series, command only": "drop|series|voltage that is not",
    "slew": "edges|slow driver|--voltage",
    "rc driver": "edges|driver|--voltage",
    "offset": "offset",
    "bits": "bit|converter",
    "pwm": "PWM",
    **dict.fromkeys(("play", "hyst", "eddy", "both"), "losses|commission"),
}


class Case(NamedTuple):
    """A device, its drive and its instruments."""

    par: Parameters
    plant: str
    drive: str
    wrong: tuple[str, ...]  # names of `WORDS`
    values: dict[str, Any]  # of what was drawn


class Judged(NamedTuple):
    """What was found."""

    text: str
    is_explained: bool
    off: dict[str, float]  # errors of what is called identified, in stated ones


def between(rng, low: float, high: float) -> float:
    """As likely in each decade."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def valve(rng, is_short: bool) -> Parameters:
    """It moves likewise with another stroke and another gap law, by the laws of similarity."""
    upper = VALVE.stop_upper * (between(rng, 0.12, 0.4) if is_short else between(rng, 0.6, 1.6))
    slope = VALVE.gap_slope * between(rng, 0.6, 1.6)
    s = upper / VALVE.stop_upper
    turns = VALVE.coil_turns * np.sqrt(s * slope / VALVE.gap_slope) * rng.uniform(0.8, 1.2)
    par = VALVE._replace(
        stop_upper=upper,
        initial_position=upper,
        gap_slope=slope,
        spring_rest=VALVE.spring_rest * s * between(rng, 0.3, 1.5),
        coil_turns=turns,
        core_reluctance=VALVE.core_reluctance * (turns / VALVE.coil_turns) ** 2 * rng.uniform(0.8, 1.3),
        core_saturation=VALVE.core_saturation * rng.uniform(0.8, 1.3),
        coil_resistance=VALVE.coil_resistance * rng.uniform(0.6, 1.4),
        mover_mass=VALVE.mover_mass / s**2 * rng.uniform(0.7, 1.4),
        damping=VALVE.damping / s**2 * rng.uniform(0.5, 2.0),
    )
    preload = VALVE.spring_stiffness * (VALVE.spring_rest - VALVE.stop_upper) / s * rng.uniform(0.6, 1.2)
    return par._replace(spring_stiffness=preload / (par.spring_rest - upper))


def pot(rng, par: Parameters) -> Parameters:
    """Numbers of a pot magnet as far as the valve has them: its weight is a spring that rests far away."""
    slope = 2.0 / (MU_0 * 7.6341e-5) * between(rng, 0.6, 1.6)
    upper = between(rng, 0.1e-3, 0.4e-3)
    rest, mass = upper * between(rng, 1e3, 5e3), 0.34 * between(rng, 0.3, 1.5)
    return par._replace(
        stop_upper=upper,
        initial_position=upper,
        gap_slope=slope,
        spring_rest=rest,
        coil_resistance=114.3 * rng.uniform(0.7, 1.3),
        coil_turns=964.0 * rng.uniform(0.8, 1.2),
        core_reluctance=1.146e6 * rng.uniform(0.8, 1.5),
        core_saturation=10.0,
        mover_mass=mass,
        damping=0.0,
        spring_stiffness=mass * 9.81 / (rest - upper / 2.0),
    )


def threshold(par: Parameters) -> float:
    """Voltage that just lifts the mover [V]."""
    flux = np.sqrt(2.0 * par.spring_stiffness * (par.spring_rest - par.stop_upper) / par.gap_slope)
    reluctance = par.core_reluctance + par.gap_slope * par.stop_upper
    return float(flux / par.coil_turns * reluctance * par.coil_resistance)


def draw(seed: int) -> tuple[Case, np.random.Generator]:
    """The case of a seed, and the generator for its noise."""
    rng = np.random.default_rng(50_000 + seed)
    kind = str(rng.choice(["usual", "short", "short fast", "pot", "heavy"], p=[0.5, 0.2, 0.1, 0.1, 0.1]))
    par = valve(rng, kind.startswith("short"))
    if kind in ("short fast", "heavy"):
        limits = (0.1, 0.5) if kind == "short fast" else (1.5, 4.0)
        par = par._replace(mover_mass=par.mover_mass * between(rng, *limits))
    par = pot(rng, par) if kind == "pot" else par
    scale, R = 8.0 if kind == "pot" else 1.0, par.coil_resistance
    core = str(rng.choice(["plain", "eddy", "hyst", "both", "play"], p=[0.45, 0.25, 0.1, 0.1, 0.1]))
    core = "pot" if kind == "pot" else core
    v: dict[str, Any] = {"volts": float(np.clip(threshold(par) * rng.uniform(1.6, 3.0), 8.0, 60.0))}
    most = v["volts"] / R
    amperes = most / 0.4
    v["eddy"] = between(rng, 0.005, 0.1) / R if core in ("eddy", "both") else 0.0
    v["hysteresis"] = between(rng, 0.01, 0.08) * most if core in ("hyst", "both") else 0.0
    v["turnover"] = rng.uniform(0.05, 0.12) * par.core_saturation
    drive = str(rng.choice(["train", "single", "pwm", "held", "clamp"], p=[0.5, 0.15, 0.12, 0.08, 0.15]))
    dt = v["dt"] = scale * float(rng.choice([1e-5, 2e-5, 4e-5, 5e-5, 8e-5, 1e-4], p=[0.05, 0.15, 0.2, 0.3, 0.2, 0.1]))
    v["edges"] = str(rng.choice(["step", "sample", "any"], p=[0.3, 0.2, 0.5]))
    v["operations"] = {"train": int(rng.integers(2, 4)), "single": 1, "pwm": 2, "held": 1, "clamp": 2}[drive]
    v["on"], v["off"] = scale * rng.uniform(4.5e-3, 8e-3), scale * rng.uniform(11e-3, 14e-3)
    v["on"] *= 2.0 if rng.uniform() < 0.1 else 1.0
    v["carrier"] = between(rng, 8.0, 20.0) * dt if drive == "pwm" else 0.0
    wrong = ["pwm in step"] if drive == "pwm" and rng.uniform() < 0.3 else []
    v["duty"] = rng.uniform(0.65, 0.85) if drive == "pwm" else 1.0
    v["clamp"] = v["volts"] * rng.uniform(0.5, 1.5) if drive == "clamp" else 0.0
    v["noise"] = between(rng, 0.2e-3, 4e-3) * amperes
    v["noise"] = between(rng, 4e-3, 10e-3) * amperes if rng.uniform() < 0.1 else v["noise"]

    def has(name: str, part: float) -> bool:
        wrong.extend([name] * (there := rng.uniform() < part))
        return bool(there)

    v["offset"] = rng.uniform(-8e-3, 8e-3) * amperes if has("offset", 0.2) else 0.0
    v["gain"] = 1.0 + rng.uniform(-0.01, 0.01) if has("gain", 0.12) else 1.0
    v["bits"] = int(rng.integers(8, 17)) if has("bits", 0.35) else 0
    v["blur"] = rng.uniform(0.15, 1.6) * dt if has("both filtered", 0.12) else 0.0
    v["order"] = int(rng.choice([1, 2]))
    v["filter"] = rng.uniform(0.2, 1.0) * dt if not v["blur"] and has("current filtered", 0.07) else 0.0
    v["delay"] = scale * rng.uniform(5e-6, 40e-6) if has("late", 0.12) else 0.0
    v["warm"] = rng.uniform(0.02, 0.2) if has("warm", 0.1) else 0.0
    v["hum"] = rng.uniform(0.5e-3, 3e-3) * amperes if has("hum", 0.08) else 0.0
    v["drift"] = rng.uniform(-4e-3, 4e-3) * amperes if has("drift", 0.08) else 0.0
    v["slew"] = rng.uniform(0.5, 3.0) * dt if has("slew", 0.06) else 0.0
    v["lag"] = rng.uniform(0.3, 1.2) * dt if not v["slew"] and has("rc driver", 0.06) else 0.0
    v["series"] = rng.uniform(0.005, 0.03) * R if has("series, command only", 0.07) else 0.0
    v["magnetised"] = core in ("hyst", "both", "play") and rng.uniform() < 0.5
    v["upper"] = rng.uniform(1.0, 1.05) if rng.uniform() < 0.5 else 1.0  # resistance of a pot magnet when open
    return Case(par, core, drive, tuple(wrong), {**v, "scale": scale}), rng


def plant(c: Case) -> tuple[ModuleType, Any]:
    """The kernel and its parameters."""
    par, v = c.par, c.values
    most, alike = v["volts"] / par.coil_resistance, ("coil_resistance", "coil_turns", "mover_mass", "stop_upper")
    if c.plant == "pot":
        start, area = kernel_parameters(own("pot_magnet"), {}), 2.0 / (MU_0 * par.gap_slope)
        return pot_magnet, start._replace(
            **{name: getattr(par, name) for name in alike},
            coil_resistance_upper=par.coil_resistance * v["upper"],
            pole_area=area,
            core_length=par.core_reluctance * start.core_permeability * MU_0 * area,
            current_on=1e-3 * most,
            current_off=1e3,
        )
    if c.plant == "play":
        start = kernel_parameters(own("play_actuator"), {})
        alike = (*alike, *FIELDS.values(), "gap_slope", "spring_rest", "stop_lower", "initial_position")
        return play_actuator, start._replace(
            **{name: getattr(par, name) for name in alike},
            gap_fringing=1e-6,
            stop_restitution=0.0,
            hysteresis_amplitude=start.hysteresis_amplitude * 0.5 * most / 0.4,
            hysteresis_reach=0.12 * par.core_saturation,
            eddy_fast=0.02 / par.coil_resistance,
            eddy_slow=0.015 / par.coil_resistance,
            micro_step=5e-6,
        )
    return lossy_valve, lossy_valve.Parameters(par, v["eddy"], v["hysteresis"], v["turnover"], 1.0)


def record(c: Case, number: int, rng) -> np.ndarray:
    """Times, voltage and current of one of the two; the second has 0.8 of the voltage."""
    v, dt, volts = c.values, c.values["dt"], c.values["volts"] * (0.8 if number else 1.0)
    count = 8 if dt > 30e-6 * v["scale"] else 4
    fine, lengths = dt / count, []
    for _ in range(v["operations"]):
        pair = np.array([v["on"], v["off"]])
        lengths.append(pair + rng.uniform(0.0, dt, 2) if v["edges"] == "any" else np.round(pair / dt) * dt)
    ends = np.cumsum([a + b for a, b in lengths])
    ons = [(e - a - b, e - b) for e, (a, b) in zip(ends.tolist(), lengths)]
    if c.drive == "held":
        ons, ends = [(0.0, 31e-3 * v["scale"])], np.array([30e-3 * v["scale"]])
    at = rng.uniform()  # where the first edge lies between two samples
    at = {"step": 0.5, "sample": 0.0}.get(v["edges"], at)
    n = (REST + round(ends[-1] / dt)) * count
    middle = (np.arange(n) + 0.5) * fine - (REST - 1 + at) * dt
    inside = [(middle > a - 1e-9) & (middle < b - 1e-9) for a, b in ons]
    is_on = np.any(inside, axis=0)
    since = np.sum([np.where(there, middle - a, 0.0) for there, (a, _) in zip(inside, ons)], axis=0)
    command = np.where(is_on, volts, 0.0)
    applied = command
    if "pwm in step" in c.wrong:
        applied = command * v["duty"]
    elif v["carrier"]:
        period = v["carrier"] if v["edges"] == "any" else max(round(v["carrier"] / dt), 2) * dt
        applied = command = np.where(since % period < v["duty"] * period, command, 0.0)
    if v["slew"]:
        steps = max(1, round(v["slew"] / fine))
        applied = command = np.asarray(lfilter(np.full(steps, 1.0 / steps), [1.0], command))
    if v["lag"]:
        applied = command = lowpass(command, fine, v["lag"])
    seen, current = driven(c, (command, applied, is_on), fine, volts)
    places = np.arange(current.size)
    current = np.interp(places - v["delay"] / fine, places, current)
    current = lowpass(lowpass(current, fine, v["filter"]), fine, v["blur"], v["order"])[count::count]
    voltage = lowpass(seen, fine, v["blur"], v["order"])[count::count]
    times, part = np.arange(current.size) * dt, np.linspace(0.0, 1.0, current.size)
    hum = v["hum"] * np.sin(2.0 * np.pi * 50.0 * times + 1.0 + number)
    current = v["gain"] * current + v["offset"] + v["drift"] * part + hum
    current = current + v["noise"] * rng.standard_normal(current.size)
    voltage = voltage + 5e-4 * volts * rng.standard_normal(voltage.size)
    return np.stack((times, *(converted(x, v["bits"]) for x in (voltage, current))), axis=1)


def converted(x, bits: int):
    """By a bipolar converter that is used to 80 %."""
    step = 2.5 * np.abs(x).max() / 2**bits
    return step * np.round(x / step) if bits else x


def driven(c: Case, drive, fine: float, volts: float) -> tuple[np.ndarray, np.ndarray]:
    """Voltage that is recorded, and current, at the end of each fine interval and at the start."""
    v, (module, par), warmed = c.values, plant(c), c.par.coil_resistance
    kernel, place = fresh(module), module.Outputs._fields.index("current")
    is_command = bool(v["series"]) or "pwm in step" in c.wrong
    kernel.call("initial", (0.0, 0.0, 0.0), par)
    for k in range(int((v["on"] + v["off"]) / fine) if v["magnetised"] else 0):
        kernel.call("step", ((k + 1) * fine - 1.0, fine, volts if k * fine < v["on"] else 0.0), par)
    i, n, rows = 0.0, len(drive[0]), [(0.0, 0.0)]
    for k, (command, applied, is_on) in enumerate(zip(*(x.tolist() for x in drive))):
        if v["warm"] and k % max(1, 4 * (8 if v["dt"] > 30e-6 * v["scale"] else 4)) == 0:
            R = warmed * (1.0 + v["warm"] * k / n)
            has_valve = isinstance(par, lossy_valve.Parameters)
            par = (
                par._replace(valve=c.par._replace(coil_resistance=R)) if has_valve else par._replace(coil_resistance=R)
            )
        is_clamped = bool(v["clamp"]) and not is_on and i > 1e-6 * volts
        u = -v["clamp"] if is_clamped else applied - (v["series"] * i if is_on else 0.0)
        kernel.call("step", ((k + 1) * fine, fine, u), par)
        i = float(kernel.outputs[place])
        rows.append((command if is_command and (is_on or not v["clamp"]) else u, i))
    voltage, current = np.array(rows).T
    return voltage, current


def judged(seed: int, folder: Path, starts: int = 2) -> tuple[Case, Judged]:
    """What `gapsense.identify` says of the case of a seed."""
    c, rng = draw(seed)
    files = [folder / f"{seed}-{number}.csv" for number in range(2)]
    for number, file in enumerate(files):
        head = "time [s],voltage [V],current [A]"
        np.savetxt(file, record(c, number, rng), delimiter=",", header=head, comments="", fmt="%.9g")
    known = folder / f"{seed}.toml"
    known.write_text("[values]\n" + "".join(f'"{name}" = {float(x)!r}\n' for name, x in told(c, seed).items()))
    accuracy = f"coil.resistance={100.0 * OHMMETER:g}" + (",current=0.6" if "gain" in c.wrong else "")
    options = {"parameters": known, "out": folder / f"{seed}-found.toml", "starts": starts, "accuracy": accuracy}
    try:
        found = gapsense.identify(files, **options)
    except ValueError as error:
        return c, Judged(str(error), False, {})
    return c, Judged(str(found), found.passed, off(c, found.parameters, found.standard_errors))


def told(c: Case, seed: int) -> dict[str, float]:
    """What a user knows, and of a pot magnet, which no first guess is like, a guess."""
    par = c.par
    exact = {
        "stop.lower": 0.0,
        "stop.upper": par.stop_upper,
        "gap.slope": par.gap_slope,
        "spring.rest": par.spring_rest,
    }
    ohms = par.coil_resistance * (1.0 + 0.01 * np.random.default_rng(seed).standard_normal())
    guesses = {"coil.turns": 1.1, "core.reluctance": 0.8, "mover.mass": 1.2, "spring.stiffness": 0.9}
    guessed = {name: x * getattr(par, FIELDS[name]) for name, x in guesses.items()}
    guessed |= {"core.saturation": 0.2, "damping": 1e-3 * par.coil_turns}
    return {**exact, "coil.resistance": ohms, **(guessed if c.plant == "pot" else {})}


def off(c: Case, found, errors) -> dict[str, float]:
    """Errors of what both models have, in stated ones; a resistance that changes is one of its values."""
    v = c.values
    truth = {name: getattr(c.par, field) for name, field in FIELDS.items()}
    truth |= {"core.eddy": v["eddy"], "core.hysteresis": v["hysteresis"], "core.turnover": v["turnover"]}
    others = {"play": ("core.",), "pot": ("core.saturation",)}.get(c.plant, ())
    made = {}
    for name, error in errors.items():
        rough = name in ("core.eddy", "core.hysteresis", "core.turnover")
        is_told = np.isfinite(error) and abs(error / found[name]) < (ROUGH if rough else POOR)
        if name not in truth or not is_told or name.startswith(others or "none"):
            continue
        true, most = truth[name], truth[name]
        if name == "coil.resistance":
            most *= max(1.0 + v["warm"], v["upper"] if c.plant == "pot" else 1.0)
        made[name] = float((found[name] - np.clip(found[name], true, most)) / error)
    return made


def is_right(c: Case, said: str) -> bool:
    """Whether a refusal names something that is wrong."""
    words = [WORDS[name] for name in (*c.wrong, c.drive, c.plant) if name in WORDS]
    return bool(words and re.search("|".join(words), said))
