"""JUnit XML, which every CI system reads: one suite per scenario, one case per check."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gapsense.cosim.regression import Check, Outcome
from gapsense.files import write_atomically


def write_junit(outcomes: Sequence[Outcome], path: str | Path) -> None:
    """Write outcomes as a JUnit file, complete or not at all."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    text = junit(outcomes)
    write_atomically(path, lambda file: print(text, end="", file=file))


def junit(outcomes: Sequence[Outcome]) -> str:
    """Outcomes as JUnit XML."""
    failed = sum(len(outcome.failures) for outcome in outcomes)
    tests = sum(len(outcome.checks) for outcome in outcomes)
    root = Element("testsuites", name="gapsense", tests=str(tests), failures=str(failed))
    for outcome in outcomes:
        add_suite(root, outcome)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def add_suite(root: Element, outcome: Outcome) -> None:
    """One scenario or variant; the whole time counts for its first check, the run."""
    suite = SubElement(
        root,
        "testsuite",
        name=outcome.scenario,
        tests=str(len(outcome.checks)),
        failures=str(len(outcome.failures)),
        time=f"{outcome.seconds:.3f}",
    )
    for index, check in enumerate(outcome.checks):
        add_case(suite, outcome, check, outcome.seconds if index == 0 else 0.0)


def add_case(suite: Element, outcome: Outcome, check: Check, seconds: float) -> None:
    """One check."""
    case = SubElement(suite, "testcase", classname=outcome.scenario, name=check.name, time=f"{seconds:.3f}")
    if check.failure:
        text = printable(check.failure)
        failure = SubElement(case, "failure", message=text.splitlines()[0])
        failure.text = text


def printable(text: str) -> str:
    """Text without the control characters that XML forbids."""
    return "".join(c if c >= " " or c in "\n\t" else " " for c in text)
