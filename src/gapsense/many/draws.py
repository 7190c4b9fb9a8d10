"""Points in the unit cube by method, and the quantiles of distributions at them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
METHODS = ("random", "latin-hypercube", "sobol")
EDGE = 2.0**-32  # distance from 0 and 1, which have no quantile; Sobol's points may lie on them
LEAST = 1e-9  # probability that the limits of a distribution may leave at least


class Distribution(NamedTuple):
    """A distribution: the keys that it needs and accepts, its quantiles, and a check of its numbers."""

    needs: tuple[str, ...]
    takes: tuple[str, ...]
    quantile: Callable[[Vector, Mapping[str, Any]], npt.NDArray[Any]]
    problem: Callable[[Mapping[str, Any]], str]
    what: str


def points(method: str, count: int, dimensions: int, seed: int) -> Vector:
    """Points (count, dimensions) inside the unit cube, always the same ones for the same arguments."""
    random = np.random.Generator(np.random.Philox(seed))
    if method == "random":
        return np.clip(random.random((count, dimensions)), EDGE, 1.0 - EDGE)
    from inspect import signature

    from scipy.stats import qmc  # here, since it takes a while to load

    maker = {"latin-hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol}[method]
    name = "rng" if "rng" in signature(maker).parameters else "seed"  # as SciPy before 1.15 calls it
    drawn: Vector = maker(dimensions, **{name: random}).random(count)
    return np.clip(drawn, EDGE, 1.0 - EDGE)


def uniform(u: Vector, own: Mapping[str, Any]) -> Vector:
    """Quantiles of even density."""
    return np.asarray(own["low"] + (own["high"] - own["low"]) * u)


def loguniform(u: Vector, own: Mapping[str, Any]) -> Vector:
    """Quantiles of even density of the logarithm."""
    return np.asarray(np.exp(uniform(u, {"low": math.log(own["low"]), "high": math.log(own["high"])})))


def integer(u: Vector, own: Mapping[str, Any]) -> npt.NDArray[np.int64]:
    """Whole numbers, each as often."""
    return np.floor(uniform(u, {"low": own["low"], "high": own["high"] + 1})).astype(np.int64)


def choice(u: Vector, own: Mapping[str, Any]) -> npt.NDArray[Any]:
    """Values of a list, each as often."""
    return np.array(own["values"], dtype=object)[np.floor(u * len(own["values"])).astype(np.intp)]


def normal(u: Vector, own: Mapping[str, Any]) -> Vector:
    """Quantiles of a normal distribution between its limits."""
    from scipy.special import ndtri

    low, high = shares(own)
    return np.asarray(own["mean"] + own["std"] * ndtri(low + (high - low) * u))


def shares(own: Mapping[str, Any]) -> tuple[float, float]:
    """Probabilities below the limits of a normal distribution."""
    from scipy.special import ndtr

    low, high = ((own[key] - own["mean"]) / own["std"] if own[key] is not None else None for key in ("low", "high"))
    return 0.0 if low is None else float(ndtr(low)), 1.0 if high is None else float(ndtr(high))


def lognormal(u: Vector, own: Mapping[str, Any]) -> Vector:
    """Quantiles of a distribution whose logarithm is normal."""
    return np.asarray(np.exp(normal(u, logarithmic(own))))


def logarithmic(own: Mapping[str, Any]) -> dict[str, Any]:
    """The normal distribution of the logarithm."""
    limits = {key: None if own[key] is None else math.log(own[key]) for key in ("low", "high")}
    return {"mean": math.log(own["median"]), "std": own["sigma"], **limits}


def rising(own: Mapping[str, Any]) -> str:
    """What is wrong with limits."""
    if own["low"] is not None and own["high"] is not None and own["low"] >= own["high"]:
        return f"`low` is {own['low']:.9g} and `high` is {own['high']:.9g}. `low` must be the smaller one."
    return ""


def rising_above_0(own: Mapping[str, Any]) -> str:
    """What is wrong with limits of a logarithm."""
    wrong = [key for key in ("low", "high") if own[key] is not None and own[key] <= 0.0]
    return f"`{wrong[0]}` is {own[wrong[0]]:.9g}, a positive number is expected. Correct it." if wrong else rising(own)


def whole(own: Mapping[str, Any]) -> str:
    """What is wrong with limits of whole numbers."""
    wrong = [key for key in ("low", "high") if not isinstance(own[key], int)]
    return f"`{wrong[0]}` is {own[wrong[0]]}, a whole number is expected. Correct it." if wrong else rising(own)


def leaves(own: Mapping[str, Any]) -> str:
    """What is wrong with limits of a normal distribution."""
    problem = rising(own)
    if not problem and np.diff(shares(own))[0] < LEAST:
        return f"the limits leave less than {LEAST:g} of the distribution. Widen them."
    return problem


LIMITS = ("low", "high")
DISTRIBUTIONS: Mapping[str, Distribution] = {
    name: Distribution(*entry)
    for name, entry in {
        "uniform": (LIMITS, (), uniform, rising, "Uniform between `low` and `high`"),
        "loguniform": (LIMITS, (), loguniform, rising_above_0, "Its logarithm is uniform"),
        "normal": (("mean", "std"), LIMITS, normal, leaves, "Normal; with limits, truncated"),
        "lognormal": (
            *(("median", "sigma"), LIMITS, lognormal, lambda own: rising_above_0(own) or leaves(logarithmic(own))),
            "Its logarithm is normal; limits as for `normal`",
        ),
        "integer": (LIMITS, (), integer, whole, "Whole numbers from `low` to `high`, all equally likely"),
        "choice": (("values",), (), choice, lambda own: "", "One of `values`, all equally likely"),
    }.items()
}
