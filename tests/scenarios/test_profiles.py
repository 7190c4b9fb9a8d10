"""The estimators of the scenario `profiles` are as wrong as its parameter set says."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from gapsense.cosim import load

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FOLDER = Path(__file__).resolve().parents[2] / "scenarios" / "profiles"


def values(name):
    return tomllib.loads((FOLDER / "parameters" / f"{name}.toml").read_text(encoding="utf-8"))["values"]


def test_estimators_have_the_errors_of_the_first_run_of_the_monte_carlo():
    true, wrong = values("actuator"), values("estimators")
    e = 0.1 * np.random.default_rng([1, 0, 0]).uniform(-0.5, 0.5, 8)
    low, stroke = true["stop.lower"], true["stop.upper"] - true["stop.lower"]

    def gap(z):  # the fringing law over the normalised position
        g = low + stroke * z
        widening = 1.0 + true["gap.fringing"] * g * np.log(true["gap.window"] / g)
        return true["gap.slope"] * g / widening

    expected = {
        "mover.mass": true["mover.mass"] * (1.0 + e[0]),
        "spring.stiffness": true["spring.stiffness"] * (1.0 + e[1]),
        "spring.rest": low + (true["spring.rest"] - low) * (1.0 + e[2]),
        "damping": true["damping"] * (1.0 + e[3]),
        "core.reluctance": 1.75 * 1200.0**2 * (1.0 + e[4]),
        "core.saturation": 0.0238 * (1.0 + e[5]),
        "gap.reluctance": quad(gap, 0.0, 1.0)[0] * e[6],
        "gap.tilt": (gap(1.0) - gap(0.0)) / stroke * e[7],
    }
    assert {name: wrong[name] for name in expected} == pytest.approx(expected, rel=1e-9)
    same = set(true) & set(wrong) - set(expected)
    assert same == {
        "gap.law",
        "coil.resistance",
        "coil.turns",
        "stop.lower",
        "stop.upper",
        "gap.slope",
        "gap.fringing",
        "gap.window",
    }
    assert all(wrong[name] == true[name] for name in same)


def test_there_are_the_35_profiles_of_the_paper():
    plan = load(FOLDER).plan
    points = [tuple(round(1e3 * value, 6) for value in plan.point(k).values()) for k in range(plan.points)]
    assert points == [(3.0 + 0.5 * j, 1.0 + 0.25 * k) for j in range(7) for k in range(5)]
    assert points[0] == tuple(1e3 * values("drive")[f"profile.{name}"] for name in ("first", "second"))
