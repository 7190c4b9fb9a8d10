"""The study in tables: impact speeds over cycles, and what became of them under all conditions."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report.table import table

from . import figures as drawn
from .comparison import TUNED_ON, Found
from .conditions import CONDITIONS
from .cycles import Outcome
from .loops import LAWS
from .measures import (
    FOLLOWED,
    HARD,
    HELD,
    LAST,
    LEARNT,
    LEVELS,
    OPERATIONS,
    ORDINARY,
    SHOWN,
    SOFT,
    WARNINGS,
    Floats,
    impact_energy,
    missed,
    noticed,
    quantile,
    soft_speeds,
    verdicts,
    warned,
)

BELOW = 0.2  # impact speed whose share is told [m/s]
ENERGIES = ("energy / mJ", "impact / uJ")


def tables(found: Found) -> list[Table | str]:
    """Speeds over the cycles of each condition, all conditions, and what must hold."""
    tuned = ", one that the laws were tuned on" if found.seed in TUNED_ON else ", used for no tuning"
    head = (
        f"{found.runs} actuators of seed {found.seed}{tuned}. Hardest impact of an operation / (m/s), by the plant:"
        f" {' / '.join(LEVELS)}\nof the actuators; what did not arrive counts as 2. Cycle 0 is an ordinary one."
    )
    names = dict.fromkeys(name for name, _ in found.outcomes)
    return [
        head,
        *(part for name in names for part in over_cycles(found, name)),
        summary(found),
        *soft(found),
        *said(found),
        *demands(found),
    ]


def over_cycles(found: Found, name: str) -> list[Table]:
    """Impact speeds of a condition."""
    rows = {law: outcome for (condition, law), outcome in found.outcomes.items() if condition == name}
    count = len(next(iter(rows.values())).speeds)
    shown = [k for k in dict.fromkeys((*SHOWN, count - 1)) if k < count]
    heads = ["law", *(f"cycle {k}" for k in shown), f"last {LAST}"]
    made = []
    for k, operation in enumerate(OPERATIONS):
        cells = (
            [LAWS[law].title, *(spread(o.speeds[c : c + 1])[k] for c in shown), spread(o.speeds[-LAST:])[k]]
            for law, o in rows.items()
        )
        made.append(table(f"{name}: {CONDITIONS[name].title}, {operation}", heads, cells))
    return made


def summary(found: Found) -> Table:
    """All conditions at their end."""
    title = (
        f"The last {LAST} cycles of each condition; not arrived: from cycle {LEARNT} on, closing + opening; ordinary:"
        f" cycles of all\nactuators in which the controller fell back; warned: {', '.join(WARNINGS)}"
    )
    below = f"below {BELOW:g} m/s / %"
    heads = ("", *OPERATIONS, below, "not arrived", "of each", "ordinary", "warned / %", *ENERGIES)
    return table(title, heads, (_summed(name, law, o) for (name, law), o in found.outcomes.items()))


def _summed(name: str, law: str, outcome: Outcome) -> list[str]:
    (closing, opening), count = missed(outcome)
    last = outcome.speeds[-LAST:]
    shares = " / ".join(f"{x:.0f}" for x in 100.0 * np.mean(last < BELOW, axis=(0, 2)))
    energy, impact = 1e3 * outcome.energy[-LAST:].mean(), 1e6 * np.median(impact_energy(outcome)[-LAST:])
    counts = (f"{closing} + {opening}", f"{count}", f"{outcome.is_ordinary.sum():g}")
    warnings = " ".join(f"{100.0 * share:.0f}" for share in warned(outcome))
    return [f"{name}, {law}", *spread(last), shares, *counts, warnings, f"{energy:.3g}", f"{impact:.3g}"]


def soft(found: Found) -> list[Table]:
    """Impacts of the operations that the controller wanted soft, which the ordinary ones among them hide."""
    title = f"Operations that were to be soft, from cycle {FOLLOWED} on"
    heads = ("", "soft / %", *OPERATIONS, f"beyond {HELD:g} m/s")
    rows = []
    for name, outcome in known(found).items():
        own = soft_speeds(outcome)
        share = 100.0 * sum(map(len, own)) / max(outcome.speeds[FOLLOWED:].size, 1)
        levels = (" ".join(short(np.quantile(x, level)) for level in LEVELS.values()) if len(x) else "" for x in own)
        rows.append([name, f"{share:.1f}", *levels, str(sum(int(np.sum(x > HELD)) for x in own))])
    return [table(title, heads, rows)] if rows else []


def known(found: Found) -> dict[str, Outcome]:
    """The rows of laws that say in which state they are."""
    return {f"{name}, {law}": o for (name, law), o in found.outcomes.items() if np.any(o.states)}


def said(found: Found) -> list[Table]:
    """What the controller has noticed under each condition."""
    title = (
        f"What the loop noticed, from cycle {LEARNT} on, of operations that were to be soft. Told: by a warning or an"
        f" ordinary operation.\nWarned wrongly: of a landing below {SOFT:g} m/s. Twice: harder than {ORDINARY:g} times"
        " ordinary switching, and so the one before of its kind"
    )
    heads = (
        "",
        f"above {HARD:g} m/s",
        "told in the next",
        "in the next of its kind",
        "soft",
        "warned wrongly",
        "twice",
    )
    rows = [[name, *(str(count) for count in noticed(outcome))] for name, outcome in known(found).items()]
    return [table(title, heads, rows)] if rows else []


def spread(speeds: Floats) -> list[str]:
    """Median, 90 %, 99 % and worst of closings, and of openings."""
    rows = np.transpose([quantile(speeds, level) for level in LEVELS])
    return [" ".join(short(x) for x in row) for row in rows]


def short(speed: float) -> str:
    """`.123`, `1.23`."""
    return f"{speed:.3f}".removeprefix("0") if speed < 1.0 else f"{speed:.2f}"


def demands(found: Found) -> list[Table]:
    """What must hold, and whether it does."""
    made = verdicts(found.outcomes)
    rows = (
        (v.sentence, *(f"{x:.3g}" for x in v.found), f"{v.bound:g}", "holds" if v.holds else "misses") for v in made
    )
    return [table("What must hold", ("", *OPERATIONS, "at most", ""), rows)] if made else []


def figures(found: Found) -> dict[str, Figure]:
    """By the end of their file's name."""
    made = {"conditions": drawn.over_conditions(found)}
    for name in dict.fromkeys(name for name, _ in found.outcomes):
        of = {law: outcome for (condition, law), outcome in found.outcomes.items() if condition == name}
        made[f"{name}_speeds"] = drawn.speeds(CONDITIONS[name].title, of)
        made[f"{name}_energy"] = drawn.energies(CONDITIONS[name].title, of)
        made[f"{name}_motions"] = drawn.motions(CONDITIONS[name].title, of)
    return made
