"""What a scenario says and SSP has no words for: TOML in an annotation, with the keys of a scenario file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gapsense.cosim.scenario.read import Document
from gapsense.cosim.scenario.records import Component, Scenario
from gapsense.problems import listing

OF_CONNECTIONS = ("delayed", "mean")
WHOLE = ("title", "description", "figure", "experiment", "record", "metrics", "events", "page")  # as the file has them
OF_COMPONENTS = ("step", "offset", "edge", "isolation")
LEFT_OUT = {"sweep": "its sweep is", "baseline": "its baseline is", "variants": "its other variants are"}


def collect_tables(scenario: Scenario, document: Document) -> dict[str, Any]:
    """Collect the tables for the annotation."""
    tables = {key: document.data[key] for key in WHOLE if key in document.data}
    tables["experiment"] = {**tables["experiment"], "method": scenario.experiment.method}
    components = {name: own for name, component in scenario.components.items() if (own := differing(component))}
    played = {
        str(port): {
            "times": signal.times.tolist(),
            "values": signal.values.tolist(),
            "interpolation": signal.interpolation,
        }
        for port, signal in scenario.played.items()
    }
    links = [
        {"from": str(link.source), "to": str(link.target), **own}
        for link in scenario.connections
        if (own := {key: True for key in OF_CONNECTIONS if getattr(link, key)})
    ]
    parts = {"components": components, "inputs": played, "seeds": dict(scenario.seeds), "connections": links}
    return {**tables, **{name: part for name, part in parts.items() if part}}


def differing(component: Component) -> dict[str, Any]:
    """How a component runs, where that differs from the default."""
    usual = Component("", "")
    return {key: getattr(component, key) for key in OF_COMPONENTS if getattr(component, key) != getattr(usual, key)}


def notes(scenario: Scenario, data: Mapping[str, Any]) -> Iterator[str]:
    """One sentence on each thing that other tools do not see, or that is left out."""
    experiment = scenario.experiment
    if experiment.method != "jacobi":
        yield f"experiment.method: only Gapsense's annotation has `{experiment.method}`; SSP has no coupling."
    slower, later = (
        [name for name, component in scenario.components.items() if getattr(component, key) != usual]
        for key, usual in (("step", 1), ("offset", 0))
    )
    delayed = [str(link.target) for link in scenario.connections if link.delayed]
    if slower:
        yield f"step of {listing(slower)}: only annotations of Gapsense and OSP have it; other tools ignore it."
    if later:
        yield f"offset of {listing(later)}: it is only in Gapsense's annotation; in other tools they start at once."
    if scenario.played:
        found = listing([str(port) for port in scenario.played])
        yield f"signals of {found}: they are only in Gapsense's annotation; in other tools their first value holds."
    if delayed:
        yield f"delay of {listing(delayed)}: it is only in Gapsense's annotation."
    if on_boards := [name for name, component in scenario.components.items() if component.board]:
        yield f"board of {listing(on_boards)}: it is left out; the FMU runs in its place."
    if scenario.events:
        yield f"events {listing([*scenario.events])}: only Gapsense's annotation has them, so other tools ignore them."
    for key, what in LEFT_OUT.items():
        if data.get(key):
            yield f"{key}: {what} left out."
