"""A component in a process of its own: the same bits, and whatever it does to its process is its failure alone."""

import sys
import zipfile

import numpy as np
import pytest

from gapsense.cosim import FmuError, Master, check, prepare, run, run_once

OWN = 'isolation = "process"\n'
FAULTY = """
title = "A component that fails"
[experiment]
stop = 1.0
base_step = 0.1
step_limit = 1.0
METHOD
[components.lag]
fmu = "Lag"
ISOLATION
[components.coil]
fmu = "Faulty"
set = { fault = "FAULT" }
ISOLATION
[components.noise]
fmu = "Noise"
offset = 2
step = 2
[connect]
"coil.u" = "lag.y"
"lag.u" = "noise.y"
[seeds]
noise = 3
"""


def faulty(fault, isolation=OWN, method=""):
    return FAULTY.replace("FAULT", fault).replace("ISOLATION", isolation).replace("METHOD", method)


@pytest.mark.parametrize("method", ["", 'method = "jacobi"'])
def test_isolated_components_give_the_same_result(write, fmus, method):
    apart = run(write(faulty("warn", method=method)), fmus=fmus)
    here = run(write(faulty("warn", "", method)), fmus=fmus)
    assert all(np.array_equal(apart[name], here[name]) for name in here.signals)
    assert (apart.parameters, apart.messages) == (here.parameters, here.messages)
    assert {n: t.calls for n, t in apart.timing.items()} == {n: t.calls for n, t in here.timing.items()}


@pytest.mark.skipif(sys.platform == "win32", reason="speaks of signals")
@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("exit", "its process ended with exit code 0, in its step."),
        ("segfault", "its process was ended by signal 11 (SIGSEGV, Segmentation fault), in its step."),
        ("hang", "no answer within 1 s, the limit, so its process was ended, in its step."),
        ("discard", "fmi2DoStep returned fmi2Discard; the component says: step too long."),
        ("nan", "output `y` is nan. Look at its inputs and parameters; the component gives no reason."),
    ],
)
def test_component_that_ends_its_process_fails_and_the_run_keeps_its_rows(write, fmus, fault, cause):
    with pytest.raises(FmuError) as caught:
        run(write(faulty(fault)), fmus=fmus)
    error = caught.value
    assert (error.instance, error.time, error.step, error.cause) == ("coil", 0.5, 6, cause)
    good = run(write(faulty("", "")), fmus=fmus)
    assert all(np.array_equal(error.result[name], good[name][:6]) for name in good.signals)


def test_failure_at_the_start_is_that_of_the_component(write, fmus):
    causes = []
    for isolation in (OWN, ""):
        with pytest.raises(FmuError) as caught:
            run(write(faulty("initialization", isolation)), fmus=fmus)
        causes.append(str(caught.value).replace("remote", ""))
    assert causes[0] == causes[1]


def test_component_hangs_before_the_run_does(write, fmus):
    """The component's process is ended first, so that the run can end as it should."""
    with pytest.raises(FmuError, match=r"coil, t = 0.5 s \(base step 6\): no answer within 1 s") as caught:
        run(write(faulty("hang")), fmus=fmus, isolation="process")
    assert caught.value.result.timing["coil"].calls == 5


@pytest.fixture
def single(fmus, tmp_path):
    """FMU of which a process can hold only one instance, by its own words."""
    with zipfile.ZipFile(fmus / "Lag.fmu") as stock, zipfile.ZipFile(tmp_path / "Single.fmu", "w") as changed:
        for name in stock.namelist():
            text = stock.read(name)
            if name == "modelDescription.xml":
                old, new = b"canBeInstantiatedOnlyOncePerProcess=", b'canBeInstantiatedOnlyOncePerProcess="true" was='
                text = text.replace(old, new).replace(b' was="false"', b"").replace(b' was="true"', b"")
                assert text.count(b'canBeInstantiatedOnlyOncePerProcess="true"') == 1
            changed.writestr(name, text)
    return tmp_path


TWO = """
title = "Two of one"
[experiment]
stop = 1.0
base_step = 0.1
[components.one]
fmu = "Single"
[components.two]
fmu = "Single"
ISOLATION
[connect]
"two.u" = "one.y"
[inputs]
"one.u" = 1.0
"""


def test_fmu_for_one_instance_per_process_is_used_twice(write, single):
    assert len(check(write(TWO.replace("ISOLATION", "")), fmus=single)) == 1
    result = run(write(TWO.replace("ISOLATION", OWN)), fmus=single)
    assert result["two.u"].tolist()[1:] == result["one.y"].tolist()[1:]
    assert result["two.y"][-1] > 0.0


TYPES = """
title = "Types"
[experiment]
stop = 0.5
base_step = 0.1
[components.a]
fmu = "Types2"
set = { gain = 3.0, label = "a", shift = 2, law = "On", level = 4.0 }
ISOLATION
[components.b]
fmu = "Types3"
set = { label = "b", law = 3, on = true }
ISOLATION
[connect]
"b.u" = "a.flag_out"
"b.flag" = "a.flag_out"
"b.text" = "a.text_out"
"b.mode" = "a.mode_out"
"b.single" = "a.y"
WIRES
[inputs]
"a.u" = 2.0
"a.flag" = false
"a.text" = "é"
"a.mode" = "Auto"
"a.n" = 5
"""
WIRES = "".join(f'"b.n{sign}Int{bits}" = "a.n_out"\n' for bits in (8, 16, 32, 64) for sign in ("", "U"))


def test_variables_of_all_types_and_both_versions_of_fmi_are_moved(write, foreign):
    results, texts = [], []
    for isolation in (OWN, ""):
        path = write(TYPES.replace("ISOLATION", isolation).replace("WIRES", WIRES))
        with Master(*prepare(path, None, foreign)) as master:
            results.append(run_once(master))
            texts.append(dict(master.texts))
    apart, here = results
    assert all(np.array_equal(apart[name], here[name]) for name in here.signals) and here.signals
    assert apart.parameters == here.parameters and texts[0] == texts[1] and any(texts[0].values())
