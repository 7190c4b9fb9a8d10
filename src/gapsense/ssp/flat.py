"""Nested systems as one level: each input of a component is followed back to where its value comes from."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

from gapsense.cosim.fmu.archive import shown
from gapsense.ssp.structure import SINKS, Connector, Element, Link
from gapsense.ssp.units import Line, Units, conversion
from gapsense.ssp.values import Node


class Edge(NamedTuple):
    """Where a connector gets its value from."""

    source: Node
    link: Link


class Way(NamedTuple):
    """Where an input of a component gets its value from, and what becomes of it."""

    source: Node
    line: Line


class Wiring:
    """Connections of a whole structure; `problems` takes what is wrong with them."""

    def __init__(self, root: Element, units: Units, problems: list[str]) -> None:
        self.units, self.problems = units, problems
        self.connectors: dict[Node, Connector] = {}
        self.components: set[tuple[str, ...]] = set()
        self.edges: dict[Node, Edge] = {}
        self.add(root)

    def add(self, element: Element) -> None:
        """Connectors and connections of an element and all below it."""
        self.connectors |= {(element.path, name): connector for name, connector in element.connectors.items()}
        if element.is_component:
            self.components.add(element.path)
        for inner in element.elements.values():
            self.add(inner)
        for link in element.links:
            self.connect(element, link)

    def connect(self, system: Element, link: Link) -> None:
        """Add a connection in the direction that the kinds of its connectors tell."""
        place = " -> ".join(shown(".".join(filter(None, end))) for end in link.ends)
        ends = [self.end(system, *end) for end in link.ends]
        if link.refused:
            self.problems.append(f"{system.name}, {place}: `{link.refused}` is not supported. Remove it.")
        elif None in ends:
            self.problems.append(f"{system.name}, {place}: there is no such connector. Correct the connection.")
        else:
            (one, gives), (other, other_gives) = (end for end in ends if end)
            if gives == other_gives:
                self.problems.append(
                    f"{system.name}, {place}: both ends {'give' if gives else 'take'} a value. Correct it."
                )
            else:
                self.join(*((one, other) if gives else (other, one)), link, f"{system.name}, {place}")

    def end(self, system: Element, element: str, connector: str) -> tuple[Node, bool] | None:
        """An end of a connection, and whether it gives a value; a system's own input gives it to those inside."""
        owner = system.elements.get(element) if element else system
        found = owner.connectors.get(connector) if owner else None
        if owner is None or found is None:
            return None
        return (owner.path, connector), (found.kind in SINKS) == (owner is system)

    def join(self, source: Node, sink: Node, link: Link, place: str) -> None:
        """Let a connector get its value from another one."""
        if sink in self.edges:
            self.problems.append(f"{place}: `{shown('.'.join((*sink[0], sink[1])))}` is connected twice. Keep one.")
        else:
            self.edges[sink] = Edge(source, link)

    def way(self, sink: Node, units: Mapping[Node, str], given: Collection[Node]) -> Way | None:
        """Where an input of a component gets its value from, or None if nothing is connected to it.

        That is an output of a component, or the outermost connector of a system on the way that is `given` a value.
        `units` has those of the variables of components, which go before what the structure says.
        """
        steps: list[tuple[Node, Link]] = []
        node = sink
        while node in self.edges and len(steps) <= len(self.edges):
            edge = self.edges[node]
            steps.append((node, edge.link))
            node = edge.source
            if node[0] in self.components:
                break
        while steps and node not in given and node[0] not in self.components:
            node = steps.pop()[0]
        return Way(node, self.line(node, steps, units)) if steps else None

    def line(self, source: Node, steps: list[tuple[Node, Link]], units: Mapping[Node, str]) -> Line:
        """What becomes of a value on its way from the source to the sink."""
        made, unit = Line(), units.get(source) or self.connectors[source].unit
        for node, link in reversed(steps):
            own = units.get(node) or self.connectors[node].unit
            if unit and own and unit != own and not link.suppress:
                found = conversion(unit, own, self.units)
                if found is None:
                    name = shown(".".join((*node[0], node[1])))
                    said = f"`{name}` is in `{shown(own)}`, what it gets is in `{shown(unit)}`"
                    self.problems.append(f"{said}, and there is no conversion. Define both units, or correct one.")
                made = made.then(found or Line())
            made, unit = made.then(link.line), own or unit
        return made
