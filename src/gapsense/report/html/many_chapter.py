"""Many runs as a chapter of the page: what the template `many.html` asks for."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from gapsense.cosim.provenance import EVENTS
from gapsense.problems import number_of
from gapsense.report.distributions import named
from gapsense.report.html.chapter import Chapter, Verdict, limits
from gapsense.report.html.many import Many
from gapsense.report.html.many_plots import drawn
from gapsense.tables import parsed_value

if TYPE_CHECKING:
    from gapsense.campaign.worst import Extremes, Worst

BENT = 0.2  # share of a metric that must go with a parameter, if it does not so in one direction


def chapter_of_many(many: Many, key: str) -> Chapter:
    """Everything about a campaign or a sweep."""
    about, tables = many.about, dict[str, list[str]]()
    for name in many.extremes:
        tables.setdefault(many.labels[name][0], []).append(name)
    figures, hint = drawn(many, key)
    content = {
        "many": many,
        "seeds": ", ".join(f"{name} {seed}" for name, seed in about.get("seeds", {}).items()),
        "settings": ", ".join(f"{name} = {value}" for name, value in about.get("settings", {}).items()),
        "tables": tables,
        "worst": [(metric, one) for metric, found in many.extremes.items() for one in telling(found)],
        "figures": figures,
        "hint": hint,
        "limits": lambda name: limits(many.bounds(name), partial(many.shown, name)),
        "goes_with": partial(goes_with, many),
        "levels": lambda name: "many" if (found := many.levels[name]) is None else ", ".join(map(named, found)),
        "named": partial(run_name, many),
        "repeated": partial(repeated, many),
        "why": partial(why, many),
    }
    return Chapter(
        key=key,
        title=f"{about['title']}: {many.kind}",
        name=many.file.stem,
        about=about.get("description", ""),
        verdict=verdict(many),
        template="many.html",
        content=content,
        figures=tuple(one for own in figures.values() for one in own),
    )


def verdict(many: Many) -> Verdict:
    """What came of all runs: complete if each is there and none failed; bounds are those of the scenario as it is."""
    of = many.campaign
    missing, sentences = of.runs - of.rows, []
    if missing > 0:
        sentences.append(f"{missing} of {of.runs} runs are missing: the same command goes on.")
    if of.failed:
        sentences.append(f"{number_of(of.failed, 'run')} failed.")
    if not sentences:
        sentences.append(f"All {of.runs} runs are there, none failed.")
    words = ("complete", "incomplete")
    return Verdict(missing <= 0 and not of.failed, (*sentences, *of_bounds(many)), words)


def of_bounds(many: Many) -> Iterator[str]:
    """Sentences on the bounds of the metrics, and on metrics without a value."""
    bounded = [name for name in many.extremes if many.bounds(name)]
    outside = [name for name in bounded if many.extremes[name].outside]
    if outside:
        yield f"{len(outside)} of {len(bounded)} metrics with bounds are outside of them in some runs."
    elif bounded:
        yield f"All {len(bounded)} metrics with bounds are within them in all runs that have a value."
    gaps = [name for name in many.extremes if many.spreads[name].missing > many.campaign.failed]
    if gaps:
        yield f"{len(gaps)} metrics have no value in some runs that did not fail."


def run_name(many: Many, run: int) -> str:
    """A run, and what it adds to every seed."""
    shift = many.rows[run]["seed"]
    return f"{run}" if not many.about.get("seeds") or shift is None else f"{run} (seeds + {shift})"


def goes_with(many: Many, name: str) -> str:
    """What a metric goes with most: a correlation, unless it goes up and down with another parameter."""
    found = many.correlations.get(name, ())
    if not found or not found[0].correlation:
        return "-"
    bent = max(found, key=lambda one: one.share)
    if bent.share > max(BENT, 2.0 * found[0].correlation ** 2):
        return f"{bent.factor}, up and down"
    return f"{found[0].factor} {found[0].correlation:+.2f}"


def telling(found: Extremes) -> tuple[Worst, ...]:
    """Runs of a metric that are worth a row: of those within the bounds, the nearest to a bound."""
    return found.worst if not found.worst or found.worst[0].beyond > 0.0 else found.worst[:1]


def why(many: Many, metric: str, beyond: float) -> tuple[str, bool]:
    """Why a run is listed: where its value lies, and whether that is outside of the bounds."""
    if many.bounds(metric) is None:
        return f"{many.shown(metric, beyond)} from the median", False
    if beyond <= 0.0:
        return "inside" if math.isinf(beyond) else f"inside by {many.shown(metric, -beyond)}", False
    return f"outside by {many.shown(metric, beyond)}", True


# How a single run is repeated -----------------------------------------------------------------------------------------


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
