"""Commands for campaigns: run one, show its result, draw it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from gapsense.cli import common as cli
from gapsense.cli import console
from gapsense.problems import InputError

if TYPE_CHECKING:
    from gapsense.many.result import Campaign

RUN = "run"


class RunsByDefault(TyperGroup):
    """A group in which the word `run` may be left out: `gapsense campaign STUDY.toml`."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments name."""
        return super().resolve_command(ctx, args if args[0] in self.commands else [RUN, *args])

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Options before the study file are those of `run`."""
        is_option = args and args[0].startswith("-") and args[0] not in ctx.help_option_names
        return super().parse_args(ctx, [RUN, *args] if is_option else args)


group = typer.Typer(
    cls=RunsByDefault,
    no_args_is_help=True,
    help="Run the cases of a study file, thousands if need be; `campaign STUDY.toml` means `campaign run STUDY.toml`.",
)
cli.app.add_typer(group, name="campaign")
Result = Annotated[Path, typer.Argument(help="Folder of a campaign's result")]
Export = Annotated[Path | None, cli.Output.FILE, typer.Option(help="CSV or Parquet file to write, one row per run")]


@cli.command(RUN, group)
def run(
    study: Annotated[Path, typer.Argument(help="Study file")],
    workers: Annotated[
        int | None, typer.Option(help="Processes", min=1, max=1000, show_default="one per processor")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, whose workers then do the runs: tcp://HOST:8786")
    ] = None,
    fmus: cli.Fmus = None,
    to: Annotated[
        Path | None,
        cli.Output.FOLDER,
        typer.Option("--out", help="Folder of the result", show_default="results/<study>"),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run failed runs again")] = False,
    engine: cli.Engine = "auto",
    export: Export = None,
    only_check: Annotated[bool, typer.Option("--check", help="Check only, do not run")] = False,
) -> None:
    """Run a study. Runs already in its folder are not repeated, so the same command continues it."""
    from gapsense.many.campaign import campaign
    from gapsense.many.prepare import check_study
    from gapsense.many.result import check_export

    if only_check:
        if problems := check_study(study, fmus):
            raise InputError(problems)
        return console.show(f"{study}: no problems.")
    if export:
        check_export(export)
    with console.bar("running") as progress:
        result = campaign(study, workers, to, fmus, scheduler, retry, progress, engine)
    summarize(result, export)
    done = f"{result.computed} of them computed now{cli.as_vectors(result)}"
    console.show(f"{result.folder}: {result.rows} of {result.runs} runs, {done}.")
    if result.interrupted:
        console.problem("interrupted; run the same command to continue.", "yellow")
    raise SystemExit(console.INTERRUPTED if result.interrupted else console.COMPONENT_FAILED if result.failed else 0)


@cli.command("show", group)
def show(result: Result, export: Export = None) -> None:
    """Show quantiles of every metric, what each depends on, and what failed. Works while the campaign runs, too."""
    from gapsense.many.result import check_export, read_campaign

    if export:
        check_export(export)
    summarize(read_campaign(result, hold=True), export)


def summarize(result: Campaign, export: Path | None) -> None:
    """Print the outcome, and write its rows if that is wanted."""
    from gapsense.report import campaigns

    console.show(*campaigns.summary(result))
    if export:
        console.say_written(result.export(export))


@cli.command("figure", group)
def figure(
    result: Result,
    metric: Annotated[list[str] | None, typer.Option(help="Metric to draw", show_default="the first 4")] = None,
    factor: Annotated[list[str] | None, typer.Option(help="Parameter to draw", show_default="the first 4")] = None,
    to: Annotated[
        Path | None, cli.Output.FILE, typer.Option("--out", help="PNG, PDF or SVG file", show_default="<result>.png")
    ] = None,
) -> None:
    """Draw every metric over every parameter: points, or a density if there are many."""
    from gapsense.many.result import read_campaign
    from gapsense.report import campaigns, plot

    file = to or result.resolve().with_name(f"{result.resolve().name}.png")
    plot.check_file(file)
    made = campaigns.figure(read_campaign(result, hold=True), metric or (), factor or ())
    console.say_written(plot.save(made, file))
