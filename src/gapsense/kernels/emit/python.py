"""Print a traced graph as scalar Python (stdlib only), and compile it: only here."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from gapsense.kernels.elementary import FORMULAS
from gapsense.kernels.emit.printer import Graph, Loop, Printer, elementary, operands, regions
from gapsense.kernels.layout import names
from gapsense.kernels.trace import Expr, Region

FIXED = ("in", "var", "if", "loop", "get", "store")  # operations that are printed where they are
MANY = 8  # operations for which a choice is worth a branch of its own

Side = tuple[int, int]  # condition, and operand of the choice on it: 1 or 2
WORD = re.compile(r"\b[A-Za-z_]\w*")
WORDS = re.compile(f"({WORD.pattern})")  # splits a line
COPY = re.compile(r" *(\w+),? = \1")
ASSIGNMENT = re.compile(r" *([\w, ]+?),? = (.*)")
TEMPORARY = re.compile(r"[a-z]\d+")  # made by `Printer.fresh`; all other names are arguments, and stay


# Choices in generated code: those on one condition share a branch, and what only one side needs is computed in it.
#
# A kernel chooses value by value, `where(c, a, b)`, from operands that are both harmless. Code for one run at a time is
# quicker if it asks for the condition once, and computes nothing that is not chosen.


class Choices(NamedTuple):
    """Of a region: what waits until it is needed."""

    groups: dict[int, list[Expr]]  # choices, by condition
    sides: dict[int, Side]  # of values that one side only needs


class Choosing(Printer):
    """A printer that gathers choices; its `_branch` prints what `gathered` gives too."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.choices = Choices({}, {})  # of the region that is being printed

    def region(self, region: Region) -> None:
        """Print the live nodes of a region; choices wait for others on their condition until one is needed."""
        outer, self.choices = self.choices, self._choices(region)
        waiting = {choice.id: choice for group in self.choices.groups.values() for choice in group}
        for node in region.nodes:
            if node.id in self.uses and not (node.id in waiting or node.id in self.choices.sides):
                if waiting:
                    self._choose(waiting[value] for value in _read(node, region) if value in waiting)
                self._print(node)
        self._choose(waiting.values())
        self.choices = outer

    def block(self, opening: str, region: Region, targets: list[str], values: list[Any]) -> None:
        """Print a branch: its nodes, and the values that it gives, each after the nodes that only it needs."""
        self.write(opening)
        self.depth += 1
        self.region(region)
        for target, value in zip(targets, values):
            for kept in self._find_kept([value]):
                self._print(kept)
            self.assign([target], [value])
        self.depth -= 1

    def gather(self, c: Any) -> tuple[list[str], list[Any], list[Any]]:
        """Names of all choices on a condition that can be printed by now, and the operands for both cases."""
        group = self._ready(c.id) if isinstance(c, Expr) else []
        targets = [self.fresh("c") for _ in group]
        self.text.update((choice.id, target) for choice, target in zip(group, targets))
        return targets, [choice.args[1] for choice in group], [choice.args[2] for choice in group]

    def _choices(self, region: Region) -> Choices:
        """Of the live nodes of a region."""
        found = Choices({}, {})
        needed: dict[int, set[Side | None]] = {}  # by whom each value is
        for node in reversed(region.nodes):
            if node.id not in self.uses or node.id in self.text:
                continue
            side = self._side(node, needed)
            is_choice = node.op == "where" and not side and not self.is_index(node)
            if side:
                found.sides[node.id] = side
            elif is_choice:
                found.groups.setdefault(node.args[0].id, []).insert(0, node)
            for k, value in enumerate(node.args):
                if isinstance(value, Expr):
                    needed.setdefault(value.id, set()).add((node.args[0].id, k) if is_choice and k else side)
        return found

    def _side(self, node: Expr, needed: dict[int, set[Side | None]]) -> Side | None:
        """The only side that needs a node; array memory is read where it was, because it may change."""
        sides = needed.get(node.id, {None})
        is_fixed = node.op in FIXED or (node.op == "load" and node.args[0].extra != "table")
        is_elsewhere = node.id in self.far or node.id in self.leaving
        return None if is_fixed or is_elsewhere or len(sides) > 1 else next(iter(sides))

    def _choose(self, wanted: Iterable[Expr]) -> None:
        """Print choices, if they have not been, with others on their conditions that can be."""
        for choice in self._in_order(wanted):
            if choice.id not in self.text:
                if self._is_worth_a_branch(self._ready(choice.args[0].id)):
                    self._branch(choice.args[0], (Region(), Region()), [], [], [])
                else:
                    for value in (*self._find_kept(choice.args), choice):
                        self._print(value)

    def _in_order(self, wanted: Iterable[Expr]) -> list[Expr]:
        """Choices that are not printed yet, each after those that it reads."""
        found: dict[int, Expr] = {}
        pending = [*wanted]
        while pending:
            choice = pending.pop()
            if choice.id not in self.text and choice.id not in found:
                found[choice.id] = choice
                pending += self._missing(choice)
        return [found[k] for k in sorted(found)]

    def _is_worth_a_branch(self, group: list[Expr]) -> bool:
        """By what the condition costs to ask again, and a name for what could do without."""
        kept = [*self._find_kept(value for choice in group for value in choice.args)]
        inline = sum(self.uses[choice.id] == 1 and choice.id not in self.far for choice in group)
        return 5 * (len(group) - 1) > 4 * inline or len(kept) >= MANY or any(self.uses[v.id] > 1 for v in kept)

    def _ready(self, condition: int) -> list[Expr]:
        """Choices on a condition that read nothing but what is printed, and each other."""
        ready: list[Expr] = []
        for choice in self.choices.groups.get(condition, []):
            if choice.id not in self.text and {v.id for v in self._missing(choice)} <= {c.id for c in ready}:
                ready.append(choice)
        return ready

    def _missing(self, choice: Expr) -> list[Expr]:
        """What a choice, and what only one of its sides needs, read of values that are not printed yet."""
        read = [*choice.args, *(value for kept in self._find_kept(choice.args) for value in kept.args)]
        return [v for v in read if isinstance(v, Expr) and v.id not in self.text and v.id not in self.choices.sides]

    def _find_kept(self, values: Iterable[Any]) -> list[Expr]:
        """Those of some values, and of what they are made from, that were kept for one side; in order."""
        found: dict[int, Expr] = {}
        pending = [*values]
        while pending:
            value = pending.pop()
            is_kept = isinstance(value, Expr) and value.id in self.choices.sides and value.id not in self.text
            if is_kept and value.id not in found:
                found[value.id] = value
                pending += value.args
        return [found[k] for k in sorted(found)]

    def _print(self, node: Expr) -> None:
        if node.id not in self.text:
            self._node(node)


def _read(node: Expr, region: Region) -> list[int]:
    """What a node reads, in its branches or its loop body too."""
    found = [value.id for value, _ in operands(node, region) if isinstance(value, Expr)]
    for inner in regions(node):
        for other in inner.nodes:
            found += _read(other, inner)
    return found


class Python(Choosing):
    """Scalar Python that needs the standard library only."""

    head = """from bisect import bisect_left
from math import floor, frexp, inf, ldexp, nan, sqrt
"""
    forms = Printer.forms | {
        "fabs": "abs({b[0]})",
        "floor": "float(floor({b[0]}))",
        "exponent": "(frexp({b[0]})[1] - 1)",
        "mantissa": "(2.0 * frexp({b[0]})[0])",
        "scaled": "ldexp({b[0]}, int({b[1]}))",
        "not": "(not {a[0]})",
        "where": "({a[1]} if {b[0]} else {a[2]})",
        "locate": "(bisect_left({a[0]}, {b[1]}, 1, len({a[0]}) - 1) - 1)",
        "whole": "int({0})",
    }

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.limits: set[int] = set()  # of loops; to make a range takes longer than a round

    @classmethod
    def module(cls, *functions: str) -> str:
        """Text of a module with some functions, and before them those of `elementary` that they call."""
        called = [name for name in FORMULAS if any(re.search(rf"\b{name}\(", text) for text in functions)]
        own = ["\n".join([f"def {n}(x):", *rename_values(cls(elementary(n)).definition()), ""]) for n in called]
        return "\n\n".join([cls.head, *own, *functions])

    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        names, chosen, others = self.gather(c)
        self.block(f"if {self.bare(c)}:", regions[0], [*targets, *names], [*a, *chosen])
        self.block("else:", regions[1], [*targets, *names], [*b, *others])

    def _repeat(self, loop: Loop) -> None:
        read = [k for k, variable in enumerate(loop.variables) if variable.id in self.uses]  # before a round ends
        self.assign([loop.targets[k] for k in read], [loop.starts[k] for k in read])
        self.limits.add(loop.limit)
        self.write(f"for _ in rounds_{loop.limit}:")
        self.depth += 1
        self.region(loop.body)
        self._advance(loop)
        self.depth -= 1

    def _advance(self, loop: Loop) -> None:
        """End a round of a loop: all new values first, of which most become the variables without a copy."""
        stop, values, new = self.bare(loop.stop), [*map(self.bare, loop.new)], [self.fresh() for _ in loop.new]
        if not {*loop.targets}.isdisjoint(WORD.findall(stop)):
            stop = self._let(loop.stop, stop)
        for target, value in (*zip(new, values), *zip(loop.targets, new)):
            self.write(f"{target} = {value}")
        after = dict(zip(values, loop.targets))  # what a value with a name has become
        self.write(f"if {WORD.sub(lambda word: after.get(word[0], word[0]), stop)}:")
        self.write("    break")

    def source(self) -> str:
        """The function's text; it takes and returns flat tuples."""
        g = self.graph
        for name, cls, symbols in g.arguments:
            self.text.update((s.id, f"{name}_{entry}") for s, entry in zip(symbols, names(cls)))
            unpacked = [self.text[s.id] if s.id in self.uses else "_" for s in symbols]
            if any(text != "_" for text in unpacked):
                self.write(f"{', '.join(unpacked)}{',' * (len(symbols) == 1)} = {name}")
        self.region(g.tape.root)
        self.write(f"return {', '.join(self._tuple(entries) for _, entries in g.results)}")
        arguments = ", ".join(name for name, _, _ in g.arguments)
        rounds = "".join(f"rounds_{limit} = range({limit})\n" for limit in sorted(self.limits))
        return "\n".join([f"{rounds}def {g.name}({arguments}):", *rename_values(self.lines), ""])

    def _tuple(self, entries: list[Any]) -> str:
        texts = [f"[0.0] * {len(e)}" if isinstance(e, list) else self.ref(e) for e in entries]
        return f"({', '.join(texts)}{',' * (len(texts) == 1)})"


def namespace(source: str, name: str) -> dict[str, Any]:
    """What the source of a module defines; `name` stands for its file in tracebacks."""
    space: dict[str, Any] = {}
    exec(compile(source, f"<{name}>", "exec"), space)
    return space


def compile_graph(graph: Graph) -> Callable[..., Any]:
    """The function of a graph, on flat tuples."""
    source = Python.module(Python(graph).source())
    function: Callable[..., Any] = namespace(source, f"{graph.name}, generated")[graph.name]
    return function


# Few names for many values: in generated Python a name is used again once its value is no longer needed.
#
# CPython clears all local variables of a function at every call, and may have to map memory for them: a thousand cost
# more than the arithmetic. This is what compilers do with registers. Find which values live at the same time, unite
# both sides of copies that do not, and give each value the first name that no value living with it has.


def rename_values(lines: Sequence[str]) -> list[str]:
    """The body of a function in which every value has a name of its own, with few names and no idle copies."""
    body = _Body(lines)
    body.live_before(0, len(lines), 0)
    for made, text in body.parts:
        if len(made) == 1 and text in body.united:
            body.unite(made[0], text)
    names = body.names()
    return _without_copies(["".join([names.get(word, word) for word in WORDS.split(line)]) for line in lines])


class _Body:
    """The lines of a function, and which of their values must not share a name; sets of values are bits of a number."""

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = [line.lstrip() for line in lines]
        self.depths = [*map(_depth, lines)]
        self.parts = [_parts(line) for line in lines]
        every = dict.fromkeys(name for made, _ in self.parts for name in made)
        self.bits = {name: 1 << k for k, name in enumerate(every)}
        self.apart = dict.fromkeys(self.bits, 0)  # of two that must not share a name, one has the other here
        self.sharing = {**self.bits}  # all that share a name with a value
        self.united = {name: name for name in self.bits}
        self.made = [self._set(made) for made, _ in self.parts]
        self.read = [self._set(WORD.findall(text)) for _, text in self.parts]

    def _set(self, words: Iterable[str]) -> int:
        found = 0
        for word in words:
            found |= self.bits.get(word, 0)
        return found

    def live_before(self, start: int, end: int, live: int) -> int:
        """Values needed before the block of lines from `start` to `end`, if `live` are needed after it."""
        while end > start:
            end -= 1
            opening = end
            while self.depths[opening] > self.depths[start] or self.lines[opening] == "else:":
                opening -= 1
            live = self._before_line(end, live) if opening == end else self._before_compound(opening, end + 1, live)
            end = opening
        return live

    def _before_compound(self, start: int, end: int, live: int) -> int:
        """The same for `for`, and for `if` with or without `else`."""
        if self.lines[start].startswith("for "):
            for _ in range(2):  # what a round needs is needed at the end of the round before
                live |= self.live_before(start + 1, end, live)
            return live
        other = next((k for k in range(start + 1, end) if self.depths[k] == self.depths[start]), end)
        otherwise = self.live_before(other + 1, end, live)
        return self.live_before(start + 1, other, live) | otherwise | self.read[start]

    def _before_line(self, k: int, live: int) -> int:
        """The same for one line, whose values must not share a name with those needed after it."""
        made, text = self.parts[k]
        for name in made:  # both sides of a copy may
            self.apart[name] |= (live | self.made[k]) & ~(self.bits[name] | self.bits.get(text, 0))
        return live & ~self.made[k] | self.read[k]

    def unite(self, a: str, b: str) -> None:
        """Let two values share a name, if they may; that of an argument if one is."""
        a, b = sorted((self.leader(a), self.leader(b)), key=lambda name: TEMPORARY.fullmatch(name) is None)
        if a != b and not (self.apart[a] & self.sharing[b] or self.apart[b] & self.sharing[a]):
            self.united[a] = b
            self.apart[b] |= self.apart.pop(a)
            self.sharing[b] |= self.sharing[a]

    def leader(self, name: str) -> str:
        """The value that stands for all that share a name with this one."""
        while self.united[name] != name:
            name = self.united[name]
        return name

    def names(self) -> dict[str, str]:
        """The new name of every value."""
        given: dict[str, str] = {}
        taken: list[tuple[int, int]] = []  # by whom each new name is, and who must not have it
        for name, apart in self.apart.items():
            given[name] = name
            if TEMPORARY.fullmatch(name):
                own = self.sharing[name]
                free = (k for k, (some, others) in enumerate(taken) if not (some & apart or others & own))
                if (k := next(free, len(taken))) == len(taken):
                    taken.append((0, 0))
                taken[k] = taken[k][0] | own, taken[k][1] | apart
                given[name] = f"t{k + 1}"
        return {name: given[self.leader(name)] for name in self.united}


def _parts(line: str) -> tuple[list[str], str]:
    """The values that a line makes, and the text that it makes them from."""
    assignment = ASSIGNMENT.fullmatch(line)
    if not assignment:
        return [], line
    return [name for name in assignment[1].split(", ") if name != "_"], assignment[2]


def _without_copies(lines: Sequence[str]) -> list[str]:
    """Lines without `x = x` and without an empty `else:`; where nothing is left of another block stands `pass`."""
    kept = [line for line in lines if not COPY.fullmatch(line)]
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
