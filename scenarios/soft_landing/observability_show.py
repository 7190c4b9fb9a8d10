"""Section IV-B and Figure 6 of [RTS]: how many samples make the state observable."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.actuators.motion import MOVING
from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, stack
from gapsense.report.table import table

from .observability import TOLERANCE, Observed

NEVER = 7.0  # where "infinite" is drawn
PUBLISHED = {2.0: "at rest", 5.0: "moving", np.inf: "the first sample after each landing"}


def counts(observed: Observed, tolerance: float = TOLERANCE) -> list[Table | str]:
    """How often each count comes, at rest and in motion, and what depends on the tolerance."""
    s, needed = observed.samples, observed.needed[tolerance]
    is_moving = s.mode == MOVING
    rows = []
    for count in np.unique(needed):
        times = (str(int(((needed == count) & chosen).sum())) for chosen in (~is_moving, is_moving))
        shown = "never" if np.isinf(count) else f"{count:g}"
        rows.append([shown, PUBLISHED.get(count, "in transitions"), *times])
    title = (
        "Samples that make the state observable (51); states and current scaled by their largest values in the cycle,\n"
        f"singular values above {tolerance:g} of the largest one count."
    )
    never = ", ".join(f"{1e3 * t:g} ms" for t in s.time[np.isinf(needed)])
    others = (
        f"tolerance {t:g}: {np.sum(other != needed)} of {needed.size} counts differ, "
        f"largest {other[np.isfinite(other)].max():g}"
        for t, other in observed.needed.items()
    )
    found = table(title, ["samples needed", "[RTS]", "at rest", "moving"], rows, texts=2)
    return [found, f"never observable: t = {never}\n", *others]


def figure(observed: Observed, tolerance: float = TOLERANCE) -> Figure:
    """Position and count over the reference cycle."""
    s, needed = observed.samples, observed.needed[tolerance]
    drawn, (position, count) = stack(
        "Observability along the reference cycle, as in Fig. 6 of [RTS]", ["position / mm", "samples needed"], [1, 2]
    )
    drawn.set_size_inches(9.0, 5.0)
    line(position, s.time, 1e3 * s.position, TRUE)
    is_never = np.isinf(needed)
    count.plot(1e3 * s.time[~is_never], needed[~is_never], ".", color=FIRST, markersize=4, label="observable")
    count.plot(1e3 * s.time[is_never], np.full(is_never.sum(), NEVER), "x", color=SECOND, label="never")
    count.set_yticks([1, 2, 3, 4, 5, NEVER], ["1", "2", "3", "4", "5", "never"])
    count.set_ylim(0.5, NEVER + 0.5)
    legend(count)
    return drawn
