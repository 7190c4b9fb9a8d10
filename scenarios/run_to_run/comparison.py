"""The study: all chosen laws under all chosen conditions, the same actuators for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.problems import suggest
from gapsense.studies.runs import Facts, compute

from .conditions import CONDITIONS
from .cycles import NUMBERS, Outcome, of_task, read
from .loops import LAWS, chain_of

TUNED_ON = (1, 2, 3, 4)  # seeds that the laws were tuned with
SEED = 5  # one that nothing was tuned with
TOGETHER = 50  # actuators of a task
Row = tuple[str, str]  # condition and law


class Found(NamedTuple):
    """Outcomes by condition and law."""

    outcomes: Mapping[Row, Outcome]
    seed: int
    runs: int
    computed: int  # tasks computed now; the others were known


def chosen(names: str, known: Sequence[str], option: str) -> list[str]:
    """Names separated by commas; those that are not known are told."""
    found = [name.strip() for name in names.split(",") if name.strip()]
    if wrong := [name for name in found if name not in known]:
        raise ValueError(f"`{option} {names}`: there is no `{wrong[0]}`. {suggest(wrong[0], known)}")
    return list(dict.fromkeys(found))


def rows(conditions: Sequence[str], laws: Sequence[str]) -> list[Row]:
    """Condition and law of each row; no laws are those that a condition names itself."""
    return [(name, law) for name in conditions for law in laws or CONDITIONS[name].laws]


def compared(
    wanted: Sequence[Row],
    runs: int,
    cycles: int,
    seed: int = SEED,
    workers: int = 2,
    file: Path | None = None,
    progress: Progress | None = None,
) -> Found:
    """Outcomes of the rows, from `file` as far as they are known there.

    Parameters
    ----------
    wanted : sequence of (str, str)
        Condition and law of each row.
    runs : int
        Actuators.
    cycles : int
        Of each, where the condition says nothing else.
    seed : int
        Of the actuators and of the noise.
    workers : int
        Number of processes; results do not depend on it.
    file : Path, optional
        Takes what is computed, task by task; another call goes on from there.
    progress : callable, optional
        Called with tasks done and tasks in all.

    Returns
    -------
    Found
    """
    for name, law in wanted:
        chain_of(LAWS[law].kind, CONDITIONS[name])  # compiled before workers look for it
    parts = [(first, min(TOGETHER, runs - first)) for first in range(0, runs, TOGETHER)]
    tasks = [_task(row, cycles, first, size) for row in wanted for first, size in parts]
    found = compute(of_task, {"seed": seed}, tasks, workers, file, progress)
    groups = [found.results[k : k + len(parts)] for k in range(0, len(tasks), len(parts))]
    outcomes = {row: joined([read(part) for part in group]) for row, group in zip(wanted, groups)}
    return Found(outcomes, seed, runs, found.computed)


def _task(row: Row, cycles: int, first: int, runs: int) -> Facts:
    name, law = row
    return {"condition": name, "law": law, "cycles": CONDITIONS[name].cycles or cycles, "first": first, "runs": runs}


def joined(parts: Sequence[Outcome]) -> Outcome:
    """Outcomes of some actuators after those of others."""
    numbers = (np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in NUMBERS)
    return Outcome._make([*numbers, parts[0].motions])
