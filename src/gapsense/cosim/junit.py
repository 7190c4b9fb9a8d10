"""JUnit XML, which every CI system reads: one suite per scenario, one case per check."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gapsense._os.files import write_atomically
from gapsense.cosim.regression import Outcome


def write_junit(outcomes: Sequence[Outcome], path: str | Path) -> None:
    """Write outcomes as a JUnit file, complete or not at all."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    root = Element("testsuites", {"name": "gapsense", **counts(outcomes)})
    for outcome in outcomes:
        add_suite(root, outcome)
    indent(root)
    text = '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
    write_atomically(path, lambda file: print(text, end="", file=file))


def counts(outcomes: Sequence[Outcome]) -> dict[str, str]:
    """Number of checks, and of those that failed."""
    failures = sum(len(outcome.failures) for outcome in outcomes)
    return {"tests": str(sum(len(outcome.checks) for outcome in outcomes)), "failures": str(failures)}


def add_suite(root: Element, outcome: Outcome) -> None:
    """One scenario or variant; the whole time counts for its first check, the run."""
    name, time = outcome.scenario, f"{outcome.seconds:.3f}"
    suite = SubElement(root, "testsuite", {"name": name, **counts([outcome]), "time": time})
    for index, check in enumerate(outcome.checks):
        case = SubElement(suite, "testcase", classname=name, name=check.name, time="0.000" if index else time)
        if check.failure:
            text = "".join(c if c >= " " or c in "\n\t" else " " for c in check.failure)  # what XML allows
            SubElement(case, "failure", message=text.splitlines()[0]).text = text
