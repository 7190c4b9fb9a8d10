"""Commands for scenarios: check, run, sweep, draw, test, baseline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense._os.files import refuse_unwritable
from gapsense.cli import common as cli
from gapsense.cli import console
from gapsense.cli.compare import draw
from gapsense.cli.run import TO
from gapsense.cli.run import run as run_scenario
from gapsense.cosim.run.ahead import run_ahead, runs_ahead
from gapsense.problems import number_of
from gapsense.report import runs
from gapsense.shipped import is_installed

FAILED = Path("results/failed")
REMEDY = "Leave it out of `baseline.signals`, or give it a larger tolerance in `[baseline.tolerances]`."


@cli.command("check")
def check(scenario: cli.Scenario, variant: cli.Variant = None, fmus: cli.Fmus = None, settings: cli.Set = None) -> None:
    """Check a scenario and all its variants without running it, and list every problem."""
    source = cosim.changed(scenario, settings or ())
    if problems := cosim.check(source, variant, fmus):
        raise cosim.ScenarioError(problems)
    remarks = cosim.remarks(source, variant, fmus)
    for remark in remarks:
        console.notice(remark)
    console.show(
        f"{scenario}: no errors, {number_of(len(remarks), 'warning')}." if remarks else f"{scenario}: no problems."
    )


@cli.command("run")
def run(
    scenario: cli.Scenario,
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    to: Annotated[
        Path, typer.Option("--out", help="Folder for the CSV file and its JSON side-car, or name of the CSV file")
    ] = TO,
    every: Annotated[
        float | None,
        typer.Option(
            "--checkpoint", help="Save the run each time that so much simulated time has passed", metavar="SECONDS"
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue from the checkpoint")] = False,
    settings: cli.Set = None,
    native: cli.Native = False,
    only_check: Annotated[bool, typer.Option("--check", help="Check only, do not run")] = False,
) -> None:
    """Run a scenario: print metrics, published values and time per component; write results as CSV and JSON."""
    fmus = console.choose_fmus(scenario, fmus, native)
    if only_check:
        return check(scenario, variant, fmus, settings)
    with run_ahead():
        run_scenario(scenario, variant, fmus, to, every, resume, settings)


@cli.command("sweep")
def sweep(
    scenario: cli.Scenario,
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Runs of each combination; run i adds i to every seed", show_default="1, or 200 without `[sweep]`"
        ),
    ] = None,
    variant: cli.Variant = None,
    workers: cli.Workers = 2,
    fmus: cli.Fmus = None,
    to: cli.Out = Path("results"),
    settings: cli.Set = None,
    native: cli.Native = False,
    engine: cli.Engine = "auto",
    signals: Annotated[bool, typer.Option("--signals", help="Keep the recorded signals of every run too")] = False,
) -> None:
    """Run a scenario over its `[sweep]` and over seeds; show median and 5-95 % range of every metric.

    An interrupted sweep continues where it was: runs already in the folder are not repeated.
    """
    engine = cli.engine_of(engine, native)
    fmus = console.choose_fmus(scenario, fmus, engine == "native")
    with runs_ahead(workers, engine, cosim.scenario_file(scenario)), console.bar("sweeping") as progress:
        from gapsense.cosim.run.loop.compiled import language  # here, while the workers start

        source = cosim.changed(scenario, settings or ())
        swept = cosim.sweep(source, seeds, variant, workers, to, fmus, None, progress, signals, engine)
    console.show(*runs.sweep(cosim.load(source, variant), swept))
    if language() != "C" and swept.engine != "vectors":
        console.show(runs.WITHOUT_C)
    count, failed = len(swept.indices) + len(swept.errors), f", {len(swept.errors)} failed" if swept.errors else ""
    console.show(f"{swept.file}: {count} runs, {swept.computed} of them computed now{cli.as_vectors(swept)}{failed}.")
    if swept.kept:
        console.show(f"{swept.kept[0].parent}: their signals.")
    for index, sentence in list(swept.ended.items())[:1]:
        console.notice(f"{len(swept.ended)} of {count} runs were ended by a component; run {index}: {sentence}")
    for index, error in swept.errors.items():
        console.problem(f"run {index}: {error}")
    if swept.interrupted:
        console.problem("interrupted; run the same command to continue.", "yellow")
    raise SystemExit(console.INTERRUPTED if swept.interrupted else console.COMPONENT_FAILED if swept.errors else 0)


@cli.command("figure")
def figure(
    scenario: Annotated[Path, typer.Argument(help="Scenario, or the CSV of a saved result")],
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    to: Annotated[
        Path | None,
        cli.Output.FILE,
        typer.Option("--out", help="PNG, PDF or SVG file", show_default="results/<scenario>.png"),
    ] = None,
    settings: cli.Set = None,
    show: Annotated[bool, typer.Option("--show", help="Show it, in the browser")] = False,
) -> None:
    """Run a scenario and draw its figure, or draw that of a saved result."""
    from gapsense.report import plot
    from gapsense.studies import drawer

    if scenario.suffix == ".csv":
        if variant or fmus or settings:
            raise ValueError(
                f"`{scenario}` is a result: --variant, --fmus and --set apply to a new run only. Leave them out."
            )
        result, file = cosim.read_result(scenario), to or Path("results") / f"{scenario.stem}.png"
        if not to:
            plot.refuse_foreign(file, cosim.relative(result.run.source, file.parent))
    else:
        source = cosim.changed(scenario, settings or ())
        file = to or plot.figure_file(Path("results"), scenario, variant, settings or ())
        drawer(cosim.load(source, variant).figure)  # refuses a wrong one before a long run
        plot.check_file(file)
        with console.bar("running") as progress:
            result = cosim.run(source, variant, fmus, progress=progress, **console.APART)
        console.stop_if_interrupted(result)
    console.say_written(plot.save(drawer(result.run.figure)(result), file, result.run.source))
    if show:
        cli.open_in_browser(file)


@cli.command("test")
def test(
    folder: Annotated[Path, typer.Argument(help="Folder with scenarios at any depth")] = Path("scenarios"),
    fmus: cli.Fmus = None,
    junit: Annotated[Path | None, cli.Output.FILE, typer.Option(help="JUnit XML file to write")] = None,
    native: cli.Native = False,
    engine: cli.EngineOfTests = "fmu",
    figures: Annotated[Path, typer.Option(help="Folder for figures of signals that differ from a baseline")] = FAILED,
) -> None:
    """Run every scenario and variant, and compare metrics with bounds and trajectories with baselines."""

    def report(outcomes: Sequence[cosim.Outcome], last: cosim.Outcome | None) -> None:
        if last:
            console.show(runs.outcome(last))
            picture(last, figures)
        if junit:
            cosim.write_junit(outcomes, junit)

    if figures != FAILED:  # what nobody has asked for may be missing
        refuse_unwritable(folders=[figures])
    engine = cli.engine_of(engine, native)
    fmus = console.choose_fmus(folder, fmus, native or engine == "native")
    outcomes = cosim.test_scenarios(folder, fmus, report, isolation="process", engine=engine)
    failed = sum(not o.passed for o in outcomes)
    console.show(f"{len(outcomes) - failed} passed, {failed} failed")
    raise SystemExit(console.INTERRUPTED if any(o.interrupted for o in outcomes) else console.FAILED if failed else 0)


def picture(outcome: cosim.Outcome, folder: Path) -> None:
    """Draw what differs from a baseline. The tests go on if that fails."""
    if outcome.comparison and outcome.comparison.failing:
        name = outcome.scenario.replace("/", "_").replace("[", "_").rstrip("]")
        try:
            draw(outcome.comparison, folder / f"{name}.png", outcome.scenario)
        except OSError as error:
            console.notice(f"`{folder / name}.png` cannot be written: {error.strerror}. Choose another folder.")


@cli.command("baseline")
def baseline(
    scenario: cli.Scenario,
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    write: Annotated[
        bool, typer.Option("--write", help="Write the baseline; without this, the changes are only shown")
    ] = False,
    sensitive: Annotated[
        bool, typer.Option("--sensitivity", help="Show instead how far changes of 1e-9 spread in the signals")
    ] = False,
    native: cli.Native = False,
) -> None:
    """Show what a new baseline of a scenario would change, and write it only with --write.

    With --sensitivity, all parameters and constant inputs are changed by 1e-9 of their values, some up, some down, in
    four runs. A signal that then leaves its tolerance depends more on rounding than on the scenario: exit code 1.
    """
    fmus = console.choose_fmus(scenario, fmus, native)
    if sensitive:
        found = cosim.sensitivity(scenario, variant, fmus)
        console.show(runs.growths(found))
        for growth in [g for g in found if g.is_beyond]:
            console.problem(f"{growth}. {REMEDY}")
        raise SystemExit(console.FAILED if any(g.is_beyond for g in found) else 0)
    if write and is_installed(cosim.scenario_file(scenario)):
        raise cosim.ScenarioError(
            [f"{scenario} came with Gapsense. Copy it first: `gapsense new mine --like {scenario}`."]
        )
    update = cosim.update_baseline(scenario, variant, fmus, write, isolation="process")
    console.show(str(update))
    raise SystemExit(console.INTERRUPTED if update.interrupted else 0)
