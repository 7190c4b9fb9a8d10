"""Variables of an FMU: one set of types for FMI 2.0 and 3.0, numbers in place of texts, arrays by their elements."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from gapsense.cosim.fmu.archive import UnusableError, shown
from gapsense.tables import Value

NUMERIC = ("Real", "Integer", "Enumeration")
TYPES: Mapping[str, str] = {  # of FMI 3.0, by those of FMI 2.0
    "Float64": "Real",
    "Float32": "Real",
    **{f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)},
}
RANGES: Mapping[str, tuple[int, int]] = {
    **{f"Int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)},
    **{f"UInt{n}": (0, 2**n - 1) for n in (8, 16, 32, 64)},
}
HAVE_STARTS = ("output", "local")  # causalities besides inputs and parameters
NOT_MOVED = ("Binary", "Clock")  # types that a run leaves alone
MOST_ELEMENTS = 100  # of an array; larger ones are left alone too
STRUCTURAL = "structuralParameter"  # causality of the numbers that sizes of arrays are
OF_TYPES = {kind: RANGES["Int32"] for kind in ("Integer", "Enumeration")}  # where the type names no size


@dataclass(frozen=True)
class Variable:
    """A scalar variable, or an element of an array: its type and causality as FMI names them, limits and start."""

    name: str
    reference: int
    type: str  # Real, Integer, Boolean, String or Enumeration
    causality: str
    unit: str | None
    min: float | None
    max: float | None
    nominal: float
    start: Value | None
    size: str = ""  # its type in FMI 3.0, such as Int16; empty for FMI 2.0
    has_start: bool = False  # an output or a local variable with a start value that may be set
    items: Mapping[str, int] = field(default_factory=dict)  # of an Enumeration
    variability: str = ""
    array: str = ""  # that it is an element of
    place: int = 0  # in that, row by row
    is_structural: bool = False  # a parameter that decides sizes of arrays

    @property
    def is_parameter(self) -> bool:
        """True if a scenario may set it."""
        return self.causality == "parameter"

    @property
    def is_tunable(self) -> bool:
        """True for a parameter that may be set during a run."""
        return self.is_parameter and self.variability == "tunable"

    @property
    def is_settable(self) -> bool:
        """True if a value may be given before the initialisation: parameters, inputs, and what has a start value."""
        return self.causality in ("parameter", "input") or self.has_start

    @property
    def range(self) -> tuple[int, int] | None:
        """Smallest and largest number of an integer type, or None for another."""
        return RANGES.get(self.size) or OF_TYPES.get(self.type)

    def number(self, value: Value) -> Value:
        """The value as FMI takes it: an item of an enumeration becomes its number."""
        return self.items.get(value, value) if isinstance(value, str) else value


def scalars(v: Any, sizes: Mapping[str, int]) -> list[Variable]:
    """A variable of fmpy's model description, or the elements of an array: `y[1]`, `A[2,1]`, row by row.

    `sizes` are values of structural parameters that are not their start values.  What a run does not move has none.
    """
    if v.type in NOT_MOVED or (v.dimensions and v.type == "String"):
        return []
    if not v.dimensions:
        return [variable(v)]
    shape = [sizes.get(d.variable.name, n) if d.variable else n for d, n in zip(v.dimensions, v.shape)]
    count = math.prod(shape)
    if count > MOST_ELEMENTS and v.causality != "input":
        return []
    if count > MOST_ELEMENTS:
        size = "x".join(map(str, shape))
        found = f"its input `{shown(v.name)}` is an array of {size}, at most {MOST_ELEMENTS} elements are supported"
        raise UnusableError(f"{found}. Make it smaller.")
    texts = (v.start or "").split()
    if len(texts) not in (0, 1, count) and count == math.prod(v.shape):
        found = f"its array `{shown(v.name)}` has {len(texts)} start values, {count} or one expected"
        raise UnusableError(f"{found}. Export it again.")
    starts = texts * count if len(texts) == 1 else texts if len(texts) == count else [None] * count
    like, places = variable(v, None), product(*(range(1, n + 1) for n in shape))
    return [
        replace(
            like, name=f"{v.name}[{','.join(map(str, at))}]", start=start_value(like.type, text), array=v.name, place=k
        )
        for k, (at, text) in enumerate(zip(places, starts))
    ]


def variable(v: Any, start: str | None = "") -> Variable:
    """A variable of fmpy's model description with its texts turned into numbers; another start if one is given."""
    kind, start = TYPES.get(v.type, v.type), v.start if start == "" else start
    low, high, nominal = (number(v, name) for name in ("min", "max", "nominal"))
    return Variable(
        name=v.name,
        reference=v.valueReference,
        type=kind,
        causality="parameter" if v.causality == STRUCTURAL else v.causality or "local",
        unit=of_type(v, "unit"),
        min=low,
        max=high,
        nominal=abs(nominal or 1.0),
        start=start_value(kind, start),
        size=v.type if v.type in TYPES else "",
        has_start=v.causality in HAVE_STARTS and v.initial in ("exact", "approx") and v.variability != "constant",
        variability="fixed" if v.causality == STRUCTURAL else v.variability or "",
        is_structural=v.causality == STRUCTURAL,
        items={item.name: int(item.value) for item in v.declaredType.items} if v.declaredType else {},
    )


def of_type(v: Any, attribute: str) -> str | None:
    """Attribute of the variable, or else of its declared type."""
    own: str | None = getattr(v, attribute)
    declared: str | None = getattr(v.declaredType, attribute, None)
    return declared if own is None else own


def number(v: Any, attribute: str) -> float | None:
    """Numeric attribute of the variable or of its declared type."""
    text = of_type(v, attribute)
    value = None if text is None else float(text)
    if value is not None and math.isnan(value):
        raise UnusableError(f"`{attribute}` of its variable `{shown(v.name)}` is no number. Export it again.")
    return value


def start_value(kind: str, text: str | None) -> Value | None:
    """Start value in its own type, or None for none."""
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind == "Real" else int(text)
