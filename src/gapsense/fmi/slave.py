"""The shell of every FMU: FMI 2.0 co-simulation callbacks around a kernel.  A copy travels in each FMU.

What pythonfmu 0.7.0 leaves to us: an exception is logged with its context before it fails the call, non-finite numbers,
parameters out of range and steps that do not fit are refused, and state saving covers everything.
"""

from __future__ import annotations

import ctypes
import json
import math
import sys
import traceback
from functools import partialmethod
from typing import Any, NoReturn

from pythonfmu import Boolean, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real, String
from pythonfmu.enums import Fmi2Status

from .life import phases_of
from .ports import Component, Port
from .sentences import say
from .values import ValuesError, fields, problems

KINDS = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "String": String}
TOLERANCE = 1e-9  # relative, on times: hosts round
SAVED = ("build", "signals", "parameters", "par", "state", "start_time", "period", "elapsed", "phase")
# The script's globals, held because pythonfmu's wrapper drops one reference too many at each instantiation.
HELD: list[dict[str, Any]] = []


class Refusal(ValueError):
    """The host or the user asked for something that cannot be done; the message says what to do."""


class Slave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """Base of the generated class, which sets `component`, `kernel` and `build` (a hash of interface and sources)."""

    component: Component
    kernel: Any
    build: str

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        while "visible" in kwargs and self.resources in sys.path:  # the wrapper, unlike the builder, never removes it
            sys.path.remove(self.resources)  # all imports are done
        component = self.component
        self.modelName, self.description = component.name, component.description
        self.inputs = len(component.of("input"))
        signals = self.inputs + len(component.of("output"))
        self.all_inputs, self.all_outputs = [*range(self.inputs)], [*range(self.inputs, signals)]  # value references
        self.signals: list[float] = [p.start or 0.0 for p in component.ports[:signals]]  # inputs, then outputs
        self.parameters: list[Any] = [p.start for p in component.ports[signals:]]
        self.clock = sum(name in self.kernel.INPUTS for name in ("time", "dt"))  # how many of them the kernel takes
        self.period = 0.0  # of the samples; 0 for a component that is not sampled
        self.par: tuple[Any, ...] = ()
        self.constants: tuple[Any, ...] = ()  # what a step needs of the parameters
        self.state: tuple[Any, ...] = ()
        self.start_time = 0.0
        self.elapsed = 0.0  # since the last sample
        self.phase = "instantiated"
        for port in component.ports:
            self.register_variable(_variable(port), nested=False)

    # --- getting and setting: value reference = position in the port table ---

    def get_real(self, refs: list[int]) -> list[float]:
        signals = self.signals
        try:
            if self.phase == "initializing" and any(self.inputs <= r < len(signals) for r in refs):
                self._initialize()
            return signals[self.inputs :] if refs == self.all_outputs else [signals[r] for r in refs]
        except IndexError:
            return [float(value) for value in self._get("Real", refs)]
        except BaseException as error:
            self._fail(error)

    def set_real(self, refs: list[int], values: list[float]) -> None:
        signals, inputs = self.signals, self.inputs
        if refs == self.all_inputs:
            signals[:inputs] = values
            return
        for r, value in zip(refs, values):
            if 0 <= r < inputs:
                signals[r] = value
            else:
                self._set("Real", [r], [value])

    def _get(self, kind: str, refs: list[int]) -> list[Any]:
        try:
            for ref in refs:
                self._port(ref, kind)
            values = [*self.signals, *self.parameters]
            return [values[ref] for ref in refs]
        except BaseException as error:
            self._fail(error)

    def _port(self, ref: int, kind: str) -> Port:
        ports = self.component.ports
        if not 0 <= ref < len(ports) or ports[ref].kind != kind:
            raise Refusal(say("no_variable", kind, ref))
        return ports[ref]

    def _set(self, kind: str, refs: list[int], values: list[Any]) -> None:
        try:
            for ref, value in zip(refs, values):
                self._set_parameter(self._port(ref, kind), ref, value)
        except BaseException as error:
            self._fail(error)

    get_integer, set_integer = partialmethod(_get, "Integer"), partialmethod(_set, "Integer")
    get_boolean, set_boolean = partialmethod(_get, "Boolean"), partialmethod(_set, "Boolean")
    get_string, set_string = partialmethod(_get, "String"), partialmethod(_set, "String")

    def _set_parameter(self, port: Port, ref: int, value: Any) -> None:
        if port.causality == "output":
            raise Refusal(say("is_output", port.name))
        is_running = self.phase in ("running", "terminated")
        if is_running and port.variability != "tunable":
            raise Refusal(say("is_fixed", port.name))
        self.parameters[ref - len(self.signals)] = value
        if is_running:
            if found := problems(self.component, self._given()):
                raise ValuesError(found)
            par = list(self.par)
            par[self.kernel.PARAMETERS.index(port.field)] = float(value)
            self._take(tuple(par))

    # --- life ---

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        self.start_time = start_time

    def enter_initialization_mode(self) -> None:
        self.phase = "initializing"

    def exit_initialization_mode(self) -> None:
        try:
            self._initialize()
            self.phase = "running"
        except BaseException as error:
            self._fail(error)

    def terminate(self) -> None:
        self.phase = "terminated"

    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            if self.phase != "running":
                raise Refusal(say("wrong_phase", "fmi2DoStep", self.phase, phases_of("fmi2DoStep")))
            end = current_time + step_size
            if not step_size > 0.0 or end - end != 0.0:  # infinite or NaN
                raise Refusal(say("step_size", repr(step_size)))
            if not self.period:
                self._advance(end, step_size)
            elif step_size == self.period and not self.elapsed:
                self._advance(end, self.period)
            else:
                for k in range(self._samples_due(end, step_size) - 1, -1, -1):
                    self._advance(end - k * self.period, self.period)
            return True
        except BaseException as error:
            self._fail(error, current_time, step_size)

    def _initialize(self) -> None:
        given = self._given()
        values = fields(self.component, given, self.resources or ".")
        self._take(tuple(values[name] for name in self.kernel.PARAMETERS))
        self.period, self.elapsed = given.get("sample_time", 0.0), 0.0
        self.state, outputs = self.kernel.initial(self._inputs(self.start_time, 0.0), self.par)
        self._publish(outputs)

    def _take(self, par: tuple[Any, ...]) -> None:
        self.par, self.constants = par, self.kernel.constants(par)

    def _samples_due(self, end: float, step: float) -> int:
        """How many samples fall due in this step; inputs are held within it."""
        period, tolerance = self.period, TOLERANCE + 2.0 * math.ulp(end) / step  # a step may be a difference of times
        ratio = step / period if step >= period else period / step
        if abs(ratio - round(ratio)) > tolerance * ratio:
            raise Refusal(say("no_fraction", step, period))
        elapsed = self.elapsed + step
        count = int(elapsed / period * (1.0 + tolerance))
        if count and abs(elapsed - count * period) > tolerance * elapsed:
            raise Refusal(say("past_sample", step, elapsed - count * period, period))
        self.elapsed = 0.0 if count else elapsed
        return count

    def _advance(self, time: float, dt: float) -> None:
        self.state, outputs = self.kernel.advance(self.state, self._inputs(time, dt), self.constants)
        self._publish(outputs)

    def _inputs(self, time: float, dt: float) -> list[float]:
        inputs = self.signals[: self.inputs]
        total = sum(inputs)
        if total - total != 0.0 and not self.component.survives:  # infinite or NaN
            self._refuse_non_finite(inputs, 0, "inputs_not_finite")
        return [time, dt, *inputs] if self.clock == 2 else [time, *inputs] if self.clock else inputs

    def _publish(self, outputs: tuple[float, ...]) -> None:
        total = sum(outputs)
        if total - total != 0.0:
            self._refuse_non_finite(outputs, self.inputs, "outputs_not_finite")
        self.signals[self.inputs :] = outputs

    def _refuse_non_finite(self, values: Any, first: int, sentence: str) -> None:
        names = [p.name for p, v in zip(self.component.ports[first:], values) if not math.isfinite(v)]
        if names:
            raise Refusal(say(sentence, ", ".join(f"`{n}`" for n in names)))

    def _given(self) -> dict[str, Any]:
        return {port.name: value for port, value in zip(self.component.of("parameter"), self.parameters)}

    # --- saving the state: all of it ---

    def _get_fmu_state(self) -> dict[str, Any]:
        return {name: _copy(getattr(self, name)) for name in SAVED}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        saved = state.get("build", "unknown (its bytes cannot be read)")
        if saved != self.build:
            self._fail(Refusal(say("other_build", saved, self.build)))
        for name, value in state.items():
            setattr(self, name, _copy(value))
        self.constants = self.kernel.constants(self.par) if self.par else ()

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        return json.dumps(state).encode()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        try:
            loaded = json.loads(bytes(state).decode())
        except ValueError:
            loaded = None
        return loaded if isinstance(loaded, dict) else {}  # which `_set_fmu_state` refuses; here is no instance to log

    # --- errors ---

    def log(self, msg: str, status: Any = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """Log a text.  On Linux our shim passes it as data; elsewhere pythonfmu's wrapper takes it as a format."""
        super().log(msg if sys.platform.startswith("linux") else msg.replace("%", "%%"), status, category)

    def _fail(self, error: BaseException, time: float | None = None, step: float | None = None) -> NoReturn:
        """Log what happened and where, and let the call fail."""
        if not getattr(error, "is_logged", False):
            error.is_logged = True  # type: ignore[attr-defined]
            place = (self.instance_name, self.component.name)
            key, values = ("said", place) if time is None else ("said_in_step", (*place, time, step))
            self.log(say(key, *values, self._cause(error)), Fmi2Status.error, "logStatusError")
            for held in (self, type(self), self.log_queue):  # the wrapper drops these once too often after an exception
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))
        raise error

    def _cause(self, error: BaseException) -> str:
        if isinstance(error, ValuesError):
            return say("correct_parameters", error)
        if isinstance(error, Refusal):
            return str(error)
        inputs = ", ".join(f"{p.name} = {v!r}" for p, v in zip(self.component.ports, self.signals[: self.inputs]))
        text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
        return say("exception", type(error).__name__, error, inputs or "none", text)


def _variable(port: Port) -> Any:
    """The pythonfmu variable of a port; describe.py completes its XML."""
    return KINDS[port.kind](
        port.name,
        causality=Fmi2Causality[port.causality],
        variability=Fmi2Variability[port.variability],
        description=port.description,
        getter=lambda: port.start,
        **({"initial": Fmi2Initial.calculated} if port.causality == "output" else {"start": port.start}),
    )


def _copy(value: Any) -> Any:
    """A copy that shares no list with the original, at most two levels deep."""
    if not isinstance(value, (list, tuple)):
        return value
    return [list(v) if isinstance(v, (list, tuple)) else v for v in value]
