"""exp, log and tanh: below 1 ulp wrong by exact arithmetic, never falling, and with the same bits in every language."""

from __future__ import annotations

import ctypes
import math
import random
import struct
from collections.abc import Callable
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_code import build
from traced import graph

from gapsense.kernels.elementary import DOUBLE, exp, log, tanh
from gapsense.kernels.emit import C, Python, namespace
from gapsense.kernels.lanes import Code, plan

FUNCTIONS = {"exp": exp, "log": log, "tanh": tanh}
IN_PYTHON = namespace(Python.module("# exp(x), log(x), tanh(x)"), "elementary")
ODD = (0.0, 5e-324, 1e-310, 2.2250738585072014e-308, 1e-200, 1e-9, 0.5, 1.0, 2.0, 10.0, 22.0, 700.0, 1e300)
COUNT = 2_000  # arguments of each kind
SINGLE = "float called_{0}(float x) {{ return same_{0}(x); }}\n"
MANY = """void called_{0}(const double *x, double *y, int n) {{ for (int k = 0; k < n; k++) y[k] = same_{0}(x[k]); }}
"""


def uniform(low: float, high: float) -> list[float]:
    rng = random.Random(f"{low} {high}")
    return [rng.uniform(low, high) for _ in range(COUNT)]


def any_number() -> list[float]:
    """Positive ones of all sizes, also without all their digits."""
    rng = random.Random(1)
    return [struct.unpack("d", rng.randrange(1, 0x7FF0 << 48).to_bytes(8, "little"))[0] for _ in range(COUNT)]


ARGUMENTS = {
    "exp": [*uniform(-1.0, 1.0), *uniform(-745.0, 709.7), *uniform(-745.0, -708.0), *uniform(709.0, 709.78)],
    "log": [*uniform(0.5, 2.0), *uniform(1.0 - 1e-6, 1.0 + 1e-6), *any_number()],
    "tanh": [*uniform(-0.7, 0.7), *uniform(0.6, 1.2), *uniform(-25.0, 25.0), *any_number()],
}


def exact(name: str, x: float) -> Decimal:
    """The value in 60 digits or more."""
    with localcontext() as context:
        context.prec, value = 80, Decimal(x)
        if name != "tanh":
            return value.exp() if name == "exp" else value.ln()
        if abs(x) < 1e-12:
            return value - value**3 / 3
        power = (2 * max(min(value, Decimal(50)), Decimal(-50))).exp()
        return (power - 1) / (power + 1)


def errors(name: str, function: Callable[[float], float], arguments: list[float], digits: int) -> list[float]:
    """In units in the last place of a number of so many binary digits."""
    found = []
    for x in arguments:
        y, least = function(x), -1074 if digits == 53 else -149
        unit = 2.0 ** max(math.frexp(y)[1] - digits, least)
        found.append(float(abs(exact(name, x) - Decimal(y)) / Decimal(unit)))
    return found


def bits(values: Any) -> Any:
    """As whole numbers; all that are no numbers are the same."""
    found = np.asarray(values, float)
    return np.where(np.isnan(found), -1, found.view(np.int64))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_error_is_below_one_unit_in_the_last_place(name: str) -> None:
    found = errors(name, IN_PYTHON[name], ARGUMENTS[name][:: 1 if name != "tanh" else 3], 53)
    assert max(found) < 0.96
    assert sum(error > 0.5 for error in found) < 0.2 * len(found)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_so_it_is_in_float(name: str, tmp_path: Path) -> None:
    function = getattr(build(C.module(SINGLE.format(name)), tmp_path, single=True), f"called_{name}")
    function.argtypes, function.restype = [ctypes.c_float], ctypes.c_float
    given = {
        "exp": uniform(-103.0, 88.7),
        "log": uniform(0.0, 3.0) + [1e-45, 1e-40, 3e38],
        "tanh": uniform(-10.0, 10.0),
    }
    numbers = np.array(given[name], np.float32).tolist()
    assert max(errors(name, function, numbers, 24)) < 0.96


@pytest.mark.parametrize("name", FUNCTIONS)
def test_bits_are_the_same_in_every_language(name: str, compiler: Any, tmp_path: Path) -> None:
    """As source, as Python, as C, and as C over runs."""
    signs = (1.0,) if name == "log" else (1.0, -1.0)
    odd = [s * x for s in signs for x in (*ODD, math.inf) if name != "exp" or not 709.0 < s * x < math.inf]
    x = np.array([*ARGUMENTS[name], *(v for v in odd if name != "log" or v), math.nan])
    expected = bits([FUNCTIONS[name](v) for v in x.tolist()])
    np.testing.assert_array_equal(bits([IN_PYTHON[name](v) for v in x.tolist()]), expected)
    np.testing.assert_array_equal(bits(in_c(name, x, tmp_path)), expected)
    code = Code(graph(lambda a, b, c: FUNCTIONS[name](a)))
    over_runs = plan(lambda given: code(given), given=3)
    assert over_runs.library
    columns = np.stack([x, x, x])
    np.testing.assert_array_equal(bits(over_runs.run(x.size, given=columns)[0]), expected)


def in_c(name: str, x: Any, folder: Path) -> Any:
    library, found = build(C.module(MANY.format(name)), folder), np.empty_like(x)
    address = ctypes.c_void_p
    getattr(library, f"called_{name}")(address(x.ctypes.data), address(found.ctypes.data), x.size)
    return found


@pytest.mark.parametrize("name", FUNCTIONS)
def test_it_never_falls(name: str) -> None:
    f, joints = IN_PYTHON[name], [DOUBLE.joint, DOUBLE.one, math.sqrt(0.5), 1.0, math.sqrt(2.0), 0.5 * math.log(2.0)]
    near = [j * (1.0 + k * 2.0**-53) for j in joints for k in range(-40, 40)]
    for x in (*ARGUMENTS[name], *near):
        assert f(math.nextafter(x, math.inf)) >= f(x), x


def test_special_values() -> None:
    inf, nan = math.inf, math.nan
    for f in (FUNCTIONS, IN_PYTHON):
        assert [f["exp"](x) for x in (0.0, -0.0, -inf, inf, -746.0, -1e308, 5e-324)] == [
            1.0,
            1.0,
            0.0,
            inf,
            0.0,
            0.0,
            1.0,
        ]
        assert [f["log"](x) for x in (1.0, inf)] == [0.0, inf]
        assert [f["tanh"](x) for x in (inf, -inf, 1e300, 5e-324)] == [1.0, -1.0, 1.0, 5e-324]
        assert math.copysign(1.0, f["tanh"](-0.0)) == -1.0
        assert all(math.isnan(f[name](nan)) for name in FUNCTIONS)


def test_c_has_infinity_and_no_number_where_python_has_errors(tmp_path: Path) -> None:
    for f in (FUNCTIONS, IN_PYTHON):
        for name, x, error in (
            ("exp", 709.8, OverflowError),
            ("log", 0.0, ZeroDivisionError),
            ("log", -1.0, ValueError),
        ):
            with pytest.raises(error):
                f[name](x)
    assert in_c("exp", np.array([709.8, 1e308]), tmp_path / "exp").tolist() == [math.inf, math.inf]
    logs = in_c("log", np.array([0.0, -0.0, -1.0, -math.inf]), tmp_path / "log")
    assert logs[:2].tolist() == [-math.inf, -math.inf] and np.isnan(logs[2:]).all()
