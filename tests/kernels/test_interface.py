"""Records that say what their fields are to the outside."""

from __future__ import annotations

from types import ModuleType
from typing import Annotated, Any, NamedTuple

import pytest
from kernel_cases import components

from gapsense.fmi.components import kernel_of, kernel_parameters
from gapsense.fmi.ports import Port
from gapsense.kernels.interface import (
    COLUMN,
    _ports,
    choice,
    input_,
    measured,
    option,
    output,
    parameter,
    part,
    ports,
    ports_of,
    record_of,
    same,
    seed,
    table,
)
from gapsense.kernels.layout import Array, Choice, Scalar, Table, leaves


class Law(Choice):
    linear, curve = range(2)


@ports()
class Parameters(NamedTuple):
    gain: Scalar = parameter("1", "Factor", 2.0, min=0.0)
    noise_voltage_std: Scalar = parameter("V", "Noise", 0.0)
    micro_step: Scalar = parameter("s", "Step", 1e-3, name="micro_step")
    seed: Scalar = seed()
    is_quiet: Scalar = option("Quiet", True)
    law: Annotated[Scalar, Law] = choice("Law")
    gap_file_x: Annotated[Array, Table()] = table("Curve", ("rising:x [m]", "y"), "curve.csv")
    gap_file_y: Annotated[Array, Table()] = COLUMN


@ports()
class Inputs(NamedTuple):
    time: Scalar
    voltage: Scalar = measured("V", "Voltage", nominal=30.0)
    mode: Scalar = input_("1", "Mode", start=3.0)


@ports()
class Health(NamedTuple):
    health: Scalar = output("1", "Health", min=0.0, max=1.0)


@ports(feedthrough=("mode",))
class Outputs(NamedTuple):
    current: Scalar = output("A", "Current")
    force: Scalar = output("N", "Force", feedthrough=())
    health: Health = part(feedthrough=("voltage", "mode"))


@ports()
class Others(NamedTuple):
    law: Annotated[Scalar, Law] = same(Parameters)
    gain: Scalar = same(Parameters)


KERNEL: Any = ModuleType("kernel")
KERNEL.Parameters, KERNEL.Inputs, KERNEL.Outputs = Parameters, Inputs, Outputs
PORTS = {port.name: port for port in ports_of(KERNEL)}


def test_ports_are_called_like_their_fields_and_have_their_order() -> None:
    """In the name of a parameter the first underscore is a dot; the time comes from the shell."""
    parameters = ["gain", "noise.voltage_std", "micro_step", "seed", "is.quiet", "law", "gap.file"]
    assert [*PORTS] == ["voltage", "mode", "current", "force", "health", *parameters]


def test_ports_have_what_their_field_says() -> None:
    assert PORTS["voltage"] == Port(
        "voltage", "input", "V", "Voltage", 0.0, nominal=30.0, source="sensor.voltage_measured"
    )
    law = Port("law", "parameter", "1", "Law: linear, curve", "linear", kind="String", variability="fixed")
    assert PORTS["law"] == law._replace(choices=("linear", "curve"))
    assert PORTS["gap.file"].columns == ("rising:x [m]", "y") and PORTS["gap.file"].start == "curve.csv"


def test_outputs_depend_on_what_they_their_record_or_the_record_around_it_says() -> None:
    found = {name: port.feedthrough for name, port in PORTS.items() if port.causality == "output"}
    assert found == {"current": ("mode",), "force": (), "health": ("voltage", "mode")}


def test_defaults_are_the_start_values_as_the_kernel_gets_them() -> None:
    assert Parameters() == (2.0, 0.0, 1e-3, 1.0, 1.0, Law.linear, [], [])
    assert Inputs(1.0) == (1.0, 0.0, 3.0) and Others() == (Law.linear, 2.0)


def test_outputs_have_no_defaults() -> None:
    with pytest.raises(TypeError, match="missing 3 required"):
        Outputs()


def test_a_record_of_a_table_has_a_port_for_each_row() -> None:
    table = {"low": ("V", 1.0), "high": ("A", 2.0)}
    limits = record_of("Limits", table, "{}_limit", lambda name, row: parameter(row[0], name, row[1]))
    assert limits() == (1.0, 2.0) and limits.__name__ == "Limits"
    assert [(port.name, port.unit) for port in _ports(limits)] == [("low.limit", "V"), ("high.limit", "A")]


@pytest.mark.parametrize("name", sorted(components()))
def test_parameters_of_a_kernel_start_as_those_of_its_component(name: str) -> None:
    """But for tables, which a file says."""
    component, folder = components()[name]
    found = leaves(kernel_of(component).module.Parameters())
    for (field, at, value), (_, _, expected) in zip(found, leaves(kernel_parameters(folder, {})), strict=True):
        assert at.kind == "table" or value == expected, field
