"""The variables of an instance, got and set, and the phases in which that is allowed.  A copy travels in every FMU."""

from __future__ import annotations

from functools import partialmethod
from typing import Any, NoReturn

from pythonfmu import Boolean, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real, String

from .life import ALLOWED, phases_of
from .ports import Component, Port
from .sentences import Refusal, say
from .values import ValuesError, problems

KINDS = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "String": String}


class Variables(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """What an instance knows of its variables; the value reference is the position in the port table."""

    component: Component
    kernel: Any
    inputs: int  # how many
    signals: list[float]  # inputs, then outputs
    parameters: list[Any]
    par: tuple[Any, ...]  # of the kernel, made of the parameters
    constants: tuple[Any, ...]  # what a step needs of them

    def _initialize(self) -> None:
        """Compute the outputs at the start."""
        raise NotImplementedError

    def _fail(self, error: BaseException) -> NoReturn:
        raise NotImplementedError

    def enter(self, phase: str) -> None:
        """Begin a phase; the binary says so when a call has failed."""
        inputs, outputs = [*range(self.inputs)], [*range(self.inputs, len(self.signals))]  # value references
        self.phase, self.is_running = phase, phase == "running"
        # What get_real and set_real may do without a further look: all outputs, all inputs.
        self.readable = outputs if phase in ALLOWED["fmi2GetReal"] and phase != "initializing" else None
        self.writable = inputs if phase in ALLOWED["fmi2SetReal"] else None

    def _demand(self, call: str) -> None:
        """Refuse a call that does not belong to this phase."""
        if self.phase not in ALLOWED[call]:
            raise Refusal(say("wrong_phase", call, self.phase, phases_of(call)))

    def get_real(self, refs: list[int]) -> list[float]:
        """Values of Real variables; all outputs at once is the usual way."""
        signals = self.signals
        if refs == self.readable:
            return signals[self.inputs :]
        if self.readable and refs and min(refs) >= 0 and max(refs) < len(signals):
            return [signals[r] for r in refs]
        return self._get("Real", refs)

    def set_real(self, refs: list[int], values: list[float]) -> None:
        """Set Real variables; all inputs at once is the usual way."""
        if refs == self.writable:
            self.signals[: self.inputs] = values
        elif self.writable and refs and min(refs) >= 0 and max(refs) < self.inputs:
            for r, value in zip(refs, values):
                self.signals[r] = value
        else:
            self._set("Real", refs, values)

    def _get(self, kind: str, refs: list[int]) -> list[Any]:
        try:
            self._demand(f"fmi2Get{kind}")
            ports = [self._port(ref, kind) for ref in refs]
            if self.phase == "initializing" and any(port.causality == "output" for port in ports):
                self._initialize()
            values = [*self.signals, *self.parameters]
            return [values[ref] for ref in refs]
        except BaseException as error:
            self._fail(error)

    def _port(self, ref: int, kind: str) -> Port:
        ports = self.component.ports
        if not 0 <= ref < len(ports) or ports[ref].kind != kind:
            raise Refusal(say("no_variable", kind, ref % 2**32))  # the wrapper makes the largest ones negative
        return ports[ref]

    def _set(self, kind: str, refs: list[int], values: list[Any]) -> None:
        try:
            self._demand(f"fmi2Set{kind}")
            ports = [self._port(ref, kind) for ref in refs]
            for port in ports:
                self._refuse_setting(port)
            signals, parameters = [*self.signals], [*self.parameters]
            for ref, value in zip(refs, values):
                both, k = (signals, ref) if ref < len(signals) else (parameters, ref - len(signals))
                both[k] = value
            if self.phase == "running" and parameters != self.parameters:
                self._tune(parameters)
            self.signals, self.parameters = signals, parameters
        except BaseException as error:
            self._fail(error)

    get_integer, set_integer = partialmethod(_get, "Integer"), partialmethod(_set, "Integer")
    get_boolean, set_boolean = partialmethod(_get, "Boolean"), partialmethod(_set, "Boolean")
    get_string, set_string = partialmethod(_get, "String"), partialmethod(_set, "String")

    def _refuse_setting(self, port: Port) -> None:
        if port.causality == "output":
            raise Refusal(say("is_output", port.name))
        if self.phase == "running" and port.causality == "parameter" and port.variability != "tunable":
            raise Refusal(say("is_fixed", port.name))

    def _tune(self, parameters: list[Any]) -> None:
        """Take new values of tunable parameters."""
        ports = self.component.of("parameter")
        if found := problems(self.component, {p.name: v for p, v in zip(ports, parameters)}):
            raise ValuesError(found)
        tuned = {p.field: float(v) for p, v in zip(ports, parameters) if p.variability == "tunable"}
        self._take(tuple(tuned.get(name, value) for name, value in zip(self.kernel.PARAMETERS, self.par)))

    def _take(self, par: tuple[Any, ...]) -> None:
        self.par, self.constants = par, self.kernel.constants(par)

    def _given(self) -> dict[str, Any]:
        return {port.name: value for port, value in zip(self.component.of("parameter"), self.parameters)}


def variable(port: Port) -> Any:
    """The pythonfmu variable of a port; describe.py completes its XML."""
    return KINDS[port.kind](
        port.name,
        causality=Fmi2Causality[port.causality],
        variability=Fmi2Variability[port.variability],
        description=port.description,
        getter=lambda: port.start,
        **({"initial": Fmi2Initial.calculated} if port.causality == "output" else {"start": port.start}),
    )
