"""Pictures of the gallery: one for each scenario and each study that draws, made anew where older than the sources."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import matplotlib.figure  # noqa: F401  loaded once, for all forks
from kept import ROOT, kept, newest

import gapsense.cosim.run.run  # noqa: F401
from gapsense.cli import start
from gapsense.cosim import load

NATIVE = ROOT / "build" / "native"  # FMUs with the bits of the Python ones, in half the time of a figure


class Entry(NamedTuple):
    """A picture, and the command that draws it."""

    title: str
    command: str  # words after `gapsense`
    place: str  # in the site
    is_file: bool = False  # `--out` of the command is the picture, not a folder
    takes_fmus: bool = False


STUDIES = [  # with the options for their pictures; studies that print tables only are not here
    Entry("Errors of the bounded UKF over the noise, [UKF] Fig. 8", "ukf-noise --seeds 2", "ukf_noise.png"),
    Entry(
        "Faults of the current sensor, and what three estimators do with them", "faults", "faults.png", takes_fmus=True
    ),
    Entry(
        "Deviations of the hybrid Kalman filter over the noise, [HEKF] Figs. 8 to 11",
        "hybrid-ekf --seeds 4",
        "hybrid_ekf_consistent_noise.png",
    ),
    Entry("A good record of a valve", "measuring --seeds 0", "measuring_good.png"),
    Entry(
        "Samples that make the state observable, [RTS] Fig. 6",
        "observability-rts",
        "observability_rts.png",
        is_file=True,
    ),
    Entry("The cycle with soft landing of [RTS] Fig. 5", "reference-cycle", "reference_cycle.png", is_file=True),
    Entry(
        "Errors of filter and smoother over wrong parameters, [RTS] Fig. 9", "monte-carlo --runs 50", "monte_carlo.png"
    ),
    Entry(
        "Errors of the smoother against its covariances, [RTS] Fig. 8", "consistency --runs 100", "consistency_nees.png"
    ),
    Entry(
        "Soft landing from cycle to cycle, eight valves that were never identified",
        "run-to-run --runs 8 --cycles 12 --conditions plain --laws contact,model",
        "run_to_run_plain_speeds.png",
    ),
]


def entries() -> list[Entry]:
    """All of them, scenarios first."""
    scenarios = [folder.parent for folder in sorted((ROOT / "scenarios").glob("*/scenario.toml"))]
    figures = [Entry(load(f).title, f"figure {f.name}", f"gallery/{f.name}.png", True, True) for f in scenarios]
    studies = [s._replace(command=f"study {s.command}", place=f"gallery/studies/{s.place}") for s in STUDIES]
    return [*figures, *studies]


def made(entry: Entry) -> Path:
    """Its picture, drawn by the command."""

    def draw(file: Path) -> None:
        """Let the command draw it into a file."""
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / Path(entry.place).name
            more = ["--fmus", str(NATIVE)] if entry.takes_fmus and is_current(NATIVE) else []
            call([*entry.command.split(), "--out", str(out if entry.is_file else folder), *more])
            shutil.move(out, file)

    return kept(entry.place, draw)


def call(words: list[str]) -> None:
    """Run `gapsense` with these words, on Linux in a fork of this process: its start takes as long as a figure."""
    if sys.platform == "linux":
        process = multiprocessing.get_context("fork").Process(target=forked, args=(words,))
        process.start()
        process.join()
        code = process.exitcode
    else:
        command = [sys.executable, "-m", "gapsense", *words]
        code = subprocess.run(command, cwd=ROOT, check=False, stdout=subprocess.DEVNULL).returncode
    if code:
        raise RuntimeError(f"`gapsense {' '.join(words)}` ended with exit code {code}")


def forked(words: list[str]) -> None:
    """The program, which prints nothing."""
    os.chdir(ROOT)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.argv[:] = ["gapsense", *words]
    start(words)


def is_current(fmus: Path) -> bool:
    """True if `make` has built these since the last change."""
    built = fmus / ".built"
    return built.is_file() and built.stat().st_mtime > newest() and any(fmus.glob("*.fmu"))


def page(pictures: list[Entry]) -> str:
    """The part of the page that has the pictures."""
    parts = (f"## {e.title}\n\n![{e.title}]({e.place})\n\n`gapsense {e.command}`\n" for e in pictures)
    return "\n".join(parts)
