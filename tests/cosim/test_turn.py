"""The C library that does component-steps, and the Python code where it does not load: same calls, same bits."""

import ctypes
import platform
import shutil
import sys
from array import array
from pathlib import Path

import numpy as np
import pytest
from faulty import FAULTY
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.cosim import run, turn
from gapsense.cosim.descriptions import Variable
from gapsense.cosim.part import GET, SET, STEP, Layout, Part
from gapsense.cosim.scenario import Component, Connection, Port
from gapsense.cosim.turn.build import TURN

REFERENCES, VALUES = ctypes.POINTER(ctypes.c_uint), ctypes.POINTER(ctypes.c_double)
EXCHANGE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, REFERENCES, ctypes.c_size_t, VALUES)
DO_STEP = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)
POINTER = 4711  # the instance; nobody follows it
BASE_STEP = 1e-4 / 3
SOURCES, INPUTS = 3, 3  # outputs of another component, inputs of the one that steps

needs_library = pytest.mark.skipif(turn.entry() is None, reason="the library is for Linux on x86-64")


@pytest.fixture
def without_library(monkeypatch):
    return lambda: monkeypatch.setattr(turn, "BINARY", Path("none.so"))


# The binary -----------------------------------------------------------------------------------------------------------


def test_committed_binary_belongs_to_the_source():
    TURN.check()  # where Zig is installed, also byte for byte with a rebuild


def test_stale_binary_is_noticed(tmp_path):
    stale = tmp_path / "stale.so"
    stale.write_bytes(turn.BINARY.read_bytes().replace(TURN.fingerprint().encode(), b"0" * 64))
    assert "not made from the present sources" in TURN.problems(stale)[0]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.skipif(sys.platform != "linux", reason="the library is for Linux")
def test_compiles_with_gcc_without_warning(tmp_path):
    assert TURN.problems(TURN.compile_with(["gcc"], tmp_path / "turn.so")) == []


@pytest.mark.skipif((sys.platform, platform.machine()) != ("linux", "x86_64"), reason="for Linux on x86-64")
def test_library_loads_where_it_should():
    assert turn.entry() is not None


def test_file_that_is_no_library_counts_as_none(tmp_path, monkeypatch):
    file = tmp_path / "turn.so"
    file.write_bytes(b"for another platform")
    monkeypatch.setattr(turn, "BINARY", file)
    assert turn.entry() is None


# Against an FMU that notes its calls ----------------------------------------------------------------------------------


class Noting:
    """Stands for an instance: notes every call with its arguments, answers with the given statuses and outputs."""

    is_near = True

    def __init__(self, statuses, outputs):
        self.calls, self.statuses, self.outputs = [], statuses, outputs
        self.pointer = ctypes.c_void_p(POINTER)
        self.entries = {SET: EXCHANGE(self.set), STEP: DO_STEP(self.step), GET: EXCHANGE(self.get)}

    def function(self, name):
        return self.entries[name]

    def set(self, instance, references, count, values):
        self.calls.append((SET, instance, references[:count], array("d", values[:count]).tobytes()))
        return self.statuses[SET]

    def step(self, *arguments):
        self.calls.append((STEP, *arguments))
        return self.statuses[STEP]

    def get(self, instance, references, count, values):
        self.calls.append((GET, instance, references[:count]))
        for i in range(count):
            values[i] = self.outputs[i]
        return self.statuses[GET]

    def failure(self, *arguments):
        return arguments

    def said(self):
        return ""

    log = said


def variable(port, causality, reference):
    return Variable(port.variable, reference, "Real", causality, None, None, None, 1.0, None)


def steps_of(case, takes_inputs):
    """Everything that steps of a component do: errors they lead to, calls, and what the buffer then holds."""
    sources = [Port("other", f"y{i}") for i in range(SOURCES)]
    inputs = [Port("part", f"u{i}") for i in range(INPUTS)]
    outputs = [Port("part", f"y{i}") for i in range(len(case["outputs"]))]
    variables = {
        **{port: variable(port, "output", 10 + i) for i, port in enumerate(sources)},
        **{port: variable(port, "input", 20 + 2 * i) for i, port in enumerate(inputs)},
        **{port: variable(port, "output", 33 - i) for i, port in enumerate(outputs)},
    }
    buffer = array("d", case["values"] + [0.5] * (INPUTS + len(outputs)))
    instance = Noting(case["statuses"], case["outputs"])
    part = Part(Component("part", "Part", step=case["step"]), instance, buffer, Layout(variables))
    for source, target, factor, bias in case["links"]:
        part.connect(Connection(sources[source], inputs[target], factor, bias))
    step = part.stepper(BASE_STEP, takes_inputs)
    failed = [step(start) for start in case["starts"]]
    errors = [part.failure(what, 0.0, 1) if what else None for what in failed]
    return failed, [str(error) for error in errors], instance.calls, buffer.tobytes()


NUMBERS = st.floats(allow_nan=False)
STATUS = st.sampled_from([0, 0, 0, 0, 1, 2, 3, 4, 5])
CASES = st.fixed_dictionaries(
    {
        "values": st.lists(st.floats(), min_size=SOURCES, max_size=SOURCES),
        "links": st.lists(
            st.tuples(
                st.integers(0, SOURCES - 1), st.integers(0, INPUTS - 1), st.none() | NUMBERS, st.none() | NUMBERS
            ),
            unique_by=lambda link: link[1],
        ),
        "outputs": st.lists(NUMBERS | NUMBERS | st.floats(), max_size=4),
        "statuses": st.fixed_dictionaries({SET: STATUS, STEP: STATUS, GET: STATUS}),
        "step": st.integers(1, 4),
        "starts": st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=2),
    }
)


@needs_library
@settings(max_examples=300, deadline=None)
@given(case=CASES, takes_inputs=st.booleans())
def test_component_step_makes_the_same_calls_with_the_same_bits(case, takes_inputs):
    in_c = steps_of(case, takes_inputs)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(turn, "BINARY", Path("none.so"))
        assert steps_of(case, takes_inputs) == in_c


# Against real FMUs ----------------------------------------------------------------------------------------------------


@needs_library
@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_run_gives_the_same_bits(write, chain, fmus, without_library, method):
    text = chain.replace("stop = 1.0", f'stop = 1.0\nmethod = "{method}"')
    text = text.replace('to = "gain.u"', 'to = "gain.u"\nfactor = 0.3\nbias = -0.1\nunit = "V"')
    path = write(text)
    in_c = run(path, fmus=fmus)
    without_library()
    in_python = run(path, fmus=fmus)
    assert np.ptp(in_c["gain.y"]) > 0.0
    assert list(in_c.signals) == list(in_python.signals)
    assert all(in_c[name].tobytes() == in_python[name].tobytes() for name in in_c.signals)
    assert [t.calls for t in in_c.timing.values()] == [t.calls for t in in_python.timing.values()]


ERRORS = """
from gapsense.cosim import FmuError, run
errors = []
for turn.BINARY in (turn.BINARY, Path("none.so")):
    try:
        run(PATH, fmus=fmus)
    except FmuError as error:
        rows = {name: error.result[name].tobytes() for name in error.result.signals}
        errors.append((str(error), error.instance, error.time, error.step, rows))
assert len(errors) == 2 and errors[0] == errors[1], errors
print(errors[0])
"""


@needs_library
@pytest.mark.parametrize(
    ("fault", "words"),
    [("raise", "returned fmi2Fatal"), ("discard", "returned fmi2Discard"), ("nan", "is nan"), ("infinite", "is inf")],
)
def test_run_fails_in_the_same_way(write, python, fault, words):
    path = write(FAULTY.replace("FAULT", fault))
    done = python(ERRORS.replace("PATH", repr(str(path))))
    assert done.returncode == 0, done
    assert words in done.stdout
