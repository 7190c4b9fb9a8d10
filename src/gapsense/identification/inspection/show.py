"""Tables and sentences on what a record can give."""

from __future__ import annotations

from rich.table import Table

from gapsense.identification.inspection.checklist import checklist
from gapsense.identification.inspection.facts import Facts
from gapsense.identification.inspection.kinks import Kink
from gapsense.identification.inspection.remarks import remarks
from gapsense.identification.measurements.record import Record
from gapsense.report.table import quantity, table

UNITS = {"voltage": "V", "current": "A"}
MOST = 10  # operations that are listed


def tables(record: Record, found: Facts, resistance: float | None = None) -> list[Table | str]:
    """All facts, then what they mean."""
    t, n = record.times, record.times.size
    what = (
        f"{record.name}: {n} samples every {quantity(record.dt, 's')}, {quantity(float(t[-1] - t[0]), 's')} in all,"
        f" {found.rest} of them at rest first. {voltage(found)}"
    )
    said = remarks(record, found, resistance)
    listed = [operations(record, found)] if found.pulses else []
    left = [f"{len(found.pulses) - MOST} more operations are not listed."] if len(found.pulses) > MOST else []
    items = table("What it gives", ("", "given", "why, and what to change"), checklist(found, len(said)), texts=3)
    return [what, *extra(record), signals(found), *listed, *left, scales(found), items, *said]


def voltage(found: Facts) -> str:
    """Where the voltage stays, and how the current falls."""
    zero = 3.0 * found.signals["voltage"].noise
    levels = [quantity(v if abs(v) > zero else 0.0, "V") for v in found.levels]
    said = [f"The voltage stays at {', '.join(levels)}" if levels else "The voltage never stays where it is"]
    if found.path.decay is not None:
        said.append(f"the current falls at {quantity(found.path.decay if abs(found.path.decay) > zero else 0.0, 'V')}")
    if found.path.source is not None:
        said.append(f"the supply sags as behind {quantity(found.path.source, 'Ohm')}")
    if found.path.carrier is not None:
        said.append(f"it is switched, {100.0 * found.path.carrier.duty:.0f} % on")
    return f"{'; '.join(said)}."


def extra(record: Record) -> list[str]:
    """What else was recorded."""
    if record.position is None:
        return []
    ends = (quantity(float(f(record.position)), "m") for f in (min, max))
    return [f"A position is recorded, {' to '.join(ends)}."]


def signals(found: Facts) -> Table:
    """Voltage and current."""
    rows = []
    for name, s in found.signals.items():
        unit = UNITS[name]
        at_rest = f"{quantity(s.offset.value, unit)} +- {quantity(s.offset.error, unit)}" if s.offset else "unknown"
        rows.append(
            (
                name,
                f"{quantity(s.smallest, unit)} to {quantity(s.largest, unit)}",
                quantity(s.noise, unit),
                quantity(s.step, unit) if s.step else "fine",
                at_rest,
            )
        )
    return table("Signals", ("", "range", "noise", "step", "at rest"), rows, texts=5)


def operations(record: Record, found: Facts) -> Table:
    """Complete operations."""
    rows = (
        (
            f"{1e3 * record.times[p.operation.start]:.6g} ms",
            f"{1e3 * record.times[p.operation.stop]:.6g} ms",
            quantity(p.peak, "A"),
            quantity(p.resistance, "Ohm"),
            *(
                ("unknown",) * 2
                if not found.is_from_rest
                else (quantity(p.flux_linkage, "Wb"), quantity(p.inductance, "H"))
            ),
            at(p.closing),
            at(p.opening),
        )
        for p in found.pulses[:MOST]
    )
    heads = ("from", "to", "current", "R, (23)", "flux linkage", "L", "closes", "opens")
    return table("Complete operations", heads, rows, texts=0)


def at(kink: Kink | None) -> str:
    """When a motion is seen to end."""
    return "not seen" if kink is None else f"{1e3 * kink.end:.6g} ms"


def scales(found: Facts) -> Table:
    """What is fast, in samples."""
    rows = [("edge of the voltage", found.path.edge)]
    if found.path.carrier is not None:
        rows.append(("period of the PWM", found.path.carrier.samples))
    if found.pulses and found.is_from_rest:
        rows.append(("current to half of its largest", float(min(p.rise for p in found.pulses))))
        constants = [p.inductance / p.resistance for p in found.pulses if p.resistance > 0.0]
        rows += [("time constant L/R", min(constants) / found.dt)] if constants else []
    for name, kinks in (("closing", [p.closing for p in found.pulses]), ("opening", [p.opening for p in found.pulses])):
        if lengths := [kink.samples for kink in kinks if kink]:
            rows.append((f"motion that is seen, {name}", float(min(lengths))))
    cells = ((name, f"{n:.3g}", quantity(n * found.dt, "s")) for name, n in rows)
    return table("Time scales", ("", "samples", "time"), cells)
