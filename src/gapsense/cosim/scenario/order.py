"""Execution order of the components: that of the connections, with loops cut where there is no direct feedthrough."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.scenario.elements import Connection


@dataclass(frozen=True)
class Order:
    """Components in the order in which they step, and the connections that carry the value of one step before."""

    names: tuple[str, ...]
    delayed: tuple[Connection, ...] = ()


class FeedthroughCycleError(ValueError):
    """Every input on this loop has direct feedthrough, so no order avoids an algebraic loop."""

    def __init__(self, cycle: Sequence[Connection]) -> None:
        super().__init__(
            f"algebraic loop through {', '.join(map(str, cycle))}: every input on it has direct feedthrough. "
            "Break it with a component without feedthrough, such as a delay or a lag, or with `delayed = true` in "
            "`[[connections]]`."
        )


def execution_order(names: Sequence[str], connections: Sequence[Connection], descriptions: Descriptions) -> Order:
    """Order in which every component follows those that drive it, as far as there are no loops.

    In a loop, a component all of whose waiting inputs lack direct feedthrough goes first; the connections to these
    inputs then carry the value of one step before. Where a connection is to be delayed, its source follows its target.
    Among equals the order of the file decides, that of `names`.
    Raises FeedthroughCycleError if a loop has nothing but direct feedthrough.
    """
    left, done, delayed = list(names), [], [c for c in connections if c.delayed]
    ways = [turned(c) if c.delayed else c for c in connections if not (c.delayed and is_own(c))]
    while left:
        edges = [c for c in ways if {c.source.component, c.target.component} <= set(left)]
        direct = [c for c in edges if c.delayed or c.target.variable in descriptions[c.target.component].direct_inputs]
        driven = {c.target.component for c in edges}
        chosen = next((name for name in left if name not in driven), None) or first_cut(left, edges, direct)
        if chosen is None:
            raise FeedthroughCycleError(find_cycle(left, direct))
        delayed += [c for c in edges if c.target.component == chosen]
        left.remove(chosen)
        done.append(chosen)
    return Order(tuple(done), tuple(delayed))


def turned(connection: Connection) -> Connection:
    """The way from target to source."""
    return replace(connection, source=connection.target, target=connection.source)


def is_own(connection: Connection) -> bool:
    """True if the component takes what it gives itself."""
    return connection.source.component == connection.target.component


def first_cut(left: Sequence[str], edges: Sequence[Connection], direct: Sequence[Connection]) -> str | None:
    """First component of a loop that nothing outside it drives, all of whose waiting inputs lack feedthrough."""
    waiting = {c.target.component for c in direct}
    ahead = {name: reached(name, edges) for name in left}
    behind = {name: {other for other in left if name in ahead[other]} for name in left}
    return next((name for name in left if name not in waiting and behind[name] <= ahead[name]), None)


def reached(name: str, edges: Collection[Connection]) -> set[str]:
    """Components that a component drives, directly or through others."""
    seen: set[str] = set()
    fresh = {name}
    while fresh:
        fresh = {c.target.component for c in edges if c.source.component in fresh} - seen
        seen |= fresh
    return seen


def find_cycle(left: Sequence[str], direct: Sequence[Connection]) -> list[Connection]:
    """A loop of direct feedthrough, found by walking against the connections until a component comes twice."""
    on_cycle = next(name for name in left if name in reached(name, direct))
    path: list[Connection] = []
    seen: list[str] = []
    while on_cycle not in seen:
        seen.append(on_cycle)
        path.append(next(c for c in direct if c.target.component == on_cycle and closes(c, direct)))
        on_cycle = path[-1].source.component
    return path[seen.index(on_cycle) :][::-1]


def closes(connection: Connection, direct: Sequence[Connection]) -> bool:
    """True if the connection lies on a loop of direct feedthrough."""
    source, target = connection.source.component, connection.target.component
    return source == target or source in reached(target, direct)
