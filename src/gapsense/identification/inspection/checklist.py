"""What a record can give, thing by thing: whether, why, and what to change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.identification.inspection.facts import Facts
from gapsense.identification.inspection.kinks import Kink
from gapsense.identification.measurements.rest import FEWEST, MOST
from gapsense.report.table import quantity

YES, CARE, NO = "yes", "with care", "no"
ENOUGH = 20  # samples at rest, that tell offsets and noise
UNMOVED = "no motion is seen: it tells of coil and core; the mechanics would be guesses"
EQUAL = 0.02  # of the resistance, that operations may differ by
CONSTANT = 0.025  # of the flux linkage, which noise and the sampling may hide
WRONG = (
    "no coil has such a voltage and current: a sensor is reversed, columns are interchanged, or there is no voltage."
)
USES = ("`identify`", "`commission`", "`estimate`")
WHOLE = "Record from rest until the current has ended."


class Item(NamedTuple):
    """One thing that a record may give."""

    what: str
    answer: str
    why: str


def checklist(found: Facts, impaired: int) -> list[Item]:
    """All of it; `impaired` is the number of remarks on the record."""
    motion = closing(found)
    return [
        offsets(found),
        resistance(found),
        inductance(found),
        motion,
        opening(found),
        *uses(found, motion, impaired),
    ]


def offsets(found: Facts) -> Item:
    """Offsets and noise, from rest before the first operation."""
    if found.pulses and not found.is_from_rest:
        return Item("offsets, noise", NO, "it does not begin at rest, without current.")
    if found.rest < FEWEST:
        return Item("offsets, noise", NO, f"{found.rest} samples at rest first. Record {ENOUGH} of them or more.")
    answer = YES if found.rest >= ENOUGH else CARE
    return Item("offsets, noise", answer, f"from {found.rest} samples at rest first")


def resistance(found: Facts) -> Item:
    """Resistance by (23)."""
    R = np.array([p.resistance for p in found.pulses])
    if not R.size:
        return Item("resistance", NO, f"no complete operation. {WHOLE}")
    if is_wrong(found):
        return Item("resistance", NO, WRONG)
    spread = f", equal within {100.0 * float(np.ptp(R) / abs(R.mean())):.2g} %" if R.size > 1 else ""
    many = f"{R.size} operations" if R.size > 1 else "1 operation"
    is_sure = not is_shifted(found) and not found.clipped and float(np.ptp(R)) < EQUAL * abs(float(R.mean()))
    return Item("resistance", YES if is_sure else CARE, f"{quantity(float(R.mean()), 'Ohm')}, {many}{spread}")


def is_shifted(found: Facts) -> bool:
    """Whether a current stays where it is without a voltage, as that of a sensor does, but no coil's."""
    v = found.signals["voltage"]
    return not found.is_from_rest and v.offset is not None and abs(v.offset.value) < MOST * v.largest


def is_wrong(found: Facts) -> bool:
    """Whether voltage and current cannot be those of one coil."""
    R, L = ([getattr(p, name) for p in found.pulses] for name in ("resistance", "inductance"))
    return bool(found.pulses) and (float(np.mean(R)) <= 0.0 or float(np.median(L)) <= 0.0)


def inductance(found: Facts) -> Item:
    """Flux linkage and inductance."""
    if resistance(found).answer == NO:
        return resistance(found)._replace(what="flux linkage")
    if not found.is_from_rest:
        return Item("flux linkage", NO, f"an integral over a whole operation from rest on. {WHOLE}")
    largest, L = max(p.flux_linkage for p in found.pulses), np.median([p.inductance for p in found.pulses])
    bend = 100.0 * float(np.median([p.bend for p in found.pulses]))
    text = f"up to {quantity(largest, 'Wb')}; inductance about {quantity(float(L), 'H')}, constant within {bend:.2g} %"
    return Item("flux linkage", CARE if found.clipped else YES, text)


def closing(found: Facts) -> Item:
    """Motion that the rising current shows."""
    kinks = [p.closing for p in found.pulses]
    if is_wrong(found):
        return Item("motion, closing", NO, WRONG)
    if any(kinks):
        return Item("motion, closing", YES, seen(found, kinks))
    return Item("motion, closing", NO, unseen(found))


def unseen(found: Facts) -> str:
    """Why no motion is seen while the current rises."""
    if not found.pulses:
        return f"no complete operation. {WHOLE}"
    if found.clipped:
        return "clipped, where it would be seen. Widen the measuring range."
    bend = float(np.median([p.bend for p in found.pulses]))
    if bend < CONSTANT:
        return (
            f"the inductance is constant within {100.0 * bend:.2g} %: no iron moves. Raise the voltage, if some should."
        )
    hidden = ", or the ripple of the PWM hides it: drive without PWM" if found.path.carrier else ""
    return (
        f"the current falls nowhere under a held voltage{hidden}. Raise the voltage, hold it for longer, or let"
        " something move."
    )


def opening(found: Facts) -> Item:
    """Motion that the falling current shows."""
    kinks, decay = [p.opening for p in found.pulses], found.path.decay
    if is_wrong(found):
        return Item("motion, opening", NO, WRONG)
    if any(kinks):
        return Item("motion, opening", YES, seen(found, kinks))
    text = "the falling current bends nowhere."
    if (
        decay is not None
        and decay < 0.0
        and found.signals["voltage"].smallest < -0.1 * found.signals["voltage"].largest
    ):
        text += f" Against {quantity(decay, 'V')} it may have ended before the mover goes back: record some without."
    return Item("motion, opening", NO, text if found.pulses else f"no complete operation. {WHOLE}")


def seen(found: Facts, kinks: list[Kink | None]) -> str:
    """In how many operations, and when."""
    one = next(kink for kink in kinks if kink)
    begin = next(p.operation.start for p, kink in zip(found.pulses, kinks) if kink) * found.dt + found.first
    many = f"in {sum(map(bool, kinks))} of {len(kinks)}: " if len(kinks) > 1 else ""
    return (
        f"{many}from {1e3 * (one.begin - begin):.3g} ms to {1e3 * (one.end - begin):.3g} ms after the operation begins,"
        f" {one.samples} samples"
    )


def uses(found: Facts, motion: Item, impaired: int) -> list[Item]:
    """The commands that could come next."""
    if is_wrong(found):
        return [Item(name, NO, WRONG) for name in USES]
    care = f"see {'the remark' if impaired == 1 else f'{impaired} remarks'} below"
    ready = (CARE, care) if impaired else (YES, "ready")
    begun = (NO, short(found.unready[0])) if found.unready else ready
    whole = (NO, short(found.unfinished[0])) if found.unfinished else begun
    if motion.answer == NO:
        whole, begun = (use if use[0] == NO else (CARE, UNMOVED) for use in (whole, begun))
    flowing = ready if found.is_from_rest else (CARE, "nothing is right before the current has ended once")
    flowing = flowing if found.pulses or found.incomplete else begun
    named = zip(USES, (whole, begun, flowing))
    return [Item(name, answer, why) for name, (answer, why) in named]


def short(problem: str) -> str:
    """A problem without the name of its file."""
    return problem.partition(": ")[2]
