"""The studies of `BoundedUkf` in numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gapsense.studies.bounded_ukf import NOISE, UNSEEN, VOLTAGES, Errors

PARTS = ("closing", "opening")


def noise_text(found: Mapping[str, Errors], levels: Sequence[float], seeds: int) -> str:
    """Table behind Fig. 8: rms over the seeds."""
    lines = [
        f"RMS error of the position / um over {seeds} seeds, right parameters; noise sigma_n (37)",
        "[UKF] shows Fig. 8 as curves and prints no numbers. `-` is a filter that leaves the device.",
    ]
    for j, volts in enumerate(VOLTAGES):
        for p, part in enumerate(PARTS):
            lines += ["", _row(f"{volts:g} V, {part}", [f"{x:g}" for x in levels])]
            for name, e in found.items():
                lines.append(_row(name, [_micro(np.sqrt(np.mean(x**2))) for x in e.rmse[:, j, :, p]]))
    return "\n".join([*lines, "", *_missed(found, [f"{x:g}" for x in levels])])


def parameter_text(found: Mapping[str, Errors], errors: Sequence[float], resistance: float) -> str:
    """Table behind Fig. 9: the worst of the sign combinations, closing and opening separately."""
    wrong = f", resistance wrong by {100 * resistance:+g} %" if resistance else ""
    lines = [
        f"RMS error of the position / um, worst of the 2^6 signs of wrong parameters{wrong}; sigma_n = {NOISE:g}",
        "[UKF] shows Fig. 9 as curves; in words: accurate enough with errors around 1 %.",
    ]
    heads = [f"{100 * x:g} %" for x in errors]
    for j, volts in enumerate(VOLTAGES):
        for p, part in enumerate(PARTS):
            lines += ["", _row(f"{volts:g} V, {part}", heads)]
            lines += [_row(name, [_micro(x.max()) for x in e.rmse[:, j, :, p]]) for name, e in found.items()]
    return "\n".join([*lines, "", *_missed(found, heads)])


def resistance_text(found: Mapping[float, Mapping[str, Errors]], error: float) -> str:
    """What a wrong resistance does by itself, and together with all the other parameters."""
    lines = [
        "Resistance wrong (not in the paper): worst RMS error of the position / um of all voltages, closing / opening,",
        f"alone and with the worst signs of {100 * error:g} % in six parameters; then the landings missed with these",
        "",
        _row("", [f"{100 * r:+g} %" for r in found], 20),
    ]
    for name in next(iter(found.values())):
        rmse = [found[r][name].rmse for r in found]
        for title, k in (("alone", 0), ("with the others", 1)):
            cells = ["/".join(_micro(x[k, :, :, p].max()) for p in (0, 1)) for x in rmse]
            lines.append(_row(f"{name}, {title}", cells, 20))
        missed = [found[r][name].missed[1] for r in found]
        lines.append(_row(f"{name}, missed", [f"{m.sum()} of {m.size}" for m in missed], 20))
    return "\n".join(lines)


def unseen_text(found: Mapping[str, Errors]) -> str:
    """The check by cases that the tuning does not know."""
    lines = [
        f"Cases that no tuning was made with: {', '.join(f'{v:g}' for v in UNSEEN)} V, random errors of all parameters",
        "and the resistance within +-5 and +-10 %. RMS error of the position / um, closing / opening; landings missed",
        "",
        _row("", ["5 %", "10 %", "missed 5 %", "missed 10 %"], 16),
    ]
    for name, e in found.items():
        errors = ["/".join(_micro(np.sqrt(np.mean(x[..., p] ** 2))) for p in (0, 1)) for x in e.rmse]
        lines.append(_row(name, [*errors, *(f"{m.sum()} of {m.size}" for m in e.missed)], 16))
    return "\n".join(lines)


def _missed(found: Mapping[str, Errors], heads: Sequence[str]) -> list[str]:
    count = next(iter(found.values())).missed[0].size
    lines = [_row(f"landings missed, of {count}", heads)]
    return [*lines, *(_row(name, [str(m.sum()) for m in e.missed]) for name, e in found.items())]


def _micro(value: float) -> str:
    return f"{1e6 * value:.3g}" if value < 1e-2 else "-"


def _row(title: str, values: Sequence[str], width: int = 9) -> str:
    return f"  {title:38}" + "".join(f"{value:>{width}}" for value in values)
