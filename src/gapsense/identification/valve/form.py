"""What is sought of a valve and what is held: its parameters by name, the plain form, and what may be added to it.

Added may be eddy currents, hysteresis, fringes of the gap, and a low-pass of the current alone.
First guesses are in proportion to what is known.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence, Set
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from gapsense.actuators import solenoid_valve
from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.gap_law.laws import Law, rows
from gapsense.identification.measurements.record import Vector
from gapsense.identification.options import FORMS
from gapsense.identification.valve import lossy_valve

Device: TypeAlias = "solenoid_valve.Parameters | lossy_valve.Parameters"
TURNOVER = 0.07  # flux linkage in which hysteresis turns over, of that of saturation: as in the actuator of [RTS]


def value_of(par: Device, name: str) -> Any:
    """A parameter."""
    return getattr(par if name in par._fields else valve(par), name)


def replace_values(par: Device, **values: Any) -> Device:
    """The device with other values."""
    own = {name: values.pop(name) for name in [*values] if name in par._fields}
    if isinstance(par, lossy_valve.Parameters):
        return par._replace(valve=par.valve._replace(**values), **own)
    return par._replace(**own, **values)


def valve(par: Device) -> solenoid_valve.Parameters:
    """Without losses."""
    return par.valve if isinstance(par, lossy_valve.Parameters) else par


def with_losses(par: Device) -> lossy_valve.Parameters:
    """With parameters of losses, which are 0 at first."""
    if isinstance(par, lossy_valve.Parameters):
        return par
    return lossy_valve.Parameters(
        valve=par, core_eddy=0.0, core_hysteresis=0.0, core_turnover=TURNOVER * par.core_saturation, coil_factor=1.0
    )


FITTED = ("coil_turns", "core_reluctance", "core_saturation", "spring_stiffness", "damping", "mover_mass")
BOUND = 5.0  # the result lies within this factor of the first guess
WIDE = 300.0  # or within this one, if hardly anything is known of it
SHAPE = "gap_shape_"  # and a number, of the gap law
TABLE_FIELDS = ("gap_file_reluctance", "gap_file_slope")
LOST = 1.0  # relative standard error
FACTOR = "coil_factor"  # no parameter of the device, but one on the resistances of (23)
FILTER = "current_filter"  # likewise, but the time constant of what the current was measured through
GUESSED = ("core_eddy", "core_hysteresis", "core_turnover", "gap_window", "gap_area", FILTER)
LIMITS = {**dict.fromkeys(GUESSED, WIDE), "core_turnover": 10.0}  # below, hysteresis is friction; beyond, a reluctance
HIGHEST = {"core_saturation": 100.0}  # upwards: of a core that hardly saturates no guess is near


class Form(NamedTuple):
    """The names that are fitted, from their values in `known` on; all else is held at its value there."""

    known: Device
    fitted: tuple[str, ...] = FITTED
    added: tuple[str, ...] = ()  # to the plain form, see `forms`
    law: Law | None = None  # of the gap, where its shape is fitted or the core leaves it its offset
    total: float | None = None  # reluctance of core and gap when it is closed, where that is known [1/H]

    def at(self, ratios: Vector) -> Device:
        """The fitted parameters multiplied by e^ratio, so that they stay positive; the others as they are known."""
        factors = zip(self.fitted, np.exp(ratios).tolist())
        made = replace_values(self.known, **{n: x for name, f in factors for n, x in multiply(self.known, name, f)})
        if self.law is None:
            return made
        columns = rows(self.law_at(ratios), float(value_of(made, "stop_upper")))
        return replace_values(made, **{f"gap_file_{name}": column.tolist() for name, column in columns.items()})

    def law_at(self, ratios: Vector) -> Law:
        """The gap law with its fitted numbers; what is known without a gap is that of core and gap together."""
        law = self.law or Law("none", 0.0, ())
        at = dict(zip(self.fitted, np.exp(ratios).tolist()))
        offset, *numbers = (at.get(name, 1.0) * x for name, x in zip(shape(law), (law.offset, *law.numbers)))
        if self.total is not None:
            offset = self.total - value_of(self.known, "core_reluctance") * at.get("core_reluctance", 1.0)
        return law._replace(offset=offset, numbers=tuple(numbers))

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Smallest and largest ratios."""
        factors = {name: LIMITS.get(name, BOUND) for name in self.fitted}
        return -np.log([*factors.values()]), np.log([HIGHEST.get(name, factor) for name, factor in factors.items()])

    def factor(self, ratios: Vector) -> float:
        """On the resistances."""
        return float(np.exp(ratios[self.fitted.index(FACTOR)])) if FACTOR in self.fitted else 1.0

    def reset(self, ratios: Vector, parameter: str) -> Vector:
        """Reset one parameter to its first guess."""
        return np.where([name == parameter for name in self.fitted], 0.0, ratios)

    @property
    def start(self) -> Vector:
        """Ratios of the first guess."""
        return np.zeros(len(self.fitted))

    def without_lost(self, ratios: Vector, errors: Vector) -> tuple[Form, Vector]:
        """The form that holds what was not identified, and its ratios: at the first guess what has no effect at all.

        `errors` are the relative standard errors of the fitted parameters.  What was added to the plain form is lost if
        they are larger than the value; the parameters of the plain form are kept, and called poor.
        """
        names = [name for name in self.fitted if name != FACTOR]
        none = {name for name, error in zip(names, errors) if np.isinf(error)}
        lost = none | {name for name, error in zip(names, errors) if name in GUESSED and not error < LOST}
        free = [name not in lost for name in self.fitted]
        now = self.at(np.where([name in none for name in self.fitted], 0.0, ratios))
        known = replace_values(self.known, **{name: value_of(now, name) for name in lost})
        fitted = tuple(name for name in self.fitted if name not in lost)
        return self._replace(known=known, fitted=fitted), ratios[free]


def shape(law: Law) -> tuple[str, ...]:
    """Names of the numbers of a gap law, its offset first, which are no parameters of the device."""
    return tuple(f"{SHAPE}{k}" for k in range(len(law.numbers) + 1))


def multiply(par: Device, name: str, factor: float) -> list[tuple[str, Any]]:
    """A parameter times a factor; of the table of a gap law, both columns."""
    if name.startswith(SHAPE):
        return []
    if name != TABLE_FIELDS[0]:
        return [(name, value_of(par, name) * factor)]
    return [(column, [factor * x for x in value_of(par, column)]) for column in TABLE_FIELDS]


EDDY = 0.01  # R g_e of a first guess
HYSTERESIS = 0.05  # I_h of it, in currents lambda_sat R_iron0 / N^2
SCALES = {GapLaw.linear: "gap_slope", GapLaw.fringing: "gap_area", GapLaw.table: "gap_file_reluctance"}
LOSSES = ("core_eddy", "core_hysteresis", "core_turnover")
MAGNETISED = "magnetised"  # of a form with hysteresis


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
    gap = (SCALES[GapLaw(value_of(known, "gap_law"))],) if sought.gap is None else sought.gap
    names = (*FITTED, *gap) if "coil_turns" in sought.held else FITTED
    kept = {name: guess for name, guess in sought.guesses.items() if name in sought.held}
    device = replace_values(with_losses(known), **kept) if kept else known
    free = tuple(name for name in names if name not in sought.held)
    return Form(device, free, law=sought.law, total=sought.total)


def larger(form: Form, sought: Sought) -> list[Form]:
    """The forms with one more of what may be added."""
    found = []
    for name in sought.forms:
        device, guesses = ADDED[name](form)
        guesses |= {n: guess for n, guess in sought.guesses.items() if n in guesses and guess > 0.0}
        if name not in form.added and guesses and next(iter(guesses)) not in sought.held:
            more = [n for n in guesses if n not in sought.held]
            old = [n for n in form.fitted if not (n == "gap_slope" and "gap_area" in more)]  # of a law that is gone
            known, added = replace_values(device, **guesses), (*form.added, name)
            made = form._replace(known=known, fitted=(*old, *more), added=added)
            found += [made, _toggle_magnetised(made)] if "hysteresis" in added else [made]
    return found


def _toggle_magnetised(form: Form) -> Form:
    """Toggle whether the core keeps, at the start, the flux of an operation before the record."""
    others, was = tuple(name for name in form.added if name != MAGNETISED), MAGNETISED in form.added
    known = replace_values(form.known, core_remanence=0.0 if was else 1.0)
    return form._replace(known=known, added=others if was else (*others, MAGNETISED))


def with_hysteresis(form: Form) -> tuple[Device, dict[str, float]]:
    """Hysteresis, and the resistance, for (23) is wrong where the core stays magnetised."""
    known = with_losses(form.known)
    current = (
        value_of(known, "core_saturation") * value_of(known, "core_reluctance") / value_of(known, "coil_turns") ** 2
    )
    guesses = {"core_hysteresis": HYSTERESIS * current, "core_turnover": known.core_turnover, "coil_factor": 1.0}
    return known, guesses


def with_fringing(form: Form) -> tuple[Device, dict[str, float]]:
    """Fringes: of a linear gap law the pole area that they depend on, of one that has fringes their window."""
    known, law = form.known, value_of(form.known, "gap_law")
    window = {"gap_window": value_of(known, "gap_window")}
    if law != GapLaw.linear:
        return known, window if law == GapLaw.fringing else {}
    guesses = {"gap_area": 1.0 / (MU_0 * value_of(known, "gap_slope"))}
    if "gap_slope" in form.fitted:  # the turns are held: the area gives the scale, and the window the fringes
        guesses |= window
    return replace_values(known, gap_law=GapLaw.fringing), guesses


ADDED: dict[str, Callable[[Form], tuple[Device, dict[str, float]]]] = {
    "eddy": lambda form: (with_losses(form.known), {"core_eddy": EDDY / value_of(form.known, "coil_resistance")}),
    "hysteresis": with_hysteresis,
    "fringing": with_fringing,
    "filter": lambda form: (with_losses(form.known), {FILTER: 1e-5}),
}


VALVE: Parameters = kernel_parameters(own("solenoid_valve"), {})  # [SEMERA] Table I
MECHANICS = ("stop_lower", "stop_upper", "spring_rest")
LAWS = {GapLaw.linear: ("gap_slope",), GapLaw.fringing: ("gap_area", "gap_window"), GapLaw.table: (TABLE_FIELDS[0],)}
BOUNCE = "stop_restitution"  # need not be given: what is left of the current shows a bounce


def find_needed(form: Form) -> tuple[str, ...]:
    """Find the fields that are held, and that no record tells."""
    law = LAWS[GapLaw(value_of(form.known, "gap_law"))] if form.law is None else ()
    return tuple(name for name in (*MECHANICS, *law, *FITTED) if name not in form.fitted)


def missing(form: Form, given: Collection[str]) -> list[str]:
    """Those of them that were not given."""
    return [name for name in find_needed(form) if name not in given]


def guess_similar(par: Parameters, given: Collection[str]) -> Parameters:
    """The given values, and all others such that voltage and current are about those of the valve of [SEMERA] Table I.

    Voltage and current stay the same if lengths are multiplied by s, and mass, stiffness and damping by 1/s^2. They
    also stay if reluctances per gap are multiplied by k, the core by k s, and the turns by its square root.
    """
    s = (par.stop_upper - par.stop_lower) / (VALVE.stop_upper - VALVE.stop_lower)
    rest = par.spring_rest if "spring_rest" in given else VALVE.spring_rest * s
    turns = par.coil_turns if "coil_turns" in given else VALVE.coil_turns * np.sqrt(s * _slope(par) / VALVE.gap_slope)
    preload = VALVE.spring_rest * s / rest if rest > par.stop_upper else 1.0
    guesses = {
        "spring_rest": rest,
        "initial_position": float(np.clip(rest, par.stop_lower, par.stop_upper)),
        "coil_turns": float(turns),
        "core_reluctance": VALVE.core_reluctance * float(turns / VALVE.coil_turns) ** 2,
        "spring_stiffness": VALVE.spring_stiffness * preload / s**2,
        "damping": VALVE.damping / s**2,
        "mover_mass": VALVE.mover_mass / s**2,
    }
    return par._replace(**{name: guess for name, guess in guesses.items() if name not in given})


def _slope(par: Parameters) -> float:
    """Of the gap reluctance, mean over the stroke [1/(H m)]."""
    if par.gap_law == GapLaw.linear:
        return float(par.gap_slope)
    ends = np.array([par.stop_lower, par.stop_upper])
    if par.gap_law == GapLaw.table:
        R = np.interp(ends, par.gap_file_gap, par.gap_file_reluctance)
    else:
        r0, k = 1.0 / (MU_0 * par.gap_area), par.gap_area**-0.5
        R = np.array([fringing(h, r0, k, 2.0 * par.gap_window)[0] for h in ends.tolist()])
    return float(np.diff(R)[0] / np.diff(ends)[0])
