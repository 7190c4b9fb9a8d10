"""Write fmus/<component>/typical.csv, from which the picture on its page is drawn: a run of an example scenario.

python tests/fmus/make_typical.py [NAME[=EXAMPLE] ...]

By default of the example with the fewest components that has it. The FMUs are those in build/fmus.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from drivers import ROOT

sys.path.insert(0, str(ROOT / "src"))

from gapsense import cosim
from gapsense.cosim.scenario.records import Record
from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.picture import FILE, signals_by_panel

SPAN, ROWS = 40e-3, 200  # s of the end of a run, and rows at most


class Found(NamedTuple):
    """A component in a scenario."""

    variant: str
    others: int
    path: Path
    name: str


def main(names: list[str]) -> None:
    """Write the files of all components, or of those named."""
    chosen = dict(name.partition("=")[::2] for name in names)
    for folder in find_components(ROOT / "fmus", list(chosen)):
        component = load_component(folder)
        ports = [port for panel in signals_by_panel(component) for port in panel]
        if found := example(component.name, chosen.get(folder.name) or "*"):
            write(folder / FILE, found, {port.name: port.unit for port in ports})


def example(fmu: str, among: str) -> Found | None:
    """Where the component is with the fewest others, plain scenarios before their variants."""
    found = []
    for path in sorted((ROOT / "scenarios").glob(f"{among}/scenario.toml")):
        for variant in (None, *cosim.load(path).variants):
            parts = cosim.load(path, variant).components
            names = [name for name, part in parts.items() if part.fmu == fmu]
            found += [Found(variant or "", len(parts), path, names[0])] if names else []
    return min(found, key=lambda f: (bool(f.variant), f.others), default=None)


def write(file: Path, found: Found, units: dict[str, str]) -> None:
    """Run the scenario, keep the last part of it in which much happens."""
    read, descriptions = cosim.prepare(found.path, found.variant or None)
    steps = min(SPAN / read.experiment.base_step, read.experiment.count)
    record = Record(tuple(f"{found.name}.{signal}" for signal in units), max(1, round(steps / ROWS)))
    with cosim.Master(replace(read, record=record, metrics=()), descriptions) as master:
        result = cosim.run_once(master)
    rows = busy(np.array([result[f"{found.name}.{signal}"] for signal in units]))
    columns = [result.times[rows], *(result[f"{found.name}.{signal}"][rows] for signal in units)]
    lines = [f"# A typical run: `{found.name}` in the example `{read.name}`"]
    lines.append(",".join(["time [s]", *(f"{signal} [{unit}]" for signal, unit in units.items())]))
    lines += [",".join(f"{value:.5g}" for value in row) for row in zip(*columns)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{file.relative_to(ROOT)}: {len(lines) - 2} rows of {read.name}")


def busy(signals: Any) -> slice:
    """Rows of the last part in which signals (signals, rows) vary as they do elsewhere."""
    parts = [slice(max(0, end - ROWS - 1), end) for end in range(signals.shape[1], 0, -ROWS)]
    whole = np.maximum(signals.std(axis=1), 1e-300)
    variety = [float((signals[:, part].std(axis=1) / whole).sum()) for part in parts]
    return next(part for part, much in zip(parts, variety) if much > 0.3 * max(variety))


if __name__ == "__main__":
    main(sys.argv[1:])
