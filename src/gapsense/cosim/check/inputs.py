"""Signals that inputs follow against the variables of these inputs and the time of the run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gapsense.cosim.check.values import limits, within
from gapsense.cosim.fmu.variables import NUMERIC, Variable
from gapsense.cosim.scenario.elements import Experiment
from gapsense.cosim.scenario.input_signals import SLACK, Played

WHOLE = ("Integer", "Boolean", "Enumeration")


def check_signal(played: Played, variable: Variable) -> Iterator[str]:
    """Problems of a signal with the input that is to follow it."""
    if variable.type == "String":
        yield "a text follows no signal. Give it a constant."
        return
    if played.unit and variable.unit and played.unit != variable.unit:
        yield f"the column is in `{played.unit}`, the input in `{variable.unit}`. Convert the column."
    if variable.type in WHOLE:
        yield from check_whole(played, variable)
    if variable.type in NUMERIC:
        for value in (float(played.values.min()), float(played.values.max())):
            if not within(value, variable):
                yield f"{value:.9g} found, {limits(variable)} expected. Correct the value."


def check_whole(played: Played, variable: Variable) -> Iterator[str]:
    """Problems of a signal for an input that takes whole numbers only."""
    if played.interpolation != "hold":
        yield f'an input of type {variable.type} takes no values in between. Write `interpolation = "hold"`.'
    items = [0, 1] if variable.type == "Boolean" else [*variable.items.values()]
    fits = np.isin(played.values, items) if items else played.values == np.rint(played.values)
    for value in played.values[~fits][:1]:
        yield f"{value:.9g} found, a value of type {variable.type} is expected. Correct it."


def check_span(played: Played, experiment: Experiment) -> Iterator[str]:
    """Problem of a signal that does not cover the run."""
    begin, end, slack = float(played.times[0]), float(played.times[-1]), SLACK * experiment.base_step
    if begin > experiment.start + slack or end < experiment.time(experiment.count) - slack:
        span = f"{experiment.start:.9g} s to {experiment.stop:.9g} s"
        yield f"it has values from {begin:.9g} s to {end:.9g} s, the run is from {span}. Add what is missing."
