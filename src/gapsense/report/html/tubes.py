"""A result beside its baseline: tube of what is allowed, rows that leave it."""

from __future__ import annotations

from dataclasses import dataclass

from gapsense.cosim.result.compare import compare
from gapsense.cosim.result.difference import Difference
from gapsense.report.html.subject import Shown


@dataclass(frozen=True)
class Regression:
    """What comparing with the baseline showed; `note` says why nothing was compared, if nothing was."""

    tubes: tuple[Difference, ...] = ()
    problems: tuple[str, ...] = ()
    note: str = ""


def regression(shown: Shown) -> Regression:
    """Tubes of all signals that the baseline covers, the worst first."""
    if shown.scenario is None:
        return Regression(note=shown.note)
    baseline, result = shown.scenario.baseline, shown.result
    if not baseline.file.is_file():
        return Regression(note="The scenario has no baseline; `gapsense baseline --write` makes one.")
    if shown.is_changed:
        return Regression(note="Not compared: this run has other values or seeds than the scenario's baseline.")
    if result.interrupted or result.failure:
        return Regression(note="Not compared: the run did not reach its end.")
    found = compare(result, baseline)
    return Regression((*found.failing, *found.within), tuple(found.sentences))
