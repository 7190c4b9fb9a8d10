"""Every key of a scenario file as data: what the loader asks for, and what its documentation is made of."""

from __future__ import annotations

from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.records import (
    ACTIONS,
    INTERPOLATIONS,
    ISOLATIONS,
    METHODS,
    NAME,
    STEP_LIMIT,
    Experiment,
    Tolerance,
)
from gapsense.parameters import is_file
from gapsense.tables import (
    BOUNDS,
    COUNT,
    INDEX,
    LIST,
    NOT_NEGATIVE,
    NUMBER,
    NUMBER_OR_TEXT,
    NUMBERS,
    POSITIVE,
    SCALAR,
    TABLE,
    TABLES,
    TEXT,
    TEXTS,
    TRUTH,
    Key,
    Section,
)

WHEN = Section(
    "[events.<event>.when]",
    "A condition on a signal, evaluated after every base step. The event begins when it holds for the first time, with "
    "the next value that an input takes, or the next step of the component of a parameter.",
    (
        Key("signal", TEXT, "Input or output `component.variable`", '"valve.position"', required=True),
        Key("above", NUMBER, "The signal is greater than this", "0.5e-3", otherwise="`below`", is_other=True),
        Key("below", NUMBER, "The signal is less than this", "0.1e-3", otherwise="`above`"),
        Key("for", POSITIVE, "It has held for this time [s], whole base steps", "1e-3", otherwise="at once"),
        Key("after", NUMBER, "It is evaluated from this time on [s], a base step", "20e-3", otherwise="from the start"),
        Key("again", TRUTH, "The event can happen again once the condition has stopped holding", "true", default=False),
    ),
    at="[events.offset.when]",
    before='[events.offset]\ntarget = "semera.current"\naction = "stuck"\nduration = 2e-3\n',
)
EVENT = Section(
    "[events.<event>]",
    "Something that happens to a signal or a tunable parameter during a run: from `at` or from where a condition "
    "holds, until `until` or for `duration`, or to the end. Several on one target act in the order of the file.",
    (
        Key(
            "target",
            TEXT,
            "`component.variable`: an input, whatever drives it; an output, for all inputs that it drives; or a "
            "tunable parameter",
            '"semera.current"',
            required=True,
        ),
        Key("action", TEXT, "What happens, see below", '"bias"', required=True, choices=tuple(ACTIONS)),
        Key("value", SCALAR, "How much, in the unit of the target", "20e-3", otherwise="not needed"),
        Key("over", POSITIVE, "Time [s] over which it grows from zero", "5e-3", otherwise="at once"),
        Key("at", NUMBER, "Begin [s], a base step", "30e-3", otherwise="`when`"),
        Key("until", NUMBER, "End [s], a base step", "50e-3", otherwise="`duration`, or to the end"),
        Key(
            "duration",
            POSITIVE,
            "How long [s], whole base steps",
            "10e-3",
            otherwise="`until`, or to the end",
            is_other=True,
        ),
        Key("when", TABLE, "Condition", otherwise="`at`", section=WHEN),
        Key("seed", INDEX, "Seed of `noise`; run i of a sweep adds i", "7", default=0, is_other=True),
        Key("enabled", TRUTH, "`false`: the event is switched off", "true", default=True),
        Key("description", TEXT, "What it stands for", '"Offset of the current sensor"', default=""),
    ),
    at="[events.offset]",
)
EVENTS = Section("[events]", "The events by name.", free=Key("<event>", TABLE, "An event", section=EVENT, pattern=NAME))


# Every key of a scenario file as data: what the loader asks for, and what its documentation is made of.


def always(name: str, text: str) -> bool:
    """True: the text is a path."""
    return True


def is_fmu(name: str, text: str) -> bool:
    """True for the path of an FMU; without its ending it is the name of one."""
    return text.endswith(".fmu")


EXPERIMENT = Section(
    "[experiment]",
    "Time grid `start + k * base_step`, and how values are exchanged on it. A whole number of base steps fits between "
    "start and stop.",
    (
        Key("start", NUMBER, "Start of the run [s]", "-1e-3", default=0.0),
        Key("stop", NUMBER, "End of the run [s]", "20e-3", required=True),
        Key("base_step", POSITIVE, "Step of the grid [s]", "25e-6", required=True),
        Key(
            "method",
            TEXT,
            "Components step one after another, or all at once with the values of the previous step, or one after "
            "another with those in a loop repeating the step until their values agree",
            '"iterative"',
            default=METHODS[0],
            choices=METHODS,
        ),
        Key("pace", POSITIVE, "Simulated seconds per second of wall time", "1.0", otherwise="as fast as possible"),
        Key(
            "isolation",
            TEXT,
            "`process`: run in a process of its own from Python too; the command line always does",
            '"process"',
            default=ISOLATIONS[0],
            choices=ISOLATIONS,
        ),
        Key(
            "step_limit",
            POSITIVE,
            "Wall time [s] that a step of a component in another process may take, and each call at its start",
            "10.0",
            default=STEP_LIMIT,
        ),
        Key(
            "loop_tolerance",
            POSITIVE,
            "With `iterative`: what a value in a loop may be off, of its nominal value, or of the one a step before if "
            "that is more",
            "1e-10",
            default=Experiment.loop_tolerance,
        ),
        Key(
            "loop_evaluations",
            COUNT,
            "With `iterative`: how often a loop may be evaluated in one step",
            "50",
            default=Experiment.loop_evaluations,
        ),
        Key(
            "inputs",
            TEXT,
            "Real inputs of components that can interpolate (canInterpolateInputs) go in a straight line to their new "
            "value, or on from their last two values where the new one is not known yet; or they hold in a step",
            '"linear"',
            otherwise="`linear` with `iterative`, else `hold`",
            choices=INTERPOLATIONS,
        ),
        Key(
            "step_control",
            POSITIVE,
            "Values are exchanged every so many base steps that they are off by about this at most, of their nominal "
            "value, or of the value itself if that is more",
            "1e-4",
            otherwise="in every base step",
        ),
        Key(
            "shortest_step",
            COUNT,
            "With `step_control`: base steps from exchange to exchange, at least",
            "2",
            default=1,
        ),
        Key("longest_step", COUNT, "The same, at most", "50", otherwise="up to the next row"),
    ),
)
SET = Section(
    "[components.<component>.set]",
    "Parameters of this component, which override its parameter sets; the FMU must have them. A parameter "
    "`file` or `....file` names a file relative to this one. A name with dots is quoted, or written as tables.",
    free=Key(
        "<parameter>", SCALAR, "Value of the parameter, in its unit", "damping = 0.4", is_dotted=True, is_path=is_file
    ),
    at="[components.valve.set]",
)
COMPONENT = Section(
    "[components.<component>]",
    "One FMU instance. Its name is letters, digits and `_`, not starting with a digit.",
    (
        Key(
            "fmu",
            TEXT,
            "FMU by name, from the folder of FMUs, or the path of any FMU file (`.fmu`), relative to this file",
            '"SolenoidValve"',
            required=True,
            is_path=is_fmu,
        ),
        Key("step", COUNT, "Base steps per step of this component", "2", default=1),
        Key("offset", INDEX, "Base steps from the start of the run to the start of this component", "1", default=0),
        Key(
            "edge",
            TEXT,
            "With `iterative`: output of this component that says when in its step an edge comes, from the beginning "
            "[s]; its loop steps to there first, then on",
            '"edge"',
            otherwise="none",
        ),
        Key(
            "parameters",
            TEXTS,
            "Parameter-set files relative to this file; a later one wins",
            '["valve.toml"]',
            default=[],
            is_path=always,
        ),
        Key(
            "isolation",
            TEXT,
            "`process`: this component has a process of its own",
            '"process"',
            default=ISOLATIONS[0],
            choices=ISOLATIONS,
        ),
        Key(
            "board",
            TEXT,
            "[Board](firmware.md) on which the component runs: `qemu:<machine>`, `serial:<device>[:<baud>]` or "
            "`tcp:<host>:<port>`. Components with the same board share it",
            '"qemu:mps2-an386"',
            otherwise="none",
        ),
        Key(
            "firmware",
            TEXT,
            "Program of `export-c --loop` that QEMU loads, relative to this file",
            '"firmware/cortex-m4.elf"',
            otherwise="none",
            is_path=always,
        ),
        Key("clock", POSITIVE, "Clock of the board [Hz], by which its load is told", "168e6", otherwise="not told"),
        Key("set", TABLE, "Parameters of this component", otherwise="none", section=SET),
    ),
    at="[components.valve]",
)
COMPONENTS = Section(
    "[components]",
    "The FMU instances by name.",
    free=Key("<component>", TABLE, "A component", section=COMPONENT, pattern=NAME),
)
CONNECT = Section(
    "[connect]",
    "Where inputs come from: target on the left, source on the right, of the same unit.",
    free=Key(
        "<component>.<input>",
        TEXT,
        "Output `component.variable` that drives the input",
        '"sensor.voltage" = "drive.voltage"',
        is_dotted=True,
    ),
)
CONNECTION = Section(
    "[[connections]]",
    "A connection that converts (the input becomes `factor * source + bias`), is delayed or carries a mean.",
    (
        Key("from", TEXT, "Output `component.variable`", '"drive.voltage"', required=True),
        Key("to", TEXT, "Input `component.variable`", '"sensor.voltage"', required=True),
        Key("factor", NUMBER, "Factor", "0.5", otherwise="1"),
        Key("bias", NUMBER, "Added to that", "5.0", otherwise="0"),
        Key("unit", TEXT, "Unit after the conversion; it must be that of the input", '"V"', otherwise="not checked"),
        Key(
            "delayed",
            TRUTH,
            "The component with the input steps first and gets the value of the previous step; this closes a loop",
            "true",
            default=False,
        ),
        Key(
            "mean",
            TRUTH,
            "The output is a mean over the step: with `iterative` the input has it in the whole step, and is not "
            "interpolated; of a step that `edge` divides others get the mean of all pieces",
            "true",
            default=False,
        ),
    ),
)
FROM_FILE, FROM_LISTS = "`file` and `column`", "`times` and `values`"
SIGNAL = Section(
    "[inputs.<component>.<input>]",
    "A signal that an input follows, from a CSV file or from two lists. At each base step it gets the value at the "
    "time of that step, as from a component that steps before all others. Its times rise and cover the run; an input "
    "that is not Real takes whole numbers that hold.",
    (
        Key(
            "file",
            TEXT,
            "CSV file with a column `time [s]`, relative to this file",
            '"record.csv"',
            otherwise=FROM_LISTS,
            is_path=always,
        ),
        Key("column", TEXT, "Column of the file", '"reference [V]"', otherwise=FROM_LISTS),
        Key("times", NUMBERS, "Times [s]", "[0.0, 20e-3]", otherwise=FROM_FILE, is_other=True),
        Key("values", NUMBERS, "Values at these times", "[0.0, 24.0]", otherwise=FROM_FILE, is_other=True),
        Key(
            "interpolation",
            TEXT,
            "Straight lines between the samples, or each value holds until the next",
            '"hold"',
            default=INTERPOLATIONS[0],
            choices=INTERPOLATIONS,
        ),
    ),
    at="[inputs.drive.reference]",
)
INPUTS = Section(
    "[inputs]",
    "Inputs that no output drives: constants, and signals. Every input is connected or listed here, or in the `set` of "
    "its component.",
    free=Key(
        "<component>.<input>",
        SCALAR,
        "Value, in its unit; of an enumeration the number or the name of an item",
        '"drive.enable" = 1.0',
        section=SIGNAL,
        is_dotted=True,
    ),
)
SEEDS = Section(
    "[seeds]",
    "Seeds of the random components: those with an Integer parameter `seed`. Run i of a sweep adds i.",
    free=Key("<component>", INDEX, "Value of its parameter `seed`", "sensor = 1"),
)
SWEEP = Section(
    "[sweep]",
    "Values of which `gapsense sweep` runs all combinations. Keys of events are parameters too, as "
    "`events.offset.value`.",
    (
        Key(
            "rows",
            TEXT,
            "CSV file of values that belong together, a column per parameter, a row per run; relative to this file",
            '"rows.csv"',
            otherwise="none",
            is_path=always,
        ),
    ),
    free=Key(
        "<component>.<parameter>",
        LIST,
        "Values of the parameter, each once",
        '"valve.damping" = [0.2, 0.4, 0.8]',
        is_dotted=True,
        is_path=is_file,
    ),
)
RECORDING = Section(
    "[record]",
    "Which signals are recorded, and how often.",
    (
        Key(
            "signals",
            TEXTS,
            "Signals `component.variable`, or patterns: `*` any characters, `?` one, `[ab]` one of these",
            '["valve.*", "sensor.current_measured"]',
            default=["*"],
        ),
        Key("decimation", COUNT, "Base steps from one recorded row to the next", "10", default=1),
    ),
)
PAGE = Section(
    "[page]",
    "What `gapsense page` offers its readers to change, and shows them first.",
    (
        Key(
            "controls",
            TEXTS,
            "Parameters `component.parameter`, in the order in which they are shown",
            '["valve.damping", "sensor.noise.current"]',
            otherwise="the first ten tunable ones that the components are given",
        ),
        Key(
            "first",
            TEXTS,
            "Recorded signals whose plots come first",
            '["valve.position"]',
            otherwise="those of estimates and their errors",
        ),
    ),
)
METRIC = Section(
    "[metrics.<metric>]",
    "One number computed from the samples of a recorded signal: the rows at which its component has just stepped.",
    (
        Key("kind", TEXT, "What is computed, see below", '"rmse"', required=True, choices=tuple(KINDS)),
        Key("signal", TEXT, "Recorded signal", '"sensor.current_measured"', required=True),
        Key(
            "reference",
            NUMBER_OR_TEXT,
            "What is subtracted: a recorded signal, a parameter `component.parameter`, or a number",
            '"valve.current"',
            otherwise="none",
        ),
        Key("after", NUMBER, "Only samples after this time [s]", "1e-3", otherwise="from the start"),
        Key("before", NUMBER, "Only samples before this time [s]", "9e-3", otherwise="to the end"),
        Key("where", TEXT, "Only samples at which this signal is not 0", '"valve.contact"', otherwise="all"),
        Key(
            "time",
            TEXT,
            "Signal with the time [s] that a sample refers to, for outputs that are published later",
            '"offline.published_time"',
            otherwise="that of its row",
        ),
        Key(
            "event",
            TEXT,
            "`after` and `before` are counted from the first beginning of this event",
            '"offset"',
            otherwise="they are times",
            is_other=True,
        ),
        Key(
            "flows",
            TEXTS,
            "Of a `bond`: the two recorded signals that are multiplied by signal and reference",
            '["spring.speed", "mass.speed"]',
            otherwise="none",
            is_other=True,
        ),
        Key(
            "bounds",
            BOUNDS,
            "Range in which it must lie; otherwise `gapsense test` and `run` fail",
            "[0.0, 2e-3]",
            otherwise="any",
        ),
        Key("description", TEXT, "What it tells", '"Noise of the current"', default=""),
        Key("published", NUMBER, "Published value, shown beside it and not tested", "1e-3", otherwise="none"),
        Key("table", TEXT, "Title of the table in which it is shown", '"Noise"', default=""),
        Key("label", TEXT, "Its name there", '"current"', otherwise="that of the metric"),
    ),
    at="[metrics.current_noise]",
)
METRICS = Section("[metrics]", "The metrics by name.", free=Key("<metric>", TABLE, "A metric", section=METRIC))
RTOL = Key("rtol", NOT_NEGATIVE, "Share of the nominal value", "1e-6", default=Tolerance().rtol)
ATOL = Key("atol", NOT_NEGATIVE, "In the unit of the signal", "1e-9", default=Tolerance().atol)
EDGES = Key(
    "edge_steps",
    INDEX,
    "Steps of its component by which an edge may come earlier or later",
    "1",
    default=Tolerance().edge_steps,
)
TOLERANCE = Section(
    "[baseline.tolerances.<pattern>]",
    "Another tolerance for the signals that match a pattern.",
    tuple(key._replace(default=None, otherwise="that of `[baseline]`") for key in (RTOL, ATOL, EDGES)),
    at='[baseline.tolerances."valve.*"]',
)
TOLERANCES = Section(
    "[baseline.tolerances]", "Tolerances by pattern.", free=Key("<pattern>", TABLE, "A tolerance", section=TOLERANCE)
)
BASELINE = Section(
    "[baseline]",
    "Reference trajectory that `gapsense test` compares with: allowed is `atol + rtol * nominal`. "
    "`gapsense baseline --write` makes it, below this folder. With this section, `test` fails if the file is missing; "
    "one without `file` asks for one of each variant with metrics too.",
    (
        Key(
            "file",
            TEXT,
            "CSV file, relative to this file",
            '"baseline.csv"',
            otherwise="`baseline.csv`, of a variant `baseline.<variant>.csv`",
            is_path=always,
        ),
        Key("signals", TEXTS, "Recorded signals, or patterns", '["valve.*"]', otherwise="all recorded"),
        Key("decimation", COUNT, "Keep one of so many recorded rows", "8", default=1),
        RTOL,
        ATOL,
        EDGES,
        Key("tolerances", TABLE, "Exceptions", otherwise="none", section=TOLERANCES),
    ),
)
VARIANT = Section(
    "[variants.<variant>]",
    "Changes that `--variant` lays over the file: tables are merged key by key, anything else is replaced. All "
    "sections of the file may be given, as `[variants.<variant>.components.valve.set]`.",
    (Key("description", TEXT, "What is different", '"Cold coil"', default=""),),
    at="[variants.cold]",
)
VARIANTS = Section("[variants]", "The variants by name.", free=Key("<variant>", TABLE, "A variant", section=VARIANT))
FILE = Section(
    "",
    "Before the first table.",
    (
        Key("title", TEXT, "Title of tables and figures", '"My valve"', required=True),
        Key("description", TEXT, "More about it", '"30 V, square wave"', default=""),
        Key(
            "figure",
            TEXT,
            "Figure that shows a run: `overview`, all signals by unit, or that of a study",
            '"overview"',
            default="overview",
        ),
        Key("experiment", TABLE, "Time grid", required=True, section=EXPERIMENT),
        Key("components", TABLE, "FMU instances", required=True, section=COMPONENTS),
        Key("connect", TABLE, "Wiring", section=CONNECT),
        Key("connections", TABLES, "Wiring that converts, is delayed or carries a mean", section=CONNECTION),
        Key("inputs", TABLE, "Inputs that no output drives", section=INPUTS),
        Key("events", TABLE, "What happens during a run", section=EVENTS),
        Key("seeds", TABLE, "Seeds", section=SEEDS),
        Key("sweep", TABLE, "Sweep", section=SWEEP),
        Key("record", TABLE, "Recording", section=RECORDING),
        Key("metrics", TABLE, "Metrics", section=METRICS),
        Key("page", TABLE, "Controls of a page", section=PAGE),
        Key("baseline", TABLE, "Baseline", section=BASELINE),
        Key("variants", TABLE, "Variants", section=VARIANTS),
    ),
)


def key_of(section: Section, name: str) -> Key | None:
    """The key of that name in a section; a variant may have all that a file has."""
    own = {key.name: key for key in (*(FILE.keys if section is VARIANT else ()), *section.keys)}
    return own.get(name, section.free)
