"""A table of finite elements for the user: what must hold, what the models leave, a figure, and the files for plant
and estimators.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense._os.files import write_atomically, write_columns
from gapsense.estimators.mhe.model import Parameters
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.actuator.fit import run
from gapsense.identification.fem.model import (
    SHARP,
    Left,
    Map,
    Reduced,
    Surface,
    current,
    left_of,
    reduce,
    smooth,
    to_map,
)
from gapsense.identification.fem.reading import Solved, neighbours
from gapsense.identification.gap_law.laws import Vector, rows
from gapsense.identification.least_squares import rms
from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.identification.parameter_set import (
    Entry,
    parameter_names,
    round_value,
    table_file,
    write_set,
    write_table,
)
from gapsense.identification.residual import Residual
from gapsense.identification.scale import find_tuning, process_noise, spans_of, untold_losses
from gapsense.identification.valve.model import Trajectory
from gapsense.problems import listing
from gapsense.report.plot import SECOND, TRUE, legend, panels
from gapsense.report.table import percent, quantity, table
from gapsense.tables import Value

MAP_UNITS = {"gap": "m", "flux_linkage": "Wb", "current": "A"}
ANOTHER = 0.1  # by which the force is another one than the slope of the energy
SPREADS = 3.0  # deviations of points that count as none
FAR = (0.05, 0.1)  # relative errors of flux linkage and force that are a wrong point, if they are no noise
CHANCE = 10.0  # standard deviations that noise has not
SHOWN = 3
STEPS = (50e-6, 100e-6, 200e-6, 500e-6, 1e-3)  # s; sampling periods that are proposed
WINDOW = 600  # samples until the end of a window, with which `Mhe` is done in time
MOVING = 100  # samples of a motion, at least
FLUX_LEFT = 0.01  # of the flux linkage, that is left when a trial ends
HALVES = (2000, 20_000, 100_000)  # samples of a trial with the voltage and without


class Models(NamedTuple):
    """What is made of a table."""

    points: Solved
    reduced: Reduced
    sharp: Reduced  # with a core that bends later and more sharply
    surface: Surface
    alone: Surface | None  # without the forces, where there are some, and currents that tell an energy
    map: Map


def make_models(points: Solved, turns: float, low: float, high: float) -> Models:
    """Models of a table, for gaps from `low` to `high`."""
    reduced = reduce(points, turns)
    tells = points.force is not None and not points.has_one_current
    surface = smooth(points, reduced, low, high)
    return Models(
        points=points,
        reduced=reduced,
        sharp=reduce(points, turns, SHARP),
        surface=surface,
        alone=smooth(points, reduced, low, high, has_force=False) if tells else None,
        map=to_map(surface),
    )


def ratio(m: Models) -> tuple[float, float] | None:
    """The force over the slope of the energy of the flux linkages alone: middle of the points, and their deviation."""
    if m.alone is None or m.points.force is None:
        return None
    F = m.alone.force(m.points.flux_linkage, m.points.gap)
    large = np.abs(F) > 0.05 * np.abs(F).max()
    shares = m.points.force[large] / F[large]
    middle = float(np.median(shares))
    return middle, 1.4826 * float(np.median(np.abs(shares - middle)))


def fem_tables(m: Models) -> list[Table | str]:
    """What must hold, and what the models leave."""
    smoothed, estimated = left_of(m.points, m.surface), left_of(m.points, m.reduced)
    parts = [("smooth table", smoothed), ("reduced model", estimated)]
    heads = ("model", "quantity", "RMS", "worst", "where")
    made = [row for name, left in parts for row in left_rows(m.points, name, left)]
    return [must_hold(m), table("What the models leave of the table", heads, made, texts=2), *said(m, estimated)]


def must_hold(m: Models) -> Table:
    """Flux linkage, gap and energy."""
    p, made = m.points, list[tuple[str, ...]]()
    for what, lines, sign in (
        ("flux linkage rises with current", neighbours(p.current, p.gap), 1.0),
        ("flux linkage falls with gap", neighbours(p.gap, p.current), -1.0),
    ):
        x = sign * p.flux_linkage
        pairs = [pair for line in lines for pair in zip(line.tolist(), line[1:].tolist())]
        steps = np.array([(x[b] - x[a]) / np.abs(x).max() for a, b in pairs])
        if not pairs:
            made.append((what, "no neighbours"))
            continue
        k = int(steps.argmin())
        worst = f"{'rises' if sign * steps[k] > 0.0 else 'falls'} {percent(abs(steps[k]))}"
        made.append((what, f"{(steps > 0.0).sum()} of {len(pairs)}", worst, p.place(pairs[k][1])))
    left = None if m.alone is None else left_of(p, m.alone).force
    if left is not None and (share := ratio(m)) is not None:
        k = int(np.abs(left).argmax())
        found = f"{share[0]:.3f} of it, RMS {percent(rms(left))}"
        made.append(("force is the slope of energy", found, percent(abs(left[k])), p.place(k)))
    elif p.force is not None:
        made.append(("force is the slope of energy", "not told by one current"))
    return table("What must hold", ("", "found", "worst", "where"), made, texts=1)


def left_rows(points: Solved, name: str, left: Left) -> list[tuple[str, ...]]:
    """What a model leaves, by quantity."""
    made = []
    for what, x in left._asdict().items():
        if x is not None:
            k, both = int(np.abs(x).argmax()), (rms(x), float(np.abs(x).max()))
            sizes = (quantity(v, "A") if what == "current" else percent(v) for v in both)
            made.append((name, "flux linkage" if what == "flux" else what, *sizes, points.place(k)))
    return made


def said(m: Models, left: Left) -> list[str]:
    """What the numbers are, and what they do not tell."""
    p, count = m.points, m.points.gap.size * (1 if m.points.force is None else 2)
    told = [
        *p.remarks,
        f"Smoothing leaves {m.surface.numbers:.0f} of {count} numbers free beside the reduced model. The force of the"
        " smooth table is the slope of its energy.",
        f"The reduced model has a core that all flux passes, by the law `{m.reduced.form}`, and one reluctance by the"
        f" gap, with all leaks parallel to it. It leaves out leaks past a part of the core: {sizes(left)}.",
    ]
    if p.has_one_current:
        at, share, where = half_current(m)
        told.append(
            f"One current does not tell how the flux linkage rises up to it. A core that bends more sharply leaves"
            f" {sizes(left_of(p, m.sharp))}, and at {quantity(at, 'A')} differs by up to {100.0 * share:.2g} % in the"
            f" flux linkage, at {quantity(where, 'm')}. Solve at smaller currents too."
        )
    told.append("Eddy currents, hysteresis, friction and noise are not in a static table: `gapsense commission`.")
    if p.force is None:
        told.append("Without forces the slope of the gap law is that of the flux linkage alone. Solve for forces too.")
    return told


def sizes(left: Left) -> str:
    """RMS of what a model leaves."""
    force = "" if left.force is None else f", {percent(rms(left.force))} of the force"
    return f"{percent(rms(left.flux))} of the flux linkage ({quantity(rms(left.current), 'A')}){force}"


def half_current(m: Models) -> tuple[float, float, float]:
    """Half the current of the table, by how much two cores differ there in the flux linkage, and at which gap [m]."""
    half, gaps = 0.5 * float(m.points.current.max()), np.unique(m.points.gap)
    fine = np.linspace(0.0, float(m.points.flux_linkage.max()), 400)
    at = np.array(
        [[np.interp(half, current(r, fine, np.full(400, h))[0], fine) for h in gaps] for r in (m.reduced, m.sharp)]
    )
    apart = np.abs(at[1] / at[0] - 1.0)
    return half, float(apart.max()), float(gaps[int(apart.argmax())])


def doubts(m: Models) -> list[str]:
    """What cannot be right in the table."""
    p, told = m.points, list[str]()
    share, spread = ratio(m) or (1.0, 0.0)
    if abs(share - 1.0) > max(ANOTHER, SPREADS * spread):
        return [
            f"{p.file}: the force is {share:.2g} times the slope of the energy that the flux linkages have, 1 expected."
            " One of them belongs to a part of the device, or to other turns: give both for the same, and `--symmetry`."
        ]
    if not m.map.is_device:
        told.append(
            f"{p.file}: no smooth table through these points has a flux linkage that rises with the current and falls"
            " with the gap everywhere. Look at the worst points above, and do not use the table."
        )
    for what, x, least in zip(("flux linkage", "force"), m.surface.apart, FAR):
        most = max(least, CHANCE * 1.4826 * float(np.median(np.abs(x))))
        wrong = [(float(abs(e)), k) for k, e in enumerate(x) if abs(e) > most]
        told += [
            f"{p.file}, {p.place(k)}: the {what} is {100.0 * e:.2g} % off the smooth table through all others, less"
            f" than {100.0 * most:.2g} % expected. Correct this line, or solve it again."
            for e, k in sorted(wrong, reverse=True)[:SHOWN]
        ]
    return told


def values(m: Models) -> dict[str, Value]:
    """Parameters that the table tells, but for files."""
    r = m.reduced
    is_bent = r.form == "bent"
    core = {"core.reluctance": max(r.law.offset, 1.0) if is_bent else r.core, "core.saturation": r.saturation}
    return {"coil.turns": r.turns, "gap.law": "table", **core, "core.bend": r.core if is_bent else 0.0}


def law_rows(m: Models) -> dict[str, Vector]:
    """The gap law of the estimators as a table; what is left without gap is the core's, if that has no other part."""
    law = m.reduced.law
    return rows(law._replace(offset=0.0 if m.reduced.form == "bent" else law.offset), float(m.map.gap[-1]))


def write_fem(file: Path, m: Models, given: Mapping[str, Value], origin: str, assumed: Sequence[str]) -> list[Path]:
    """Write a parameter set for plant and estimators, the gap law of these and the map of that; the files beside it."""
    gap = write_table(file.with_name(f"{file.stem}_law.csv"), law_rows(m))
    columns = {
        "gap": np.repeat(m.map.gap, m.map.flux_linkage.size),
        "flux_linkage": np.tile(m.map.flux_linkage, m.map.gap.size),
        "current": m.map.current.ravel(),
    }
    plant = file.with_name(f"{file.stem}_map.csv")
    write_atomically(plant, lambda out: write_columns(out, columns, MAP_UNITS))
    found = {**values(m), "gap.file": str(gap.resolve()), "map.file": str(plant.resolve())}
    kept = {name: value for name, value in given.items() if not name.startswith(("gap.", "core.bend", "map."))}
    write_set(
        file,
        "Actuator from a table of finite elements",
        origin,
        [Entry(name, round_value(value)) for name, value in {**kept, **found}.items()],
        assumed=assumed,
    )
    return [gap, plant]


def beyond(points: Solved, given: Mapping[str, Value], assumed: Sequence[str]) -> list[str]:
    """What is said of stops that the table does not reach, or that are taken from it."""
    lower, upper = (float(given[name]) for name in ("stop.lower", "stop.upper"))
    gap = quantity(float(points.gap[0]), "m"), quantity(float(points.gap[-1]), "m")
    told = [f"The stops are assumed where the table ends, at {gap[0]} and {gap[1]}."] if "stop.upper" in assumed else []
    if lower < points.gap[0] or upper > points.gap[-1]:
        told.append(
            f"The stops, {quantity(lower, 'm')} and {quantity(upper, 'm')}, lie beyond the table, which has gaps from"
            f" {gap[0]} to {gap[1]}: there the laws are continued. Solve up to the stops."
        )
    return told


MOVER = ("coil.resistance", "mover.mass", "damping", "spring.stiffness")  # what a trial needs


def windows(m: Models, given: Mapping[str, Value], volts: float | None) -> tuple[dict[str, float], list[str]]:
    """Tuning of `Mhe` for a device that is switched by so many volts, from a trial of its model; and a sentence."""
    missing = [*["--supply"] * (volts is None), *(name for name in MOVER if name not in given)]
    if volts is None or missing:
        return {}, [f"No windows for `Mhe`: {listing(missing)} missing. Give them, in `--parameters`."]
    names = parameter_names([own("mhe")])
    known = {**untold_losses(m.reduced.turns, m.reduced.saturation), **given, **values(m)}
    known = {name: value for name, value in known.items() if name in names}
    par: Parameters = kernel_parameters(own("mhe"), {**known, "gap.file": str(table_file(law_rows(m)))})
    at, dt = quantity(volts, "V"), float(par.sample_time)
    if (found := trial(par, volts)) is None:
        return {}, [
            f"No windows for `Mhe`, for the model does not close within {quantity(HALVES[-1] * dt, 's')} at {at}."
        ]
    motion, landing = spans_of(*found)
    steps = [step for step in STEPS if step > dt and step * MOVING <= motion]
    if WINDOW * dt < landing + motion and steps and "sample_time" not in given:
        dt = next((step for step in steps if WINDOW * step >= landing + motion), steps[-1])
        par = par._replace(sample_time=dt)
        found = trial(par, volts) or found
    error = rms(left_of(m.points, m.reduced).current)
    left = Residual("trial", rms=error, noise=0.0, limit=0.0, correlation=0.0, places={}, hum=None)
    tuning = find_tuning([found[0]], [found[1]], [left], par)
    told = (
        f"At {at} the reduced model moves for {quantity(motion, 's')} and lands {quantity(landing, 's')} after an edge:"
        f" from that are windows and error of `Mhe`, with samples every {quantity(dt, 's')}."
    )
    return {"sample_time": dt, **tuning, **process_noise(volts, m.reduced.turns, error)}, [told]


def trial(par: Parameters, volts: float) -> tuple[Record, Trajectory] | None:
    """A closing and an opening of the model of `Mhe`, or nothing if it does not close."""
    for half in HALVES:
        u = np.r_[np.zeros(50), np.full(half, volts), np.zeros(half)]
        i, lam, z = run(par, u.tolist()).T
        if z[half + 49] == par.stop_lower and lam[-1] < FLUX_LEFT * lam.max():
            n = np.arange(u.size)
            columns = {"time": float(par.sample_time) * n, "voltage": u, "current": i}
            return to_record(Columns("trial.csv", n, columns)), Trajectory(i, lam, z)
    return None


def fem_figure(m: Models) -> Figure:
    """Flux linkage by current at some gaps, force by gap at some currents."""
    p = m.points
    figure, axes = panels("Table, smooth table and reduced model", 1, 2, size=(9.0, 3.6))
    left, right = axes[0]
    shown = p.gap[[0, p.gap.size // 2, -1]]
    fine = np.linspace(0.0, float(p.flux_linkage.max()), 200)
    left.plot(p.current, 1e3 * p.flux_linkage, ".", ms=3, color=TRUE, label="table")
    for k, h in enumerate(np.unique(shown)):
        i, estimated = m.surface.current(fine, np.full(200, h)), current(m.reduced, fine, np.full(200, h))[0]
        for x, style, name in ((i, "-", "smooth"), (estimated, "--", "reduced")):
            at = x < 1.05 * p.current.max()
            left.plot(x[at], 1e3 * fine[at], style, color=f"C{k}", lw=1.0, label=f"{name}, {quantity(float(h), 'm')}")
    left.set(xlabel="current / A", ylabel="flux linkage / mWb")
    legend(left)
    if p.force is not None:
        right.plot(1e3 * p.gap, p.force, ".", ms=3, color=TRUE, label="table")
    right.plot(1e3 * p.gap, m.surface.force(p.flux_linkage, p.gap), "x", ms=4, color=SECOND, label="smooth")
    right.set(xlabel="gap / mm", ylabel="force / N")
    legend(right)
    return figure
