"""Write fmus/<component>/reference.csv: a short run of each FMU, or of those named, as it is now.

python tests/fmus/make_references.py [NAME ...]

Look at the changes before you commit them: `git diff fmus`.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from pathlib import Path

from drivers import ROOT, fresh

ROWS = 40


def main(names: list[str]) -> None:
    sys.path.insert(0, str(ROOT / "src"))
    from gapsense.fmi.components import find_components, load_component

    for folder in find_components(ROOT / "fmus", names):
        component = load_component(folder)
        step = max(1, round(component.stop_time / ROWS / component.step_size)) * component.step_size
        with tempfile.TemporaryDirectory() as out:
            fresh("build", [str(folder)], out)
            run = fresh("reference", Path(out) / f"{component.name}.fmu", step, ROWS)
        rows = [[k * step, *inputs, *outputs] for k, (inputs, outputs) in enumerate(zip(run["inputs"], run["outputs"]))]
        with (folder / "reference.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["time", *run["names"][0], *run["names"][1]])
            writer.writerows([f"{value:.17g}" for value in row] for row in rows)
        print(f"{folder.name}/reference.csv: {len(rows)} rows, step {step:g} s")


if __name__ == "__main__":
    main(sys.argv[1:])
