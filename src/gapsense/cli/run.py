"""What `gapsense run` does. With the usual options it does not need typer, which takes longer to load than a run."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gapsense import cosim
from gapsense._os.files import refuse_unwritable
from gapsense._os.interrupts import count_interrupts, handle
from gapsense.cli.console import APART, FAILED, INTERRUPTED, bar, choose_fmus, notice, problem, show
from gapsense.cli.straight import NATIVE, SCENARIO, SET
from gapsense.problems import number_of

TO = Path("results")


def run_straight(given: dict[str, Any], interrupts: Callable[[], int]) -> None:
    """Run a scenario with options that `parse_run` understood, unless there was a Ctrl-C before."""
    with handle(signal.default_int_handler):
        if interrupts():
            raise KeyboardInterrupt
        fmus = choose_fmus(given[SCENARIO], given.get("--fmus"), NATIVE in given)
        run(given[SCENARIO], given.get("--variant"), fmus, given.get("--out", TO), settings=given.get(SET))


def run(
    scenario: Path,
    variant: str | None,
    fmus: Path | None,
    to: Path = TO,
    every: float | None = None,
    resume: bool = False,
    settings: Sequence[str] | None = None,
) -> None:
    """Run a scenario, show and save what came of it, and end the program with the exit code for that."""
    with count_interrupts() as interrupts:  # it loads numpy, which takes a Ctrl-C meanwhile for an error of its own
        source = cosim.changed(scenario, settings or ())
    if interrupts():
        raise KeyboardInterrupt
    file = cosim.result_file(to, scenario, variant, settings or ())
    refuse_unwritable(file, file.with_suffix(".json"))
    saved = file.with_suffix(".checkpoint")
    checkpoint = cosim.Checkpoint(saved, every, resume) if resume or every is not None else None
    try:
        with bar("running") as progress:
            result = cosim.run(source, variant, fmus, progress=progress, checkpoint=checkpoint, **APART)
    except cosim.FmuError as error:
        if error.result is not None and error.result.times.size:
            save(error.result, file)
            notice(f"{file}: {number_of(error.result.times.size, 'row')} from before the failure.")
        raise
    from gapsense.report import runs  # here: the progress bar loads it while the run goes on

    try:
        makers = (runs.metrics, runs.events, runs.loops, runs.steps, runs.boards)
        show(*(table for made in makers for table in made(result)), runs.timing(result))
    finally:  # saved afterwards: on a full disk the numbers are at least shown; and also if nobody reads them
        is_stopped = save(result, file)
    for remark in result.run.remarks:
        notice(remark)
    show(f"{file}: {number_of(result.times.size, 'row')}, {number_of(len(result.signals), 'signal')}.")
    if result.interrupted:
        on = " use `--resume` to continue from the checkpoint." if checkpoint and checkpoint.file.is_file() else ""
        notice(f"interrupted at t = {result.times[-1]:.6g} s; what was computed is in {file}.{on}")
        raise SystemExit(INTERRUPTED)
    if checkpoint:
        checkpoint.file.unlink(missing_ok=True)  # nothing is left to go on with
    failures = [m for m in result.metrics.values() if not m.passed]
    for measured in failures:
        problem(f"outside its bounds: {measured}")
    raise SystemExit(INTERRUPTED if is_stopped else FAILED if failures else 0)


def save(result: cosim.Result, file: Path) -> bool:
    """Save a result; true after Ctrl-C meanwhile, which may have been meant for the run: only the next one stops it."""

    def tell() -> None:
        """Say what a Ctrl-C has to wait for."""
        if interrupts() == 1:
            notice(f"interrupted; {file} is being written. Ctrl-C again stops that.")

    with count_interrupts(at_most=1, then=tell) as interrupts:
        result.save(file)
    return interrupts() > 0
