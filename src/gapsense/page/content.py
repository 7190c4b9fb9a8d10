"""What the scripts of a page need to know, of JSON: the plan of the runs, panels, metrics and controls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.result.result import Result, is_late, unit_of
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.records import Metric, Scenario
from gapsense.fmi.ports import Port
from gapsense.page import plan
from gapsense.page.module import parts
from gapsense.report.html import figures, run, style
from gapsense.report.html.curves import SIGMAS, VARIANCE, Curve, Panel, deviation
from gapsense.report.html.figures import Entry
from gapsense.report.html.subject import Shown
from gapsense.report.table import PREFIXES, UNPREFIXED, choose_prefix

CONTROLS = 10  # where the scenario names none
SPAN = 4.0  # from the least value of a slider to the given one, and from that to the greatest


def make_plan(subject: Subject, result: Result) -> dict[str, Any]:
    """Collect what the scripts of a page need, as JSON."""
    scenario, experiment = subject.scenario, subject.scenario.experiment
    components = plan.values(subject, subject.make_take())
    return {
        "name": scenario.name.replace("[", "_").rstrip("]"),
        "start": experiment.start,
        "baseStep": experiment.base_step,
        "count": experiment.count,
        "decimation": scenario.record.decimation,
        "components": [
            {**own, "step": scenario.components[own["name"]].step, "offset": scenario.components[own["name"]].offset}
            for own in components
        ],
        "files": plan.files(subject),
        "inputs": plan.inputs(subject),
        "events": [*plan.events(subject)],
        "signals": [[name, about.unit] for name, about in subject.about.items()],
        "constants": dict(constants(subject)),
        "panels": [*panels(scenario, result)],
        "metrics": [metric(m, result) for m in scenario.metrics],
        "controls": [*controls(subject)],
        "prefixes": PREFIXES,
        "unprefixed": UNPREFIXED,
    }


def constants(subject: Subject) -> Iterator[tuple[str, list[int]]]:
    """Parameters that metrics refer to, with their places in the module."""
    for name in dict.fromkeys(m.reference for m in subject.scenario.metrics):
        if isinstance(name, str) and name not in subject.about:
            component, _, parameter = name.partition(".")
            variable = subject.descriptions[component].variables[parameter]
            yield name, [subject.order.names.index(component), variable.reference]


def panels(scenario: Scenario, result: Result) -> Iterator[dict[str, Any]]:
    """Panels as in a report, with where their curves come from instead of their values.

    Those that the scenario names come first, then those in which something is compared.
    """
    shown = Shown(file=Path(), result=result, scenario=scenario, note="")
    pairs = {pair.signal: pair for pair in run.pairs(shown)}
    axes = figures.make_time_axis(shown, style.colours(result.run.order), 0)
    for of in sorted(run.panels(shown), key=lambda of: place_of(of, scenario)):
        entries = figures.entries(of, axes, "")
        curves = [
            describe_curve(curve, entry, of.is_error, pairs.get(curve.name), band(result, curve.name))
            for curve, entry in zip(of.curves, entries)
        ]
        yield {"title": of.title, "unit": of.unit, "note": of.note, "isError": of.is_error, "curves": curves}
    for strip in run.strips(shown):
        colour = style.colour(axes.numbers[strip.name.partition(".")[0]])
        curves = [{"name": strip.name, "colour": property_of(colour), "dash": ()}]
        yield {"title": strip.name, "unit": "", "note": "", "isStrip": True, "curves": curves}


def place_of(panel: Panel, scenario: Scenario) -> int:
    """0 for a panel that comes first, 1 for one in which something is compared, 2 for any other."""
    if not panel.is_error and any(curve.name in scenario.page.first for curve in panel.curves):
        return 0
    return 1 if panel.is_error or any(curve.is_truth for curve in panel.curves) else 2


def describe_curve(
    curve: Curve, entry: Entry, is_error: bool, pair: Metric | None, band: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Describe a curve: a signal, or its difference from a reference. What is published later has its own times."""
    is_of_samples = pair is not None and (is_error or not curve.is_held)
    keys = {key: getattr(pair, key) for key in ("time", "where")} if is_of_samples else {}
    return {
        "name": curve.name,
        "colour": property_of(entry.colour),
        "dash": entry.dash,
        "isTruth": curve.is_truth,
        **({"band": band} if band else {}),
        **keys,
        **({"reference": pair.reference} if is_error and pair else {}),
    }


def band(result: Result, name: str) -> dict[str, Any] | None:
    """What the band of a signal is made of, if it has one."""
    signal = deviation(result, name)
    return {"signal": signal, "isVariance": signal.endswith(VARIANCE), "sigmas": SIGMAS} if signal else None


def property_of(colour: str) -> str:
    """Custom property of CSS that is a colour on any ground, as in `style.variables`."""
    return f"--c-{colour[1:]}"


def metric(of: Metric, result: Result) -> dict[str, Any]:
    """A metric, as the scripts measure it."""
    ends = (of.signal, str(of.reference), *(of.flows or ()))
    bounds = of.bounds and [bound if math.isfinite(bound) else None for bound in of.bounds]
    keys = ("name", "kind", "signal", "reference", "after", "before", "event", "where", "time", "published", "table")
    return {
        **{key: getattr(of, key) for key in keys},
        "label": of.label,
        "unit": unit_of(of, result.units),
        "isAxis": KINDS[of.kind].reference == "axis",
        "flows": of.flows,
        "isLate": [is_late(result, name) for name in ends] if of.flows else None,
        "bounds": bounds,
    }


def controls(subject: Subject) -> Iterator[dict[str, Any]]:
    """What the reader may change: what the scenario names, or else the first tunable numbers that it sets."""
    tunable = (
        f"{name}.{parameter}"
        for name in subject.order.names
        for parameter in subject.scenario.components[name].values
        if (v := subject.descriptions[name].variables[parameter]).is_tunable and v.type == "Real"
    )
    for name in subject.scenario.page.controls or [*tunable][:CONTROLS]:
        component, _, parameter = name.partition(".")
        own = parts(subject.descriptions[component].name).component
        port = next(port for port in own.ports if port.name == parameter)
        given = subject.scenario.components[component].values.get(parameter)
        yield {
            "name": name,
            "part": subject.order.names.index(component),
            "reference": subject.descriptions[component].variables[parameter].reference,
            "kind": plan.KINDS.index(port.kind),
            "text": port.description,
            **({"start": port.start} if given is None else {}),
            **({"choices": port.choices} if port.kind == "String" else {}),
            **(scale(port, float(port.start if given is None else given)) if port.kind in ("Real", "Integer") else {}),
        }


def scale(port: Port, value: float) -> Mapping[str, Any]:
    """Ends of a slider, and the unit beside it: about four times as much and as little as the scenario gives.

    Parameters that begin at zero go as far as is usual for them.
    """
    least, most = (-math.inf if port.min is None else port.min), (math.inf if port.max is None else port.max)
    size = abs(value) or port.nominal
    low, high = (size / SPAN, size * SPAN) if value > 0.0 else (-size, size)
    if -math.inf < least < most < math.inf and (least <= 0.0 or most / least <= SPAN**4):
        low, high = least, most
    factor, unit = choose_prefix(value, port.unit) if port.unit != "1" else (1.0, "")
    ends = [float(f"{max(least, min(most, end)):.3g}") for end in (low, high)]
    return {"low": ends[0], "high": ends[1], "unit": unit, "exponent": round(math.log10(factor))}
