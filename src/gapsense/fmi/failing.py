"""How a call fails: the host is told once what happened and where.  A copy travels in every FMU."""

from __future__ import annotations

import ctypes
import math
import sys
import traceback
from collections.abc import Sequence
from typing import Any, NoReturn

from pythonfmu.enums import Fmi2Status

from .ports import Port
from .sentences import Refusal, say
from .values import ValuesError, wrong_value


def tell(slave: Any, error: BaseException, time: float | None, step: float | None) -> None:
    """Log an error of an instance, in a step with its time and size."""
    place = (slave.instance_name, slave.component.name)
    key, values = ("said", place) if time is None else ("said_in_step", (*place, time, step))
    inputs = dict(zip([port.name for port in slave.component.of("input")], slave.signals))
    slave.log(say(key, *values, cause(error, inputs)), Fmi2Status.error, "logStatusError")
    if sys.platform == "linux":
        return
    for held in (slave, type(slave), slave.log_queue):  # pythonfmu's own binary drops these once too often
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))


def cause(error: BaseException, inputs: dict[str, float]) -> str:
    """The sentence of a refusal; of any other error all that its author needs."""
    if isinstance(error, ValuesError):
        return say("correct_parameters", error)
    if isinstance(error, Refusal):
        return str(error)
    shown = ", ".join(f"{name} = {value!r}" for name, value in inputs.items())
    text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    return say("exception", type(error).__name__, error, shown or "none", text)


def refuse_non_finite(ports: Sequence[Port], values: Sequence[float], sentence: str) -> None:
    """Refuse values of signals that are infinite or NaN."""
    if names := [f"`{p.name}`" for p, v in zip(ports, values) if not math.isfinite(v)]:
        raise Refusal(say(sentence, ", ".join(names)))


def refuse_inputs(ports: Sequence[Port], values: Sequence[float]) -> NoReturn:
    """Refuse inputs that are not in their range."""
    found = [wrong_value(port, value) for port, value in zip(ports, values)]
    raise Refusal(say("correct_inputs", " ".join(filter(None, found))))
