"""Components from Python: a class for each, made of its port table, that runs on arrays or step by step.

>>> import numpy as np, gapsense
>>> valve = gapsense.SolenoidValve(damping=0.2)
>>> moved = valve.run(voltage=np.full(800, 24.0), sample_time=25e-6)
>>> bool(moved.position[-1] < moved.position[0])
True
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from functools import cache, cached_property
from inspect import Parameter, Signature
from math import isfinite
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from gapsense._os.native import own_compiler
from gapsense.fmi.components import kernel_of, load_component, own
from gapsense.fmi.ports import Component, Port
from gapsense.fmi.sentences import say
from gapsense.fmi.values import ValuesError, fields, wrong_value
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names
from gapsense.parameters import core_problem, read_parameters
from gapsense.problems import ScenarioError, format_limits, suggest

Floats = npt.NDArray[np.float64]
SAMPLE_TIME = "sample_time"
TYPES = {"Real": "float", "Integer": "int", "Boolean": "bool", "String": "str"}
R = TypeVar("R", bound="Runnable")


class Moment(NamedTuple):
    """Where a component stands between two steps: its state as the kernel has it, the time [s], and its name."""

    state: Any
    time: float
    component: str


class Response:
    """What a component made of its inputs: each output by its name, an array over samples, or over runs and samples."""

    def __init__(self, name: str, time: Floats, outputs: Mapping[str, Floats], units: Mapping[str, str]) -> None:
        self.name, self.time, self.outputs, self.units = name, time, outputs, units

    if not TYPE_CHECKING:  # a type checker knows the outputs of each component from components.pyi

        def __getattr__(self, name: str) -> Floats:
            outputs = self.__dict__.get("outputs", {})
            if name not in outputs:
                raise AttributeError(f"`{name}` is not an output. {suggest(name, outputs)}")
            return outputs[name]

    def __getitem__(self, run: int) -> Response:
        """What came of one run of several."""
        return Response(self.name, self.time, {name: values[run] for name, values in self._many().items()}, self.units)

    def __len__(self) -> int:
        return len(next(iter(self._many().values())))

    def _many(self) -> Mapping[str, Floats]:
        if any(values.ndim == 1 for values in self.outputs.values()):
            raise TypeError("this is a single run. Take its outputs by their names.")
        return self.outputs

    def _one(self) -> Mapping[str, Floats]:
        if any(values.ndim > 1 for values in self.outputs.values()):
            raise TypeError(f"these are {len(self)} runs. Choose one: `result[0]`.")
        return self.outputs

    def __dir__(self) -> list[str]:
        return ["name", "time", "outputs", "units", "plot", "to_pandas", *self.outputs]

    def __repr__(self) -> str:
        runs = "" if next(iter(self.outputs.values())).ndim == 1 else f"{len(self)} runs, "
        return f"<{self.name}: {runs}{self.time.size} samples, outputs {', '.join(self.outputs)}>"

    def to_pandas(self) -> Any:
        """The outputs of a single run as a DataFrame of pandas, by time [s]; units are in its `attrs["units"]`."""
        from gapsense.report import pages

        return pages.frame(self._one(), "time", self.time, self.units)

    def plot(self, *patterns: str) -> Any:
        """Figure of the outputs of these names or patterns, by default all: a panel per unit."""
        from gapsense.report import plot

        return plot.signals(Drawn(self), [f"{self.name}.{pattern}" for pattern in patterns])


class Drawn:
    """A response as figures take it: signals are called `component.variable`."""

    def __init__(self, response: Response) -> None:
        self.run, self.times = SimpleNamespace(title=response.name, scenario=response.name), response.time
        self.signals = {f"{response.name}.{name}": values for name, values in response._one().items()}
        self.units = {f"{response.name}.{name}": unit for name, unit in response.units.items()}
        self.events: Sequence[Any] = ()

    def __getitem__(self, name: str) -> Floats:
        return self.signals[name]


class Runnable:
    """Base of the classes of all components."""

    ports: ClassVar[Component]
    folder: ClassVar[Path]
    kernel: ClassVar[Kernel]
    _moment: Moment | None = None

    def __init__(self, **parameters: Any) -> None:
        known = {port.field: port for port in self.ports.of("parameter")}
        if unknown := [key for key in parameters if key not in known]:
            found = [f"`{key}` is not a parameter of {self.ports.name}. {suggest(key, known)}" for key in unknown]
            raise ValuesError(found)
        self._parameters = {port.name: number(port, parameters.get(key, port.start)) for key, port in known.items()}
        self._values = fields(self.ports, self.parameters, self.folder)
        self.reset()

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Values by the names of the FMU, to read: a component keeps those with which it was made."""
        return MappingProxyType(self._parameters)

    if not TYPE_CHECKING:  # a type checker knows the attributes

        def __setattr__(self, name: str, value: Any) -> None:
            if name != "state" and not name.startswith("_"):
                made, known = self.ports.name, [port.field for port in self.ports.of("parameter")]
                if name in known:
                    raise AttributeError(
                        f"`{name}` does not change any more. Make another one: {made}({name}={value!r})."
                    )
                raise AttributeError(f"`{name}` is not an attribute of {made}. {suggest(name, [*known, 'state'])}")
            super().__setattr__(name, value)

    @classmethod
    def from_file(cls: type[R], path: str | Path, **parameters: Any) -> R:
        """A component with the parameters of a parameter-set file that it has, and others that are given."""
        found: list[str] = []
        values = read_parameters(Path(path), found)
        if found:
            raise ScenarioError(found)
        known = {port.name: port.field for port in cls.ports.of("parameter")}
        if problem := core_problem(values, known):
            raise ScenarioError([f"{Path(path).name}, {cls.ports.name}: {problem}"])
        return cls(**{**{known[name]: value for name, value in values.items() if name in known}, **parameters})

    def run(
        self,
        *signals: Any,
        sample_time: float | None = None,
        start_time: float = 0.0,
        outputs: Iterable[str] = (),
        **named: Any,
    ) -> Response:
        """Outputs over samples of the inputs.

        Parameters
        ----------
        *signals : array_like
            Inputs in their order: (samples,), or (runs, samples) for many runs at once, or a number that stays. An
            input that is optional has its start value if it is not given, or None. What an array masks is NaN.
        sample_time : float, optional
            Time between two samples [s]; by default the parameter `sample_time`, or where the component has none the
            step of its model description.
        start_time : float
            Time of the first sample [s].
        outputs : str or iterable of str
            The outputs that are wanted, by default all.
        **named : array_like
            Inputs by name.

        Returns
        -------
        Response
            Row k has the outputs at the time `start_time + k * sample_time`, after a step with row k of the inputs.
            Row 0 is the initialisation. The bits are those of the FMU.

        Raises
        ------
        ValueError
            In the words of the FMU, for inputs that it does not take or outputs that are not finite.
        """
        values, step = self._with_sample_time(sample_time)
        inputs = self._inputs(signals, named)
        is_single = all(x.ndim < 2 for x in inputs)
        shape = np.broadcast_shapes((1, 1), *(x.shape for x in inputs))
        flat = [np.broadcast_to(x, shape) for x in inputs]
        every = [port.name for port in self.ports.of("output")]
        wanted = ([outputs] if isinstance(outputs, str) else [*outputs]) or every
        if unknown := [name for name in wanted if name not in every]:
            raise ValueError(f"`{unknown[0]}` is not an output of {self.ports.name}. {suggest(unknown[0], every)}")
        chosen = [every.index(name) for name in wanted]
        if (data := self._in_c(flat, chosen, values, start_time, step)) is None:
            data = np.stack([self._in_python(flat, k, values, start_time, step)[chosen] for k in range(shape[0])])
        found = {name: data[0, k] if is_single else data[:, k] for k, name in enumerate(wanted)}
        units = {port.name: port.unit for port in self.ports.of("output") if port.name in wanted}
        return Response(self.ports.name, np.array(start_time + step * np.arange(shape[1]), float), found, units)

    def step(self, *signals: float, sample_time: float | None = None, **named: float) -> Any:
        """One step with these inputs, in a loop of one's own: a named tuple of the outputs.

        The first call after the beginning or `reset` is the initialisation, as row 0 of `run`.
        """
        values, step = self._with_sample_time(sample_time)
        arrays = self._inputs(signals, named)
        if any(x.ndim for x in arrays):
            raise TypeError("an array found, a number for each input expected: `run` takes arrays.")
        inputs = [float(x) for x in arrays]
        prepared = self._usual if values is self._values else self._prepare_constants(values)
        state, time, dt = (None, 0.0, 0.0)
        if self._moment is not None:
            state, time, dt = self._moment.state, self._moment.time + step, step
        made, state = self._advance(prepared)(state, [*(time, dt)[: self._clocks], *inputs])
        self._moment = Moment(state, time, self.ports.name)
        return self._outputs(*made)

    @property
    def state(self) -> Moment | None:
        """Where it stands after `step`: what to set again later; None before the first step."""
        return deepcopy(self._moment)

    @state.setter
    def state(self, moment: Moment | None) -> None:
        """Go on from there."""
        if moment is not None and getattr(moment, "component", None) != self.ports.name:
            raise TypeError(f"`{moment!r:.60}` found, a `state` of another moment of {self.ports.name} expected.")
        self._moment = deepcopy(moment)

    def reset(self) -> None:
        """Begin anew with the next `step`."""
        self._moment = None

    def __repr__(self) -> str:
        starts = {port.name: port.start for port in self.ports.of("parameter")}
        changed = (f"{k.replace('.', '_')}={v!r}" for k, v in self.parameters.items() if v != starts[k])
        return f"{self.ports.name}({', '.join(changed)})"

    @cached_property
    def _outputs(self) -> Any:
        return _outputs_of(self.ports.name, tuple(port.name for port in self.ports.of("output")))

    @cached_property
    def _usual(self) -> tuple[Any, Any]:
        """What `_prepare_constants` makes of the component's own parameters."""
        return self._prepare_constants(self._values)

    @cached_property
    def _clocks(self) -> int:
        """How many of time and step the kernel takes."""
        return len(names(self.kernel.module.Inputs)) - len(self.ports.of("input"))

    @cached_property
    def _has_ranges(self) -> bool:
        return any((port.min, port.max) != (None, None) for port in self.ports.of("input"))

    def _with_sample_time(self, sample_time: float | None) -> tuple[dict[str, Any], float]:
        """Take a sample time: fields of the parameters with it, and the step between two rows [s]."""
        usual = self.parameters.get(SAMPLE_TIME, self.ports.step_size)
        step = float(usual if sample_time is None else sample_time)
        if SAMPLE_TIME in self.parameters and step != usual:
            return fields(self.ports, {**self.parameters, SAMPLE_TIME: step}, self.folder), step
        if not (isfinite(step) and step > 0.0):
            raise ValueError(say("step_size", repr(step)))
        return self._values, step

    def _inputs(self, signals: Sequence[Any], named: Mapping[str, Any]) -> list[Floats]:
        """Every input as an array; what is wrong with names, shapes and types is told."""
        ports = self.ports.of("input")
        known = [port.name for port in ports]
        if len(signals) > len(ports):
            raise TypeError(f"{len(signals)} inputs found, {len(ports)} expected: {', '.join(known)}.")
        given = dict(zip(known, signals))
        for name, value in named.items():
            if name not in known:
                raise TypeError(f"`{name}` is not an input of {self.ports.name}. {suggest(name, known)}")
            if name in given:
                raise TypeError(f"input `{name}` is given twice. Leave one out.")
            given[name] = value
        given = {name: value for name, value in given.items() if value is not None}
        if missing := [p.name for p in ports if p.name not in given and not p.is_optional]:
            raise TypeError(f"input {', '.join(f'`{name}`' for name in missing)} missing. Give an array or a number.")
        arrays = [as_numbers(port.name, given.get(port.name, port.start or 0.0)) for port in ports]
        if any(x.ndim > 2 or 0 in x.shape for x in arrays):
            shapes = ", ".join(f"`{name}` {x.shape}" for name, x in zip(known, arrays))
            raise ValueError(f"shapes {shapes} found; (samples,) or (runs, samples), not empty, expected.")
        try:
            runs, samples = np.broadcast_shapes((1, 1), *(x.shape for x in arrays))
        except ValueError:
            shapes = ", ".join(f"`{name}` {x.shape}" for name, x in zip(known, arrays) if x.ndim)
            raise ValueError(f"shapes {shapes} found, the same number of samples expected. Correct them.") from None
        if runs > 1 == samples:  # a column of a table, which would be as many runs
            columns = ", ".join(f"`{name}` {x.shape}" for name, x in zip(known, arrays) if x.ndim == 2)
            raise ValueError(f"{columns} found, {runs} runs of one sample each; a record is ({runs},). Reshape it.")
        return arrays

    def _in_c(
        self, inputs: list[Floats], chosen: list[int], values: Mapping[str, Any], start: float, step: float
    ) -> Floats | None:
        """The outputs by C; None where no compiler is. What fails is done again in Python, for its words."""
        if own_compiler() is None:
            return None
        from gapsense.vectors.library import filter_runs, functions, loop

        found = functions(self.ports.name) if loop() else None
        if found is None:
            return None
        data, failed = filter_runs(found, values, inputs, chosen, start, step)
        for run in np.flatnonzero(failed):
            self._in_python(inputs, int(run), values, start, step)
        return data

    def _in_python(
        self, inputs: list[Floats], run: int, values: Mapping[str, Any], start: float, step: float
    ) -> Floats:
        """The outputs of one run (outputs, samples) by the scalar code."""
        advance, state, found = self._advance(self._prepare_constants(values)), None, array("d")
        count = len(inputs[0][run])
        times, steps = start + (np.arange(count) - 1.0) * step + step, np.full(count, step)
        times[0], steps[0] = start, 0.0
        clocks = [times, steps][: self._clocks]
        for k, row in enumerate(zip(*(x.tolist() for x in (*clocks, *(x[run] for x in inputs))))):
            try:
                made, state = advance(state, row)
            except ValueError as error:
                where = f"run {run}, " if len(inputs[0]) > 1 else ""
                raise ValueError(f"{where}sample {k}: {error}") from None
            found.extend(made)
        return np.frombuffer(found).reshape(count, -1).T

    def _prepare_constants(self, values: Mapping[str, Any]) -> tuple[Any, Any]:
        """Compute the constants that a step needs of the parameters; these, flat, come first."""
        scalar = self.kernel.scalar
        par = tuple(values[name] for name in names(self.kernel.module.Parameters))
        return par, scalar["constants"](par)

    def _advance(self, prepared: tuple[Any, Any]) -> Callable[..., tuple[Sequence[float], Any]]:
        """The function of a state and a row of clocks and inputs that gives the outputs and the next state.

        Without a state it initialises. It refuses what the FMU refuses.
        """
        initial, advance = self.kernel.scalar["initial"], self.kernel.scalar["advance"]
        par, constants = prepared
        clocks, inputs, outputs = self._clocks, self.ports.of("input"), self.ports.of("output")
        survives, has_ranges = self.ports.survives, self._has_ranges

        def advance_checked(state: Any, row: Sequence[float]) -> tuple[Sequence[float], Any]:
            if not survives:
                if not isfinite(sum(row)):
                    failing().refuse_non_finite(inputs, row[clocks:], "inputs_not_finite")
                if has_ranges and any(map(wrong_value, inputs, row[clocks:])):
                    failing().refuse_inputs(inputs, row[clocks:])
            state, made = initial(row, par) if state is None else advance(state, row, constants)
            if not isfinite(sum(made)):
                failing().refuse_non_finite(outputs, made, "outputs_not_finite")
            return made, state

        return advance_checked


@cache
def _outputs_of(name: str, outputs: tuple[str, ...]) -> Any:
    return NamedTuple(f"{name}Outputs", [(output, float) for output in outputs])


def failing() -> Any:
    """The module with the sentences of FMUs; it needs pythonfmu, and is not loaded while all values are fine."""
    from gapsense.fmi import failing

    return failing


@cache
def component_class(name: str) -> type[Runnable]:
    """The class of the component of that name."""
    folder = own(name)
    ports = load_component(folder)
    own_names = {"ports": ports, "folder": folder, "kernel": kernel_of(ports), "__doc__": make_docstring(ports)}
    made = type(ports.name, (Runnable,), {**own_names, "__module__": "gapsense"})
    keywords = [Parameter(p.field, Parameter.KEYWORD_ONLY, default=p.start) for p in ports.of("parameter")]
    made.__signature__ = Signature(keywords)  # type: ignore[attr-defined]
    return made


def number(port: Port, value: Any) -> Any:
    """A value of a parameter, as a float if it is to be a number and is one."""
    is_number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    return float(value) if port.kind == "Real" and is_number else value


def make_docstring(ports: Component) -> str:
    """Write the docstring of a class: parameters, inputs and outputs with units, ranges and start values."""

    def chapter(title: str, found: Sequence[Port], line: Callable[[Port], str]) -> str:
        lines = [f"{line(port)}\n    {port.description}." for port in found]
        return "\n".join(["", title, "-" * len(title), *lines])

    return "\n".join(
        [
            f"{ports.description}.",
            chapter(
                "Parameters", ports.of("parameter"), lambda p: f"{p.field} : {describe_type(p)}, by default {p.start!r}"
            ),
            chapter("Inputs of run and step", ports.of("input"), lambda p: f"{p.name} : {describe_type(p)}"),
            chapter("Outputs", ports.of("output"), lambda p: f"{p.name} : {describe_type(p)}"),
        ]
    )


def describe_type(port: Port) -> str:
    """Give type, unit and range of a port as a docstring has them."""
    kind = TYPES[port.kind]
    unit = f" [{port.unit}]" if port.kind == "Real" and port.unit != "1" else ""
    span = f", {limits}" if (limits := format_limits(port.min, port.max)) else ""
    choices = f", one of {', '.join(port.choices)}" if port.choices else ""
    optional = ", optional" if port.is_optional else ""
    return f"{kind}{unit}{span}{choices}{optional}"


def as_numbers(name: str, value: Any) -> Floats:
    """The samples of an input; what an array masks was not measured."""
    if np.iscomplexobj(value):
        raise TypeError(f"input `{name}`: complex numbers found, real ones expected.")
    try:
        if isinstance(value, np.ma.MaskedArray):
            value = np.where(value.mask, np.nan, value.data)
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise type(error)(f"input `{name}`: an array or a number expected, {error}.") from None
