"""Every key of a study file as data: what is asked for when one is read, and what its documentation is made of."""

from __future__ import annotations

from gapsense.cosim.scenario.keys import SWEEP, always
from gapsense.many.draws import DISTRIBUTIONS, METHODS
from gapsense.tables import COUNT, INDEX, LIST, NUMBER, POSITIVE, TABLE, TABLES, TEXT, TEXTS, Key, Section

NOISES = ("own", "common")
SPACINGS = ("linear", "log")
PARAMETER = Key("parameter", TEXT, "Parameter or constant input `component.variable`", '"valve.damping"', required=True)
GRID = Section("[grid]", "Lists of values, combined each with every other.", free=SWEEP.free)
RANGE = Section(
    "[[ranges]]",
    "Evenly spaced values, combined each with every other.",
    (
        PARAMETER,
        Key("from", NUMBER, "First value, in the unit of the parameter", "0.1", required=True),
        Key("to", NUMBER, "Last value", "0.8", required=True),
        Key("count", COUNT, "How many values", "8", required=True),
        Key("spacing", TEXT, "Even differences, or even ratios", '"log"', default=SPACINGS[0], choices=SPACINGS),
    ),
)
OF_MOST = (  # keys of distributions
    ("low", NUMBER, "Lowest value", "40.0"),
    ("high", NUMBER, "Highest value", "55.0"),
    ("mean", NUMBER, "Mean, of `normal`", "48.0"),
    ("std", POSITIVE, "Standard deviation, of `normal`", "1.5"),
)
OF_FEW = (  # and those that the example has not
    ("median", POSITIVE, "Median, of `lognormal`", "0.4"),
    ("sigma", POSITIVE, "Standard deviation of the natural logarithm, of `lognormal`", "0.2"),
    ("values", LIST, "What `choice` chooses from, all equally likely", "[1, 2]"),
)
FACTOR = Section(
    "[[sample.factors]]",
    "A parameter that is drawn, independent of the others.",
    (
        PARAMETER,
        Key(
            "distribution",
            TEXT,
            "What it is drawn from, see below",
            '"normal"',
            required=True,
            choices=(*DISTRIBUTIONS,),
        ),
        *(Key(*key, otherwise="see below", is_other=key in OF_FEW) for key in (*OF_MOST, *OF_FEW)),
    ),
)
SAMPLE = Section(
    "[sample]",
    "Values that are drawn: `count` points of all factors together.",
    (
        Key(
            "method",
            TEXT,
            "Independent draws, a Latin hypercube, or points of a scrambled Sobol sequence",
            '"sobol"',
            default=METHODS[0],
            choices=METHODS,
        ),
        Key("count", COUNT, "Points; of Sobol a power of 2", "256", required=True),
        Key("seed", INDEX, "Seed of the draws", "7", default=0),
        Key("factors", TABLES, "What is drawn", required=True, section=FACTOR),
    ),
)
TRAJECTORIES = Section(
    "[trajectories]",
    "Signals that are kept of every run.",
    (
        Key("signals", TEXTS, "Signals, or patterns as in `[record]`", '["valve.position"]', required=True),
        Key("decimation", COUNT, "Recorded rows from one row of the baseline to the next", "10", default=1),
    ),
)
STUDY = Section(
    "",
    "Before the first table.",
    (
        Key("title", TEXT, "Title of tables and figures", '"Tolerances of my valve"', required=True),
        Key("description", TEXT, "More about it", '"All within 5 %"', default=""),
        Key(
            "scenario",
            TEXT,
            "Scenario file, its folder, or the name of an example; relative to this file",
            '"my_valve"',
            required=True,
        ),
        Key("variant", TEXT, "Variant of the scenario", '"cold"', otherwise="the scenario itself"),
        Key("seeds", COUNT, "Runs of each point, with other seeds", "4", default=1),
        Key(
            "noise",
            TEXT,
            "Every run has its own seeds, or the runs of all points share the same `seeds` seeds",
            '"common"',
            default=NOISES[0],
            choices=NOISES,
        ),
        Key(
            "rows",
            TEXT,
            "CSV file of values that belong together, a column per parameter; relative to this file",
            '"rows.csv"',
            otherwise="none",
            is_path=always,
        ),
        Key("grid", TABLE, "Lists", section=GRID),
        Key("ranges", TABLES, "Evenly spaced values", section=RANGE),
        Key("sample", TABLE, "Values that are drawn", section=SAMPLE),
        Key("trajectories", TABLE, "Signals that are kept", section=TRAJECTORIES),
    ),
)
