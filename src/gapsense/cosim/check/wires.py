"""Both ends of a connection: whether one can follow the other."""

from __future__ import annotations

from collections.abc import Iterator

from gapsense.cosim.fmu.variables import Variable
from gapsense.cosim.scenario.elements import Connection

AS_NUMBERS = ("Boolean", "Integer")  # types of which a Real input takes the number; true is 1


def check_types(connection: Connection, source: Variable, target: Variable) -> Iterator[str]:
    """Problems of a connection between types that do not fit, or whose values cannot be converted."""
    ends = f"{connection.source} ({source.type}) -> {connection.target} ({target.type})"
    is_number = target.type == "Real" and source.type in AS_NUMBERS
    if source.type != target.type and not is_number:
        yield (
            f"{connection.place}: {ends}: types differ. Connect variables of one type; only a Real input takes others, "
            "those of type Boolean and Integer."
        )
    elif source.items and target.items and source.items != target.items:
        found, expected = (", ".join(f"{n} = {k}" for n, k in v.items.items()) for v in (source, target))
        yield f"{connection.place}: {ends}: items differ, {found} and {expected}. Correct the connection."
    elif connection.converts and target.type != "Real":
        yield f"{connection.place}: {ends}: only a Real input takes `factor` and `bias`. Remove them."


def check_units(connection: Connection, source: Variable, target: Variable) -> Iterator[str]:
    """Problem of a connection between different units."""
    sent = connection.unit or (None if connection.converts else source.unit)
    if sent and target.unit and sent != target.unit:
        ends = f"{connection.source} [{source.unit or 'no unit'}] -> {connection.target} [{target.unit}]"
        after = f" after conversion to [{connection.unit}]" if connection.unit else ""
        remedy = "Correct the connection, or give `factor`, `bias` and `unit` in `[[connections]]`."
        yield f"{connection.place}: {ends}: units differ{after}. {remedy}"
