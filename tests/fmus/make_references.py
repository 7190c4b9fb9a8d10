"""Write fmus/<component>/reference.csv: a short run of each FMU, or of those named, as it is now.

python tests/fmus/make_references.py [NAME ...]

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


def main(names: list[str]) -> int:
    """Exit code: 0 if all were written; 2 with one sentence if a component cannot be built, or its FMU refuses."""
    try:
        for folder in find_components(ROOT / "fmus", names):
            write(folder)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def write(folder: Path) -> None:
    """Write the reference of one component; a ValueError tells why not, and the old one stays."""
    component = load_component(folder)
    step = max(1, round(component.stop_time / ROWS / component.step_size)) * component.step_size
    with tempfile.TemporaryDirectory() as out:
        run = recorded(build(folder, Path(out)), step)
    rows = [[k * step, *inputs, *outputs] for k, (inputs, outputs) in enumerate(zip(run["inputs"], run["outputs"]))]
    with (folder / "reference.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *run["names"][0], *run["names"][1]])
        writer.writerows([f"{value:.17g}" for value in row] for row in rows)
    print(f"{folder.name}/reference.csv: {len(rows)} rows, step {step:g} s")


def recorded(fmu: Path, step: float) -> Any:
    """A short run in a fresh process."""
    done = call("reference", fmu, step, ROWS)
    if done.returncode:
        raise ValueError(done.stderr.strip().splitlines()[-1])
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
