"""Few names for many values: in generated Python a name is used again once its value is no longer needed.

CPython clears all local variables of a function at every call, and may have to map memory for them: a thousand cost
more than the arithmetic.  What is done here is what compilers do with registers: find which values live at the same
time, unite both sides of copies that do not, and give each value the first name that none living with it has.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

WORD = re.compile(r"\b[A-Za-z_]\w*")
ASSIGNMENT = re.compile(r" *([\w, ]+?),? = (.*)")
TEMPORARY = re.compile(r"[a-z]\d+")  # as `Printer.fresh` makes them; all others are arguments, which keep their names


def renamed(lines: Sequence[str]) -> list[str]:
    """The body of a function in which every value has a name of its own, with few names and no idle copies."""
    body = _Body(lines)
    body.live_before(0, len(lines), frozenset())
    for made, text in body.parts:
        if len(made) == 1 and text in body.united:
            body.unite(made[0], text)
    names = body.names()
    return _without_copies([WORD.sub(lambda word: names.get(word[0], word[0]), line) for line in lines])


class _Body:
    """The lines of a function, and which of their values must not share a name."""

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = [line.lstrip() for line in lines]
        self.depths = [*map(_depth, lines)]
        self.parts = [_parts(line) for line in lines]
        self.apart: dict[str, set[str]] = {name: set() for made, _ in self.parts for name in made}
        self.united = {name: name for name in self.apart}
        self.read = [self.apart.keys() & WORD.findall(text) for _, text in self.parts]

    def live_before(self, start: int, end: int, live: frozenset[str]) -> frozenset[str]:
        """Values needed before the block of lines from `start` to `end`, if `live` are needed after it."""
        while end > start:
            end -= 1
            opening = end
            while self.depths[opening] > self.depths[start] or self.lines[opening] == "else:":
                opening -= 1
            live = self._before_line(end, live) if opening == end else self._before_compound(opening, end + 1, live)
            end = opening
        return live

    def _before_compound(self, start: int, end: int, live: frozenset[str]) -> frozenset[str]:
        """The same for `for`, and for `if` with or without `else`."""
        if self.lines[start].startswith("for "):
            for _ in range(2):  # what a round needs is needed at the end of the round before
                live |= self.live_before(start + 1, end, live)
            return live
        other = next((k for k in range(start + 1, end) if self.depths[k] == self.depths[start]), end)
        otherwise = self.live_before(other + 1, end, live)
        return self.live_before(start + 1, other, live) | otherwise | self.read[start]

    def _before_line(self, k: int, live: frozenset[str]) -> frozenset[str]:
        """The same for one line, whose values must not share a name with those needed after it."""
        made, text = self.parts[k]
        for name in made:
            self._part(name, live.union(made) - {name, text})  # both sides of a copy may
        return live.difference(made) | self.read[k]

    def _part(self, name: str, others: frozenset[str]) -> None:
        new = others - self.apart[name]
        self.apart[name] |= new
        for other in new:
            self.apart[other].add(name)

    def unite(self, a: str, b: str) -> None:
        """Let two values share a name, if they may; that of an argument if one is."""
        a, b = sorted((self.leader(a), self.leader(b)), key=lambda name: TEMPORARY.fullmatch(name) is None)
        if a != b and a not in self.apart[b]:
            self.united[a] = b
            for other in self.apart.pop(a):
                self.apart[other].remove(a)
                self._part(b, frozenset([other]))

    def leader(self, name: str) -> str:
        """The value that stands for all that share a name with this one."""
        while self.united[name] != name:
            name = self.united[name]
        return name

    def names(self) -> dict[str, str]:
        """The new name of every value."""
        given: dict[str, str] = {}
        for name in self.apart:
            if TEMPORARY.fullmatch(name):
                taken = {given.get(other) for other in self.apart[name]}
                given[name] = next(new for k in range(1, len(taken) + 2) if (new := f"t{k}") not in taken)
            else:
                given[name] = name
        return {name: given[self.leader(name)] for name in self.united}


def _parts(line: str) -> tuple[list[str], str]:
    """The values that a line makes, and the text that it makes them from."""
    assignment = ASSIGNMENT.fullmatch(line)
    if not assignment:
        return [], line
    return [name for name in assignment[1].split(", ") if name != "_"], assignment[2]


def _without_copies(lines: Sequence[str]) -> list[str]:
    """Lines without `x = x` and without an empty `else:`; where nothing is left of another block stands `pass`."""
    kept = [line for line in lines if _parts(line)[0] != [_parts(line)[1]]]
    made: list[str] = []
    for line, following in zip(kept, [*kept[1:], ""]):
        is_empty = line.endswith(":") and _depth(following) <= _depth(line)
        if not is_empty:
            made.append(line)
        elif line.lstrip() != "else:":
            made += [line, " " * (_depth(line) + 4) + "pass"]
    return made


def _depth(line: str) -> int:
    return len(line) - len(line.lstrip())
