"""Any calls in any order with any values: `python fuzz.py library resources guid count seed` in a process of its own.

Prints how often each status came.  Pointers are good; a host that passes others is beyond help.
"""

from __future__ import annotations

import ctypes
import json
import math
import random
import sys
from collections import Counter
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from typing import Any

from raw import LATIN, Host

MOST = 4  # instances, and variables per call


class Fuzz:
    """Instances that come and go, and one saved state."""

    def __init__(self, host: Host, seed: int) -> None:
        self.host, self.random = host, random.Random(seed)
        self.instances = [host.instantiate() for _ in range(MOST)]
        self.handle, self.data = c_void_p(), b""

    def call(self) -> int:
        """One call; its status."""
        k = self.random.randrange(MOST)
        if self.random.random() < 0.01:
            self.host.library.fmi2FreeInstance(self.instances[k])
            self.instances[k] = self.host.instantiate(logging=self.random.randrange(2))
        make = self.random.choice((self.usual, self.usual, self.variables, self.unusual, self.state))
        name, *arguments = make()
        status = self.host.call(self.instances[k], name, *arguments)
        self.host.heard()
        return status

    def number(self) -> c_double:
        choice = [0.0, 1e-3, self.random.uniform(-1.0, 1.0), math.nan, math.inf, 1e308, -0.0]
        return c_double(self.random.choice(choice))

    def usual(self) -> list[Any]:
        """Calls that bring an instance to run."""
        zero, step = c_double(0.0), c_double(1e-3)
        setup = ["SetupExperiment", 0, zero, zero, 0, zero]
        others = [["EnterInitializationMode"], ["ExitInitializationMode"], ["DoStep", zero, step, 1], ["Reset"]]
        return self.random.choice([setup, *others])

    def variables(self) -> list[Any]:
        """Getting and setting, also what is not there."""
        choose, n = self.random, range(MOST)
        references = [choose.choice([choose.randrange(40), choose.randrange(2**32)]) for _ in n]
        values: dict[str, Any] = {
            "Real": (c_double * MOST)(*[self.number() for _ in n]),
            "Integer": (c_int * MOST)(*[choose.randrange(-(2**31), 2**31) for _ in n]),
            "Boolean": (c_int * MOST)(*[choose.randrange(-1, 3) for _ in n]),
            "String": (c_char_p * MOST)(*[choose.choice([LATIN, b"", b"%n", None]) for _ in n]),
        }
        kind, direction = choose.choice(list(values)), choose.choice(["Get", "Set"])
        return [f"{direction}{kind}", (c_uint * MOST)(*references), c_size_t(choose.randrange(MOST)), values[kind]]

    def unusual(self) -> list[Any]:
        """Calls with odd times and sizes, and those that are rare."""
        flag = self.random.randrange(2)
        setup = ["SetupExperiment", flag, self.number(), self.number(), flag, self.number()]
        logging = ["SetDebugLogging", flag, c_size_t(0), None]
        step = ["DoStep", self.number(), self.number(), flag]
        return self.random.choice([setup, logging, step, ["Terminate"], ["CancelStep"]])

    def state(self) -> list[Any]:
        """Something with the saved state, whose bytes may be damaged."""
        name = self.random.choice(["GetFMUstate", "SetFMUstate", "FreeFMUstate", "DeSerializeFMUstate"])
        if name != "DeSerializeFMUstate":
            return [name, self.handle if name == "SetFMUstate" else byref(self.handle)]
        if self.handle.value:
            self.data = self.serialized()
        data = bytearray(self.data)
        if data and self.random.randrange(2):
            data[self.random.randrange(len(data))] = self.random.randrange(256)
        return [name, bytes(data), c_size_t(len(data)), byref(self.handle)]

    def serialized(self) -> bytes:
        size, c = c_size_t(), self.instances[0]
        self.host.call(c, "SerializedFMUstateSize", self.handle, byref(size))
        buffer = ctypes.create_string_buffer(size.value or 1)
        given = self.random.choice([size.value, size.value // 2])
        self.host.call(c, "SerializeFMUstate", self.handle, buffer, c_size_t(given))
        return buffer.raw


if __name__ == "__main__":
    fuzz = Fuzz(Host(*sys.argv[1:4]), int(sys.argv[5]))
    print(json.dumps(Counter(fuzz.call() for _ in range(int(sys.argv[4])))))
