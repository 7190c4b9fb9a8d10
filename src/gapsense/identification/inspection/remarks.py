"""What impairs a record, a sentence each, with what to change."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gapsense.identification.inspection.facts import WHITE, Facts, Signal
from gapsense.identification.measurements.record import SHOWN, Record, Vector
from gapsense.report.table import quantity

FEW = 20  # samples in the rise of the current below which the place of an edge between two samples counts
COARSE = 200.0  # steps of the converter in the largest value, below which it is coarse
OFTEN = 20.0  # samples per period of PWM, below which its edges are badly placed
UNSEEN = 4.0  # below which they are not seen
BETWEEN = 0.75  # samples: an edge lies somewhere between two of them
LATE, EARLY = 0.02, 0.05  # of the rise of the current, which eddy currents make begin earlier
BLURRED = 2.0  # samples; an edge that takes more is filtered
JUMP = 0.25  # of the range of a signal
RARE = 5  # samples; more of them are no spikes
DRIFT = 0.01  # of the resistance
COPPER = 0.00393  # of its resistance, per kelvin
SPREAD = 0.05  # of the resistance: no coil warms by so much between two operations
OTHER = 0.1  # of the resistance that is known: what the coil's temperature changes


def remarks(record: Record, found: Facts, resistance: float | None = None) -> list[str]:
    """All of them; `resistance` is that of the coil as a meter tells it [Ohm]."""
    said = list(found.clipped)
    coded = ["voltage"] if found.path.is_command else []  # its values are no steps of a converter
    said += [text for name, s in found.signals.items() if name not in coded for text in of_signal(name, s)]
    said += [
        *of_jumps(record, found),
        *of_switching(record, found),
        *of_filters(found),
        *of_driver(found),
        *of_sampling(found),
    ]
    return [*said, *of_resistances(found, resistance)]


def of_signal(name: str, s: Signal) -> Iterator[str]:
    """What a signal lacks."""
    largest = max(abs(s.smallest), abs(s.largest))
    if s.step and largest < COARSE * s.step:
        yield f"`{name}` has {largest / s.step:.0f} steps of its converter only. Choose a smaller range."
    if s.correlation > WHITE:
        yield (
            f"The noise of `{name}` is not white (neighbours correlate by {s.correlation:.2f}): it is filtered, and"
            " edges come late. Filter less, or sample slower."
        )


def of_jumps(record: Record, found: Facts) -> Iterator[str]:
    """A current that jumps, and single samples that do."""
    jump = {"voltage": JUMP * float(np.ptp(record.voltage)), "current": JUMP * float(np.ptp(record.current))}
    steps = {name: float(np.abs(np.diff(getattr(record, name))).max()) for name in jump}
    if steps["current"] > jump["current"] > 0.0 and steps["voltage"] < jump["voltage"]:
        yield (
            "The current jumps from one sample to the next, the voltage does not: no coil lets it. Are the columns"
            " interchanged?"
        )
    for name in jump if found.path.carrier is None else ():
        for k in spikes(getattr(record, name), jump[name])[:SHOWN]:
            yield (
                f"row {record.rows[k]}: `{name}` is {getattr(record, name)[k]:.4g} in this one sample only. Correct it,"
                " or look for what disturbs."
            )


def spikes(x: Vector, least: float) -> list[int]:
    """Single samples that are off both their neighbours by more than so much, if there are but a few."""
    steps = np.diff(x)
    found = np.flatnonzero((np.minimum(np.abs(steps[1:]), np.abs(steps[:-1])) > least) & (steps[1:] * steps[:-1] < 0.0))
    return [int(k) + 1 for k in found] if found.size <= RARE else []


def of_switching(record: Record, found: Facts) -> Iterator[str]:
    """PWM that the samples do not resolve."""
    carrier = found.path.carrier
    if carrier is None or carrier.samples >= OFTEN:
        return
    n, largest = carrier.samples, found.signals["voltage"].largest
    error = quantity(largest / n, "V")
    if n < UNSEEN:
        yield (
            f"The voltage is switched every {n:.2g} samples: its mean, which the flux linkage is made of, is lost, by"
            f" up to {error}. Sample {OFTEN:.0f} times in each period of the PWM, or drive without PWM."
        )
    elif carrier.spread == 0.0:
        yield (
            f"The voltage is switched every {n:g} samples, in step with the sampling: where an edge lies between two"
            f" samples is always the same, and its mean is wrong by up to {error} throughout. Sample {OFTEN:.0f} times"
            " in each period, or out of step, or drive without PWM."
        )
    else:
        yield (
            f"The voltage is switched every {n:.3g} samples: its mean over a period is known to {error} only, though"
            f" that averages out. Better sample {OFTEN:.0f} times in each period, or drive without PWM."
        )


def of_filters(found: Facts) -> Iterator[str]:
    """Filters, and channels that are not taken at the same time."""
    if found.path.edge > BLURRED:
        yield (
            f"An edge of the voltage takes {found.path.edge:.0f} samples: it is filtered, or the driver is slow. Filter"
            " both channels alike, or neither."
        )
    if found.lag is None or not found.pulses or not found.is_from_rest:
        return
    late, rise = found.lag.samples, min(p.rise for p in found.pulses)
    if abs(late) > BETWEEN + 3.0 * found.lag.error + (LATE if late > 0.0 else EARLY) * rise:
        where = "late behind" if late > 0.0 else "before"
        yield (
            f"The current is {abs(late):.2g} samples {where} the voltage: channels that are taken one after the"
            " other, or a filter in one of them. Shift or filter the other one alike."
        )


def of_driver(found: Facts) -> Iterator[str]:
    """A voltage that is not the coil's."""
    if found.path.is_command:
        yield (
            "The voltage has few values and no noise: a command, or too coarse a converter. A command does not have the"
            " drops of the driver, which are then taken for resistance. Measure at the coil's terminals."
        )


def of_sampling(found: Facts) -> Iterator[str]:
    """Too few samples."""
    rise = min((p.rise for p in found.pulses), default=FEW)
    if 0 < rise < FEW and found.is_from_rest:
        need = quantity(rise / FEW * found.dt, "s")
        yield (
            f"The current rises to half within {rise} samples: where an edge lies between two samples, and the motion,"
            f" are badly resolved. Sample every {need}, or in step with the drive."
        )


def of_resistances(found: Facts, resistance: float | None) -> Iterator[str]:
    """A coil that gets warm, or that is another one than a meter tells."""
    R = np.array([p.resistance for p in found.pulses])
    if R.size >= 4:
        slope, level = np.polyfit(np.arange(R.size), R, 1)
        drift = float(slope * (R.size - 1) / level)
        if abs(drift) > DRIFT and np.std(R - slope * np.arange(R.size)) < 0.5 * np.std(R):
            yield (
                f"The resistance changes by {100.0 * drift:.2g} % from the first operation to the last: as copper does"
                f" in {drift / COPPER:.2g} K. Pause for longer, or record fewer operations."
            )
    if not R.size or R.mean() <= 0.0:
        return
    spread = float(np.ptp(R) / R.mean())
    if spread > SPREAD:
        yield (
            f"The resistances of operations differ by {100.0 * spread:.2g} %: a voltage that is not the coil's, too few"
            " samples for PWM or a clamp, an offset, or operations that end before the current."
        )
    off = float(R.mean()) / resistance - 1.0 if resistance else 0.0
    if resistance and abs(off) > OTHER:
        yield (
            f"The record's resistance is {quantity(float(R.mean()), 'Ohm')}, {100.0 * off:+.0f} %"
            f" off the {quantity(resistance, 'Ohm')} that are known: the voltage is not the coil's (drops, PWM in step"
            " with the sampling), the coil is warm, or a unit is wrong."
        )
