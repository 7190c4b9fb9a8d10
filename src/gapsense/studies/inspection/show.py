"""Tables, sentences and a figure of what a record can give."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report.plot import FAINT, FIRST, SECOND, TRUE, line, stack, suited
from gapsense.report.table import quantity, table
from gapsense.studies.identification.flux import estimate
from gapsense.studies.identification.record import Record
from gapsense.studies.identification.rest import FEWEST
from gapsense.studies.inspection.facts import WHITE, Facts, Signal

UNITS = {"voltage": "V", "current": "A"}
FEW = 20  # samples in the rise of the current below which edges and motion are badly resolved
COARSE = 200.0  # steps of the converter in the largest value, below which it is coarse


def tables(record: Record, found: Facts) -> list[Table | str]:
    """All facts, and what they mean for an identification."""
    t, n = record.times, record.times.size
    what = f"{record.name}: {n} samples every {quantity(record.dt, 's')}, {quantity(float(t[-1] - t[0]), 's')} in all,"
    return [signals(found), operations(record, found), f"{what} {found.rest} of them at rest first.", *remarks(found)]


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
    return table("Signals", ("", "range", "noise", "step of the converter", "at rest"), rows, texts=5)


def operations(record: Record, found: Facts) -> Table:
    """Complete operations."""
    rows = (
        (
            f"{1e3 * record.times[p.operation.start]:.6g} ms",
            f"{1e3 * record.times[p.operation.stop]:.6g} ms",
            quantity(p.peak, "A"),
            quantity(p.resistance, "Ohm"),
            quantity(p.flux_linkage, "Wb"),
            f"{quantity(p.inductance, 'H')}, off by {100.0 * p.bend:.2g} %",
            f"{p.rise} samples",
            f"{1e3 * p.kink:.6g} ms" if p.kink is not None else "none",
        )
        for p in found.pulses
    )
    heads = ("from", "to", "largest current", "R, (23)", "largest flux linkage", "inductance", "half after", "kink")
    return table("Complete operations", heads, rows, texts=0)


def remarks(found: Facts) -> list[str]:
    """What the record gives and what not, and what would help."""
    zero = 3.0 * found.signals["voltage"].noise
    levels = [quantity(v if abs(v) > zero else 0.0, "V") for v in found.levels]
    said = [f"The voltage stays at {', '.join(levels)}." if levels else "The voltage never stays where it is."]
    if found.rest < FEWEST:
        said.append("No rest before the first operation: offsets stay unknown. Record some milliseconds before it.")
    if not found.pulses:
        said.append(
            "No complete operation: resistance and flux linkage stay unknown. Record until the current has ended."
        )
    if found.incomplete:
        said.append(f"{found.incomplete} more without an end: not used. Record until the current has ended.")
    said += [text for name, s in found.signals.items() for text in of_signal(name, s)]
    if found.pulses:
        said += of_operations(found)
    return said


def of_signal(name: str, s: Signal) -> list[str]:
    """What a signal lacks."""
    said, largest = [], max(abs(s.smallest), abs(s.largest))
    if s.step and largest < COARSE * s.step:
        said.append(f"`{name}` has {largest / s.step:.0f} steps of its converter only. Choose a smaller range.")
    if s.correlation > WHITE:
        said.append(
            f"The noise of `{name}` is not white (neighbours correlate by {s.correlation:.2f}): it is filtered, and"
            " edges come late. Filter less, or sample slower."
        )
    return said


def of_operations(found: Facts) -> list[str]:
    """What operations give."""
    said, count = [], len(found.pulses)
    kinks = sum(p.kink is not None for p in found.pulses)
    R = np.array([p.resistance for p in found.pulses])
    said.append(f"Resistance {quantity(float(R.mean()), 'Ohm')}, from {count} operation{'s' if count > 1 else ''}.")
    if min(p.rise for p in found.pulses) < FEW:
        said.append("The current rises within few samples: motion is badly resolved. Sample faster.")
    if kinks:
        said.append(f"The current falls under a held voltage in {kinks} of {count}: something moves, and is seen.")
    else:
        said.append(
            "The current falls nowhere under a held voltage: no motion is seen, and a model with one is not identified"
            " for certain. Raise the voltage, hold it for longer, or move something."
        )
    return said


def figure_of(record: Record, found: Facts) -> Figure:
    """Voltage, current and flux linkage, with the operations."""
    flux = np.zeros(record.times.size)
    if found.pulses:
        flux = estimate(record, [p.operation for p in found.pulses]).flux_linkage
    panels = (("voltage", "V", record.voltage), ("current", "A", record.current), ("flux linkage", "Wb", flux))
    scales = [suited(*panel) for panel in panels]
    figure, axes = stack(record.name, [label for label, _ in scales], [1.0, 2.0, 1.0])
    for axis, (_, scale), (_, _, x), color in zip(axes, scales, panels, (TRUE, TRUE, FIRST)):
        line(axis, record.times, scale * x, color)
    for axis in axes:
        for p in found.pulses:
            axis.axvline(1e3 * record.times[p.operation.start], color=FAINT, linewidth=0.8)
            if p.kink is not None:
                axis.axvline(1e3 * p.kink, color=SECOND, linewidth=0.8, linestyle="--")
    return figure
