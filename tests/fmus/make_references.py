"""Write fmus/<component>/reference.csv: a short run of each FMU, or of those named, as it is now.

python tests/fmus/make_references.py [--keep-inputs] [NAME ...]

The inputs are random; those of `run_to_run`, of the closed loop of its example, are kept with --keep-inputs.
Look at the changes before you commit them: `git diff fmus`.
"""

from __future__ import annotations

import csv
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from drivers import ROOT, call

sys.path.insert(0, str(ROOT / "src"))

from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.package import build

ROWS = 40
KEEP = "--keep-inputs"


def main(words: list[str]) -> int:
    """Exit code: 0 if all were written; 2 with one sentence if a component cannot be built, or its FMU refuses."""
    names = [word for word in words if word != KEEP]
    try:
        for folder in find_components(ROOT / "fmus", names):
            write(folder, KEEP in words)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def write(folder: Path, keeps_inputs: bool = False) -> None:
    """Write the reference of one component; a ValueError tells why not, and the old one stays."""
    component = load_component(folder)
    step = max(1, round(component.stop_time / ROWS / component.step_size)) * component.step_size
    given = None
    if keeps_inputs:
        step, given = kept(folder / "reference.csv", len(component.of("input")))
    with tempfile.TemporaryDirectory() as out:
        run = recorded(build(folder, Path(out)), step, given)
    rows = [[k * step, *inputs, *outputs] for k, (inputs, outputs) in enumerate(zip(run["inputs"], run["outputs"]))]
    with (folder / "reference.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *run["names"][0], *run["names"][1]])
        writer.writerows([f"{value:.17g}" for value in row] for row in rows)
    print(f"{folder.name}/reference.csv: {len(rows)} rows, step {step:g} s")


def kept(file: Path, count: int) -> tuple[float, list[list[float]]]:
    """Step and inputs of the reference as it is."""
    with file.open(newline="", encoding="utf-8") as lines:
        rows = [[float(cell) for cell in row[: 1 + count]] for row in list(csv.reader(lines))[1:]]
    return rows[1][0], [row[1:] for row in rows]


def recorded(fmu: Path, step: float, given: list[list[float]] | None = None) -> Any:
    """A short run in a fresh process."""
    done = call("reference", fmu, step, len(given) - 1 if given else ROWS, given)
    if done.returncode:
        raise ValueError(done.stderr.strip().splitlines()[-1])
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
