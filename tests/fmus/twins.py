"""An instance of an FMU and a slave of the same class, which get the same calls and have to give the same answers:
`python twins.py library resources guid inputs outputs step calls seed` in a process of its own.

The slave is called as it is, in Python, so that it never lends anything to the binary.  Prints how often each call was
answered with which status, and the first difference.
"""

from __future__ import annotations

import ctypes
import json
import math
import random
import struct
import sys
from collections import Counter
from ctypes import byref, c_double, c_int, c_size_t, c_uint, c_void_p
from typing import Any

from raw import Host

ODD = (math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, -0.0)
ERROR = 3
Answer = tuple[int, bytes, list[str]]  # status, bits of what was got, messages


def class_in(host: Host) -> Any:
    """The slave's class, as the binary knows it."""
    assert host.instantiate() is not None, host.said
    loader = next(module for name, module in sys.modules.items() if name.startswith("_gapsense_loader_"))
    return next(iter(loader.CLASSES.values()))


class Binary:
    """The instance in the binary."""

    def __init__(self, host: Host) -> None:
        self.host, self.c = host, host.instantiate()
        self.handles: dict[int, c_void_p] = {}

    def told(self, name: str, *arguments: Any) -> tuple[int, list[str]]:
        return self.host.call(self.c, name, *arguments), [text for _, _, text in self.host.heard()]

    def plain(self, name: str, *numbers: float) -> Answer:
        flag = {"SetupExperiment": [0, c_double(0.0)], "DoStep": []}.get(name, [])
        after = {"SetupExperiment": [0, c_double(0.0)], "DoStep": [1]}.get(name, [])
        status, said = self.told(name, *flag, *map(c_double, numbers), *after)
        return status, b"", said

    def get(self, kind: str, refs: list[int]) -> Answer:
        values = ({"Real": c_double}.get(kind, c_int) * len(refs))()
        status, said = self.told(f"Get{kind}", (c_uint * len(refs))(*refs), c_size_t(len(refs)), values)
        return status, b"" if status else bits(values), said

    def set(self, refs: list[int], values: list[float]) -> Answer:
        given = (c_double * len(refs))(*values)
        status, said = self.told("SetReal", (c_uint * len(refs))(*refs), c_size_t(len(refs)), given)
        return status, b"", said

    def save(self, slot: int) -> Answer:
        handle, size = self.handles.setdefault(slot, c_void_p()), c_size_t()
        status, said = self.told("GetFMUstate", byref(handle))
        self.told("SerializedFMUstateSize", handle, byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.told("SerializeFMUstate", handle, buffer, size)
        return status, buffer.raw, said

    def restore(self, slot: int) -> Answer:
        status, said = self.told("SetFMUstate", self.handles[slot])
        return status, b"", said


class Twin:
    """The slave."""

    def __init__(self, cls: Any, resources: str) -> None:
        self.make = lambda: cls(instance_name="one", resources=resources)
        self.slave, self.states = self.make(), {}

    def told(self, method: str, *arguments: Any) -> tuple[int, Any, list[str]]:
        value, status, queue = None, 0, self.slave.log_queue
        try:
            value = getattr(self.slave, method)(*arguments)
        except BaseException:
            status = ERROR
        said = [message.msg for message in queue]
        queue.clear()
        return status, value, said

    def plain(self, name: str, *numbers: float) -> Answer:
        if name == "Reset":
            self.slave = self.make()
            return 0, b"", []
        method = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)[1:]
        status, _, said = self.told(method, *numbers)
        return status, b"", said

    def get(self, kind: str, refs: list[int]) -> Answer:
        status, values, said = self.told(f"get_{kind.lower()}", refs)
        return status, b"" if status else bits(values), said

    def set(self, refs: list[int], values: list[float]) -> Answer:
        status, _, said = self.told("set_real", refs, values)
        return status, b"", said

    def save(self, slot: int) -> Answer:
        status, self.states[slot], said = self.told("_get_fmu_state")
        return status, self.slave._fmu_state_to_bytes(self.states[slot]), said

    def restore(self, slot: int) -> Answer:
        status, _, said = self.told("_set_fmu_state", self.states[slot])
        return status, b"", said


def bits(values: Any) -> bytes:
    return b"".join(struct.pack("d", value) for value in values)


class Pair:
    """Both, and what a sensible host knows of them."""

    def __init__(self, one: Binary, two: Twin, inputs: list[list[float]], outputs: int, step: float, seed: str) -> None:
        self.both, self.inputs, self.outputs, self.size = (one, two), inputs, outputs, step
        self.rng, self.time, self.slots = random.Random(seed), 0.0, set[int]()
        self.ports = two.slave.component.ports
        self.seen: Counter[str] = Counter()

    def do(self, call: str, *arguments: Any) -> int:
        """Make one call of both; the status, if the answers are the same."""
        one, two = (getattr(each, call)(*arguments) for each in self.both)
        self.seen[f"{arguments[0] if call == 'plain' else call} {one[0]}"] += 1
        if (one[:2], heads(one[2])) != (two[:2], heads(two[2])):
            raise AssertionError(f"{call} {arguments} after {self.seen}: {one} and {two}")
        return int(one[0])

    def begin(self) -> None:
        self.do("plain", "Reset")
        self.time = self.rng.choice([0.0, 0.0, 1000.0])
        if self.rng.random() < 0.8:
            self.do("plain", "SetupExperiment", self.time)
        self.do("plain", "EnterInitializationMode")
        self.do("plain", "ExitInitializationMode")

    def any(self) -> int:
        """Any call, a usual one as a rule."""
        rng = self.rng
        usual = [self.set, self.step, self.get]
        rare = [self.odd_set, self.odd_step, self.odd_get, self.tune, self.save, self.restore]
        return int((rng.choice(rare) if rng.random() < 0.1 else rng.choice(usual))())

    def drawn(self) -> list[float]:
        return [self.rng.uniform(low, high) for low, high in self.inputs]

    def set(self) -> int:
        return self.do("set", [*range(len(self.inputs))], self.drawn())

    def step(self) -> int:
        size, self.time = self.size, self.time * self.rng.choice([1.0, 1.0, 1.0, 1.0 + 2e-16])
        status = self.do("plain", "DoStep", self.time, size)
        self.time += size
        return status

    def get(self) -> int:
        return self.do("get", "Real", [*range(len(self.inputs), len(self.inputs) + self.outputs)])

    def odd_set(self) -> int:
        """Some inputs, none or twice; seldom what is no input, or no good value."""
        refs = self.rng.choices([*range(len(self.inputs))] or [10**6], k=self.rng.randrange(4))
        values = [self.drawn()[ref] if ref < len(self.inputs) else 0.0 for ref in refs]
        if refs and self.rng.random() < 0.2:
            refs[-1] = self.rng.choice([len(self.inputs), len(self.ports), 2**31, 2**32 - 1])
        elif refs and self.rng.random() < 0.3:
            values[-1] = self.rng.choice(ODD)
        return self.do("set", refs, values)

    def odd_step(self) -> int:
        factor = self.rng.choice([0.5, 0.5, 2.0, 3.0, 0.37, 0.0, -1.0, math.nan, 1.0, 1.0])
        self.time += self.rng.choice([0.0, 0.0, 0.0, 1e-8, 1.0, math.nan]) * self.size
        status = self.do("plain", "DoStep", self.time, factor * self.size)
        self.time += factor * self.size
        return status

    def odd_get(self) -> int:
        kind = self.rng.choice(["Real", "Real", "Real", "Integer", "Boolean"])
        refs = [k for k, port in enumerate(self.ports) if port.kind == kind]
        refs = self.rng.choices(refs, k=self.rng.randrange(5)) if refs else []
        if self.rng.random() < 0.1:
            refs.append(self.rng.choice([len(self.ports), 2**31, 2**32 - 1]))
        return self.do("get", kind, refs)

    def tune(self) -> int:
        refs = [k for k, port in enumerate(self.ports) if port.variability == "tunable"]
        return self.do("set", refs, [self.ports[k].start * self.rng.choice([1.0, 1.01]) for k in refs])

    def save(self) -> int:
        slot = self.rng.randrange(3)
        self.slots.add(slot)
        self.kept = self.time
        return self.do("save", slot)

    def restore(self) -> int:
        if not self.slots:
            return self.save()
        self.time = self.rng.choice([self.kept, self.time])
        return self.do("restore", self.rng.choice([*self.slots]))


def heads(texts: list[str]) -> list[str]:
    """Without the lines of code on the way to an exception."""
    return [text.partition("Traceback")[0] for text in texts]


def main(library: str, resources: str, guid: str, *options: str) -> None:
    host, (inputs, outputs, step, count, seed) = Host(library, resources, guid), map(json.loads, options)
    twin = Twin(class_in(host), resources.removeprefix("file://"))
    pair = Pair(Binary(host), twin, inputs, outputs, step, f"{library.rpartition('/')[2]} {seed}")
    pair.begin()
    for _ in range(count):
        if pair.any() == ERROR:
            pair.begin()
    print(json.dumps(pair.seen))


if __name__ == "__main__":
    main(*sys.argv[1:])
