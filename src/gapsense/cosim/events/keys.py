"""Keys of the events of a scenario file as data."""

from __future__ import annotations

from gapsense.cosim.events.event import ACTIONS
from gapsense.cosim.scenario.records import NAME
from gapsense.tables import INDEX, NUMBER, POSITIVE, SCALAR, TABLE, TEXT, TRUTH, Key, Section

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
        Key(
            "until",
            NUMBER,
            "End [s], a base step",
            "50e-3",
            otherwise="`duration`, or to the end",
        ),
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
EVENTS = Section(
    "[events]",
    "The events by name.",
    free=Key("<event>", TABLE, "An event", section=EVENT, pattern=NAME),
)
