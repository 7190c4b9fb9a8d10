"""The plain form, and what may be added to it: eddy currents, hysteresis, fringes of the gap."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence, Set
from typing import NamedTuple

from gapsense.actuators.magnetics import MU_0
from gapsense.actuators.solenoid_valve import GapLaw
from gapsense.identification.gap_law.laws import Law
from gapsense.identification.measurements.conventions import FORMS
from gapsense.identification.valve.device import Device, changed, value, with_losses
from gapsense.identification.valve.form import FITTED, Form

EDDY = 0.01  # R g_e of a first guess
HYSTERESIS = 0.05  # I_h of it, in currents lambda_sat R_iron0 / N^2
SCALES = {GapLaw.linear: "gap_slope", GapLaw.fringing: "gap_area", GapLaw.table: "gap_file_reluctance"}
LOSSES = ("core_eddy", "core_hysteresis", "core_turnover")


class Sought(NamedTuple):
    """What a fit may seek, and how it begins."""

    forms: Sequence[str] = FORMS  # that may be added to the plain one
    held: Collection[str] = ()  # names that keep their value
    guesses: Mapping[str, float] = {}  # of the losses, where they are known
    gap: tuple[str, ...] | None = None  # of the gap law, where records or inductances tell it; the turns are held then
    law: Law | None = None  # see `Form`
    total: float | None = None  # likewise
    given: Set[str] | None = None  # fields whose values are known; nothing: all that are held
    accuracy: Mapping[str, float] = {}  # relative standard errors of held fields


EVERYTHING = Sought()


def plain(known: Device, sought: Sought = EVERYTHING) -> Form:
    """Only what the valve without losses has; where the turns are held, the scale of the gap law takes their place.

    Losses that are held stay.
    """
    gap = (SCALES[GapLaw(value(known, "gap_law"))],) if sought.gap is None else sought.gap
    names = (*FITTED, *gap) if "coil_turns" in sought.held else FITTED
    kept = {name: guess for name, guess in sought.guesses.items() if name in sought.held}
    device = changed(with_losses(known), **kept) if kept else known
    free = tuple(name for name in names if name not in sought.held)
    return Form(device, free, law=sought.law, total=sought.total)


def larger(form: Form, sought: Sought) -> list[Form]:
    """The forms with one more of what may be added."""
    found = []
    for name in sought.forms:
        device, guesses = ADDED[name](form)
        guesses |= {n: guess for n, guess in sought.guesses.items() if n in guesses and guess > 0.0}
        if name not in form.added and guesses and next(iter(guesses)) not in sought.held:
            found.append(_more(form, name, changed(device, **guesses), [n for n in guesses if n not in sought.held]))
    return found


def eddy(form: Form) -> tuple[Device, dict[str, float]]:
    """Eddy currents."""
    return with_losses(form.known), {"core_eddy": EDDY / value(form.known, "coil_resistance")}


def hysteresis(form: Form) -> tuple[Device, dict[str, float]]:
    """Hysteresis, and the resistance, for (23) is wrong where the core stays magnetised."""
    known = with_losses(form.known)
    current = value(known, "core_saturation") * value(known, "core_reluctance") / value(known, "coil_turns") ** 2
    guesses = {"core_hysteresis": HYSTERESIS * current, "core_turnover": known.core_turnover, "coil_factor": 1.0}
    return known, guesses


def fringing(form: Form) -> tuple[Device, dict[str, float]]:
    """Fringes: of a linear gap law the pole area that they depend on, of one that has fringes their window."""
    known, law = form.known, value(form.known, "gap_law")
    window = {"gap_window": value(known, "gap_window")}
    if law != GapLaw.linear:
        return known, window if law == GapLaw.fringing else {}
    guesses = {"gap_area": 1.0 / (MU_0 * value(known, "gap_slope"))}
    if "gap_slope" in form.fitted:  # the turns are held: the area gives the scale, and the window the fringes
        guesses |= window
    return changed(known, gap_law=GapLaw.fringing), guesses


ADDED: dict[str, Callable[[Form], tuple[Device, dict[str, float]]]] = {
    "eddy": eddy,
    "hysteresis": hysteresis,
    "fringing": fringing,
}


def _more(form: Form, name: str, known: Device, names: Sequence[str]) -> Form:
    """The form with more parameters; those of a law that it no longer has are gone."""
    old = [n for n in form.fitted if not (n == "gap_slope" and "gap_area" in names)]
    return form._replace(known=known, fitted=(*old, *names), added=(*form.added, name))
