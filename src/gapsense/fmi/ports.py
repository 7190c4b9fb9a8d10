"""The port table: everything that a component says about its interface, once.

The model description, the documentation page, the tests and the shell in the FMU read it.  Standard library only:
a copy travels in every FMU.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Port(NamedTuple):
    """One variable of a component."""

    name: str  # flat snake_case for signals, dotted for parameters
    causality: str  # input, output or parameter
    unit: str  # a key of gapsense.units.UNITS
    description: str
    start: Any = 0.0
    min: float | None = None
    max: float | None = None
    nominal: float = 1.0
    kind: str = "Real"  # Real, Integer, Boolean or String
    variability: str = "continuous"
    feedthrough: tuple[str, ...] = ()  # inputs that an output depends on at the same instant
    choices: tuple[str, ...] = ()  # of a String parameter: the kernel gets the index
    columns: tuple[str, ...] = ()  # of a String parameter that names a CSV file: one table each, see `read_table`
    is_optional: bool = False  # of an input: its start value says that nothing is known
    source: str = ""  # of an input: what drives it as a rule, see `page.py`; nothing: a constant

    @property
    def field(self) -> str:
        """Name of the port in the kernel's records."""
        return self.name.replace(".", "_")


class Limit(NamedTuple):
    """A rule for several parameters: the product of their powers stays below a limit."""

    powers: tuple[tuple[str, int], ...]  # real parameters that are not zero, and the power of each
    below: float
    reason: str  # what happens otherwise

    def text(self) -> str:
        """The product, as a reader writes it."""
        over = [f"`{name}`" for name, power in self.powers for _ in range(power)]
        under = [f"`{name}`" for name, power in self.powers for _ in range(-power)]
        return " / ".join([" * ".join(over or ["1"]), *under])


class Component(NamedTuple):
    """An FMU: its name, its one-line description, its ports, its kernel's module and a fitting experiment."""

    name: str
    description: str
    kernel: str
    ports: tuple[Port, ...]
    stop_time: float = 0.08  # s
    step_size: float = 25e-6  # s
    resources: tuple[str, ...] = ()  # files of the component's folder that travel with it
    rising: tuple[tuple[str, str], ...] = ()  # pairs of parameters of which the second must be larger
    limits: tuple[Limit, ...] = ()
    survives: bool = False  # inputs that are not finite reach the kernel, which copes; else they are an error

    def of(self, causality: str) -> tuple[Port, ...]:
        """Ports of one causality, in order."""
        return tuple(p for p in self.ports if p.causality == causality)


def input_(name: str, unit: str, description: str, *, nominal: float = 1.0, start: float = 0.0, **more: Any) -> Port:
    """A real input."""
    return Port(name, "input", unit, description, start, nominal=nominal, **more)


def measured(name: str, unit: str, description: str, **more: Any) -> Port:
    """A real input that a sensor measures."""
    return input_(name, unit, description, source=f"sensor.{name}_measured", **more)


def output(name: str, unit: str, description: str, *, nominal: float = 1.0, **more: Any) -> Port:
    """A real output, valid at the end of the step."""
    return Port(name, "output", unit, description, None, nominal=nominal, **more)


def parameter(name: str, unit: str, description: str, start: float, *, min: float | None = None, **more: Any) -> Port:
    """A real parameter that may be changed during a run; its nominal value is its start value."""
    more.setdefault("variability", "tunable")
    return Port(name, "parameter", unit, description, start, min, nominal=abs(start) or 1.0, **more)


def fixed(name: str, unit: str, description: str, start: float, *, min: float | None = None, **more: Any) -> Port:
    """A real parameter that is set before the run."""
    return parameter(name, unit, description, start, min=min, variability="fixed", **more)


def sample_time(start: float) -> Port:
    """The sampling period of a sampled component."""
    text = "Sampling period; the communication step is a whole multiple or a whole fraction of it"
    return fixed("sample_time", "s", text, start, min=1e-9)


def seed() -> Port:
    """The seed of a component's random numbers."""
    text = "Seed of the random numbers: the same seed gives the same bits"
    return Port("seed", "parameter", "1", text, 1, 0, 2**31 - 1, 1.0, "Integer", "fixed")


def option(name: str, description: str, start: bool) -> Port:
    """A Boolean parameter."""
    return Port(name, "parameter", "1", description, start, kind="Boolean", variability="fixed")


def choice(name: str, description: str, choices: tuple[str, ...]) -> Port:
    """A String parameter with one of a few values, the first by default."""
    text = f"{description}: {', '.join(choices)}"
    return Port(name, "parameter", "1", text, choices[0], kind="String", variability="fixed", choices=choices)


def table(name: str, description: str, columns: tuple[str, ...], start: str) -> Port:
    """A String parameter that names a CSV file, in the FMU's resources or else from the working folder on."""
    return Port(name, "parameter", "1", description, start, kind="String", variability="fixed", columns=columns)
