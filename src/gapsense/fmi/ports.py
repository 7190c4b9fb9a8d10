"""The port table: everything that a component says about its interface.

`kernels.interface` makes it from the records of a kernel.  The model description, the documentation page, the tests and
the shell in the FMU read it.  Standard library only: a copy travels in every FMU.
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
