"""The C library that does component-steps, and the Python code where it does not load: same calls, same bits."""

import ctypes
import os
import platform
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from threading import Timer
from time import sleep

import numpy as np
import pytest
from fakes import DO_STEP, Trial
from faulty import FAULTY
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense._os.interrupts import count_interrupts
from gapsense.cosim import run
from gapsense.cosim.run.events import Effect
from gapsense.cosim.run.loop import compiled
from gapsense.cosim.run.loop.build import LOOP
from gapsense.cosim.run.loop.compiled import in_python
from gapsense.cosim.run.part import Player
from gapsense.cosim.run.recording import ROWS, STEP, STOP, bin_edge, median

needs_library = pytest.mark.skipif(compiled.entry() is None, reason="the library is for Linux on x86-64")


def in_c(work):
    return compiled.in_c(work, compiled.entry())


@pytest.fixture
def without_library(monkeypatch):
    return lambda: monkeypatch.setattr(compiled, "BINARY", Path("none.so"))


# The binary -----------------------------------------------------------------------------------------------------------


def test_committed_binary_belongs_to_the_source():
    LOOP.check()  # where Zig is installed, also byte for byte with a rebuild


def test_stale_binary_is_noticed(tmp_path):
    stale = tmp_path / "stale.so"
    stale.write_bytes(compiled.BINARY.read_bytes().replace(LOOP.fingerprint().encode(), b"0" * 64))
    assert "is not up to date with its sources" in LOOP.problems(stale)[0]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.skipif(sys.platform != "linux", reason="the library is for Linux")
def test_compiles_with_gcc_without_warning(tmp_path):
    assert LOOP.problems(LOOP.compile_with(["gcc"], tmp_path / "loop.so")) == []


@pytest.mark.skipif((sys.platform, platform.machine()) != ("linux", "x86_64"), reason="for Linux on x86-64")
def test_library_loads_where_it_should():
    assert compiled.entry() is not None


def test_file_that_is_no_library_counts_as_none(tmp_path, monkeypatch):
    file = tmp_path / "loop.so"
    file.write_bytes(b"for another platform")
    monkeypatch.setattr(compiled, "BINARY", file)
    assert compiled.entry() is None


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_structures_are_those_of_c(tmp_path):
    kinds = (compiled.Link, compiled.WatchInC, compiled.Exchange, compiled.PartInC, compiled.Loop)
    kinds += (compiled.Cycle, compiled.RampInC)
    fields = [(kind.__name__, name) for kind in kinds for name, _ in kind._fields_]
    lines = [f'printf("%zu ", offsetof({kind}, {name}));' for kind, name in fields]
    lines += [f'printf("%zu ", sizeof({kind.__name__}));' for kind in kinds]
    source, program = tmp_path / "layout.c", tmp_path / "layout"
    head = f'#include <stdio.h>\n#include "{compiled.SOURCE.as_posix()}"\n'
    source.write_text(head + "int main(void)\n{\n" + "\n".join(lines) + "\n}\n")
    subprocess.run(["gcc", str(source), "-o", str(program), "-lm"], check=True)
    said = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
    sizes = [getattr(kind, name).offset for kind in kinds for name, _ in kind._fields_]
    assert [int(word) for word in said.split()] == sizes + [ctypes.sizeof(kind) for kind in kinds]


# Against FMUs that note their calls -----------------------------------------------------------------------------------

NUMBERS = st.floats(-1e3, 1e3)
PLACE = st.tuples(st.integers(0, 2), st.integers(0, 1))
TROUBLE = st.tuples(
    st.sampled_from(["", "", "status", "value", "stop", "ends", "last"]), st.integers(1, 40), st.integers(0, 5)
)
PARTS = st.tuples(st.sampled_from([2, 3]), st.integers(1, 4), st.integers(0, 3), st.sampled_from([True, True, False]))
EFFECTS = st.none() | st.builds(Effect, st.none() | NUMBERS, NUMBERS | st.just(np.nan))
CASES = st.fixed_dictionaries(
    {
        "parts": st.lists(st.tuples(PARTS, TROUBLE).map(lambda two: (*two[0], two[1])), min_size=3, max_size=3),
        "links": st.lists(
            st.tuples(PLACE, PLACE, st.none() | NUMBERS, st.none() | NUMBERS), unique_by=lambda link: link[1]
        ),
        "events": st.lists(st.tuples(PLACE, st.lists(EFFECTS, max_size=3)), max_size=3),
        "watches": st.lists(st.tuples(st.integers(0, 11), NUMBERS, st.booleans()), max_size=2),
        "columns": st.lists(st.integers(0, 11), max_size=12, unique=True).map(sorted),
        "signals": st.integers(0, 1),
        "at_once": st.integers(1, 5),
        "start": NUMBERS,
        "base_step": st.sampled_from([1.0, 0.1, 1e-4 / 3]),
        "count": st.integers(1, 25),
        "decimation": st.integers(1, 4),
        "method": st.sampled_from(["gauss-seidel", "jacobi"]),
        "blocks": st.lists(st.integers(1, 9), min_size=1, max_size=5),
    }
)


@needs_library
@settings(max_examples=80)
@given(case=CASES, is_patient=st.booleans())
def test_loop_makes_the_same_calls_with_the_same_bits(case, is_patient):
    compare_loops(case, is_patient)


@needs_library
@pytest.mark.slow
@settings(max_examples=300)
@given(case=CASES, is_patient=st.booleans())
def test_so_it_does_in_many_more_cases(case, is_patient):
    compare_loops(case, is_patient)


def compare_loops(case, is_patient):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled, "PATIENCE", 0.05 if is_patient else 0.0)
        found = Trial(case).run(in_c)
    assert Trial(case).run(in_python) == found


PLAIN = {
    "parts": [(2, 1, 0, True, ("", 0, 0)), (3, 2, 1, False, ("", 0, 0)), (3, 1, 0, True, ("", 0, 0))],
    "links": [((0, 0), (1, 0), None, None), ((1, 1), (2, 1), 2.0, None)],
    "events": [],
    "watches": [],
    "columns": list(range(12)),
    "signals": 1,
    "at_once": 7,
    "start": 0.5,
    "base_step": 0.1,
    "count": 20,
    "decimation": 3,
    "method": "jacobi",
    "blocks": [20],
}


@pytest.mark.parametrize("advancer", [pytest.param(in_c, marks=needs_library), in_python])
def test_all_base_steps_are_done_and_timed(advancer):
    trial = Trial({**PLAIN, "at_once": 30})
    advance = advancer(trial.work(0))
    assert (advance(0), advance(20)) == (0, 20)
    assert trial.recording.calls == [20, 9, 20] and trial.recording.rows == 7
    assert all(0.0 < seconds < 10.0 for seconds in trial.recording.seconds)
    assert trial.recording.spread.sum(axis=1).tolist() == [20, 9, 20]
    for spread, longest, seconds in zip(trial.recording.spread, trial.recording.longest, trial.recording.seconds):
        last = int(np.flatnonzero(spread)[-1])
        assert bin_edge(last) <= longest < bin_edge(last + 1)
        assert longest <= seconds and 0.0 < median(spread, longest) <= longest
    assert trial.marks[ROWS] == 7 and not np.any(trial.recording.data == -1.0)


@pytest.mark.parametrize("advancer", [pytest.param(in_c, marks=needs_library), in_python])
def test_median_and_longest_step_are_those_of_a_component_that_seldom_takes_long(advancer):
    """Of 20 steps two sleep: the mean is theirs, the median is not."""
    trial = Trial({**PLAIN, "parts": [(2, 1, 0, True, ("", 0, 0))] * 3, "at_once": 30})
    slow = trial.parts[1].instance

    def step(*told):
        sleep(0.05 if trial.marks[STEP] in (7, 8) else 0.0)
        return slow.step(*told)

    slow.entries["DoS"] = DO_STEP[2](step)
    advance = advancer(trial.work(0))
    while advance(20) < 20:
        pass
    own = trial.recording
    assert own.longest[1] >= 0.05 and own.seconds[1] / own.calls[1] >= 0.005 > median(own.spread[1], own.longest[1])
    assert max(own.longest[0], own.longest[2]) < own.longest[1]


@pytest.mark.parametrize("advancer", [pytest.param(in_c, marks=needs_library), in_python])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_python_raises_in_a_step_is_raised(advancer, error):
    trial = Trial(PLAIN)

    def exploding(start):
        raise error("as told")

    advance = advancer(trial.work(0))
    assert advance(0) == 0
    trial.parts[1].instance.doer = lambda duration: exploding
    advance = advancer(trial.work(1))

    with pytest.raises(error, match="as told"):
        while advance(20) < 20:
            pass
    assert trial.recording.rows == trial.marks[ROWS] == 1 and trial.recording.calls == [3, 0, 2]


@needs_library
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_ctrl_c_ends_a_run_in_which_only_c_is_busy():
    forever = 10**15
    trial, done = Trial({**PLAIN, "signals": 0, "decimation": forever}), 0
    trial.parts, trial.player = [], Player([], lambda k: np.empty((forever, 0)))

    def stop():
        trial.marks[STOP] = 1

    advance = in_c(trial.work(0))
    with count_interrupts(then=stop):
        Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
        while not trial.marks[STOP]:
            done = advance(forever)
    assert 0 < done < forever


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
    assert (in_c.run.versions["loop"], in_python.run.versions["loop"]) == ("C", "Python")


ERRORS = """
from gapsense.cosim import FmuError, run
errors = []
for compiled.BINARY in (compiled.BINARY, Path("none.so")):
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
