"""A scenario for a page: wires and time grid as C, everything else as JSON.

No number is in both. Texts about ports come from the same place as in modelDescription.xml.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from gapsense.cosim.run import events as run_events
from gapsense.cosim.run.events import NEVER, Actor, noise
from gapsense.cosim.run.part import Layout, Wire, constants, first_exchange, first_turn, player
from gapsense.cosim.run.recording import Subject, Take, shape
from gapsense.cosim.scenario.records import Component, Experiment, Port, ports, texts
from gapsense.fmi.native.headers import literal
from gapsense.page.module import SYMBOLS, parts
from gapsense.tables import Value

KINDS = ("Real", "Integer", "Boolean", "String")  # as model.h numbers them
SLOT = "{{{symbols}, {name}, {folder}, {begin!r}, NULL}}"
PART = (
    "{{.fmi = 2, .instance = slots + {k}, .inputs = {inputs}, .outputs = {outputs}, .do_step = step_component,\n"
    "     .duration = {duration!r}, .links = {links}, .link_count = {link_count}, .follows = {follows},\n"
    "     .every = {every}, .steps_at = {steps_at}, .takes_at = {takes_at}, .spread = spread}}"
)
PLAN = """/* {title} Generated from the scenario. */
#define STOP_TIME {stop!r}
{externs}
static double buffer[{size}], data[{cells}];
{arrays}
static Slot slots[] = {{
{slots}
}};
static Part parts[] = {{
{parts}
}};
static Loop plan = {{
    .parts = parts, .part_count = {count}, .buffer = buffer, .start = {start!r}, .base_step = {base_step!r},
    .is_jacobi = {is_jacobi}, .decimation = {decimation}, .columns = columns, .column_count = {columns}, .data = data,
    .places = places, .place_count = {places}, .played = played, .marks = marks, .patience = INFINITY,
    .watches = watches, .watch_count = {watches},
}};
"""


def header(subject: Subject) -> str:
    """Text of plan.h."""
    scenario, experiment = subject.scenario, subject.scenario.experiment
    layout, acting = layout_of(subject), actors(subject)
    rows = player(scenario.played, layout.inlets, experiment)
    components = [scenario.components[name] for name in subject.order.names]
    made, own = zip(*(wires(subject, layout, component, k) for k, component in enumerate(components)))
    watches = [actor.watch for actor in acting.values() if actor.watch]
    played = [row for k in range(0, experiment.count + 1) for row in at(rows, k)]
    arrays = (
        *chain.from_iterable(own),
        array("int64_t", "columns", subject.columns),
        array("int64_t", "places", [layout.inlets[port] for port in scenario.played]),
        array("double", "played", played),
        array("double", "noise", noises(acting, experiment)),
        array("Watch", "watches", [f"{{{w.place}, {int(w.is_above)}, 0, 0, {w.level!r}}}" for w in watches]),
    )
    count, width = shape(scenario, subject.columns)
    return PLAN.format(
        title=f"{scenario.name}.",
        stop=experiment.stop,
        externs=externs({subject.descriptions[component.name].name for component in components}),
        size=layout.size,
        cells=count * width,
        arrays="\n".join(arrays),
        slots=join_items(slot(subject, component, k) for k, component in enumerate(components)),
        parts=join_items(made),
        count=len(components),
        start=experiment.start,
        base_step=experiment.base_step,
        is_jacobi=int(experiment.method == "jacobi"),
        decimation=scenario.record.decimation,
        columns=width,
        places=len(scenario.played),
        watches=len(watches),
    )


def layout_of(subject: Subject) -> Layout:
    """Places in the buffer."""
    events = {name: event for name, event in subject.scenario.events.items() if event.enabled}
    return Layout(ports(subject.descriptions), texts(subject.descriptions), subject.prepare_events(events))


def at(rows: Any, k: int) -> list[float]:
    """Values that are played at a base step."""
    rows.provide(k)
    return [float(value) for value in rows.block[k - rows.begin]]


def externs(names: Iterable[str]) -> str:
    """Declarations of what the components are."""
    kinds = {"model": "extern const Model {};", "arrays": "extern const Arrays {};", "kernel_is_exact": "int {}(void);"}
    return "\n".join(kinds[symbol].format(f"{symbol}_{name}") for name in sorted(names) for symbol in SYMBOLS)


def slot(subject: Subject, component: Component, k: int) -> str:
    """A component, as page.c has it."""
    model, arrays, is_exact = (f"{symbol}_{subject.descriptions[component.name].name}" for symbol in SYMBOLS)
    return SLOT.format(
        symbols=f"&{model}, &{arrays}, {is_exact}",
        name=literal(component.name),
        folder=literal(folder_of(k)),
        begin=subject.scenario.experiment.time(component.offset),
    )


def folder_of(k: int) -> str:
    """Where a component looks for its files."""
    return f"/{k}"


def wires(subject: Subject, layout: Layout, component: Component, k: int) -> tuple[str, tuple[str, ...]]:
    """The component of that number, as `structure` in `compiled.py` tells the loop of it, and arrays of its own."""
    scenario, experiment = subject.scenario, subject.scenario.experiment
    found = layout.wires(scenario.connections, component.name)
    is_fed = bool(found) or any(port.component == component.name for port in scenario.played)
    found += [
        Wire(target=slot.after, source=slot.before, converts=False, factor=1.0, bias=0.0)
        for slot in layout.slots_of(component.name).values()
    ]
    links = [f"{{{w.target}, {w.source}, {int(w.converts)}, {w.factor!r}, {w.bias!r}}}" for w in found]
    inputs, outputs = (layout.of(component.name, causality) for causality in ("input", "output"))
    references = [layout.variables[port].reference for port in (*inputs, *outputs)]
    part = PART.format(
        k=k,
        inputs=exchange("set_inputs", k, 0, inputs, layout),
        outputs=exchange("get_outputs", k, len(inputs), outputs, layout),
        duration=component.step * experiment.base_step,
        links=f"links_{k}",
        link_count=len(links),
        follows=int(is_fed and experiment.method == "gauss-seidel"),
        every=component.step,
        steps_at=first_turn(component, 0),
        takes_at=first_exchange(component, 0),
    )
    return part, (array("unsigned", f"references_{k}", references), array("Link", f"links_{k}", links))


def exchange(function: str, k: int, first: int, moved: Sequence[Port], layout: Layout) -> str:
    """A call that moves values."""
    place = layout.index[moved[0]] if moved else 0
    return f"{{{function}, references_{k} + {first}, {len(moved)}, buffer + {place}, {len(moved)}}}"


def array(kind: str, name: str, items: Sequence[Any]) -> str:
    """An array, which is never empty."""
    text = ", ".join(item if isinstance(item, str) else repr(item) for item in items)
    return f"static {kind} {name}[] = {{{text or '0'}}};"


def join_items(items: Iterable[str]) -> str:
    """Write the items of an array, one per line."""
    return ",\n".join(f"    {item}" for item in items)


# What the page sets before a run, of JSON.


def values(subject: Subject, take: Take) -> list[dict[str, Any]]:
    """Components in execution order with the values that they are given; a text that names a file is without folder."""
    made = []
    for name in subject.order.names:
        component, description = subject.scenario.components[name], subject.descriptions[name]
        seed: dict[str, Value] = {"seed": take.seeds[name]} if name in take.seeds else {}
        made.append(
            {
                "name": name,
                "fmu": description.name,
                "values": [
                    [description.variables[n].reference, KINDS.index(description.variables[n].type), inside(value)]
                    for n, value in {**component.values, **seed}.items()
                ],
            }
        )
    return made


def inside(value: Value) -> Value:
    """A value, where a file is known by its name alone."""
    return Path(value).name if isinstance(value, str) and Path(value).is_absolute() else value


def files(subject: Subject) -> Mapping[str, str]:
    """Text of each file that a component may ask for, by its path in the module."""
    found: dict[str, str] = {}
    for k, name in enumerate(subject.order.names):
        shipped = parts(subject.descriptions[name].name).resources
        found |= {f"{folder_of(k)}/{file}": content.decode() for file, content in shipped.items()}
        for value in subject.scenario.components[name].values.values():
            if isinstance(value, str) and Path(value).is_absolute():
                found[f"{folder_of(k)}/{Path(value).name}"] = Path(value).read_text(encoding="utf-8")
    return found


def inputs(subject: Subject) -> list[list[float]]:
    """Places of inputs that have one value, and these."""
    inlets = layout_of(subject).inlets
    given = constants(subject.scenario, subject.descriptions, {})
    return [[inlets[port], float(value)] for port, value in given.items()]


# Events: what is known before a run, counted in base steps, is that of the runner; the rest is in events.js.


def actors(subject: Subject) -> dict[str, Actor]:
    """The events, with one target each."""
    layout, scenario = layout_of(subject), subject.scenario
    return run_events.actors(layout.events, scenario.experiment, scenario.components, layout, subject.make_take().seeds)


def noises(acting: Mapping[str, Actor], experiment: Experiment) -> list[float]:
    """Numbers of events that are noise, one after the other."""
    return [noise(of.event.name, of.seed, k) for of in acting.values() for k in noisy(of, experiment)]


def noisy(actor: Actor, experiment: Experiment) -> range:
    """Base steps at which an event may need a random number."""
    if not actor.event.is_random:
        return range(0)
    begin = actor.after if actor.watch else actor.track.begin or 0
    return range(begin, min(actor.track.end or NEVER, experiment.count + 1))


def events(subject: Subject) -> Iterator[dict[str, Any]]:
    """Events, as events.js has them."""
    layout, known, experiment = layout_of(subject), actors(subject), subject.scenario.experiment
    first = run_events.tellers(layout.events)
    watched = [name for name, actor in known.items() if actor.watch]
    room = 0  # of noise
    for name, actor in known.items():
        event, component = actor.event, actor.event.target.component
        variable = subject.descriptions[component].variables[event.target.variable]
        keys = {key: getattr(actor, key) for key in ("lead", "step", "offset", "first", "over", "duration", "lasting")}
        yield {
            **keys,
            "name": event.name,
            "tells": first[event.name] == name,
            "what": f"{event.action} {subject.scenario.events[event.name].target}",
            "target": str(event.target),
            "part": subject.order.names.index(component),
            "reference": variable.reference,
            "kind": KINDS.index(variable.type),
            "action": event.action,
            "value": event.value,
            "begin": actor.track.begin,
            "end": actor.track.end,
            "watch": watched.index(name) if actor.watch else None,
            "after": actor.after,
            "again": bool(event.when and event.when.again),
            "noise": room - noisy(actor, experiment).start,
            **stage(name, layout, subject),
        }
        room += len(noisy(actor, experiment))


def stage(name: str, layout: Layout, subject: Subject) -> dict[str, int]:
    """Where an event on an input acts: its link, which is behind those of connections, and its places in the buffer."""
    if name not in layout.slots:
        return {}
    component, slot = layout.events[name].target.component, layout.slots[name]
    plain = sum(connection.target.component == component for connection in subject.scenario.connections)
    return {"link": plain + [*layout.slots_of(component)].index(name), "before": slot.before, "held": slot.held}
