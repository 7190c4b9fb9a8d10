"""The file: the module, what it is given and how its results are shown, and a policy that lets nothing be fetched."""

from __future__ import annotations

import math
import zlib
from base64 import b64encode
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gapsense._os.files import write_atomically
from gapsense.cosim.check import prepare
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.result.result import Result, unit_of
from gapsense.cosim.run.engines import run_as_vectors
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.run.run import run
from gapsense.cosim.scenario.read import Source
from gapsense.cosim.scenario.records import Metric, Scenario
from gapsense.fmi.ports import Port
from gapsense.page import plan
from gapsense.page.module import module, parts, refuse_without_zig
from gapsense.problems import InputError, ScenarioError, listing
from gapsense.report.html import page as report
from gapsense.report.html import style
from gapsense.report.table import PREFIXES, UNPREFIXED, prefixed
from gapsense.vectors.engine import is_ours
from gapsense.version import __version__

HERE = "gapsense.page"
POLICY = f"{report.POLICY}; worker-src blob:"
MAY_COMPILE = "'wasm-unsafe-eval'"
MISSING = report.MISSING.replace("Reports are drawn", "The panels of a page are chosen as in reports, which are drawn")
CONTROLS = 10  # where the scenario names none
SPAN = 4.0  # from the least value of a slider to the given one, and from that to the greatest
UPLOT = "uPlot 1.6.32"


def write_page(scenario: Source, to: str | Path, variant: str | None = None, fmus: str | Path | None = None) -> Path:
    """Write one HTML file in which a scenario runs, complete or not at all.

    Parameters
    ----------
    scenario : str, Path or Document
        Scenario file, its folder, or its content.
    to : str or Path
        The file; its folder is made if there is none.
    variant : str, optional
        Variant of the scenario.
    fmus : str or Path, optional
        Folder of the FMUs, as in `run`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the scenario is wrong or has what a page cannot run, or if bokeh is missing.
    NativeError
        If the compiler is missing, or fails.
    """
    content, to = page(scenario, variant, fmus), Path(to)
    to.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(to, lambda file: print(content, end="", file=file))
    return to


def page(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> str:
    """The page of a scenario, as HTML."""
    from markupsafe import Markup

    subject = Subject(*prepare(scenario, variant, fmus))
    refuse_unfit(subject)
    refuse_without_zig()
    try:
        import bokeh  # noqa: F401  # which is optional, and brings jinja2
    except ImportError:
        raise InputError([MISSING]) from None
    result = run_as_vectors(scenario, variant, fmus, "auto") or run(scenario, variant, fmus)
    compiled = module([subject.descriptions[name].name for name in subject.order.names], plan.header(subject))
    names = ("uplot/uPlot.iife.min.js", "numbers.js", "measure.js", "page.js")
    scripts = [report.closed(report.read(name, HERE)) for name in names]
    allowed = " ".join([MAY_COMPILE, *map(report.digest, scripts)])
    styles = (style.variables(), report.read("page.css"), report.read("uplot/uPlot.min.css", HERE))
    return str(
        report.template("page.html", HERE).render(
            scenario=subject.scenario,
            policy=Markup(POLICY.format(allowed)),
            style=Markup("\n".join([*styles, report.read("page.css", HERE)])),
            plan=content(subject, result),
            module=packed(compiled),
            worker=Markup(report.closed(report.read("worker.js", HERE))),
            scripts=[*map(Markup, scripts)],
            version=__version__,
            uplot=UPLOT,
        )
    )


def refuse_unfit(subject: Subject) -> None:
    """Raise a ScenarioError with what of a scenario a page cannot run."""
    scenario = subject.scenario
    foreign = [f"`{name}` ({d.path.name})" for name, d in subject.descriptions.items() if not is_ours(d)]
    problems = []
    if foreign:
        found = f"these FMUs are not from this version: {', '.join(foreign)}"
        problems.append(f"{found}. A page is compiled of Gapsense's own components; build them with `gapsense build`.")
    if scenario.events:
        problems.append(
            f"a page has no events: {listing([*scenario.events])}. Choose a variant that disables them all."
        )
    if problems:
        raise ScenarioError([f"{scenario.path.name}: {problem}" for problem in problems])


def packed(content: bytes) -> str:
    """A file as text that the browser unpacks by itself."""
    made = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return b64encode(made.compress(content) + made.flush()).decode("ascii")


def content(subject: Subject, result: Result) -> dict[str, Any]:
    """All that the scripts need to know, of JSON."""
    scenario, experiment = subject.scenario, subject.scenario.experiment
    components = plan.values(subject, subject.taken())
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
        "signals": [[name, about.unit] for name, about in subject.about.items()],
        "constants": dict(constants(subject)),
        "panels": sorted(panels(scenario, result), key=lambda panel: not panel["isCompared"]),
        "metrics": [metric(m, result) for m in scenario.metrics],
        "controls": [*controls(subject)],
        "prefixes": PREFIXES,
        "unprefixed": UNPREFIXED,
    }


def constants(subject: Subject) -> Iterator[tuple[str, list[int]]]:
    """Parameters that metrics refer to, and where the module has them."""
    for name in dict.fromkeys(m.reference for m in subject.scenario.metrics):
        if isinstance(name, str) and name not in subject.about:
            component, _, parameter = name.partition(".")
            variable = subject.descriptions[component].variables[parameter]
            yield name, [subject.order.names.index(component), variable.reference]


def panels(scenario: Scenario, result: Result) -> Iterator[dict[str, Any]]:
    """Panels as a report has them, with where their curves come from in place of their values."""
    from gapsense.report.html import figures
    from gapsense.report.html import run as drawn
    from gapsense.report.html.subject import Shown

    shown = Shown(file=Path(), result=result, scenario=scenario, note="", events=())
    pairs = {pair.signal: pair for pair in drawn.pairs(shown)}
    axes: Any = figures.shared(shown, style.colours(result.run.order), 0)
    for of in drawn.panels(shown):
        curves = []
        for curve, entry in zip(of.curves, figures.entries(of, axes, "")):
            pair = pairs.get(curve.name)
            error = {"reference": pair.reference if pair else None, "where": pair.where if pair else None}
            curves.append(
                {
                    "name": curve.name,
                    "colour": f"--c-{entry.colour[1:]}",
                    "dash": entry.dash,
                    "isTruth": curve.is_truth,
                    "time": pair.time if pair and (of.is_error or not curve.is_held) else None,
                    **(error if of.is_error else {}),
                }
            )
        yield {
            "title": of.title,
            "unit": of.unit,
            "note": of.note,
            "isError": of.is_error,
            "curves": curves,
            "isCompared": of.is_error or any(c.is_truth for c in of.curves),
        }
    for strip in drawn.strips(shown):
        colour = style.colour(axes.numbers[strip.name.partition(".")[0]])
        curve = {"name": strip.name, "colour": f"--c-{colour[1:]}", "dash": ()}
        yield {"title": strip.name, "unit": "", "note": "", "isStrip": True, "isCompared": False, "curves": [curve]}


def metric(of: Metric, result: Result) -> dict[str, Any]:
    """A metric, as the scripts measure it."""
    bounds = of.bounds and [bound if math.isfinite(bound) else None for bound in of.bounds]
    keys = ("name", "kind", "signal", "reference", "after", "before", "where", "time", "published", "table")
    return {
        **{key: getattr(of, key) for key in keys},
        "label": of.label,
        "unit": unit_of(of, result.units),
        "isAxis": KINDS[of.kind].reference == "axis",
        "bounds": bounds,
    }


def controls(subject: Subject) -> Iterator[dict[str, Any]]:
    """What the reader may change: what the scenario names, or else the first tunable numbers that it gives."""
    tunable = (
        f"{name}.{parameter}"
        for name in subject.order.names
        for parameter in subject.scenario.components[name].values
        if (v := subject.descriptions[name].variables[parameter]).is_tunable and v.type == "Real"
    )
    for name in subject.scenario.controls or [*tunable][:CONTROLS]:
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
    """Ends of a slider and the unit beside it; by and large four times as much and as little as the scenario gives.

    Parameters that begin at zero go as far as is usual for them.
    """
    least, most = (-math.inf if port.min is None else port.min), (math.inf if port.max is None else port.max)
    size = abs(value) or port.nominal
    low, high = (size / SPAN, size * SPAN) if value > 0.0 else (-size, size)
    if -math.inf < least < most < math.inf and (least <= 0.0 or most / least <= SPAN**4):
        low, high = least, most
    factor, unit = prefixed(value, port.unit) if port.unit != "1" else (1.0, "")
    ends = [float(f"{max(least, min(most, end)):.3g}") for end in (low, high)]
    return {"low": ends[0], "high": ends[1], "unit": unit, "exponent": round(math.log10(factor))}
