"""The study of `HybridEkf` in numbers."""

from __future__ import annotations

from collections.abc import Mapping

from gapsense.studies.hybrid_ekf.deviations import EDGE, LEVELS, SAMPLES, STEPS, T_S, Case, Deviations

UNITS = (("current / mA", 1e3), ("position / um", 1e6), ("velocity / (mm/s)", 1e3), ("mode", 1.0))
TITLES = {"robust": "robust", "paper": "paper", "none": "open loop"}


def text(found: Mapping[Case, Deviations], orientation: str, seeds: int) -> str:
    """RMSD over the seeds and the time after the edge, and the share of samples with the wrong mode."""
    lines = [
        f"RMSD over {seeds} seeds and {1e3 * T_S * (SAMPLES - EDGE):g} ms after the edge, {orientation} orientation",
        "[HEKF] shows Figs. 8-11 as curves and prints no numbers.",
    ]
    for step in STEPS:
        for mismatch in dict.fromkeys(case.mismatch for case in found):
            what = f"parameters wrong by up to {100 * mismatch:g} %" if mismatch else "right parameters"
            lines += ["", f"{step}, {what}; noise of the current / mA", _row("", [f"{1e3 * x:g}" for x in LEVELS])]
            some = {case.tuning: d for case, d in found.items() if case[:2] == (step, mismatch)}
            for k, (name, factor) in enumerate(UNITS):
                lines += [
                    _row(f"{name}, {TITLES[t]}", [f"{factor * x:.3g}" for x in d.total[:, k]]) for t, d in some.items()
                ]
            for t, d in some.items():
                lines.append(_row(f"wrong mode / %, {TITLES[t]}", [f"{100 * x:.3g}" for x in d.wrong.mean(axis=1)]))
    return "\n".join(lines)


def _row(title: str, values: list[str]) -> str:
    return f"  {title:30}" + "".join(f"{value:>9}" for value in values)
