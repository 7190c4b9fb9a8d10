"""How a component is wired into a scenario and when it samples: a chapter of its page, from its port table."""

from __future__ import annotations

import re

from gapsense.fmi.ports import Component

ROLES = {
    "drive": "`drive` is a `DriveVoltage`",
    "plant": "`plant` is one of the actuators",
    "sensor": "`sensor` is a `Sensor`",
}
SAMPLED = """It samples every `sample_time`, {period:g} us if nothing else is set, from its start on. Its step, that is
`step` times the base step of the scenario, must be a whole multiple or a whole fraction of that. In a shorter step
nothing happens until the next sample is due, and the outputs hold; in a longer one the inputs hold for all its samples.
"""
CONTINUOUS = """It has no sample time: any step will do. Inputs hold during a step, so take one that is short against
what drives it; {step:g} us is a good one.{micro}
"""
MICRO = " Within a step it integrates in steps of at most `micro_step`."


def chapter(component: Component) -> str:
    """The chapter, as Markdown."""
    period = next((port.start for port in component.ports if port.name == "sample_time"), None)
    micro = MICRO if any(port.name == "micro_step" for port in component.ports) else ""
    times = CONTINUOUS.format(step=1e6 * component.step_size, micro=micro)
    if period is not None:
        times = SAMPLED.format(period=1e6 * period)
    others = {port.source.partition(".")[0] for port in component.of("input") if port.source}
    roles = ", ".join(text for name, text in ROLES.items() if name in others)
    told = f"Here {roles}." if roles else "Nothing has to be wired."
    return f"## How to wire\n\n```toml\n{snippet(component)}```\n\n{told}{optional(component)}\n\n{times}"


def snippet(component: Component) -> str:
    """Tables for a scenario file."""
    name, inputs = called(component), component.of("input")
    wired = [f'"{name}.{port.name}" = "{port.source}"' for port in inputs if port.source]
    constant = [f'"{name}.{port.name}" = {float(port.start)!r}' for port in inputs if not port.source]
    parts = (f"[components.{name}]", f'fmu = "{component.name}"'), ("[connect]", *wired), ("[inputs]", *constant)
    return "\n".join("\n".join(part) + "\n" for part in parts if len(part) > 1)


def called(component: Component) -> str:
    """Name of the component in the example: that of its class in small letters."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", component.name).lower()


def optional(component: Component) -> str:
    """What may be left at its start value."""
    names = [f"`{port.name}`" for port in component.of("input") if port.is_optional]
    return f" With the value above {' and '.join(names)} counts for nothing; it may be wired." if names else ""
