"""The files of the scenario `estimators` that follow from the contenders and from what they believe of the valve.

In `scenario.toml` these are the parts between `# >>> NAME` and `# <<<`; all else there is written by hand.
`python -m gapsense.scenarios.estimators.scenario scenarios/estimators` writes them anew.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gapsense.tables import Value

from ..soft_landing.setting import errors
from .contenders import CONTENDERS, NOISES, Contender
from .parameters import DEVICES, VALVE, Valve, gap_table, plant, wrong

SEED, DRAWS = 1, 16
WIDTHS = {"rows_5.csv": 0.1, "rows_10.csv": 0.2}  # intervals of +-5 % and +-10 %, (55)
QUIET, NOISY = (dict(zip(NOISES, sizes)) for sizes in ((0.003, 0.0002), (0.3, 0.02)))  # [V], [A]
LEVELS = {"quiet": QUIET, "noisy": NOISY, "together": NOISY}  # noise by variant
GAP_FILE, TABULATED = "gap_19.csv", "BoundedUkf"  # gap table, and the FMU that reads one
PART = re.compile(r"^( *# >>> (\w+).*?\n).*?^( *# <<<\n)", re.DOTALL | re.MULTILINE)


def write(folder: Path) -> None:
    """Write the marked parts of the scenario in a folder, its gap tables and its rows of wrong beliefs."""
    file, made = folder / "scenario.toml", parts()
    filled = PART.sub(lambda part: part[1] + made[part[2]] + part[3], file.read_text(encoding="utf-8"))
    file.write_text(filled, encoding="utf-8")
    for name, valve in {GAP_FILE: VALVE, **{gap_file(name): valve for name, valve in DEVICES.items()}}.items():
        save(folder / name, "gap [m],reluctance [1/H],slope [1/(H.m)]", np.transpose(gap_table(valve)), "%.10g")
    for name, width in WIDTHS.items():
        table = rows(width)
        save(folder / name, ",".join(table[0]), [[*row.values()] for row in table], "%.8g")


def save(file: Path, header: str, values: ArrayLike, form: str) -> None:
    """Write a CSV file."""
    np.savetxt(file, values, form, ",", header=header, comments="", encoding="utf-8")


def beliefs(v: Valve) -> dict[str, float]:
    """Parameters of all contenders by `component.parameter`."""
    return {f"{c.source}.{parameter}": value for c in CONTENDERS for parameter, value in c.told(v).items()}


def rows(width: float, draws: int = DRAWS) -> list[dict[str, float]]:
    """Wrong beliefs, one row per draw: the first draws of the Monte Carlo of [RTS], uniform in an interval of `width`.

    The same draws for every width, as there.  What nobody believes wrong is left out.
    """
    table, right = [beliefs(wrong(e)) for e in width * errors(SEED, 0, draws).T], beliefs(VALVE)
    varied = [name for name in right if any(row[name] != right[name] for row in table)]
    return [{name: row[name] for name in varied} for row in table]


def parts() -> dict[str, str]:
    """The marked parts by name."""
    wires = {f"{c.source}.{name}": source for c in CONTENDERS for name, source in c.wires.items()}
    return {
        "components": "\n".join(component(c) for c in CONTENDERS if not c.shared),
        "connections": lines({target: source for target, source in wires.items() if isinstance(source, str)}),
        "inputs": lines({target: source for target, source in wires.items() if not isinstance(source, str)}),
        "signals": "".join(f'  "*.{name}",\n' for name in dict.fromkeys(s for c in CONTENDERS for s in c.signals())),
        "noise": "\n".join(map(noise, LEVELS)),
        "devices": "\n".join(map(device, DEVICES)),
    }


def lines(values: Mapping[str, Value]) -> str:
    """Values of a table of TOML, one a line."""
    return "".join(f'"{name}" = {literal(value)}\n' for name, value in values.items())


def component(c: Contender) -> str:
    """FMU and parameters of a contender."""
    options = {"set": c.options} if c.options else {}
    return toml(f"components.{c.component}", {"fmu": c.fmu, "parameters": [set_file(c)], **options})


def set_file(c: Contender, variant: str | None = None) -> str:
    """The parameter set of a contender, or that for another actuator, in the folder of the scenario."""
    return f"parameters/{c.file}{'' if variant is None else f'_{variant}'}.toml"


def noise(variant: str) -> str:
    """The noise of the sensor in a variant, as the contenders know it."""
    told = {"sensor": NOISES, **{c.source: c.noises for c in CONTENDERS if c.noises}}
    values = {f"{name}.set": {n: LEVELS[variant][n] for n in noises} for name, noises in told.items()}
    return toml(f"variants.{variant}.components", values)


def device(variant: str) -> str:
    """Another actuator, and what the contenders are told of it: all that is not as before."""
    valve = DEVICES[variant]
    told = {"actuator": plant, **{c.source: c.told for c in CONTENDERS}}
    values = {name: differing(tell(valve), tell(VALVE)) for name, tell in told.items()}
    for c in CONTENDERS:
        values[c.source] |= {"gap.file": gap_file(variant)} if c.fmu == TABULATED else {}
    sets = {f"{c.source}.parameters": [set_file(c, variant)] for c in CONTENDERS if c.is_commissioned}
    told_all = {f"{name}.set": given for name, given in values.items() if given}
    return toml(f"variants.{variant}.components", {**told_all, **sets})


def differing(values: Mapping[str, float], others: Mapping[str, float]) -> dict[str, Value]:
    """The values that are not the same, to ten digits: the last ones are not the same on all machines."""
    return {name: float(f"{value:.10g}") for name, value in values.items() if value != others[name]}


def gap_file(variant: str) -> str:
    """Name of the gap table of another actuator."""
    return GAP_FILE.replace(".csv", f"_{variant}.csv")


def toml(header: str, values: Mapping[str, Any]) -> str:
    """A table of TOML; tables in it are in one line."""
    return "".join([f"[{header}]\n", *(f"{name} = {literal(value)}\n" for name, value in values.items())])


def literal(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f'"{name}" = {literal(v)}' for name, v in value.items()) + " }"
    return json.dumps(value)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
