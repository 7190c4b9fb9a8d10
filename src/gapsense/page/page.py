"""The HTML file of a page: the module, its data, the scripts that show results, and a policy that forbids fetching."""

from __future__ import annotations

import zlib
from base64 import b64encode
from pathlib import Path

from gapsense._os.files import write_atomically
from gapsense.cosim.check import prepare
from gapsense.cosim.run.engines import run_as_vectors
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.run.run import run
from gapsense.cosim.scenario.read import Source
from gapsense.cosim.scenario.records import ITERATIVE
from gapsense.page import plan
from gapsense.page.module import module, refuse_without_zig
from gapsense.problems import ScenarioError
from gapsense.report.html import page as report
from gapsense.report.html import style
from gapsense.vectors.engine import is_ours
from gapsense.version import __version__

HERE = "gapsense.page"
POLICY = f"{report.POLICY}; worker-src blob:"
MAY_COMPILE = "'wasm-unsafe-eval'"
DRAWN = "The panels of a page are chosen as in reports, which are drawn"
MOST_NOISE = 10_000  # numbers of events, of 11 bytes each
UPLOT = "uPlot 1.6.32"


def write_page(scenario: Source, to: str | Path, variant: str | None = None, fmus: str | Path | None = None) -> Path:
    """Write one HTML file in which a scenario runs, complete or not at all; its folder is made if there is none.

    An InputError tells what is wrong with the scenario, what a page cannot run, or that bokeh is missing; a NativeError
    that the compiler is missing, or fails.
    """
    text, to = page(scenario, variant, fmus), Path(to)
    write_atomically(to, lambda file: print(text, end="", file=file))
    return to


def page(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> str:
    """The page of a scenario, as HTML."""
    subject = Subject(*prepare(scenario, variant, fmus))
    refuse_unfit(subject)
    refuse_without_zig()
    report.refuse_without_bokeh(DRAWN)
    from markupsafe import Markup

    from gapsense.page.content import make_plan  # here, since it needs bokeh

    result = run_as_vectors(scenario, variant, fmus, "auto") or run(scenario, variant, fmus)
    compiled = module([subject.descriptions[name].name for name in subject.order.names], plan.header(subject))
    names = ("uplot/uPlot.iife.min.js", "numbers.js", "measure.js", "page.js")
    scripts = [report.escape_script(report.read(name, HERE)) for name in names]
    allowed = " ".join([MAY_COMPILE, *map(report.digest, scripts)])
    styles = (style.variables(), report.read("page.css"), report.read("uplot/uPlot.min.css", HERE))
    return str(
        report.template("page.html", HERE).render(
            scenario=subject.scenario,
            policy=Markup(POLICY.format(allowed)),
            style=Markup("\n".join([*styles, report.read("page.css", HERE)])),
            plan=make_plan(subject, result),
            module=pack_binary(compiled),
            worker=Markup(
                "\n".join(report.escape_script(report.read(name, HERE)) for name in ("events.js", "worker.js"))
            ),
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
    if scenario.experiment.method == ITERATIVE:
        problems.append("its loops are iterated (`method`), which a page cannot do. Choose another method.")
    if scenario.experiment.step_control is not None:
        problems.append("its steps are controlled (`step_control`), which a page cannot do. Leave that out.")
    if on_boards := [f"`{name}`" for name, component in scenario.components.items() if component.board]:
        problems.append(
            f"{', '.join(on_boards)} run on boards, which a page cannot reach. Choose a variant without them."
        )
    hissing = sum(len(plan.noisy(actor, scenario.experiment)) for actor in plan.actors(subject).values())
    if hissing > MOST_NOISE:
        found = f"its events have noise for {hissing} base steps, each with a number in the page, {MOST_NOISE} at most"
        problems.append(f"{found}. End them earlier with `until`, or choose a variant without them.")
    if problems:
        raise ScenarioError([f"{scenario.path.name}: {problem}" for problem in problems])


def pack_binary(binary: bytes) -> str:
    """Compress a file to text that the browser unpacks by itself."""
    made = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return b64encode(made.compress(binary) + made.flush()).decode("ascii")
