"""What the tests of the controller have in common."""

from __future__ import annotations

from typing import Any

from gapsense.control import run_to_run
from gapsense.control.records import Inputs, Parameters
from gapsense.fmi.components import kernel_parameters, own


def parameters(**changed: Any) -> Parameters:
    """As shipped, with some fields changed."""
    par: Parameters = kernel_parameters(own("run_to_run"), {})
    return par._replace(**changed)


def inputs(**given: float) -> Inputs:
    """Nothing is known but what is given; enabled."""
    return Inputs(*[0.0] * len(Inputs._fields))._replace(**{"enable": 1.0, **given})


def commanded(commands: list[float], par: Parameters, **given: float) -> list[tuple[Any, Any]]:
    """State and outputs of each sample of a controller whose inputs stay but for the command."""
    state, outputs = run_to_run.initial(inputs(**given), par)
    rows = [(state, outputs)]
    for k, command in enumerate(commands, 1):
        state, outputs = run_to_run.step(state, inputs(time=k * par.sample_time, command=command, **given), par)
        rows.append((state, outputs))
    return rows
