"""Section IV-B of [RTS] in numbers: the samples needed along the reference cycle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.actuators.motion import MOVING
from gapsense.studies.observability_rts.samples import TOLERANCE, Vector, samples_needed
from gapsense.studies.smoother.nominal import nominal, own
from gapsense.studies.smoother.reference import reference_states
from gapsense.studies.soft_landing import Samples, sampled, soft_landing

OTHERS = (1e-9, 1e-10, 1e-11, 1e-13, 1e-14)  # tolerances to compare with


class Observed(NamedTuple):
    """Samples of a cycle and how many each needs, by tolerance."""

    samples: Samples
    needed: dict[float, Vector]  # (N,) each


def along_reference_cycle(tolerances: tuple[float, ...] = (TOLERANCE, *OTHERS)) -> Observed:
    """The count (51) for every sample of the cycle of Fig. 5, with the reduced model of Table II."""
    m = nominal()
    full = sampled(soft_landing(), m.T_s)
    x = reference_states(full, own(m), m)
    states = np.column_stack([x.position, x.position_prev, x.flux_linkage, x.current_error[0], x.force_error[0]])
    s = Samples(*(column[:-1] for column in full))  # the last sample is the first of the next period
    found = {t: samples_needed(states[:-1], s.current, s.voltage, s.mode, m, t) for t in tolerances}
    return Observed(s, found)


def text(observed: Observed, tolerance: float = TOLERANCE) -> str:
    """How often each count comes, at rest and in motion, and what depends on the tolerance."""
    s, needed = observed.samples, observed.needed[tolerance]
    is_moving = s.mode == MOVING
    never = ", ".join(f"{1e3 * t:g} ms" for t in s.time[np.isinf(needed)])
    lines = [
        "Samples that make the state observable (51); states and current scaled by their largest values in the cycle,",
        f"singular values above {tolerance:g} of the largest one count.",
        "",
        f"{'samples needed':16} {'at rest':>8} {'moving':>8}   [RTS]",
    ]
    published = {2.0: "at rest", 5.0: "moving", np.inf: "the first sample after each landing"}
    for count in np.unique(needed):
        shown = "never" if np.isinf(count) else f"{count:g}"
        rest, motion = ((needed == count) & ~is_moving).sum(), ((needed == count) & is_moving).sum()
        lines.append(f"{shown:16} {rest:8d} {motion:8d}   {published.get(count, 'in transitions')}")
    lines += ["", f"never observable: t = {never}", ""]
    for other, found in observed.needed.items():
        changed = int((found != needed).sum())
        lines.append(f"tolerance {other:g}: {changed} of {needed.size} counts differ, largest {_largest(found):g}")
    return "\n".join(lines)


def _largest(needed: Vector) -> float:
    return float(needed[np.isfinite(needed)].max())
