"""How a single run of many is repeated."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from gapsense.many.provenance import EVENTS
from gapsense.report.html.many import Many
from gapsense.tables import parsed_value


def repeated(many: Many, run: int) -> str:
    """Command that repeats a run, or a line of Python where no option of a command says what it takes."""
    about, row = many.about, many.rows[run]
    if not many.scenario:
        return f"the scenario has no file: run it with seed_shift={row['seed']}"
    values = {name: row[name] for name in many.campaign.factors}
    if about.get("has_random_events") or any(name.startswith(EVENTS) for name in values):
        return in_python(many, run, row["seed"], values)
    seeds = {f"{name}.seed": seed + row["seed"] for name, seed in about.get("seeds", {}).items()}
    given = {**about.get("settings", {}), **seeds, **values}
    words = ["gapsense", "run", many.scenario, *variant(about), *(w for s in settings(given) for w in ("--set", s))]
    return shlex.join(words)


def variant(about: Mapping[str, Any]) -> tuple[str, ...]:
    """Option for the variant."""
    return ("--variant", about["variant"]) if about.get("variant") else ()


def settings(values: Mapping[str, Any]) -> Iterator[str]:
    """Values as `--set` takes them."""
    return (f"{name}={written(value)}" for name, value in values.items())


def written(value: Any) -> str:
    """A value as it is read back; a text in quotes where it would mean something else."""
    return value if isinstance(value, str) and parsed_value(value) == value else json.dumps(value)


def in_python(many: Many, run: int, shift: int, values: Mapping[str, Any]) -> str:
    """The same in Python, where all seeds are shifted, and a sweep has its values by their number."""
    about, is_sweep = many.about, many.kind == "sweep"
    given = list(settings(about.get("settings", {}) if is_sweep else values))
    scenario = f"changed({many.scenario!r}, {given!r})" if given else repr(many.scenario)
    own = [f"{about['variant']!r}"] if about.get("variant") else []
    point = [f"point={run % about['points']}"] if is_sweep else []
    return f"run({', '.join([scenario, *own, f'seed_shift={shift}', *point])})"
