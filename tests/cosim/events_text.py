"""A scenario in which everything that events change can be seen."""

HEAD = """
title = "Events"
[experiment]
stop = 2.0
base_step = 0.1
"""
RAMP = f"""{HEAD}
[components.source]
fmu = "Source"
set = {{ level = 1.0, slope = 3.0 }}
[components.tuned]
fmu = "Tuned"
[connect]
"tuned.u" = "source.y"
"""


def event(name, target, action, **more):
    """Text of an event; `when` is a table."""
    when = more.pop("when", None)
    keys = {"target": target, "action": action, **more}
    lines = [f"[events.{name}]", *(f"{key} = {said(value)}" for key, value in keys.items() if value is not None)]
    if when:
        lines += [f"[events.{name}.when]", *(f"{key} = {said(value)}" for key, value in when.items())]
    return "\n".join([*lines, ""])


def said(value):
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)
