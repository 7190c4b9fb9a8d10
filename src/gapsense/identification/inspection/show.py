"""A record for the user: what impairs it, what it can give, what to change, tables and a figure of its facts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich.table import Table

from gapsense.identification.inspection.facts import WHITE, Facts, Kink, Signal
from gapsense.identification.measurements.operations import estimate
from gapsense.identification.measurements.prepare import FEWEST_AT_REST, MOST_OFFSET
from gapsense.identification.measurements.record import SHOWN, Record, Vector
from gapsense.report.plot import FAINT, FIRST, GRID, PAGE, SECOND, THIRD, TRUE, panels, scale_axis
from gapsense.report.table import quantity, table

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
    said += [*of_jumps(record, found), *of_switching(found), *of_filters(found), *of_sampling(found)]
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
    jump = {name: JUMP * float(np.ptp(x)) for name, x in record.signals.items()}
    steps = {name: float(np.abs(np.diff(x)).max()) for name, x in record.signals.items()}
    if steps["current"] > jump["current"] > 0.0 and steps["voltage"] < jump["voltage"]:
        yield (
            "The current jumps from one sample to the next, the voltage does not: no coil allows that. Are the columns"
            " swapped?"
        )
    for name in jump if found.path.carrier is None else ():
        for k in spikes(record.signals[name], jump[name])[:SHOWN]:
            yield (
                f"row {record.rows[k]}: `{name}` is {record.signals[name][k]:.4g} in this one sample only. Correct it,"
                " or find the disturbance."
            )


def spikes(x: Vector, least: float) -> list[int]:
    """Single samples that are off both their neighbours by more than so much, if there are but a few."""
    steps = np.diff(x)
    found = np.flatnonzero((np.minimum(np.abs(steps[1:]), np.abs(steps[:-1])) > least) & (steps[1:] * steps[:-1] < 0.0))
    return [int(k) + 1 for k in found] if found.size <= RARE else []


def of_switching(found: Facts) -> Iterator[str]:
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
        if late < 0.0 and not found.lag.is_before:
            yield (
                "The current jumps with the voltage, in fewer samples than a coil alone allows: eddy currents of a"
                " solid core, which `identify` finds where they are small and `commission` where they are not."
            )
            return
        where = "late behind" if late > 0.0 else "before"
        yield (
            f"The current is {abs(late):.2g} samples {where} the voltage: channels that are taken one after the"
            " other, or a filter in one of them. Shift or filter the other one alike."
        )


def of_sampling(found: Facts) -> Iterator[str]:
    """A voltage that is not the coil's, and too few samples."""
    if found.path.is_command:
        yield (
            "The voltage has few values and no noise: a command, or too coarse a converter. A command does not have the"
            " drops of the driver, which then look like resistance. Measure at the coil's terminals."
        )
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


YES, CARE, NO = "yes", "with care", "no"
ENOUGH = 20  # samples at rest, that tell offsets and noise
UNMOVED = "no motion is seen: the record can identify coil and core, the mechanics would be guesses"
EQUAL = 0.02  # of the resistance, that operations may differ by
CONSTANT = 0.025  # of the flux linkage, which noise and the sampling may hide
WRONG = "no coil has such a voltage and current: a sensor is reversed, columns are swapped, or there is no voltage."
USES = ("`identify`", "`commission`", "`estimate`")
COIL, MOTION = ("resistance", "flux linkage"), "motion, {}".format
WHOLE = "Record from rest until the current has decayed."


class Item(NamedTuple):
    """One thing that a record may give."""

    what: str
    answer: str
    why: str


def checklist(found: Facts, impaired: int) -> list[Item]:
    """All of it; `impaired` is the number of remarks on the record."""
    R, L = ([getattr(p, name) for p in found.pulses] for name in ("resistance", "inductance"))
    closings = [each.closing for each in found.closings]
    seen = {"closing": closings, "opening": [p.opening for p in found.pulses]}
    if found.pulses and (float(np.mean(R)) <= 0.0 or float(np.median(L)) <= 0.0):
        return [offsets(found), *(Item(what, NO, WRONG) for what in (*COIL, *map(MOTION, seen), *USES))]
    if found.pulses:
        why = {"closing": why_unseen(found), "opening": why_no_way_back(found)}
        coil = [resistance(found), inductance(found)]
    else:
        why = dict.fromkeys(seen, f"no complete operation. {WHOLE}")
        coil = [Item(what, NO, why["closing"]) for what in COIL]
    moves = [
        Item(MOTION(way), *((YES, describe_kinks(found, kinks)) if any(kinks) else (NO, why[way])))
        for way, kinks in seen.items()
    ]
    return [offsets(found), *coil, *moves, *uses(found, any(closings), impaired)]


def offsets(found: Facts) -> Item:
    """Offsets and noise, from rest before the first operation."""
    if found.pulses and not found.is_from_rest:
        return Item("offsets, noise", NO, "it does not begin at rest, without current.")
    if found.rest < FEWEST_AT_REST:
        return Item("offsets, noise", NO, f"{found.rest} samples at rest first. Record {ENOUGH} of them or more.")
    answer = YES if found.rest >= ENOUGH else CARE
    return Item("offsets, noise", answer, f"from {found.rest} samples at rest first")


def resistance(found: Facts) -> Item:
    """Resistance by (23)."""
    R = np.array([p.resistance for p in found.pulses])
    spread = f", equal within {100.0 * float(np.ptp(R) / abs(R.mean())):.2g} %" if R.size > 1 else ""
    many = f"{R.size} operations" if R.size > 1 else "1 operation"
    is_alike, v = float(np.ptp(R)) < EQUAL * abs(float(R.mean())), found.signals["voltage"]
    # A current that stays where it is without a voltage is that of a sensor, but no coil's.
    is_shifted = not found.is_from_rest and v.offset is not None and abs(v.offset.value) < MOST_OFFSET * v.largest
    answer = CARE if is_shifted or found.clipped or not is_alike else YES
    return Item("resistance", answer, f"{quantity(float(R.mean()), 'Ohm')}, {many}{spread}")


def inductance(found: Facts) -> Item:
    """Flux linkage and inductance."""
    if not found.is_from_rest:
        return Item("flux linkage", NO, f"an integral over a whole operation from rest on. {WHOLE}")
    largest, L = max(p.flux_linkage for p in found.pulses), np.median([p.inductance for p in found.pulses])
    bend = 100.0 * float(np.median([p.bend for p in found.pulses]))
    text = f"up to {quantity(largest, 'Wb')}; inductance about {quantity(float(L), 'H')}, constant within {bend:.2g} %"
    return Item("flux linkage", CARE if found.clipped else YES, text)


def why_unseen(found: Facts) -> str:
    """Why no motion is seen while the current rises."""
    if found.clipped:
        return "clipped, where it would be seen. Widen the measuring range."
    bend = float(np.median([p.bend for p in found.pulses]))
    if bend < CONSTANT:
        return f"the inductance is constant within {100.0 * bend:.2g} %: no iron moves. Raise the voltage if it should."
    hidden = ", or the ripple of the PWM hides it: drive without PWM" if found.path.carrier else ""
    return (
        f"the current falls nowhere under a held voltage{hidden}. Raise the voltage, hold it for longer, or let"
        " something move."
    )


def why_no_way_back(found: Facts) -> str:
    """Why none is seen while it falls."""
    if all(p.operation.held for p in found.pulses):
        return "the coil is held to the end. Record until the current has ended."
    text, v = "the falling current has no bend.", found.signals["voltage"]
    if found.path.decay is not None and found.path.decay < 0.0 and v.smallest < -0.1 * v.largest:
        text += f" Against {quantity(found.path.decay, 'V')} it may have ended before the mover goes back:"
        text += " record some without."
    return text


def describe_kinks(found: Facts, kinks: list[Kink | None]) -> str:
    """In how many operations, and when."""
    one = next(kink for kink in kinks if kink)
    begun = next(p.operation.start for p, kink in zip(found.closings, kinks) if kink)
    begin = begun * found.dt + found.first
    many = f"in {sum(map(bool, kinks))} of {len(kinks)}: " if len(kinks) > 1 else ""
    return (
        f"{many}from {quantity(one.begin - begin, 's')} to {quantity(one.end - begin, 's')} after the operation begins,"
        f" {one.samples} samples"
    )


def uses(found: Facts, has_motion: bool, impaired: int) -> list[Item]:
    """The commands that could come next."""
    care = f"see {'the remark' if impaired == 1 else f'{impaired} remarks'} below"
    ready = (CARE, care) if impaired else (YES, "ready")
    begun = (NO, found.unready[0].partition(": ")[2]) if found.unready else ready
    whole = (NO, found.unfinished[0].partition(": ")[2]) if found.unfinished else begun
    if not has_motion:
        whole, begun = (use if use[0] == NO else (CARE, UNMOVED) for use in (whole, begun))
    flowing = ready if found.is_from_rest else (CARE, "no value is valid before the current has decayed once")
    flowing = flowing if (found.pulses or found.begun) and not found.slow else begun
    return [Item(name, *use) for name, use in zip(USES, (whole, begun, flowing))]


MOST_LISTED = 10  # operations that are listed


def inspection_tables(record: Record, found: Facts, resistance: float | None = None) -> list[Table | str]:
    """All facts, then what they mean."""
    t, n = record.times, record.times.size
    what = (
        f"{record.name}: {n} samples every {quantity(record.dt, 's')}, {quantity(float(t[-1] - t[0]), 's')} in all,"
        f" {found.rest} of them at rest first. {voltage(found)}"
    )
    said = remarks(record, found, resistance)
    listed: list[Table | str] = [operations(record, found)] if found.pulses else []
    if (left := len(found.pulses) - MOST_LISTED) > 0:
        listed.append(f"{left} more operations are not listed.")
    items = table("What it gives", ("", "given", "why, and what to change"), checklist(found, len(said)), texts=3)
    return [what, *extra(record), signals(found), *listed, scales(found), items, *said]


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
    for (name, s), unit in zip(found.signals.items(), "VA"):
        at_rest = f"{quantity(s.offset.value, unit)} +- {quantity(s.offset.error, unit)}" if s.offset else "unknown"
        span = f"{quantity(s.smallest, unit)} to {quantity(s.largest, unit)}"
        rows.append((name, span, quantity(s.noise, unit), quantity(s.step, unit) if s.step else "fine", at_rest))
    return table("Signals", ("", "range", "noise", "step", "at rest"), rows, texts=5)


def operations(record: Record, found: Facts) -> Table:
    """Complete operations."""
    rows = []
    for p in found.pulses[:MOST_LISTED]:
        ends = (f"{1e3 * record.times[k]:.6g} ms" for k in p.operation[:2])
        flux = (quantity(p.flux_linkage, "Wb"), quantity(p.inductance, "H"))
        moves = (f"{1e3 * kink.end:.6g} ms" if kink else "not seen" for kink in (p.closing, p.opening))
        integral = flux if found.is_from_rest else ("unknown", "unknown")
        rows.append((*ends, quantity(p.peak, "A"), quantity(p.resistance, "Ohm"), *integral, *moves))
    heads = ("from", "to", "current", "R, (23)", "flux linkage", "L", "closes", "opens")
    return table("Complete operations", heads, rows, texts=0)


def scales(found: Facts) -> Table:
    """What is fast, in samples."""
    rows = [("edge of the voltage", found.path.edge)]
    if found.path.carrier is not None:
        rows.append(("period of the PWM", found.path.carrier.samples))
    if found.pulses and found.is_from_rest:
        rows.append(("current to half of its largest", float(min(p.rise for p in found.pulses))))
        constants = [p.inductance / p.resistance for p in found.pulses if p.resistance > 0.0]
        rows += [("time constant L/R", min(constants) / found.dt)] if constants else []
    for name, kinks in (
        ("closing", [each.closing for each in found.closings]),
        ("opening", [p.opening for p in found.pulses]),
    ):
        if lengths := [kink.samples for kink in kinks if kink]:
            rows.append((f"motion that is seen, {name}", float(min(lengths))))
    cells = ((name, f"{n:.3g}", quantity(n * found.dt, "s")) for name, n in rows)
    return table("Time scales", ("", "samples", "time"), cells)


POINTS = 2000  # of a curve; more are drawn as the span of each of its parts
BEFORE, AFTER = 0.05, 0.02  # shown before and after an operation, in its length
MARKS: dict[str, tuple[str, Any]] = {
    "begins": (FAINT, "-"),
    "ends": (FAINT, ":"),
    "closes": (SECOND, "--"),
    "opens": (THIRD, "--"),
}
MOST_MARKED = 20  # operations in sight; of more none is marked


def inspection_figure(records: Sequence[Record], found: Sequence[Facts]) -> Figure:
    """Three rows for each record: voltage, current and flux linkage."""
    size, title = (PAGE, 0.6 + 4.2 * len(records)), records[0].name if len(records) == 1 else ""
    figure, axes = panels(title, 3 * len(records), 2, size, sharex=False, width_ratios=[1.0, 1.0])
    for k, (record, facts) in enumerate(zip(records, found)):
        draw(axes[3 * k : 3 * k + 3], record, facts, record.name if len(records) > 1 else "")
    figure.align_ylabels(axes[:, 0])
    marks = [Line2D([], [], color=color, linestyle=style) for color, style in MARKS.values()]
    figure.legend(
        [Patch(color=GRID, alpha=0.6), *marks], ["at rest", *MARKS], loc="outside lower center", ncols=5, frameon=False
    )
    return figure


def draw(axes: Any, record: Record, found: Facts, title: str) -> None:
    """One record."""
    flux = np.zeros(record.times.size)
    if found.pulses:
        flux = estimate(record, [p.operation for p in found.pulses]).flux_linkage
    names = (("voltage", "V", record.voltage), ("current", "A", record.current), ("flux linkage", "Wb", flux))
    axes[0, 0].set_title(f"{title}: all" if title else "all of it", loc="left", fontsize="medium")
    axes[0, 1].set_title("first operation" if found.pulses else "its beginning", loc="left", fontsize="medium")
    for row, panel, color in zip(axes, names, (TRUE, TRUE, FIRST)):
        label, scale = scale_axis(*panel)
        row[0].set_ylabel(label.replace("flux linkage", "flux\nlinkage"))
        for axis, part in zip(row, (slice(None), in_sight(record, found))):
            curve(axis, record.times[part], scale * panel[2][part], color)
            mark(axis, record, found, *axis.get_xlim())
    for axis in axes[2]:
        axis.set_xlabel("time / ms")


def in_sight(record: Record, found: Facts) -> slice:
    """The first operation, with some of what is around it."""
    if not found.pulses:
        return slice(0, max(2, record.times.size // 4))
    first = found.pulses[0].operation
    length = first.stop - first.start
    return slice(max(0, first.start - round(BEFORE * length)), first.stop + round(AFTER * length) + 1)


def curve(axis: Any, times: Vector, x: Vector, color: str) -> None:
    """A signal; a long one as the span of its values."""
    if x.size <= 2 * POINTS:
        axis.plot(1e3 * times, x, color=color, drawstyle="steps-post", linewidth=1.0)
        return
    step = -(-x.size // POINTS)
    whole = x.size // step * step
    parts = x[:whole].reshape(-1, step)
    ends = np.stack((parts.min(axis=1), parts.max(axis=1)), axis=1).ravel()
    axis.plot(1e3 * np.repeat(times[:whole:step], 2), ends, color=color, linewidth=0.8)


def mark(axis: Any, record: Record, found: Facts, left: float, right: float) -> None:
    """Rest, beginnings of operations, and kinks, as far as they are in sight."""
    t = 1e3 * record.times
    if found.is_from_rest:
        axis.axvspan(t[0], t[max(found.rest - 1, 0)], color=GRID, alpha=0.6, linewidth=0.0)
    here = [p for p in found.pulses if left < t[p.operation.stop] and t[p.operation.start] < right]
    for p in here if len(here) <= MOST_MARKED else []:
        kinks = [1e3 * kink.end if kink else None for kink in (p.closing, p.opening)]
        places = [*(t[k] for k in p.operation[:2]), *kinks]
        for (color, style), at in zip(MARKS.values(), places):
            if at is not None:
                axis.axvline(at, color=color, linewidth=1.0, linestyle=style)
    axis.set_xlim(left, right)
