"""The shell of every FMU: FMI 2.0 co-simulation callbacks around a kernel.  A copy travels in each FMU.

What pythonfmu 0.7.0 leaves to us: an exception is logged with its context before it fails the call; calls out of order,
numbers that are not finite or not in their range and steps that do not fit are refused; state saving covers everything.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial, partialmethod
from typing import Any, NoReturn

from pythonfmu.enums import Fmi2Status

from .failing import refuse_inputs, refuse_non_finite, tell
from .ports import Port
from .sentences import Refusal, say
from .state import SAVED, from_bytes, to_bytes
from .steps import SHIFT, refuse_jump, samples_due
from .values import fields
from .variables import Variables, variable

# The script's globals, held because pythonfmu's wrapper drops one reference too many at each instantiation.
HELD: list[dict[str, Any]] = []


class StateReader:
    """Reads bytes of a saved state.  Asked of the class, as by pythonfmu's own binary, it leaves refusals for later."""

    def __get__(self, slave: Slave | None, cls: type[Slave]) -> Callable[[bytes], dict[str, Any]]:
        return partial(self.read, slave, cls)

    def read(self, slave: Slave | None, cls: type[Slave], data: bytes) -> dict[str, Any]:
        """The state, or what `_set_fmu_state` refuses."""
        try:
            return from_bytes(bytes(data), cls.component, cls.kernel, cls.build)
        except Refusal as error:
            if slave is not None:
                slave._fail(error)
            return {"refused": str(error)}


class Slave(Variables):
    """Base of the generated class, which sets `component`, `kernel` and `build` (a hash of interface and sources)."""

    build: str

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        while "visible" in kwargs and self.resources in sys.path:  # the wrapper, unlike the builder, never removes it
            sys.path.remove(self.resources)  # all imports are done
        component = self.component
        self.modelName, self.description = component.name, component.description
        self.inputs = len(component.of("input"))
        signals = self.inputs + len(component.of("output"))
        self.signals: list[float] = [float(p.start or 0.0) for p in component.ports[:signals]]  # inputs, then outputs
        self.parameters: list[Any] = [
            float(p.start) if p.kind == "Real" else p.start for p in component.ports[signals:]
        ]
        self.clock = sum(name in self.kernel.INPUTS for name in ("time", "dt"))  # how many of them the kernel takes
        self.ranges = [] if component.survives else ranges(component.of("input"))
        self.limits = [] if component.survives else limits(component.of("input"))
        self.period = 0.0  # of the samples; 0 for a component that is not sampled
        self.par: tuple[Any, ...] = ()
        self.constants: tuple[Any, ...] = ()  # what a step needs of the parameters
        self.state: tuple[Any, ...] = ()
        self.start_time = 0.0
        self.end = math.nan  # of the last step, where the next one is expected
        self.elapsed = 0.0  # since the last sample
        self.enter("instantiated")
        for port in component.ports:
            self.register_variable(variable(port), nested=False)

    # --- life ---

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        try:
            self._demand("fmi2SetupExperiment")
            if not math.isfinite(start_time):
                raise Refusal(say("start_time", repr(start_time)))
            self.start_time = self.end = start_time
        except BaseException as error:
            self._fail(error)

    def _go(self, call: str, phase: str) -> None:
        try:
            self._demand(call)
            if phase == "running":
                self._initialize()
            self.enter(phase)
        except BaseException as error:
            self._fail(error)

    enter_initialization_mode = partialmethod(_go, "fmi2EnterInitializationMode", "initializing")
    exit_initialization_mode = partialmethod(_go, "fmi2ExitInitializationMode", "running")
    terminate = partialmethod(_go, "fmi2Terminate", "terminated")

    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            if not self.is_running:
                self._demand("fmi2DoStep")
            end = current_time + step_size
            if not step_size > 0.0 or end - end != 0.0:  # infinite or NaN
                raise Refusal(say("step_size", repr(step_size)))
            if current_time != self.end and not abs(current_time - self.end) <= SHIFT * step_size:
                refuse_jump(current_time, step_size, self.end)
            if not self.period:
                self._advance(end, step_size)
            elif step_size == self.period and not self.elapsed:
                self._advance(end, self.period)
            else:
                self._sample(end, step_size)
            self.end = end
            return True
        except BaseException as error:
            self._fail(error, current_time, step_size)

    def lend(self, time: float, step: float) -> tuple[Any, ...]:
        """What the Linux binary needs to take steps like this one by itself; nothing if it had better ask `do_step`.

        While it has this, it also sets inputs and gets signals.  Before it calls any other method, it puts `state`,
        `signals` and `end` back; whatever is unusual, it leaves to `do_step`, which knows the words.
        """
        if not self.is_running or self.elapsed or self.period not in (0.0, step):
            return ()
        arguments = self.kernel.advance, self.state, self.constants, self.signals, self.limits
        return (*arguments, self.clock, self.inputs, self.period, self.end, SHIFT)

    def _initialize(self) -> None:
        given = self._given()
        values = fields(self.component, given, self.resources or ".")
        self._take(tuple(values[name] for name in self.kernel.PARAMETERS))
        self.period, self.elapsed = given.get("sample_time", 0.0), 0.0
        self.state, outputs = self.kernel.initial(self._inputs(self.start_time, 0.0), self.par)
        self._publish(outputs)

    def _sample(self, end: float, step: float) -> None:
        """The samples that fall due in a step; the outputs of all of them, or of none if one fails."""
        count, elapsed = samples_due(end, step, self.period, self.elapsed)
        signals = [*self.signals]
        try:
            for k in range(count - 1, -1, -1):
                self._advance(end - k * self.period, self.period)
        except BaseException:
            self.signals = signals
            raise
        self.elapsed = elapsed

    def _advance(self, time: float, dt: float) -> None:
        self.state, outputs = self.kernel.advance(self.state, self._inputs(time, dt), self.constants)
        self._publish(outputs)

    def _inputs(self, time: float, dt: float) -> list[float]:
        inputs = self.signals[: self.inputs]
        total = sum(inputs)
        if total - total != 0.0 and not self.component.survives:  # infinite or NaN
            refuse_non_finite(self.component.ports, inputs, "inputs_not_finite")
        for k, low, high in self.ranges:
            if not low <= inputs[k] <= high:
                refuse_inputs(self.component.ports, inputs)
        return [time, dt, *inputs] if self.clock == 2 else [time, *inputs] if self.clock else inputs

    def _publish(self, outputs: tuple[float, ...]) -> None:
        total = sum(outputs)
        if total - total != 0.0:
            refuse_non_finite(self.component.of("output"), outputs, "outputs_not_finite")
        self.signals[self.inputs :] = outputs

    # --- saving the state: all of it ---

    def _get_fmu_state(self) -> dict[str, Any]:
        state = {name: _copy(getattr(self, name)) for name in SAVED}
        return state if self.phase == "running" else {**state, "par": [], "state": []}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if "refused" in state:
            self._fail(Refusal(state["refused"]))
        for name, value in state.items():
            setattr(self, name, _copy(value))
        self.enter(self.phase)
        self.constants = self.kernel.constants(self.par) if self.par else ()
        self.period = self._given().get("sample_time", 0.0)

    _fmu_state_to_bytes = staticmethod(to_bytes)
    _fmu_state_from_bytes = StateReader()

    # --- what pythonfmu asks and is told ---

    def to_xml(self, *options: Any) -> Any:
        self.enter("terminated")  # in which start values can be read
        return super().to_xml(*options)

    def log(self, msg: str, status: Any = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """Log a text.  On Linux our shim passes it as data; elsewhere pythonfmu's wrapper takes it as a format."""
        super().log(msg if sys.platform.startswith("linux") else msg.replace("%", "%%"), status, category)

    def _fail(self, error: BaseException, time: float | None = None, step: float | None = None) -> NoReturn:
        """Log what happened and where, and let the call fail."""
        if not getattr(error, "is_logged", False):
            error.is_logged = True  # type: ignore[attr-defined]
            self.enter("failed")
            tell(self, error, time, step)
        raise error


def ranges(ports: tuple[Port, ...]) -> list[tuple[int, float, float]]:
    """Place, least and greatest value of those that have a range."""
    with_range = [(k, port) for k, port in enumerate(ports) if (port.min, port.max) != (None, None)]
    least, greatest = -math.inf, math.inf
    return [(k, least if p.min is None else p.min, greatest if p.max is None else p.max) for k, p in with_range]


def limits(ports: tuple[Port, ...]) -> list[float]:
    """Least and greatest value of each, one after the other; of those without a range the finite ones."""
    most = sys.float_info.max
    found = [-most, most] * len(ports)
    for k, least, greatest in ranges(ports):
        found[2 * k : 2 * k + 2] = max(least, -most), min(greatest, most)
    return found


def _copy(value: Any) -> Any:
    """A copy that shares no list with the original, at most two levels deep."""
    if not isinstance(value, (list, tuple)):
        return value
    return [list(v) if isinstance(v, (list, tuple)) else v for v in value]
