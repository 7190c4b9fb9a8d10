"""Read the sections of a scenario that say what is recorded and what must hold: record, metrics, baseline."""

from __future__ import annotations

from pathlib import Path

from gapsense.cosim.metrics import KINDS
from gapsense.cosim.scenario import Baseline, Metric, Record, Tolerance
from gapsense.tables import BOUNDS, COUNT, NOT_NEGATIVE, NUMBER, NUMBER_OR_TEXT, TEXT, TEXTS, Table


def read_record(table: Table) -> Record:
    """Signals to record; all inputs and outputs if the section is missing."""
    record = table.table("record")
    signals = record.take("signals", TEXTS, ["*"])
    decimation = record.take("decimation", COUNT, 1)
    record.finish()
    return Record(tuple(signals), decimation)


def read_metrics(table: Table) -> tuple[Metric, ...]:
    """Metrics in the order of the file."""
    metrics = table.table("metrics")
    read = [read_metric(metrics.table(name), name) for name in metrics.data]
    return tuple(metric for metric in read if metric is not None)


def read_metric(table: Table, name: str) -> Metric | None:
    """One metric, or None if its kind or signal is missing."""
    kind = table.choice("kind", tuple(KINDS))
    signal = table.take("signal", TEXT, required=True)
    reference = table.take("reference", NUMBER_OR_TEXT)
    after, before = table.take("after", NUMBER), table.take("before", NUMBER)
    where, time = table.take("where", TEXT), table.take("time", TEXT)
    bounds = table.take("bounds", BOUNDS)
    description, published = table.take("description", TEXT, ""), table.take("published", NUMBER)
    title, label = table.take("table", TEXT, ""), table.take("label", TEXT, name)
    table.finish()
    if after is not None and before is not None and after >= before:
        table.note("", f"`after` is {after:.9g} s and `before` is {before:.9g} s. Let `after` be the smaller one.")
    if kind is None or signal is None or not reference_fits(table, kind, reference):
        return None
    span = None if bounds is None else (float(bounds[0]), float(bounds[1]))
    shown = (description, published, title, label)
    return Metric(name, kind, signal, reference, after, before, where, time, span, *shown)


def reference_fits(table: Table, kind: str, reference: str | float | None) -> bool:
    """True if a metric of this kind has the reference it needs, and none that it does not use."""
    use, given = KINDS[kind].reference, reference is not None
    if use == "axis" and not isinstance(reference, str):
        table.note("reference", f"`{kind}` is of the curve over another signal. Name that signal.")
        return False
    if use == "required" and not given and "reference" not in table.data:
        table.note("reference", f"missing; `{kind}` compares with a signal, a parameter or a number. Add it.")
        return False
    if use == "none" and given:
        table.note("reference", f"`{kind}` uses no reference. Remove it.")
        return False
    return True


def read_baseline(table: Table, path: Path, variant: str | None) -> Baseline:
    """Reference trajectory; a variant that names no file of its own has `baseline.<variant>.csv`."""
    baseline = table.table("baseline")
    default = f"baseline.{variant}.csv" if variant else "baseline.csv"
    file = baseline.take("file", TEXT, default)
    if variant and not states_file(table, variant):
        file = default
    signals, decimation = baseline.take("signals", TEXTS), baseline.take("decimation", COUNT, 1)
    tolerance = read_tolerance(baseline, Tolerance())
    exceptions = baseline.table("tolerances")
    tolerances = {name: finished_tolerance(exceptions.table(name), tolerance) for name in exceptions.data}
    baseline.finish()
    chosen = None if signals is None else tuple(signals)
    declared = "baseline" in table.data
    return Baseline(path.parent / file, chosen, tolerance, tolerances, declared, decimation)


def states_file(table: Table, variant: str) -> bool:
    """True if the variant itself names a baseline file."""
    own = table.data["variants"][variant].get("baseline")
    return isinstance(own, dict) and "file" in own


def read_tolerance(table: Table, default: Tolerance) -> Tolerance:
    """Tolerance of a table, each part by default that of the table around it."""
    rtol = table.take("rtol", NOT_NEGATIVE, default.rtol)
    return Tolerance(rtol, table.take("atol", NOT_NEGATIVE, default.atol))


def finished_tolerance(table: Table, default: Tolerance) -> Tolerance:
    """Tolerance of one signal; the table may hold nothing else."""
    tolerance = read_tolerance(table, default)
    table.finish()
    return tolerance
