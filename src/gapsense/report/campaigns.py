"""Tables and figure of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from gapsense.many import summary as of
from gapsense.many.result import Campaign
from gapsense.many.summary import Cloud
from gapsense.problems import InputError, suggest
from gapsense.report.distributions import Bars, Distributions
from gapsense.report.table import add_row, quantity, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 5  # failures
PANELS = 4  # metrics and parameters of a figure, unless they are chosen


def summary(campaign: Campaign) -> list[Table | str]:
    """What was varied, the metrics, and what failed."""
    about = campaign.about
    state = f"{campaign.rows} of {campaign.runs} runs, {campaign.failed} failed"
    heading = f"{about['title']}: {about['scenario']}, {state}"
    shown: list[Table | str] = [heading, *factors(campaign), *metrics(campaign)]
    shown += [f"run {run}: {error}" for run, error in campaign.errors(SHOWN)]
    shown += [f"run {run}: {sentence} See column `ended`." for run, sentence in campaign.ended(1)]
    more = campaign.failed - SHOWN
    return [*shown, f"{more} more failed: column `error`."] if more > 0 else shown


def factors(campaign: Campaign) -> list[Table]:
    """What was varied."""
    if not campaign.factors or not campaign.rows:
        return []
    made, numeric = table("Varied", ("parameter", "least", "median", "greatest")), of.numeric(campaign)
    for name in campaign.factors:
        unit = campaign.units[name]
        if name in numeric:
            found = of.spread(campaign, name)
            add_row(made, name, *(quantity(v, unit) for v in (found.least, found.median, found.greatest)))
        else:
            values = of.levels(campaign, name)
            add_row(made, name, "many values" if values is None else ", ".join(map(str, values)))
    return [made]


def metrics(campaign: Campaign) -> list[Table]:
    """Quantiles of each metric, and the parameter that it goes with."""
    made: dict[str, Table] = {}
    leading = of.leading(campaign)
    for name, (title, label) in campaign.about["labels"].items() if campaign.rows else ():
        title = title or "Metrics"
        heads = ("metric", "least", "5 %", "median", "95 %", "greatest", "goes with", "missing")
        shown = made.setdefault(title, table(title, heads))
        found, unit = of.spread(campaign, name), campaign.units[name]
        numbers = (found.least, found.low, found.median, found.high, found.greatest)
        best = leading.get(name)
        with_it = f"{best.factor} {best.correlation:+.2f}" if best else "-"
        add_row(shown, label, *(quantity(number, unit) for number in numbers), with_it, str(found.missing or "-"))
    return list(made.values())


def figure(campaign: Campaign, metrics: Sequence[str] = (), factors: Sequence[str] = ()) -> Figure:
    """Each metric, alone and over each parameter: points, or a density; by default the first metrics and parameters."""
    from gapsense.report import plot

    metrics = choose_names(metrics, campaign.metrics, "metric")
    factors = choose_names(factors, campaign.factors, "parameter")
    if not metrics or not campaign.rows:
        raise InputError([f"{campaign.folder}: there are no metrics to draw yet."])
    found = Distributions(
        campaign, dict.fromkeys(metrics, factors), {name: of.levels(campaign, name) for name in factors}
    )
    words = f"{campaign.rows} runs{'; dark where many lie' if found.is_counted else ''}"
    title, size = f"{campaign.about['title']}: {words}", (len(metrics), 1 + len(factors))
    made, axes = plot.panels(title, *size, (1.0 + 2.0 * size[1], 0.9 + 2.0 * size[0]), sharey="row")
    for row, metric in zip(axes, metrics):
        bins, counts = found.alone(metric)
        row[0].stairs(counts, bins, orientation="horizontal", fill=True, color=plot.FAINT)
        row[0].set_axisbelow(True)
        scale(row[0].yaxis, campaign, metric)
        for axis, factor in zip(row[1:], factors):
            over = found.over(metric, factor)
            if isinstance(over, Bars):
                bars(axis, over)
                axis.margins(x=0.05)
                axis.set_xlabel(make_label(factor, campaign.units.get(factor, "")))
                continue
            if over is None:
                axis.plot(campaign.column(factor), campaign.column(metric), ".", color=plot.FIRST, markersize=3)
            else:
                density(axis, over)
            axis.locator_params(axis="x", nbins=3)
            axis.tick_params(axis="x", labelsize="small")
            scale(axis.xaxis, campaign, factor)
    for axis, name in zip(axes[-1], ("runs", *factors)):
        axis.set_xlabel(axis.get_xlabel() or name, fontsize="small")
    for axis in axes[:-1].flat:
        axis.set_xlabel("")
    return made


def choose_names(names: Sequence[str], known: Sequence[str], what: str) -> list[str]:
    """Choose names, by default the first ones; an InputError if one is unknown."""
    if unknown := [name for name in names if name not in known]:
        raise InputError([f"there is no {what} `{name}`. {suggest(name, known)}" for name in unknown])
    return list(names or known[:PANELS])


def scale(axis: Any, campaign: Campaign, name: str) -> None:
    """Label an axis, and the numbers along it, in the unit with the prefix that suits the largest value."""
    from gapsense.report import plot

    unit = campaign.units.get(name, "")
    axis.set_label_text(make_label(name, unit))
    if unit not in ("", "1"):  # texts and plain numbers stay as they are
        label, factor = plot.scale_axis(name, unit, campaign.column(name))
        axis.set_label_text(label.replace(" / ", "\n/ "))
        axis.set_major_formatter(lambda value, _: f"{factor * value:.6g}")


def make_label(name: str, unit: str) -> str:
    """Make the label of an axis."""
    return f"{name}\n/ {unit}" if unit not in ("", "1") else name


def bars(axis: Any, found: Bars) -> None:
    """Median and 5-95 % range at each value of a parameter."""
    from gapsense.report import plot

    for place, (low, median, high) in zip(found.places, found.quantiles):
        axis.plot([place, place], [low, high], color=plot.FAINT, linewidth=4, solid_capstyle="butt")
        axis.plot([place], [median], "o", color=plot.FIRST)
    names = [found.names[k] for k in found.labelled]
    slope = 30 if max(map(len, names), default=0) > 6 else 0
    axis.set_xticks(found.places[found.labelled], names, rotation=slope)


def density(axis: Any, cloud: Cloud) -> None:
    """Counts in colours, logarithmic; no colour where there is no run."""
    from matplotlib.colors import LogNorm

    counts = np.where(cloud.counts > 0.0, cloud.counts, np.nan).T
    norm = LogNorm(1.0, max(2.0, float(cloud.counts.max())))
    axis.pcolormesh(cloud.x, cloud.y, counts, norm=norm, cmap="viridis_r", rasterized=True)
