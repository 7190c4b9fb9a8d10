"""The core of the reduced model, fitted, beside Table II of [RTS]."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from gapsense.report.table import table

from .core_fit import PUBLISHED, Fitted

REASON = """\
left: root mean square of the current that the fitted model does not explain, e_i of (47c); +-: standard errors.
The published core belongs to the gap reluctance of the paper's Fig. 4, a picture without numbers; beside our
formula for it the published core explains the currents less well than the fitted one."""


def cores(fits: Sequence[Fitted], is_reference: bool) -> list[Table | str]:
    """A table of the fits, and why they differ from the published values."""
    rows = []
    if is_reference:
        numbers = f"{PUBLISHED['R_c0']:.4g}", f"{1e3 * PUBLISHED['lam_sat']:.4g}", f"{1e3 * fits[0].published_rms:.3g}"
        rows.append(["published, Table II", *numbers])
    for title, fit, _ in fits:
        reluctance = f"{fit.reluctance:.4g} +- {fit.reluctance_std:.2g}"
        saturation = f"{1e3 * fit.saturation:.4g} +- {1e3 * fit.saturation_std:.2g}"
        rows.append([title, reluctance, saturation, f"{1e3 * fit.rms:.3g}", f"{fit.samples}"])
    made = table("", ["", "R_c0* [1/H]", "lambda_sat [mWb]", "left [mA]", "samples"], rows)
    return [made, REASON] if is_reference else [made]
