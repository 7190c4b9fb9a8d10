"""Figure 6 of [RTS]: how many samples make the state observable."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, stack
from gapsense.studies.observability_rts.samples import TOLERANCE
from gapsense.studies.observability_rts.text import Observed

NEVER = 7.0  # where "infinite" is drawn


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
