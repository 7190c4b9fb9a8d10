"""FMUs that are functions of this process, for C to call: they note every call, and fail where they are told to."""

import ctypes
import math
from array import array
from collections import deque
from types import SimpleNamespace

import numpy as np

from gapsense.cosim.fmu.descriptions import Variable
from gapsense.cosim.fmu.instance import Instance, Instance3
from gapsense.cosim.run.part import Layout, Part, Player, Work
from gapsense.cosim.run.recording import STOP, Recording, new_marks
from gapsense.cosim.scenario.records import Component, Connection, Event, Experiment, Port, Threshold

REFERENCES, VALUES = ctypes.POINTER(ctypes.c_uint), ctypes.POINTER(ctypes.c_double)
INT, SIZE, DOUBLE, BOOL, ANY = ctypes.c_int, ctypes.c_size_t, ctypes.c_double, ctypes.c_bool, ctypes.c_void_p
ANSWER = ctypes.POINTER(BOOL)
EXCHANGE = {
    2: ctypes.CFUNCTYPE(INT, ANY, REFERENCES, SIZE, VALUES),
    3: ctypes.CFUNCTYPE(INT, ANY, REFERENCES, SIZE, VALUES, SIZE),
}
DO_STEP = {
    2: ctypes.CFUNCTYPE(INT, ANY, DOUBLE, DOUBLE, INT),
    3: ctypes.CFUNCTYPE(INT, ANY, DOUBLE, DOUBLE, BOOL, ANSWER, ANSWER, ANSWER, VALUES),
}
INPUTS, OUTPUTS = 2, 2  # of each part
TURN = 4  # base steps after which the effects of events change
SPECIAL = (-0.0, -0.0, -0.0, np.nan, np.inf, -np.inf)  # values that an output may get


class Fake:
    """Its outputs follow from its inputs, the time and the steps before; `trouble` is what happens at which call."""

    is_dead = False

    def __init__(self, name, fmi, trouble, notes, marks):
        self.name, self.fmi, self.trouble, self.notes, self.marks = name, fmi, trouble, notes, marks
        self.description, self.messages = SimpleNamespace(fmi=fmi), deque()
        self.pointer = ctypes.c_void_p(4711)  # nobody follows it
        self.count, self.inputs, self.level = 0, (), 0.0
        exchange, do_step = EXCHANGE[fmi], DO_STEP[fmi]
        self.entries = {"Set": exchange(self.set), "Get": exchange(self.get), "DoS": do_step(self.step)}

    def function(self, name):
        if name.endswith("Status"):
            raise AttributeError(name)
        return self.entries[name[4:7]]

    def noted(self, *arguments):
        """Status of a call, after noting it and the marks that are seen meanwhile."""
        self.count += 1
        self.notes.append((self.name, *arguments, list(self.marks)))
        what, call, status = self.trouble
        if what == "stop" and call == self.count:
            self.marks[STOP] = 1
        return status if what == "status" and call == self.count else 0

    def set(self, instance, references, count, values, *_):
        self.inputs = tuple(values[:count])
        return self.noted("set", instance, references[:count], array("d", self.inputs).tobytes())

    def step(self, instance, start, duration, keep, *answers):
        self.level = 0.5 * self.level + sum(self.inputs) + start + duration
        status = self.noted("step", instance, start, duration, keep, [bool(a[0]) for a in answers[:3]])
        if answers and self.trouble[:2] == ("ends", self.count):
            answers[1][0] = True
        if answers and self.trouble[:2] == ("last", self.count):
            answers[1][0], answers[2][0] = self.trouble[2] % 2, self.trouble[2] > 3
            answers[3][0] = (start + duration / 2, math.nan, start, start + 2 * duration, start + duration)[
                self.trouble[2] % 5
            ]
        return status

    def get(self, instance, references, count, values, *_):
        for i in range(count):
            values[i] = self.level * (i + 1)
        status = self.noted("get", instance, references[:count])
        if self.trouble[0] == "value" and self.trouble[1] <= self.count:
            values[0] = SPECIAL[self.trouble[2]]
        return status


class Fake2(Fake, Instance):
    """Of FMI 2.0."""


class Fake3(Fake, Instance3):
    """Of FMI 3.0."""


def variable(port, causality, reference, fmi):
    kind = "Float64" if fmi == 3 else ""
    return Variable(port.variable, reference, "Real", causality, None, None, None, 1.0, None, kind)


def variables_of(case):
    """All ports, in the order of the buffer."""
    found, reference = {}, 10
    for i, (fmi, *_) in enumerate(case["parts"]):
        names = [("input", f"u{j}") for j in range(INPUTS)] + [("output", f"y{j}") for j in range(OUTPUTS)]
        for causality, name in names:
            reference += 3
            found[Port(f"c{i}", name)] = variable(Port(f"c{i}", name), causality, reference, fmi)
    return found


class Trial:
    """A run of fake FMUs: its parts, and what it leaves behind."""

    def __init__(self, case):
        self.case, self.notes, self.marks = case, [], new_marks()
        events = {f"e{k}": Event(f"e{k}", port("u", place), "set") for k, (place, _) in enumerate(case["events"])}
        self.layout = Layout(variables_of(case), {}, events)
        self.buffer = array("d", [0.25 * k for k in range(self.layout.size)])
        self.watches = [Threshold(place, level, is_above, True) for place, level, is_above in case["watches"]]
        self.parts = [self.part(i) for i in range(len(case["parts"]))]
        # An input has one source.
        free = [link for link in case["links"] if not (case["signals"] and link[1] == (0, 0))]
        links = [Connection(port("y", y), port("u", u), factor, bias) for y, u, factor, bias in free]
        for part in self.parts:
            part.connect(links)
        rows, columns = case["count"] // case["decimation"] + 1, case["columns"]
        self.recording = Recording(np.full((rows, len(columns)), -1.0)).start(len(self.parts))
        self.player = Player([self.layout.inlets[port("u", (0, 0))]][: case["signals"]], self.signals)

    def part(self, i):
        fmi, step, offset, is_near, trouble = self.case["parts"][i]
        kind = Fake3 if fmi == 3 else Fake2
        instance = kind(f"c{i}", fmi, trouble, self.notes, self.marks)
        instance.is_near = is_near
        part = Part(Component(f"c{i}", "Fake", step, offset), instance, self.buffer, self.layout, {})
        part.is_played = bool(self.case["signals"]) and i == 0
        return part

    def signals(self, k):
        """Values of the signals, a few base steps at once."""
        times = np.arange(k, k + self.case["at_once"], dtype=float)
        return np.repeat(np.sin(times)[:, None], self.case["signals"], axis=1)

    def work(self, begin):
        """What the loop has to do from a base step on."""
        case = self.case
        grid = Experiment(case["start"], 0.0, case["base_step"], case["count"], case["method"])
        columns, view = np.array(case["columns"], dtype=np.int64), np.frombuffer(self.buffer)
        player, recording, watches = self.player, self.recording, self.watches
        return Work(self.parts, grid, player, columns, case["decimation"], view, recording, self.marks, begin, watches)

    def turn(self, done):
        """What is done between blocks: effects of events change, and news of conditions are noted."""
        stages = {name: stage for part in self.parts for name, stage in part.stages.items()}
        for k, (_, effects) in enumerate(self.case["events"]):
            if effects and not (done + 1) % TURN:
                stages[f"e{k}"].apply(effects[done // TURN % len(effects)], self.buffer)
        view = np.frombuffer(self.buffer)
        for watch in self.watches:
            if watch.look(view) != watch.holds:
                self.notes.append(("news", done, watch.place))
                watch.holds = not watch.holds

    def run(self, advancer):
        """Do all base steps, in blocks, with a fresh start of the loop here and there; what there is at the end."""
        case, done, error = self.case, -1, ""
        try:
            while done < case["count"] and not self.marks[STOP]:
                advance = advancer(self.work(done + 1))
                for block in case["blocks"]:
                    if done < case["count"] and not self.marks[STOP]:
                        done = advance(min(done + block, case["count"], done + TURN - (done + 1) % TURN))
                        self.turn(done)
        except Exception as raised:
            error = repr(raised)
        rows = self.recording.data.tobytes(), self.recording.rows
        return rows, self.buffer.tobytes(), self.recording.calls, list(self.marks), error, self.notes


def port(prefix, place):
    """An input or output: number of the part, and its own."""
    return Port(f"c{place[0]}", f"{prefix}{place[1]}")
