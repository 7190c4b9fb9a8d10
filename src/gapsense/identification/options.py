"""The options of the functions on records and of the commands of the same names, in one table, and their choices."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from textwrap import fill, indent
from typing import Any, NamedTuple, SupportsFloat, TypeVar, cast

from gapsense.problems import InputError, format_limits

CONVENTIONS = ("trapezoid", "end", "start", "filtered", "slow")  # what a recorded voltage was between two samples
SHARP = CONVENTIONS[:3]  # edges take no time; those of the others tell how long they take
FORMS = ("eddy", "hysteresis", "fringing", "filter")  # what the plain model may have added
PLAIN = "plain"  # nothing of it
AUTO = "auto"  # what explains the records best
MODELS = (AUTO, "coil", "solenoid_valve")
TYPES = {  # type of a function's argument, by the type of the command's option
    bool: "bool",
    int: "int",
    float: "float",
    str: "str",
    Path: "path",
    list[str]: "str, sequence of str or mapping",
    list[Path]: "path, mapping of arrays, or several",
}


class Option(NamedTuple):
    """An option, for the help of a command and for the docstring of a function."""

    what: str  # for both, or for the command alone
    kind: Any  # type of the command's option
    here: str = ""  # for the function, if it differs; {} is the other sentence
    without: str = ""  # what holds where the command has none
    limits: tuple[float, float | None] | None = None


VALVE = "`sample_valve.csv` comes with Gapsense"
FILE = "CSV file with the columns time [s], voltage [V], current [A], or arrays by these names"
OPTIONS = {
    "data": Option(
        f"CSV files: time [s], voltage [V], current [A]; {VALVE}", list[Path], FILE.replace("file with", "files with")
    ),
    "estimate.data": Option(f"CSV file: time [s], voltage [V], current [A]; {VALVE}", Path, FILE),
    "gap_law.data": Option("CSV file: gap [mm], inductance [mH], or inductance 100Hz [mH], ...", Path),
    "fem.data": Option("CSV file: gap [mm], current [A], flux_linkage [Wb] or inductance [mH], force [N]", Path),
    "model": Option(f"What was measured: {', '.join(MODELS)}", str),
    "commission": Option("All parameters of `Mhe`: the command `gapsense commission`", bool),
    "parameters": Option("Parameter-set file: what is known, stops, gap law, spring; first guesses", Path),
    "commission.parameters": Option("First guesses of the parameters of `Mhe`", Path, "Parameter-set file. {}"),
    "gap_law.parameters": Option("What else is known of the valve", Path, "Parameter-set file. {}"),
    "estimate.parameters": Option("Parameter-set file; each estimator takes the parameters that it has", list[Path]),
    "fem.parameters": Option("What else is known: coil, mover, spring, stops", Path, "Parameter-set file. {}"),
    "assume": Option("Assume missing values, list them and mark them in the file; results are then relative", bool),
    "validate": Option("Record to validate with; it is not used for the fit", list[Path]),
    "period": Option(
        what="Length of an operation in s",
        kind=float,
        here="{}; by default operations end at rest",
        without="to rest",
        limits=(1e-9, None),
    ),
    "resistance": Option("Resistance of the coil in Ohm, measured with a meter", float, limits=(1e-9, None)),
    "turns": Option(
        what="Turns of the coil",
        kind=float,
        here="{}, by default those of `parameters`",
        without="of --parameters",
        limits=(1e-9, None),
    ),
    "current": Option("Current of all rows in A", float, without="column `current`", limits=(1e-9, None)),
    "symmetry": Option("The table is of one of so many equal parts of the device", int, limits=(1, 1000)),
    "closed": Option(
        "Position in m at which the gap is closed", float, without="the position is the gap", limits=(-1e3, 1e3)
    ),
    "supply": Option("Voltage in V that switches the device, for the windows of `Mhe`", float, limits=(1e-9, None)),
    "voltage": Option(f"Voltage between two samples: {', '.join((AUTO, *CONVENTIONS))}", str),
    "temperature": Option("Temperature of each record in degC: 23,60,85", str, without="column `temperature`"),
    "forms": Option(f"Extensions that the model may have: {', '.join((AUTO, PLAIN, *FORMS))}", str),
    "hold": Option("Parameter that keeps its value, as `coil.turns`", list[str]),
    "inductance": Option("CSV file: gap [mm], inductance [mH], for the gap law", Path),
    "driver": Option(
        "What a driver takes from a recorded command: series=OHM,drop=V, or `fit`; delay=S of the current", str
    ),
    "accuracy": Option(
        "Accuracies in percent, for standard errors: voltage=0.5,current=1, or of given values: stop.upper=2", str
    ),
    "estimator": Option("Names, separated by commas", str, without="all whose inputs the record has"),
    "column": Option(
        "QUANTITY=NAME: column, or signal of a result, that holds the quantity",
        list[str],
        "Column, or signal of a result, that holds a quantity, as a mapping or by QUANTITY=NAME",
    ),
    "separator": Option("Separator of the columns of a CSV file", str),
    "decimal": Option("Decimal mark of the numbers", str),
    "clipped": Option("Accept signals that reach the limits of their converter", bool),
    "offset": Option("QUANTITY=VALUE: offset of a sensor, in addition to what is seen at rest", list[str]),
    "starts": Option("Starts of the least-squares search; 0: multi-directional search", int, limits=(0, 10**7)),
    "seed": Option("Seed of the random starts", int, limits=(0, 2**31 - 1)),
    "fmus": Option("Folder with the FMUs", Path, without="build/fmus, or else those that come with Gapsense"),
    "out": Option("Parameter-set file to write", Path),
    "estimate.out": Option("CSV file of the estimates", Path),
    "figure": Option("PNG, PDF or SVG file", Path, "{} to write"),
    "progress": Option("Is called with the work that is done and all of it", None),
}
SHIPPED = {"data", "estimate.data", "parameters", "commission.parameters", "estimate.parameters", "validate"}
OUTPUTS = {"out", "figure"}
RAISES = """    Raises
    ------
    ValueError
        With all that is wrong with the files and options, or that something is missing which no record tells.
    """
Function = TypeVar("Function", bound=Callable[..., Any])


def key(function: str, name: str) -> str:
    """Of an option of the function of that name, in the table."""
    return own if (own := f"{function}.{name}") in OPTIONS else name


def document_arguments(function: Function) -> Function:
    """Put the arguments of a function into its docstring, before what it returns, and at its end what it raises.

    Numbers beyond the limits of the table are refused, as by the command.
    """
    told = ["Parameters\n----------"]
    known = signature(function).parameters
    for name, argument in known.items():
        option = OPTIONS[key(function.__name__, name)]
        optional = "" if argument.default is Parameter.empty or option.kind is bool else ", optional"
        sentence = fill(f"{(option.here or '{}').format(option.what)}.", 110)
        told.append(f"{name} : {TYPES.get(option.kind, 'callable')}{optional}\n{indent(sentence, '    ')}")
    before, returns, after = (function.__doc__ or "").partition("    Returns\n")
    function.__doc__ = f"{before}{indent(chr(10).join(told), '    ')}\n\n{returns}{after.rstrip()}\n\n{RAISES}"

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        limited = {name: OPTIONS[key(function.__name__, name)].limits for name in options if name in known}
        if problems := [
            f"--{name}: {options[name]} found, a number {between} {format_limits(*limits)} expected. Correct it."
            for name, limits in limited.items()
            if limits and options[name] is not None and not is_within(options[name], *limits)
            for between in ["of" if limits[1] is None else "from"]
        ]:
            raise InputError(problems)
        return function(*arguments, **options)

    return cast(Function, call)


def is_within(value: Any, low: float, high: float | None) -> bool:
    """True for a finite number that is not beyond the limits."""
    return isinstance(value, SupportsFloat) and low <= float(value) <= (sys.float_info.max if high is None else high)
