"""What `gapsense study reduced-fit` prints: the core of the reduced model, fitted, beside Table II of [RTS]."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense.actuators.motion import MOVING
from gapsense.actuators.parameters import RTS_VALVE
from gapsense.estimators.reduced_model import normalised
from gapsense.files import read_columns
from gapsense.studies.reduced_fit.fit import CoreFit, current_rms, fit_core, integrated_flux
from gapsense.studies.soft_landing.cycle import sampled, soft_landing

PUBLISHED = {"R_c0": 1.75, "lam_sat": 0.0238}  # Table II
COLUMNS = ("time", "voltage", "current", "position")
SIMPLER = {
    "complete model, as in the paper": {},
    "  its samples in motion only": {},
    "without hysteresis": {"hysteresis": 0.0},
    "without eddy currents": {"eddy_currents": 0.0},
    "without both": {"hysteresis": 0.0, "eddy_currents": 0.0},
}


class Fitted(NamedTuple):
    """One fit, and what the published core leaves of the same currents."""

    title: str
    fit: CoreFit
    published_rms: float


def of_reference_cycle(par: Any) -> list[Fitted]:
    """Fits to the soft-landing cycle (Fig. 5) of the complete model, and of simpler ones, with their flux linkage."""
    m, found = normalised(par), []
    for title, changes in SIMPLER.items():
        s = sampled(soft_landing(RTS_VALVE._replace(**changes)), par.sample_time)
        chosen = s.mode == MOVING if "motion" in title else np.full(s.mode.shape, True)
        given = s.position[chosen], s.flux_linkage[chosen], s.current[chosen]
        found.append(Fitted(title, fit_core(*given, m), current_rms(*given, m._replace(**PUBLISHED))))
    return found


def of_record(file: Path, par: Any, held: bool) -> list[Fitted]:
    """Fit to a measured record, with the flux linkage from voltage and current."""
    columns = read_columns(file)
    missing = [name for name in COLUMNS if name not in columns]
    if missing:
        raise ValueError(f"{file}: column {', '.join(missing)} is missing; it has {', '.join(columns)}. Add it.")
    time, voltage, current, position = (columns[name] for name in COLUMNS)
    late = np.flatnonzero(~(np.diff(time) > 0.0))
    if late.size:
        raise ValueError(f"{file}, line {late[0] + 3}: `time` does not rise. Correct the file.")
    m = normalised(par)
    given = position, integrated_flux(time, voltage, current, m.R, held), current
    return [Fitted(file.name, fit_core(*given, m), current_rms(*given, m._replace(**PUBLISHED)))]


def text(fits: Sequence[Fitted], is_reference: bool) -> str:
    """A table of the fits, and why they differ from the published values."""
    head = f"{'':34} {'R_c0* [1/H]':>18} {'lambda_sat [mWb]':>18} {'left [mA]':>10}   samples"
    rows = [head]
    if is_reference:
        rows.append(f"{'published, Table II':34} {1.75:18.4g} {23.8:18.4g} {1e3 * fits[0].published_rms:10.3g}")
    for title, fit, _ in fits:
        reluctance = f"{fit.reluctance:.4g} +- {fit.reluctance_std:.2g}"
        saturation = f"{1e3 * fit.saturation:.4g} +- {1e3 * fit.saturation_std:.2g}"
        rows.append(f"{title:34} {reluctance:>18} {saturation:>18} {1e3 * fit.rms:10.3g}   {fit.samples}")
    return "\n".join([*rows, "", *(REASON if is_reference else ())])


REASON = (
    "left: root mean square of the current that the fitted model does not explain, e_i of (47c); +-: standard errors.",
    "The published core belongs to the gap reluctance of the paper's Fig. 4, a picture without numbers; beside our",
    "formula for it the published core explains the currents less well than the fitted one.",
)
