"""The one plotting module: empty figures, lines, legends, and how a figure is saved."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from itertools import takewhile
from pathlib import Path
from textwrap import wrap
from typing import Any, TypeAlias
from urllib.parse import quote, unquote

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from gapsense._os.files import read_bytes, refuse_unwritable, write_atomically
from gapsense.cosim.result.sidecar import ELSEWHERE, own_file, refuse_other, relative
from gapsense.cosim.scenario.records import matching
from gapsense.problems import InputError, suggest
from gapsense.report.table import choose_prefix
from gapsense.units import QUANTITIES, UNITS

Vector = npt.NDArray[np.float64]
Recorded: TypeAlias = Any  # a `Result` of `cosim`, which shows itself by what is here and so is not imported
ENDINGS = (".png", ".pdf", ".svg")
SOURCE = "Source"  # chunk of a PNG file that tells what it shows, in ASCII
GRID = "#d0d7de"
PAGE = 9.0  # width of a figure for a page [in], on which its text has 10 of the 16 pixels of the page's
MOST, ROOM = 5, 14  # curves in a panel of an overview, and characters in a line beside it
TRUE, FIRST, SECOND, THIRD, FAINT = "black", "#0969da", "#bc4c00", "#1a7f37", "#8c959f"


class Picture(Figure):
    """A figure that notebooks show by themselves, and `show` in a window of the system, where there is one."""

    def show(self, warn: bool = True) -> None:
        """Show it in the browser; without a display, say where the file is."""
        import webbrowser
        from tempfile import mkstemp

        handle, name = mkstemp(prefix="gapsense_", suffix=".png")
        os.close(handle)
        self.savefig(name)
        if not webbrowser.open(Path(name).as_uri()) and warn:
            print(f"There is no display here. The figure is in {name}.")

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png", dpi=100)
        return file.getvalue()


def check_file(path: Path) -> None:
    """Refuse a file that a figure cannot be written to, before a long run."""
    check_ending(path)
    refuse_unwritable(path)


def check_ending(path: Path) -> None:
    """Refuse a file whose ending is no format of figures."""
    if path.suffix not in ENDINGS:
        raise ValueError(f"`{path}`: figures are written as .png, .pdf or .svg. Change the ending.")


def figure_file(folder: Path, scenario: Path, variant: str | None, settings: Sequence[str] = ()) -> Path:
    """PNG file for the figure of a scenario; an InputError if that of another one is there."""
    file, own = own_file(folder, scenario, variant, ".png", settings)
    refuse_foreign(file, own)
    return file


def refuse_foreign(file: Path, own: str) -> None:
    """Raise an InputError if a file is there that is no figure of `own`, the path of a scenario."""
    content = read_bytes(file) if os.path.lexists(file) else b""
    found = re.search(b"(....)tEXt" + SOURCE.encode() + b"\0", content, re.DOTALL)
    if content and not found:
        raise InputError([f"{file}: this file exists and is not a figure of a run. Remove it, or {ELSEWHERE}."])
    if found:
        end = found.end() + int.from_bytes(found[1], "big") - len(SOURCE) - 1
        refuse_other(file, unquote(content[found.end() : end].decode("ascii")), own)


def save(figure: Figure, path: Path, source: str = "") -> Path:
    """Write a figure, complete or not at all; the ending of `path` says the format, a PNG tells the file it is of."""
    check_ending(path)
    about = {"Software": None, **({SOURCE: quote(relative(source, path.parent))} if source else {})}
    options: dict[str, Any] = {"format": path.suffix[1:], "dpi": 120}
    options["metadata"] = about if path.suffix == ".png" else None
    write_atomically(path, lambda file: figure.savefig(file.buffer, **options))
    return path


def panels(
    title: str, rows: int, columns: int = 1, size: tuple[float, float] | None = None, **more: Any
) -> tuple[Figure, Any]:
    """An empty figure and its axes (rows, columns), with a grid and without a box."""
    figure = Picture(figsize=size or (min(1.0 + 5.0 * columns, PAGE), 5.0), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **more)
    for axis in axes.flat:
        dress(axis)
    figure.suptitle(title)
    return figure, axes


def dress(axis: Any) -> None:
    """Draw a light grid and no box."""
    axis.grid(True, color=GRID, linewidth=0.5)
    axis.spines[["top", "right"]].set_visible(False)
    axis.margins(x=0.01)


def stack(title: str, labels: list[str], heights: list[float] | None = None) -> tuple[Figure, list[Any]]:
    """An empty figure with one panel per label, sharing the time axis."""
    size = (PAGE, 0.9 + 1.25 * len(labels))
    figure, axes = panels(title, len(labels), size=size, sharex=True, height_ratios=heights)
    for axis, label in zip(axes[:, 0], labels):
        axis.set_ylabel(label)
    axes[-1, 0].set_xlabel("time / ms")
    figure.align_ylabels()
    return figure, list(axes[:, 0])


def line(axis: Any, times: Vector, values: Vector, color: str, label: str | None = None, **style: Any) -> None:
    """A held signal: a step at each communication point."""
    style = {"linewidth": 1.0, **style}
    axis.plot(1e3 * times, values, color=color, label=label, drawstyle="steps-post", **style)


def shade(axis: Any, result: Recorded) -> None:
    """Shade the times at which an event of the scenario was on."""
    for span in result.events:
        end = result.times[-1] if span.end is None else span.end
        axis.axvspan(1e3 * span.begin, 1e3 * end, color=FAINT, alpha=0.2, linewidth=0.0, zorder=0)


def display(unit: str) -> tuple[str, float]:
    """Unit for display and the factor to it."""
    shown = UNITS[unit].display if unit in UNITS else None
    return (shown.name, shown.factor) if shown else (unit, 1.0)


def scale_axis(name: str, unit: str, *signals: Vector) -> tuple[str, float]:
    """Scale an axis: its label, `current / mA`, with the prefix that suits the largest value, and the factor to it."""
    largest = max((float(np.abs(x[np.isfinite(x)]).max(initial=0.0)) for x in signals), default=0.0)
    factor, text = choose_prefix(largest, unit)
    return f"{name} / {text}", 1.0 / factor


def legend(axis: Any) -> None:
    """A legend that stands beside the panel and hides nothing, in columns of at most ten."""
    columns = max(1, -(-len(axis.get_legend_handles_labels()[1]) // 10))
    axis.legend(loc="center left", bbox_to_anchor=(1.005, 0.5), frameon=False, fontsize="small", ncols=columns)


def legend_below(figure: Figure) -> None:
    """One legend for all panels, below them; its labels are those of the first panel that has any."""
    handles, labels = next(filter(any, (axis.get_legend_handles_labels() for axis in figure.axes)))
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)


def require_recorded(result: Recorded, names: Iterable[str]) -> None:
    """Refuse to draw a run that does not record these signals; all that are missing are named."""
    if missing := [name for name in names if name not in result.signals]:
        raise ValueError(
            f"{result.run.scenario}: its figure needs {', '.join(f'`{m}`' for m in missing)}, not recorded. "
            'Add them to `[record]`, or choose `figure = "overview"`.'
        )


def signals(result: Recorded, patterns: Sequence[str]) -> Figure:
    """The recorded signals that match one of the patterns, by default all, in one panel per unit."""
    if missing := [pattern for pattern in patterns if not matching([pattern], result.signals)]:
        raise InputError([f"`{pattern}` was not recorded. {suggest(pattern, result.signals)}" for pattern in missing])
    chosen = matching(patterns or ("*",), result.signals)
    return overview(result, chosen)


def overview(result: Recorded, chosen: Sequence[str] = ()) -> Figure:
    """Recorded signals, by default all: panels by unit, those of many signals by variable, with a few curves each."""
    units = {name: result.units[name] for name in chosen or result.signals}
    panels = [part for unit in dict.fromkeys(units.values()) for part in few(units, unit)]
    labels = [label([name.partition(".")[2] for name in names], result.units[names[0]]) for names in panels]
    figure, axes = stack(result.run.title, labels)
    for names, axis in zip(panels, axes):
        for k, name in enumerate(names):  # each thinner than the last, so that all show where they coincide
            width = 1.0 + 1.5 * (len(names) - 1 - k) / MOST
            line(axis, result.times, display(result.units[name])[1] * result[name], f"C{k}", name, linewidth=width)
        shade(axis, result)
        legend(axis)
    return figure


def few(units: Mapping[str, str], unit: str) -> list[list[str]]:
    """Signals of a unit in groups for one panel each."""
    names = [name for name in units if units[name] == unit]
    if len(names) <= MOST:
        return [names]
    by_variable: dict[str, list[str]] = {}
    for name in names:
        by_variable.setdefault(name.partition(".")[2], []).append(name)
    return [group[k : k + MOST] for group in by_variable.values() for k in range(0, len(group), MOST)]


def label(variables: Sequence[str], unit: str) -> str:
    """What an axis shows and its unit: the words that all variables begin with, or else what the unit stands for."""
    words = zip(*(re.split(r"[._]", variable) for variable in variables))
    shared = takewhile(lambda places: len(set(places)) == 1, words)
    quantity = " ".join(places[0] for places in shared) or QUANTITIES.get(unit) or ", ".join(dict.fromkeys(variables))
    shown = display(unit)[0]
    end = "" if unit == "1" else f" /\N{NO-BREAK SPACE}{f'({shown})' if '/' in shown else shown}"
    return "\n".join(wrap(quantity + end, ROOM, break_long_words=False)).replace("\N{NO-BREAK SPACE}", " ")


def over(axis: Any, result: Recorded, x: tuple[str, float], y: tuple[str, float]) -> None:
    """The second signal over the first, of each component that has both, times their factors."""
    names = [name.partition(".")[0] for name in result.signals if name.endswith(f".{x[0]}")]
    require_recorded(result, [f"{name}.{s}" for name in names or ["<actuator>"] for s in (x[0], y[0])])
    for k, name in enumerate(names):
        axis.plot(x[1] * result[f"{name}.{x[0]}"], y[1] * result[f"{name}.{y[0]}"], f"C{k}", label=name, linewidth=1.0)
