"""A short scenario and a study of it, as texts."""

NOISE = """
title = "Noise on a ramp"
[experiment]
stop = 10.0
base_step = 0.1
[components.noise]
fmu = "Noise"
[components.source]
fmu = "Source"
[seeds]
noise = 10
[metrics.spread]
kind = "std"
signal = "noise.y"
[metrics.end]
kind = "final"
signal = "source.y"
"""
STUDY = """
title = "Ramps"
scenario = "demo"
seeds = 2
[grid]
"source.slope" = [1.0, 2.0, 3.0]
"source.inverted" = [false, true]
"""


def rows(result):
    """All that does not depend on time, by column; a number that is missing is None."""
    columns = {name: column.tolist() for name, column in result.table().items() if name != "wall"}
    return {name: [None if value != value else value for value in column] for name, column in columns.items()}
