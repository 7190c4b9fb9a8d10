"""The commands on records: the functions of the same names, with the options of one table."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from gapsense import functions
from gapsense.cli.common import Output, command, tell
from gapsense.cli.console import bar
from gapsense.identification.options import OPTIONS, OUTPUTS, SHIPPED, key
from gapsense.shipped import record


def of(function: Callable[..., functions.Found], title: str, more: str = "", **own: Path | str) -> Callable[..., None]:
    """A function as a command; the first line of its docstring is that of the help, and `more` the rest.

    The progress bar has the `title`, where the function tells its progress. What is `own` holds in place of the
    function's defaults: a path, or a sentence on one.
    """
    arguments = dict(signature(function).parameters)
    has_progress = arguments.pop("progress", None) is not None

    def call(**options: Any) -> None:
        given = {name: value for name, value in options.items() if value is not None}
        with bar(title) if has_progress else nullcontext() as progress:
            found = function(**given, **({"progress": progress} if has_progress else {}))
        tell(found)

    made = [parameter_of(function.__name__, each, own.get(name)) for name, each in arguments.items()]
    call.__signature__ = Signature(made)  # type: ignore[attr-defined]
    call.__annotations__ = {each.name: each.annotation for each in made}
    call.__doc__ = f"{(function.__doc__ or '').splitlines()[0]}\n\n{more.strip()}".strip()
    return call


def parameter_of(function: str, argument: Parameter, own: Path | str | None) -> Parameter:
    """The argument of a function as one of a command."""
    name, is_needed = key(function, argument.name), argument.default is Parameter.empty
    option, default = OPTIONS[name], None if argument.default == () else argument.default
    default = own if isinstance(own, Path) else default
    about: dict[str, Any] = {"help": option.what}
    about |= {"parser": record, "metavar": "FILE"} if name in SHIPPED else {}
    about |= dict(zip(("min", "max"), option.limits or ()))
    about |= {"show_default": (own or option.without) or False} if is_needed or default is None else {}
    names = [f"--{argument.name}"] if option.kind is bool else []  # without a negative one
    made = typer.Argument(**about) if argument.name == "data" else typer.Option(*names, **about)
    kind = option.kind if default is not None else option.kind | None
    notes = (Output.FILE, made) if argument.name in OUTPUTS else (made,)
    return argument.replace(kind=Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[(kind, *notes)])


@wraps(functions.estimate)
def estimate(data: Path, **options: Any) -> functions.Found:
    """With a figure, whatever is asked."""
    return functions.estimate(data, **{"figure": Path("results") / f"{data.stem}_estimates.png", **options})


command("inspect")(of(functions.inspect, ""))
command("identify")(
    of(
        functions.identify,
        "identifying",
        """
Where a coil without motion explains the records, it is the result. For a valve the gap law, the stops and the
relaxed spring have to be known: voltage and current do not show them. Inductances or a recorded position give the
gap law too. Core losses and fringes are fitted only if the records speak for them. Prints values, standard errors
and correlations, names what the records do not identify, and with --assume all that was assumed.""",
        out=Path("valve.toml"),
    )
)
command("commission")(
    of(
        functions.commission,
        "commissioning",
        """
Known are stops and turns and, within a few percent, the gap law, the spring, the mass and the core. Prints values
and standard errors; exit code 1 where the model does not explain the records.""",
        out=Path("commissioned.toml"),
    )
)
command("gap-law")(
    of(
        functions.gap_law,
        "",
        """
Of several frequencies the lowest is used. The law is linear, has fringes, or is a table, whichever foretells best
the gaps that are left out; `gapsense identify --parameters gap.toml` goes on from there.""",
        out=Path("gap.toml"),
    )
)
command("fem")(
    of(
        functions.fem,
        "",
        """
Writes a gap law and a core for the estimators, and beside them flux linkage and force as one smooth energy for the
plant `TableActuator`. Prints what must hold and does not, with the worst place, and what the models leave. Exit code 1
where the table contradicts itself.""",
        out=Path("fem.toml"),
    )
)
command("estimate")(
    of(
        estimate,
        "estimating",
        "Draws what they say. Exit code 1 if the record itself shows that one of them is wrong.",
        figure="results/<data>_estimates.png",
    )
)
