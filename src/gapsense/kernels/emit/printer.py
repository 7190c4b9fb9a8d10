"""Walk a traced graph and print it; `python.py` and `c.py` say how the languages look."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, NamedTuple

from gapsense.kernels.elementary import DOUBLE, FORMULAS, Format
from gapsense.kernels.layout import names
from gapsense.kernels.trace import BOOLEAN, UNARY, Expr, Region, Tape, TraceError, memory_of

LONGEST_INLINE = 90  # characters; a longer expression gets a name even if it is used once


class Graph(NamedTuple):
    """A traced function: its arguments (name, record class, symbols) and the flat entries of each record it returns."""

    name: str
    tape: Tape
    arguments: list[tuple[str, type, list[Expr]]]
    results: list[tuple[type, list[Any]]]


class Loop(NamedTuple):
    """A loop as it is printed: variables that nothing needs are left out."""

    body: Region
    stop: Any
    limit: int
    targets: list[str]  # names of the variables
    variables: list[Expr]
    starts: list[Any]
    new: list[Any]


def operands(node: Expr, region: Region) -> list[tuple[Any, Region]]:
    """Operands of a node of `region`, those in its branches or its loop body included, each with where it is read."""
    found = [(arg, region) for arg in node.args]
    if node.op == "if":
        then, otherwise, outs = node.extra
        for a, b in outs.values():
            found += (a, then), (b, otherwise)
    elif node.op == "loop":
        body, _, new, stop, _ = node.extra
        found += [(value, body) for value in (*new, stop)]
    return found


def regions(node: Expr) -> tuple[Region, ...]:
    """The branches or the loop body that a node holds."""
    return node.extra[:2] if node.op == "if" else node.extra[:1] if node.op == "loop" else ()


class Number(NamedTuple):
    """What a function of `elementary` takes and gives."""

    x: Any


def elementary(name: str, form: Format = DOUBLE) -> Graph:
    """Graph of exp, log or tanh."""
    tape = Tape()
    x = tape.node("in", (), "scalar")
    return Graph(name, tape, [("", Number, [x])], [(Number, [FORMULAS[name](x, form)])])


def _bare(text: str) -> str:
    """`text` without a pair of parentheses around all of it."""
    if text[:1] != "(":
        return text
    depth, end = 1, 1
    while depth:  # up to the parenthesis that closes the first
        opening, end = text.find("(", end), text.find(")", end) + 1
        depth, end = (depth + 1, opening + 1) if 0 <= opening < end else (depth - 1, end)
    return text[1:-1] if end == len(text) else text


def indexing(graph: Graph) -> set[str]:
    """Entries of the state of which indices are made: numbers, and memories that hold some."""
    nodes, pending, seen = [*_nodes(graph.tape.root)], [], set()
    loops = {variable.id: (node, k) for node in nodes if node.op == "loop" for k, variable in enumerate(node.extra[1])}
    pending = [node.args[1] for node in nodes if node.op in ("load", "store")]
    while pending:
        value = pending.pop()
        if isinstance(value, Expr) and value.id not in seen:
            seen.add(value.id)
            pending += _made_of(value, loops)
    state = (argument for argument in graph.arguments if argument[0] == "state")
    return {entry for _, cls, symbols in state for entry, s in zip(names(cls), symbols) if s.id in seen}


def _nodes(region: Region) -> Iterator[Expr]:
    for node in region.nodes:
        yield node
        for inner in regions(node):
            yield from _nodes(inner)


def _made_of(value: Expr, loops: dict[int, tuple[Expr, int]]) -> Sequence[Any]:
    """What a value is made of, but for conditions."""
    if value.op == "where":
        return value.args[1:]
    if value.op in ("load", "locate"):
        return [memory_of(value.args[0])] if value.op == "load" else []
    if value.op not in ("get", "var"):
        return value.args
    holder, k = (value.args[0], value.extra) if value.op == "get" else loops[value.id]
    return [*holder.extra[2].values()][k] if holder.op == "if" else [holder.args[k], holder.extra[2][k]]


class Printer(ABC):
    """Walks the live nodes in order; subclasses say how the statements and expressions of one language look."""

    forms: ClassVar[dict[str, str]] = {  # text of an operation with operands `a`, or `b` without outer parentheses
        "unary": "{op}({b[0]})",
        "neg": "(-{a[0]})",
        "table": "{a[0]}[{i}]",
        "load": "{a[0]}[{i}]",
        "store": "{a[0]}[{i}] = {b[2]}",
    }
    condition_uses = 1  # how often the text of a condition is printed
    end = ""  # of a statement

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.lines: list[str] = []
        self.depth, self.count = 1, 0
        self.text: dict[int, str] = {}  # of every node printed so far: an expression or a name
        self.holders: dict[int, list[str]] = {}  # names of the values of `if` and `loop` nodes
        self.live: dict[int, dict[int, None]] = {}  # which values of an `if` or `loop` node are used, in order
        self.loops: dict[int, tuple[Expr, int]] = {}  # of a variable its loop, and its place there
        self.uses: dict[int, int] = {}
        self.home: dict[int, Region] = {}
        self.far: set[int] = set()  # used in another region than their own: never inlined
        self.leaving: set[int] = set()  # given by their branch, loop body or function
        self.indices: set[int] = set()  # used as the index of an array
        self.given = {symbol.id for _, _, symbols in graph.arguments for symbol in symbols}
        self.numbers = set(self.given)  # used otherwise, or made elsewhere
        self._place(graph.tape.root, ())
        for _, entries in graph.results:
            for entry in entries:
                self._check_visible(entry, (graph.tape.root,))
                self._use(entry)

    def _place(self, region: Region, enclosing: tuple[Region, ...]) -> None:
        for node in region.nodes:
            self.home[node.id] = region
            if node.op == "loop":
                self.loops |= {variable.id: (node, k) for k, variable in enumerate(node.extra[1])}
            for inner in regions(node):
                self._place(inner, (*enclosing, region))
            has_index = node.op in ("load", "store")
            for value, place in operands(node, region):
                if isinstance(value, Expr):
                    (self.indices if has_index and value is node.args[1] else self.numbers).add(value.id)
                    if self.home.get(value.id) is not place:
                        self._check_visible(value, (*enclosing, region))
                        self.far.add(value.id)
                    if place is not region:
                        self.leaving.add(value.id)

    def _check_visible(self, value: Any, regions: tuple[Region, ...]) -> None:
        if isinstance(value, Expr) and self.home.get(value.id) not in regions:
            raise TraceError(
                f"`{self.graph.name}`: a value made inside cond() or loop() is used outside; return it from there."
            )

    def _use(self, result: Any) -> None:
        """Count the uses of everything that `result` needs; a result counts twice, so that it gets a name."""
        pending = [(result, 2)]
        if isinstance(result, Expr):
            self.numbers.add(result.id)
            self.leaving.add(result.id)
        while pending:
            node, weight = pending.pop()
            if isinstance(node, Expr):
                is_first = node.id not in self.uses
                self.uses[node.id] = self.uses.get(node.id, 0) + weight
                if is_first and node.id not in self.given:
                    pending += self._needs(node)

    def _needs(self, node: Expr) -> list[tuple[Any, int]]:
        if node.op == "get" and node.args[0].op == "if":
            holder = node.args[0]
            self.live.setdefault(holder.id, {})[node.extra] = None
            return [(holder, 1), *((value, 1) for value in [*holder.extra[2].values()][node.extra])]
        if node.op == "get":
            return [(node.args[0], 1), *self._variable(node.args[0], node.extra)]
        if node.op == "var":
            return self._variable(*self.loops[node.id])
        if node.op == "loop":
            return [(node.extra[3], 1)]
        if node.op == "if":
            return [(node.args[0], self.condition_uses)]
        return [(value, 1) for value in node.args]

    def _variable(self, loop: Expr, k: int) -> list[tuple[Any, int]]:
        """What a variable of a loop needs, once."""
        live = self.live.setdefault(loop.id, {})
        if k in live:
            return []
        live[k] = None
        return [(loop.args[k], 1), (loop.extra[2][k], 1)]

    def write(self, line: str) -> None:
        """Add a line at the current depth."""
        self.lines.append("    " * self.depth + line)

    def fresh(self, letter: str = "t") -> str:
        """A new name."""
        self.count += 1
        return f"{letter}{self.count}"

    def ref(self, value: Any) -> str:
        """Text of an operand."""
        return self.text[value.id] if isinstance(value, Expr) else self._number(value)

    def bare(self, value: Any) -> str:
        """Text of an operand that stands alone."""
        return _bare(self.ref(value))

    def region(self, region: Region) -> None:
        """Print the live nodes of a region."""
        for node in region.nodes:
            if node.id in self.uses and node.id not in self.text:
                self._node(node)

    def _node(self, node: Expr) -> None:
        if node.op == "if":
            then, otherwise, outs = node.extra
            self.holders[node.id] = [self.holder(node, k) if k in self.live[node.id] else "" for k in range(len(outs))]
            live = [(self.holders[node.id][k], *[*outs.values()][k]) for k in sorted(self.live[node.id])]
            live = [(target, a, b) for target, a, b in live if memory_of(a) is None]  # array memory changes in place
            targets, a, b = map(list, zip(*live)) if live else ([], [], [])
            self._branch(node.args[0], (then, otherwise), targets, a, b)
        elif node.op == "loop":
            self._repeat(self._loop(node))
        elif node.op == "get":
            memory = memory_of(node)
            self.text[node.id] = self.holders[node.args[0].id][node.extra] if memory is None else self.ref(memory)
        elif node.op == "store":
            self.text[node.id] = self.ref(node.args[0])
            self.write(self.expression(node) + self.end)
        else:
            text = self.expression(node)
            is_inline = self.may_be_inline(node) and len(text) < LONGEST_INLINE
            self.text[node.id] = text if is_inline else self._let(node, _bare(text))

    def may_be_inline(self, node: Expr) -> bool:
        """Whether a short expression may be printed where it is needed."""
        return self.uses[node.id] == 1 and node.id not in self.far and node.op not in ("load", "store")

    def holder(self, node: Expr, k: int) -> str:
        """Name of a value that an `if` node gives."""
        return self.fresh("c")

    def _loop(self, node: Expr) -> Loop:
        """A loop whose variables have names; array memory changes in place."""
        body, variables, new, stop, limit = node.extra
        memory = {k: memory_of(variables[k]) for k in self.live[node.id]}
        self.text.update((variables[k].id, self.ref(m)) for k, m in memory.items() if m is not None)
        live = sorted(k for k, m in memory.items() if m is None)
        targets = [self.fresh("v") for _ in live]
        self.holders[node.id] = [dict(zip(live, targets)).get(k, "") for k in range(len(variables))]
        self.text.update((variables[k].id, target) for k, target in zip(live, targets))
        chosen = ([values[k] for k in live] for values in (variables, node.args, new))
        return Loop(body, stop, limit, targets, *chosen)

    def expression(self, node: Expr) -> str:
        """Text of an operation; what is nothing but an index becomes a whole number here, once."""
        a = [self.operand(node, arg) for arg in node.args]
        op = "table" if node.op == "load" and node.args[0].extra == "table" else node.op
        form = self.form(op)
        element = self.element(node) if node.op in ("load", "store") else ""
        text = form.format(op=op, a=a, b=[*map(_bare, a)] if "{b" in form else a, i=element)
        return self.forms["whole"].format(_bare(text)) if self.is_index(node) and node.op != "locate" else text

    def operand(self, node: Expr, value: Any) -> str:
        """Text of an operand of the operation."""
        return self.ref(value)

    def form(self, op: str) -> str:
        """What an operation looks like."""
        return self.forms.get(op, self.forms["unary"] if op in UNARY else "({a[0]} {op} {a[1]})")

    def is_index(self, node: Expr) -> bool:
        """Whether the value is used as an index only."""
        return node.id in self.indices and node.id not in self.numbers

    def element(self, node: Expr) -> str:
        """Text of the element that a `load` or `store` means."""
        return f"{self._index(node.args[1])} + {node.extra}" if node.extra else self._index(node.args[1])

    def _index(self, value: Any) -> str:
        if not isinstance(value, Expr):
            return str(int(value))
        is_whole = value.op == "locate" or self.is_index(value)
        return self.bare(value) if is_whole else self.forms["whole"].format(self.bare(value))

    def assign(self, targets: list[str], values: list[Any]) -> None:
        """Print `target = value` for each."""
        for target, text in zip(targets, map(self.bare, values)):
            if text != target:
                self.write(f"{target} = {text}{self.end}")

    def block(self, opening: str, region: Region, targets: list[str], values: list[Any]) -> None:
        """Print a branch: its nodes, and the values it gives."""
        self.write(opening)
        self.depth += 1
        self.region(region)
        self.assign(targets, values)
        self.depth -= 1

    def _number(self, value: Any) -> str:
        """Text of a constant, exact."""
        return repr(value)

    def _let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(f"{name} = {text}")
        return name

    def definition(self) -> list[str]:
        """Lines of a function of one number, `x`."""
        (x,), (result,) = self.graph.arguments[0][2], self.graph.results[0][1]
        self.text[x.id] = "x"
        self.region(self.graph.tape.root)
        self.write(f"return {self.bare(result)}{self.end}")
        return self.lines

    @abstractmethod
    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """Print a condition: `targets` become the values `a` of the first region or `b` of the second."""

    @abstractmethod
    def _repeat(self, loop: Loop) -> None:
        """Print a loop."""

    @abstractmethod
    def source(self) -> str:
        """Text of the function."""


# Split a step in two: what depends on parameters only, which is computed once, and the rest, for every step.


STRUCTURE = ("in", "var", "if", "loop", "get", "store")
MOVED_WHOLE = ("if", "get")
HARMLESS = ("+", "-", "*", "neg", "fabs", "where", *BOOLEAN)  # no error, so they may be done for a branch not taken
HARMLESS_IN_C = (*HARMLESS, "/", *UNARY)  # there is infinity, and what is not a number


def split(step: Graph, printer: type[Printer], harmless: tuple[str, ...] = HARMLESS) -> tuple[Graph, Graph]:
    """`constants(par)`, and `advance(state, inputs, constants)` that goes on from there to what `step` gives.

    Operations that are `harmless` are done there even if no branch is taken that needs them.
    """
    *others, (par, cls, symbols) = step.arguments
    once = Tape(step.tape.places)
    once.root.nodes = [*symbols, *_constant(step.tape.root, {s.id for s in symbols}, harmless)]
    titles = dict(zip((s.id for s in symbols), names(cls)))

    def advance(constants: list[Expr]) -> Graph:
        entries = [(titles.get(node.id, f"value_{k}"), float) for k, node in enumerate(constants)]
        record = NamedTuple("Constants", entries)  # type: ignore[misc]  # its fields are what this is about
        return Graph("advance", step.tape, [*others, ("constants", record, constants)], step.results)

    uses = printer(advance(once.root.nodes)).uses
    rest = advance([node for node in once.root.nodes if node.id in uses])
    _, record, constants = rest.arguments[-1]
    return Graph("constants", once, [(par, cls, symbols)], [(record, list(constants))]), rest


def _constant(region: Region, known: set[int], harmless: tuple[str, ...], is_root: bool = True) -> Iterator[Expr]:
    """Nodes, those in branches included, that need no more than `known` ones; they become known.

    A branch on a condition of this kind is one, where it is not in a branch itself; its values follow it.
    """
    for node in region.nodes:
        may_move = is_root if node.op in MOVED_WHOLE else node.op not in STRUCTURE and (is_root or node.op in harmless)
        if may_move and known.issuperset(_needs(node, region)):
            known.add(node.id)
            yield node
        else:
            for inner in regions(node):
                yield from _constant(inner, known, harmless, is_root=False)


def _needs(node: Expr, region: Region) -> set[int]:
    """What a node needs, less what is made in its branches."""
    needed = {value.id for value, _ in operands(node, region) if isinstance(value, Expr)}
    if not (inner := [(n, r) for r in regions(node) for n in r.nodes]):
        return needed
    return needed.union(*(_needs(n, r) for n, r in inner)) - {n.id for n, _ in inner}
