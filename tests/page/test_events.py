"""Events in a page do what those of the runner do: the same values, bit for bit, at the same base steps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gapsense.cosim import ScenarioError
from gapsense.cosim.check import prepare
from gapsense.cosim.run.events import Director
from gapsense.cosim.run.part import Layout, Stage
from gapsense.cosim.run.recording import Subject, new_marks
from gapsense.cosim.scenario.records import ACTIONS, Event, Port, When
from gapsense.page import plan
from gapsense.page.page import refuse_unfit

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = (ROOT / "src" / "gapsense" / "page" / "events.js").read_text(encoding="utf-8")
COUNT, AWAY = 60, 50  # base steps of a test, and those at which its events begin
INPUTS = ("sensor.current", "semera.current", "valve.voltage")
PARAMETERS = ("valve.coil.resistance", "valve.damping", "sensor.noise.current")
OUTPUTS = ("valve.current", "sensor.current_measured")
NOMINAL = 3.7  # of all parameters
IN_PAGE = """({ events, size, wires, stages, watches, noise, signals, nominal }) => {
  const memory = { buffer: new ArrayBuffer(8 * (size + noise.length)) };
  const buffer = new Float64Array(memory.buffer, 0, size);
  new Float64Array(memory.buffer, 8 * size).set(noise);
  const plain = { converts: 0, factor: 1, bias: 0 };
  const links = stages.map((of) => of.map(([after, before]) => ({ after, source: before, ...plain })));
  const holds = (k) => {
    const { place, level, isAbove } = watches[k];
    return isAbove ? buffer[place] > level : buffer[place] < level;
  };
  const told = [];
  const director = directorOf({
    memory, inputs: () => 0, noise: () => 8 * size, number: () => nominal, holds: (k) => Number(holds(k)),
    watch: (k, isOn, held) => Object.assign(watches[k], { isOn, held }),
    stage: (part, link, source, converts, factor, bias) =>
      Object.assign(links[part][link - wires[part].length], { source, converts, factor, bias }),
  }, events, (of, value) => told.push([of.target, value]));
  const rows = [];
  let change = director.turn(-1);
  director.begin();
  signals.forEach((row, k) => {
    buffer.set(row);
    wires.flat().forEach(([target, source]) => (buffer[target] = buffer[source]));
    for (const { after, source, converts, factor, bias } of links.flat())
      buffer[after] = converts ? factor * buffer[source] + bias : buffer[source];
    const hasNews = watches.some((of, j) => of.isOn && holds(j) !== of.held);
    if (!k || k === change || hasNews) change = director.turn(k);
    rows.push([[...buffer], told.splice(0), change]);
  });
  return [rows, director.happened];
}"""


@dataclass
class Component:
    """A part of the runner that keeps the values that it is given."""

    component: Any
    stages: dict[str, Stage]
    told: list[Any]
    instance: Any = field(init=False)

    def __post_init__(self) -> None:
        name, told = self.component.name, self.told
        self.instance = SimpleNamespace(change=lambda parameter, value: told.append([f"{name}.{parameter}", value]))


@pytest.fixture(scope="module")
def valve(fmus: Path) -> Subject:
    return Subject(*prepare(ROOT / "scenarios" / "semera_valve", None, fmus))


@pytest.fixture(scope="module")
def page(browser: Any) -> Any:
    opened = browser.new_page()
    opened.add_script_tag(content=SCRIPT)
    yield opened
    opened.close()


def bits(numbers: list[float]) -> bytes:
    """Bits of numbers; NaN is NaN."""
    return np.where(np.isnan(numbers), np.nan, numbers).tobytes()


def port(text: str) -> Port:
    return Port(*text.split(".", 1))


def events_of(draw: np.random.Generator, subject: Subject, action: str) -> dict[str, Event]:
    """Some events, the first one with that action, at times and on conditions, several on one target."""
    experiment, base, made = subject.scenario.experiment, subject.scenario.experiment.base_step, {}
    for k, of in enumerate([action, *draw.choice([*ACTIONS], 3)]):
        targets = (*INPUTS, *OUTPUTS, *(PARAMETERS if ACTIONS[of].on_parameter else ()))
        grows = of == "ramp" or (of in ("bias", "scale") and draw.random() < 0.5)
        begin = int(draw.integers(1, AWAY))
        keys: dict[str, Any] = {"over": float(draw.integers(1, 9)) * base} if grows else {}
        if draw.random() < 0.5:
            keys |= {"at": experiment.time(begin)}
            keys |= {"until": experiment.time(begin + int(draw.integers(1, 20)))} if draw.random() < 0.7 else {}
        else:
            lasting, after = float(draw.integers(0, 3)) * base, experiment.time(begin) if draw.random() < 0.5 else None
            above, again = bool(draw.integers(2)), bool(draw.integers(2))
            keys["when"] = When(port("drive.voltage"), float(draw.normal()), above, lasting, after, again)
            keys |= {"duration": float(draw.integers(1, 9)) * base} if again or draw.random() < 0.5 else {}
        value = None if of in ("stuck", "dropout") else float(draw.normal())
        made[f"e{k}"] = Event(f"e{k}", port(str(draw.choice(targets))), str(of), value, seed=k, **keys)
    return made


def by_runner(subject: Subject, layout: Layout, signals: np.ndarray) -> tuple[list[Any], list[Any]]:
    """What the runner's events do to a buffer, without any FMU: its values, what is set, the next change."""
    experiment, told = subject.scenario.experiment, []
    buffer, components = np.zeros(layout.size), [subject.scenario.components[n] for n in subject.order.names]
    parts = [Component(c, {n: Stage(s) for n, s in layout.slots_of(c.name).items()}, told) for c in components]
    director = Director(layout.events, experiment, parts, layout, buffer, subject.make_take().seeds, new_marks())
    director.begin({str(event.target): NOMINAL for event in layout.events.values()})
    links = [link for own in wires(subject, layout) for link in own]
    change, rows = director.limit, []
    for k, row in enumerate(signals):
        buffer[: len(row)] = row
        for target, source in links:
            buffer[target] = buffer[source]
        for part in parts:
            for of in part.stages.values():
                value = buffer[of.source]
                buffer[of.slot.after] = of.factor * value + of.bias if of.converts else value
        if not k or k == change or director.has_news():
            change = director.turn(k)
        rows.append([[*buffer], [*told], change])
        told.clear()
    return rows, director.happened


def wires(subject: Subject, layout: Layout) -> list[list[list[int]]]:
    """Ends of the connections into each component."""
    found = [[c for c in subject.scenario.connections if c.target.component == name] for name in subject.order.names]
    return [[[layout.inlets[c.target], layout.index[c.source]] for c in own] for own in found]


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 6))])
@pytest.mark.parametrize("action", ACTIONS)
def test_all_kinds_of_events_give_the_bits_of_the_runner(page, valve, action, seed):
    draw = np.random.default_rng([seed, len(action)])
    subject = Subject(replace(valve.scenario, events=events_of(draw, valve, action)), valve.descriptions)
    layout, actors = plan.layout_of(subject), plan.actors(subject)
    signals = draw.normal(size=(COUNT, len(layout.variables)))
    expected, happened = by_runner(subject, layout, signals)
    watches = [actor.watch for actor in actors.values() if actor.watch]
    rows, told = page.evaluate(
        IN_PAGE,
        {
            "events": [*plan.events(subject)],
            "size": layout.size,
            "wires": wires(subject, layout),
            "stages": [[[s.after, s.before] for s in layout.slots_of(n).values()] for n in subject.order.names],
            "watches": [{"place": w.place, "level": w.level, "isAbove": w.is_above} for w in watches],
            "noise": plan.noises(actors, subject.scenario.experiment),
            "signals": signals.tolist(),
            "nominal": NOMINAL,
        },
    )
    assert told == happened and happened
    for k, ((numbers, values, change), (own, given, limit)) in enumerate(zip(rows, expected)):
        assert bits(numbers) == bits(own), k
        assert (values, min(change or np.inf, COUNT)) == (given, min(limit, COUNT)), k


def test_event_of_a_page_is_counted_in_base_steps_as_the_runner_counts(valve):
    experiment = valve.scenario.experiment
    when = When(port("drive.voltage"), 15.0, True, 4 * experiment.base_step, experiment.time(7), True)
    events = {
        "off": Event("off", port("sensor.current"), "set", 1.0, at=0.0, enabled=False),
        "lost": Event("lost", port("sensor.current"), "dropout", when=when, duration=80 * experiment.base_step),
    }
    subject = Subject(replace(valve.scenario, events=events), valve.descriptions)
    (lost,) = plan.events(subject)
    assert (lost["after"], lost["lasting"], lost["duration"], lost["again"], lost["begin"]) == (7, 4, 80, True, None)
    text = plan.header(subject)
    place = plan.layout_of(subject).index[port("drive.voltage")]
    assert f"watches[] = {{{{{place}, 1, 0, 0, 15.0}}}};" in text and ".watch_count = 1" in text
    assert lost["step"] == 2 and lost["link"] == 4  # behind the four connections of the sensor


@pytest.mark.slow
def test_noise_of_long_events_is_refused_in_a_sentence(valve):
    long = Event("hiss", port("sensor.current"), "noise", 1.0, at=0.0)
    events = {name: replace(long, name=name) for name in ("hiss", "hum", "buzz")}
    subject = Subject(replace(valve.scenario, events=events), valve.descriptions)
    with pytest.raises(ScenarioError, match=r"noise for 12003 base steps.*10000 at most.*`until`"):
        refuse_unfit(subject)
