"""Every key of a study file as data: what is asked for when one is read, and what its documentation is made of."""

from __future__ import annotations

from gapsense.cosim.scenario.keys import always
from gapsense.many.draws import DISTRIBUTIONS, METHODS
from gapsense.parameters import is_file
from gapsense.tables import COUNT, INDEX, LIST, NUMBER, POSITIVE, TABLE, TABLES, TEXT, TEXTS, Key, Section

NOISES = ("own", "common")
SPACINGS = ("linear", "log")
PARAMETER = Key("parameter", TEXT, "Parameter or constant input `component.variable`", '"valve.damping"', required=True)
GRID = Section(
    "[grid]",
    "Lists of values; all combinations are run.",
    free=Key(
        "<component>.<parameter>",
        LIST,
        "Values of the parameter, each once",
        '"valve.damping" = [0.2, 0.4, 0.8]',
        is_dotted=True,
        is_path=is_file,
    ),
)
RANGE = Section(
    "[[ranges]]",
    "Evenly spaced values; all combinations are run.",
    (
        PARAMETER,
        Key("from", NUMBER, "First value, in the unit of the parameter", "0.1", required=True),
        Key("to", NUMBER, "Last value", "0.8", required=True),
        Key("count", COUNT, "How many values", "8", required=True),
        Key("spacing", TEXT, "Even differences, or even ratios", '"log"', default=SPACINGS[0], choices=SPACINGS),
    ),
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
            choices=tuple(DISTRIBUTIONS),
        ),
        Key("low", NUMBER, "Lowest value", "40.0", otherwise="see below"),
        Key("high", NUMBER, "Highest value", "55.0", otherwise="see below"),
        Key("mean", NUMBER, "Mean, of `normal`", "48.0", otherwise="see below"),
        Key("std", POSITIVE, "Standard deviation, of `normal`", "1.5", otherwise="see below"),
        Key("median", POSITIVE, "Median, of `lognormal`", "0.4", otherwise="see below", is_other=True),
        Key(
            "sigma",
            POSITIVE,
            "Standard deviation of the natural logarithm, of `lognormal`",
            "0.2",
            otherwise="see below",
            is_other=True,
        ),
        Key(
            "values",
            LIST,
            "What `choice` chooses from, all equally likely",
            "[1, 2]",
            otherwise="see below",
            is_other=True,
        ),
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
        Key("decimation", COUNT, "Keep one of so many recorded rows", "10", default=1),
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
