"""Tables of programs that solve fields by finite elements: what each column is, and what no device can be.

Heads name quantity and unit, `gap [mm]`, `current (A)` or `force_N`.  Lines above them, comment signs in front of them
and a line of units below them are taken as such programs write them.  Points may be a grid or scattered.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.files import Sheet, read_bytes, split_header, twice, why_unreadable
from gapsense.identification.gap_law.laws import Vector
from gapsense.identification.gap_law.table import HEAD, Column, cells, values, without_notes
from gapsense.identification.measurements.reading import Line, is_number, other_separator, with_unit
from gapsense.identification.measurements.record import SHOWN, Reading
from gapsense.problems import InputError, listing, suggest
from gapsense.report.table import quantity
from gapsense.units import factor

FEWEST = 4  # gaps
SAME = 1e-6  # of a range: points that are one
ALIKE = 1e-3  # relative difference of what was solved twice at one point
NOISE = 4.0  # deviations of what neighbours leave, up to which a fall is noise
SEEN = 2e-3  # of the largest value, the same
FIRST = 6  # points at a gap, which tell where the flux linkage begins
LEFT = 0.02  # of the largest flux linkage, that may be there without current
BLANK = " "  # columns that are aligned: any number of blanks, two at least between heads, which may have one inside
ALIASES = {"Vs": "Wb", "V.s": "Wb", "V*s": "Wb", "weber": "Wb", "newton": "N", "meter": "m", "henry": "H"}
ALIASES |= {name.capitalize(): unit for name, unit in ALIASES.items() if name.islower()}


class Kind(NamedTuple):
    """A quantity that a table may have."""

    unit: str
    names: str  # pattern of heads that are meant, where several are in that unit
    usual: tuple[float, float]  # its largest value in a table, in its unit
    example: str


KINDS = {
    "position": Kind("m", r"gap|air.?gap|position|stroke|x|z", (1e-5, 0.2), "gap [mm]"),
    "current": Kind("A", r"current|i", (1e-3, 1e4), "current [A]"),
    "flux_linkage": Kind("Wb", r".*linkage.*|psi|lambda", (1e-6, 1e2), "flux_linkage [Wb]"),
    "flux": Kind("Wb", r"flux|phi", (1e-9, 1.0), "flux [Wb]"),
    "inductance": Kind("H", r"inductance|l", (1e-6, 50.0), "inductance [mH]"),
    "force": Kind("N", r"force|f", (1e-4, 1e6), "force [N]"),
}
NEEDED = {  # and what else than a column serves
    "position": "",
    "current": ", or give that of all rows: `--current 1.2`",
    "flux_linkage": ", or `inductance [mH]`, or `flux [Wb]` of one turn; `--column flux_linkage=NAME` names it",
}
LINKS = ("flux_linkage", "inductance", "flux")  # any of them gives the flux linkage: the one named, or the first


class Given(NamedTuple):
    """What a table does not say."""

    turns: float
    current: float | None = None  # of all rows [A]
    parts: float = 1.0  # equal parts of the device; the table describes one of them
    closed: float | None = None  # position at which the gap is closed, where it is no gap [m]


class Solved(NamedTuple):
    """Points of the whole device, sorted by gap and current; a force that closes the gap is negative."""

    file: str
    lines: npt.NDArray[np.int_]
    gap: Vector  # [m]
    current: Vector  # [A]
    flux_linkage: Vector  # [Wb]
    force: Vector | None  # [N]
    remarks: tuple[str, ...] = ()

    def place(self, k: int) -> str:
        """Where a point is, as messages name it."""
        return f"line {self.lines[k]}, {quantity(float(self.gap[k]), 'm')}, {quantity(float(self.current[k]), 'A')}"

    def part(self, at: npt.NDArray[Any]) -> Solved:
        """Some points, or all in another order."""
        names = ("lines", "gap", "current", "flux_linkage", "force")
        cut: dict[str, Any] = {name: None if (x := getattr(self, name)) is None else x[at] for name in names}
        return self._replace(**cut)

    @property
    def has_one_current(self) -> bool:
        """Whether nothing tells how the flux linkage rises with the current."""
        return bool(np.ptp(self.current) < SAME * self.current.max())


def read_solved(path: Path, how: Reading, given: Given) -> Solved:
    """Points of a file; an InputError tells all that is wrong with it."""
    problems: list[str] = []
    sheet = read_heads(path, how, problems)
    places = choose(sheet, how.names, given, problems) if sheet.names else {}
    used = [Column(k, sheet.names[k], scale) for k, scale in places.values()]
    sheet = without_notes(sheet, used) if used else sheet
    problems += cells(sheet, used) if used else []
    if problems:
        raise InputError(problems)
    columns = {name: values(sheet, column) for name, column in zip(places, used)}
    found = to_solved(sheet, columns, given)
    if problems := [*unusual(found), *fields_of_rest(found)]:
        raise InputError(problems)
    found = without_repeated(found._replace(remarks=(*found.remarks, *remaining(found))), problems)
    problems += [*too_few(found), *against_neighbours(found), *pushing(found)]
    if problems:
        raise InputError(problems)
    unused = [name for k, name in enumerate(sheet.names) if k not in [column.place for column in used]]
    told = [f"{sheet.path}: left out, for nothing here needs it: {listing(unused)}."] if unused else []
    return make_attractive(found._replace(remarks=(*found.remarks, *told)))


def read_heads(path: Path, how: Reading, problems: list[str]) -> Sheet:
    """Cells of a file from the heads of its columns on, which are in the last line of texts above the numbers."""
    lines: list[Line] = []
    text = ""
    try:
        text = read_bytes(path).decode("utf-8-sig")
        lines = [*split_lines(text, how)]
    except (UnicodeDecodeError, csv.Error) as error:
        problems.append(f"{path.name}: not a CSV file in UTF-8 ({why_unreadable(error)}). Save it as one.")
    if other := other_separator(lines, how.separator):
        problems.append(f"{path.name}, line 1: {other}")
    first = first_row(lines, how.decimal)
    if not first and not problems and first_row([*split_lines(text, how._replace(separator=BLANK))], how.decimal):
        problems.append(
            f'{path.name}: the cells are separated by blanks; commas are expected. Add `--separator " "`, with'
            " at least two blanks between heads."
        )
    elif not first and not problems:
        problems.append(
            f"{path.name}: no heads above rows of numbers found. Write heads as in {EXAMPLE}, and numbers below."
        )
    if problems:
        return Sheet(path=Path(path.name), names=(), units=(), lines=[], rows=[])
    heads = lines[first - 1].cells
    if first > 1 and all(re.fullmatch(r"[\[(]?[A-Za-z.*\u00b5\u03bc]{0,6}[\])]?", c) for c in heads):  # units alone
        heads = [with_unit(h, u.strip("()[]")) for h, u in zip(lines[first - 2].cells, heads)]
    heads = [heads[0].lstrip("%# "), *heads[1:]]
    rows = [line for line in lines[first:] if len(line.cells) == len(heads)]
    wrong = [line for line in lines[first:] if len(line.cells) != len(heads)]
    problems += [
        f"{path.name}, line {line.number}: {len(line.cells)} values found, {len(heads)} expected. Correct it."
        for line in wrong[:SHOWN]
    ]
    names, units = zip(*map(split_header, heads))
    problems += twice(Path(path.name), names)
    decimal = [[c.replace(how.decimal, ".") for c in line.cells] for line in rows]
    return Sheet(path=Path(path.name), names=names, units=units, lines=[line.number for line in rows], rows=decimal)


def split_lines(text: str, how: Reading) -> Iterator[Line]:
    """Cells of the lines that have any."""
    if how.separator == BLANK:
        for number, line in enumerate(map(str.strip, text.splitlines()), 1):
            apart = re.split(r"\s{2,}|\t", line.lstrip("%# "))
            if line:
                is_plain = len(apart) < 2 or all(is_number(c, how.decimal) for c in line.split())
                yield Line(number, line.split() if is_plain else apart)
        return
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=how.separator)
    for row in reader:
        if any(map(str.strip, row)):
            yield Line(reader.line_num, [*map(str.strip, row)])


def first_row(lines: Sequence[Line], decimal: str) -> int:
    """Place of the first line with numbers; 0 if there is none below another one."""
    return next((k for k, line in enumerate(lines) if sum(is_number(c, decimal) for c in line.cells) > 1), 0)


EXAMPLE = ", ".join(f"`{KINDS[name].example}`" for name in ("position", "current", "flux_linkage", "force"))


def choose(sheet: Sheet, named: Mapping[str, str], given: Given, problems: list[str]) -> dict[str, tuple[int, float]]:
    """Column and factor to the SI unit of each quantity."""
    found: dict[str, tuple[int, float]] = {}
    told: set[str] = {name for name in named if name not in KINDS}
    problems += [f"--column {name}: {suggest(name, KINDS)}" for name in told]
    for name, kind in KINDS.items():
        fits = [(k, n, s) for k, _ in enumerate(sheet.names) for n, s in [in_unit(sheet, k, kind.unit)] if s]
        meant = [fit for fit in fits if re.fullmatch(kind.names, fit[1], re.IGNORECASE)]
        others = {other for key, other in named.items() if key != name}
        if name in named:
            fits = [fit for fit in fits if named[name] in (fit[1], sheet.names[fit[0]])]
        else:  # in Wb; only its name says whether it is the flux of one turn
            fits = [fit for fit in (meant if meant or kind.unit == "Wb" else fits) if fit[1] not in others]
        wrong = [k for k, n in enumerate(sheet.names) if re.fullmatch(kind.names, n, re.IGNORECASE)]
        where, problem = f"{sheet.path}, heads", ""
        if len(fits) > 1:
            both = listing([sheet.names[k] for k, *_ in fits])
            problem = f"{where}: {both} may be the {name}. Choose one: `--column {name}={fits[0][1]}`."
        elif not fits and name in named:
            problem = f"--column: no column `{named[name]}` in {kind.unit} is found; there are {listing(sheet.names)}."
        elif not fits and wrong:
            unit = f"the unit `{sheet.units[wrong[0]]}`" if sheet.units[wrong[0]] else "no unit"
            problem = (
                f"{where}: `{sheet.names[wrong[0]]}` has {unit}; {kind.unit} is expected, also with a prefix. Write it"
                f" as in `{kind.example}`."
            )
        if problem:
            problems.append(problem)
            told.add("flux_linkage" if name in LINKS else name)
        elif fits:
            found[name] = (fits[0][0], fits[0][2])
    links = sorted((name for name in LINKS if name in found), key=lambda name: name not in named)
    missing = {"position": not found.get("position"), "current": not found.get("current") and given.current is None}
    for name, more in NEEDED.items():
        if missing.get(name, not links) and name not in told:
            problems.append(
                f"{sheet.path}, heads: no column of the {name.replace('_', ' ')} in {KINDS[name].unit} is found; there"
                f" are {listing(sheet.names)}. Name it as in `{KINDS[name].example}`{more}."
            )
    return {name: place for name, place in found.items() if name not in links[1:]}


def in_unit(sheet: Sheet, k: int, unit: str) -> tuple[str, float | None]:
    """Name of a column without its unit, and the factor to that unit if it is a multiple of it."""
    match = HEAD.fullmatch(sheet.names[k])
    written = sheet.units[k] or (match and (match["unit"] or match["after"])) or ""
    name = sheet.names[k] if sheet.units[k] or match is None else match["name"]
    for other, ours in ALIASES.items():
        written = f"{written.removesuffix(other)}{ours}" if written.endswith(other) else written
    return name.strip(), factor(written, unit) if written else None


def to_solved(sheet: Sheet, columns: Mapping[str, Vector], given: Given) -> Solved:
    """The whole device, with gaps in place of positions and currents that are not negative."""
    position = columns["position"]
    gap = position if given.closed is None else given.closed - position
    current = columns.get("current", np.full(position.shape, given.current))
    turn = np.where(current < 0.0, -1.0, 1.0)  # the field of the opposite current is the opposite one
    link = next(name for name in LINKS if name in columns)
    factors = {"flux_linkage": turn, "inductance": np.abs(current), "flux": turn * given.turns}
    force = columns.get("force")
    found = Solved(
        file=f"{sheet.path}",
        lines=np.array(sheet.lines),
        gap=gap,
        current=np.abs(current),
        flux_linkage=given.parts * factors[link] * columns[link],
        force=None if force is None else given.parts * (1.0 if given.closed is None else -1.0) * force,
    )
    return found.part(np.lexsort((found.current, gap)))


def unusual(found: Solved) -> list[str]:
    """Quantities of another size than that of any such device, and gaps below 0."""
    kinds = {"position": found.gap, "current": found.current, "flux_linkage": np.abs(found.flux_linkage)}
    kinds |= {} if found.force is None else {"force": np.abs(found.force)}
    told = [
        f"{found.file}: the largest {name.replace('_', ' ')} is {quantity(float(x.max()), kind.unit)},"
        f" {quantity(kind.usual[0], kind.unit)} to {quantity(kind.usual[1], kind.unit)} expected. Correct the unit in"
        " the head of its column."
        for name, x in kinds.items()
        for kind in [KINDS[name]]
        if not kind.usual[0] <= x.max() <= kind.usual[1]
    ]
    if found.gap.min() < 0.0:
        k = int(found.gap.argmin())
        told.append(
            f"{found.file}, line {found.lines[k]}: a gap of {quantity(float(found.gap[k]), 'm')} found; gaps count from"
            " 0, closed. Shift them, or say by `--closed` at which position the gap is closed."
        )
    return told


def fields_of_rest(found: Solved) -> list[str]:
    """A field without current, or against it."""
    flux, largest = found.flux_linkage, float(np.abs(found.flux_linkage).max())
    told, rests = [], found.current < SAME * found.current.max()
    if (left := np.abs(flux) * rests).max() > LEFT * largest:
        k = int(left.argmax())
        told.append(
            f"{found.file}, {found.place(k)}: a flux linkage of {quantity(float(flux[k]), 'Wb')} without current found,"
            " 0 expected. Permanent magnets and remanence are not modelled here: solve without them."
        )
    against = np.flatnonzero(~rests & (flux <= 0.0))
    if against.size:
        told.append(
            f"{found.file}, {found.place(int(against[0]))}{more(against)}: a flux linkage of"
            f" {quantity(float(flux[against[0]]), 'Wb')} found, one of the sign of the current expected. Turn the sign"
            " of the column, or correct these lines."
        )
    return told


def remaining(found: Solved) -> list[str]:
    """A flux linkage that remains without current: of points there, or of the straight part at the largest gap."""
    flux, rests = found.flux_linkage, found.current < SAME * found.current.max()
    left, least = float(np.abs(flux[rests]).max(initial=0.0)), SEEN * float(flux.max())
    line = np.flatnonzero(found.gap > (1.0 - SAME) * found.gap[-1])[:FIRST]
    if not rests.any() and line.size == FIRST:
        fit, covariance = np.polyfit(found.current[line], flux[line], 2, w=1.0 / flux[line], cov=True)
        left, least = float(fit[2]), max(least, NOISE * float(covariance[2, 2]) ** 0.5)
    if left <= least:
        return []
    return [
        f"{found.file}: a flux linkage of about {quantity(left, 'Wb')} remains without current, and is taken for one of"
        " the current: remanence is not modelled here. Solve without it."
    ]


def more(places: npt.NDArray[np.int_]) -> str:
    """How many there are beside the first one."""
    return f", and {places.size - 1} more" if places.size > 1 else ""


def without_repeated(found: Solved, problems: list[str]) -> Solved:
    """Points without current and those that come twice left out; `problems` takes those that differ."""
    near = [np.abs(np.diff(x)) <= SAME * x.max() for x in (found.gap, found.current)]
    again = np.append(False, near[0] & near[1])
    for k in np.flatnonzero(again).tolist():
        for what, x in (("flux linkage", found.flux_linkage), ("force", found.force)):
            if x is not None and abs(x[k] - x[k - 1]) > ALIKE * np.abs(x).max():
                problems.append(
                    f"{found.file}, {found.place(k)}: the {what} of this point is another one in line"
                    f" {found.lines[k - 1]}, {x[k]:.4g} and {x[k - 1]:.4g}. Remove one of them."
                )
    kept = ~again & (found.current >= SAME * found.current.max())
    told = [f"{found.file}: {again.sum()} points come twice; one of each is used."] if again.any() else []
    return found.part(kept)._replace(remarks=(*found.remarks, *told))


def too_few(found: Solved) -> list[str]:
    """What tells no law of the gap."""
    count = int((np.diff(np.unique(found.gap)) > SAME * found.gap.max()).sum()) + 1
    if count >= FEWEST:
        return []
    return [f"{found.file}: {count} gaps found, at least {FEWEST} expected, better 10. Solve at more gaps."]


def neighbours(along: Vector, across: Vector) -> list[npt.NDArray[np.int_]]:
    """Points of a grid line by line: those with the same `across`, by rising `along`, three at least."""
    order = np.lexsort((along, across))
    ends = np.flatnonzero(np.diff(across[order]) > SAME * np.abs(across).max()) + 1
    return [line for line in np.split(order, ends) if line.size > 2]


def noise(lines: Sequence[npt.NDArray[np.int_]], x: Vector) -> float:
    """Standard deviation that second differences show, half of which are smaller; a bend adds to it."""
    bends = [np.abs(np.diff(x[line], 2)) for line in lines]
    return 1.4826 * float(np.median(np.concatenate(bends))) / 6.0**0.5 if bends else 0.0


def falls(lines: Sequence[npt.NDArray[np.int_]], x: Vector) -> list[tuple[int, int]]:
    """Neighbours of which the second has less, beyond noise; the worst first."""
    least = max(NOISE * 2.0**0.5 * noise(lines, x), SEEN * float(np.abs(x).max()))
    pairs = [(a, b) for line in lines for a, b in zip(line.tolist(), line[1:].tolist()) if x[a] - x[b] > least]
    return sorted(pairs, key=lambda pair: float(x[pair[1]] - x[pair[0]]))


def against_neighbours(found: Solved) -> list[str]:
    """Flux linkages that fall while the current rises, or that rise with the gap."""
    flux = found.flux_linkage
    ways = [("falls", "with less current", "rise", falls(neighbours(found.current, found.gap), flux))]
    slope = np.polyfit(found.gap, flux / found.current, 1)[0]
    if slope < 0.0:
        ways.append(("rises", "at a smaller gap", "fall", falls(neighbours(found.gap, found.current), -flux)))
    told = [
        f"{found.file}, {found.place(b)}: the flux linkage {way} to {quantity(float(flux[b]), 'Wb')} from"
        f" {quantity(float(flux[a]), 'Wb')} in line {found.lines[a]} {where}, where it has to {right}. Correct the"
        " line, or solve it again with a finer mesh."
        for way, where, right, pairs in ways
        for a, b in pairs[:SHOWN]
    ]
    if slope >= 0.0:
        told.append(
            f"{found.file}: the inductance rises with the position, from"
            f" {quantity(float(flux[0] / found.current[0]), 'H')} in line {found.lines[0]} to"
            f" {quantity(float(flux[-1] / found.current[-1]), 'H')} in line {found.lines[-1]}, where it has to fall"
            " with the gap. If the position is not the gap, say by `--closed` at which one the gap is closed."
        )
    return told


def pushing(found: Solved) -> list[str]:
    """Forces of both signs: the field pulls, so that all must have the same."""
    if found.force is None:
        return []
    large = np.abs(found.force) > 0.01 * np.abs(found.force).max()
    signs = np.sign(found.force) * large
    usual = float(np.sign(signs.sum())) or -1.0
    others = np.flatnonzero(signs == -usual)
    if not others.size:
        return []
    k = int(others[0])
    return [
        f"{found.file}, {found.place(k)}{more(others)}: a force of"
        f" {quantity(float(found.force[k]), 'N')} found among others of the other sign, where the field can only close"
        " the gap. Give all of them the same sign, negative if the position is the gap."
    ]


def make_attractive(found: Solved) -> Solved:
    """Make forces close the gap: a program may count them along another axis."""
    if found.force is None or found.force.sum() <= 0.0:
        return found
    told = (
        f"{found.file}: forces are positive, {quantity(float(found.force[0]), 'N')} in line {found.lines[0]}, where one"
        " that closes the gap is negative: they are taken with the other sign."
    )
    return found._replace(force=-found.force, remarks=(*found.remarks, told))
