"""What the fields of a kernel's records are to the outside: name, unit, description, range, start value; each once.

    @ports()
    class Parameters(NamedTuple):
        sample_time: Scalar = sample_time(20e-6)
        coil_resistance: Scalar = parameter("Ohm", "Resistance R", 48.0, min=1e-9)

The default of a field is then its start value, so `Parameters()` is the component as it starts, and `ports_of` makes
the port table of a kernel.  A signal is called like its field; in the name of a parameter the first underscore is a
dot, here `coil.resistance`, unless `name` says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from gapsense.fmi.ports import Port
from gapsense.kernels.layout import choices, parts

T = TypeVar("T", bound=type)
PORTS = "PORTS"  # attribute of a record class: of every field its port, and more as below
HERE = ("as its record",)  # feedthrough of an output that does not say any


class Part(NamedTuple):
    """In place of a port: a field that holds a record of outputs; `feedthrough` if it is not that of the others."""

    feedthrough: tuple[str, ...] = HERE


class Same(NamedTuple):
    """In place of a port: that of the field of the same name in another record."""

    record: Any
    feedthrough: tuple[str, ...] = HERE


# a further column of the table in the field before
COLUMN: Any = Port(name="", causality="column", unit="1", description="", start=[])
# a parameter without unit that is set before a run
SETTING: Any = partial(Port, causality="parameter", unit="1", variability="fixed")


# the ports of fields; they are Any, as the fields are
part: Any = Part
same: Any = Same


def _real(causality: str, unit: str, description: str, **more: Any) -> Any:
    return Port(**{"name": "", "causality": causality, "unit": unit, "description": description, **more})


def input_(unit: str, description: str, **more: Any) -> Any:
    """A real input."""
    return _real("input", unit, description, **more)


def measured(unit: str, description: str, **more: Any) -> Any:
    """A real input that a sensor measures."""
    return input_(unit, description, source="sensor.{}_measured", **more)


def output(unit: str, description: str, **more: Any) -> Any:
    """A real output, valid at the end of the step."""
    return _real("output", unit, description, **{"start": None, "feedthrough": HERE, **more})


def parameter(unit: str, description: str, start: float, **more: Any) -> Any:
    """A real parameter that may be changed during a run; its nominal value is its start value."""
    usual = {"variability": "tunable", "nominal": abs(start) or 1.0}
    return _real("parameter", unit, description, start=start, **{**usual, **more})


def fixed(unit: str, description: str, start: float, **more: Any) -> Any:
    """A real parameter that is set before the run."""
    return parameter(unit, description, start, variability="fixed", **more)


def sample_time(start: float) -> Any:
    """The sampling period of a sampled component."""
    text = "Sampling period; the communication step is a whole multiple or a whole fraction of it"
    return fixed("s", text, start, min=1e-9, name="sample_time")


def seed() -> Any:
    """The seed of a component's random numbers."""
    text = "Seed of the random numbers: the same seed gives the same bits"
    return SETTING(name="seed", description=text, start=1, min=0, max=2**31 - 1, kind="Integer")


def option(description: str, start: bool, name: str = "") -> Any:
    """A Boolean parameter."""
    return SETTING(name=name, description=description, start=start, kind="Boolean")


def choice(description: str, name: str = "") -> Any:
    """A String parameter whose values are the names of the `Choice` in its annotation, the first by default."""
    return SETTING(name=name, description=description, start=0.0, kind="String")


def table(description: str, columns: tuple[str, ...], start: str, name: str = "") -> Any:
    """A String parameter that names a CSV file, in the FMU's resources or else from the working folder on.

    It stands at the field of the first column; those of the others are `COLUMN`.  A file is no default: that is empty.
    """
    return SETTING(name=name, description=description, start=start, kind="String", columns=columns)


def ports(feedthrough: tuple[str, ...] = ()) -> Callable[[T], T]:
    """Decorator of a record whose fields have ports; `feedthrough` of outputs that say no other."""

    def note(cls: Any) -> Any:
        given = {name: _find_port(name, value) for name, value in cls._field_defaults.items()}
        starts = {name: _start(value) for name, value in given.items()}
        setattr(cls, PORTS, {"": Part(feedthrough), **given})
        is_made = any(value is None for value in starts.values())  # outputs have no start value
        cls._field_defaults = {} if is_made else starts
        cls.__new__.__defaults__ = None if is_made else tuple(starts.values())
        return cls

    return note


def record_of(name: str, table: Mapping[str, Any], field: str, port: Callable[[str, Any], Any]) -> Any:
    """A record with a number for each row of a table; `port` is made of the name of the field and of the row.

    In `field`, {} stands for the name of the row.  A record holds this one as `Annotated[Any, ...]`.
    """
    rows = {field.format(key): row for key, row in table.items()}
    cls = NamedTuple(name, [(key, Any) for key in rows])  # type: ignore[misc]  # no more is known here
    cls._field_defaults = {key: port(key, row) for key, row in rows.items()}
    return ports()(cls)


def _find_port(name: str, value: Any) -> Any:
    """The port of a field; that of another record's field of this name, if the field says so."""
    if not isinstance(value, Same):
        return value
    return _depending(next(port for field, port in _said(value.record) if field == name), value.feedthrough)


def _start(value: Any) -> Any:
    """Default of a field: the start value, as the kernel gets it."""
    if not isinstance(value, Port):
        return None if isinstance(value, Part) else value
    return [] if value.columns else float(value.start) if value.kind in ("Boolean", "Integer") else value.start


def _said(cls: Any) -> Iterator[tuple[str, Any]]:
    """Every field of a record that is a number, and of the records that it holds, with its port."""
    known = getattr(cls, PORTS, {"": Part(())})
    for name, record in parts(cls).items():
        said = known.get(name)
        if record is None:
            yield name, said
            continue
        own = said.feedthrough if isinstance(said, Part) else HERE
        for field, port in _said(record):
            yield field, _depending(port, own)


def _depending(port: Any, feedthrough: tuple[str, ...]) -> Any:
    is_open = isinstance(port, Port) and port.feedthrough == HERE
    return port._replace(feedthrough=feedthrough) if is_open else port


def ports_of(kernel: ModuleType) -> tuple[Port, ...]:
    """The port table of a kernel: ports of its inputs, outputs and parameters in the order of their fields."""
    return tuple(port for cls in (kernel.Inputs, kernel.Outputs, kernel.Parameters) for port in _ports(cls))


def _ports(cls: Any) -> Iterator[Port]:
    known, outside = choices(cls), getattr(cls, PORTS, {"": Part(())})[""].feedthrough
    for field, port in _said(cls):
        if isinstance(port, Port) and port is not COLUMN:
            yield _with_name(_depending(port, outside), field, known.get(field, ()))


def _with_name(port: Port, field: str, names: tuple[str, ...]) -> Port:
    """A port with what its field says: its name, and its choices."""
    if port.columns:
        field = field.removesuffix("_" + port.columns[0].rpartition(":")[2].partition(" ")[0])
    dotted = field.replace("_", ".", 1) if port.causality == "parameter" else field
    name = port.name or dotted
    if names:
        return port._replace(
            name=name, description=f"{port.description}: {', '.join(names)}", start=names[0], choices=names
        )
    return port._replace(name=name, source=port.source.format(name))
