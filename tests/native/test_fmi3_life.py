"""The state machine of FMI 3.0: calls in the wrong order, with wrong references, numbers or bytes are refused."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from native3 import ERROR, Instance, fmu, placed, reference  # noqa: F401

from gapsense.fmi.components import own

SEMERA, DRIVE, EKF = own("semera"), own("drive_voltage"), own("ekf")
H = 50e-6


def one(folder: Path = SEMERA, phase: str = "instantiated") -> Instance:
    """An instance in a phase of its life."""
    instance = Instance(fmu(folder))
    if phase == "configuring":
        instance.slave.enterConfigurationMode()
    if phase in ("initializing", "running", "terminated"):
        instance.slave.enterInitializationMode(startTime=0.0)
    if phase in ("running", "terminated"):
        instance.slave.exitInitializationMode()
    if phase == "terminated":
        instance.slave.terminate()
    return instance


CALLS: dict[str, tuple[Callable[[Instance], tuple[Any, ...]], set[str]]] = {
    "enterConfigurationMode": (lambda i: (), {"instantiated"}),
    "exitConfigurationMode": (lambda i: (), {"configuring"}),
    "enterInitializationMode": (lambda i: (None, 0.0, None), {"instantiated"}),
    "exitInitializationMode": (lambda i: (), {"initializing"}),
    "doStep": (lambda i: (0.0, H), {"running"}),
    "terminate": (lambda i: (), {"running"}),
    "setFloat64": (lambda i: (i.inputs, [0.0] * len(i.inputs)), {"instantiated", "initializing", "running"}),
    "getFloat64": (lambda i: (i.outputs,), {"initializing", "running", "terminated"}),
    "reset": (lambda i: (), {"instantiated", "configuring", "initializing", "running", "terminated"}),
    "getFMUState": (lambda i: (), {"instantiated", "configuring", "initializing", "running", "terminated"}),
}
PHASES = ("instantiated", "configuring", "initializing", "running", "terminated")


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("call", CALLS)
def test_call_is_allowed_in_its_phases_only(call: str, phase: str) -> None:
    instance = one(phase=phase)
    arguments, allowed = CALLS[call]
    if phase in allowed:
        getattr(instance.slave, call)(*arguments(instance))
        assert instance.log == []
        return
    text = instance.refused(call, *arguments(instance))
    assert text.startswith("`one` (Semera)") and f"`{phase}`" in text and "fmi3" in text
    assert "`failed`" in instance.refused("doStep", 0.0, H)
    instance.slave.reset()
    assert instance.run(reference(SEMERA)) == reference(SEMERA).outputs


def test_saved_state_brings_back_a_failed_instance_in_its_phase() -> None:
    for phase in PHASES:
        instance = one(phase=phase)
        data = instance.slave.serializeFMUState(instance.slave.getFMUState())
        other = one()
        other.refused("doStep", 0.0, H)
        other.slave.setFMUState(other.slave.deserializeFMUState(data))
        if phase == "configuring":
            other.slave.exitConfigurationMode()
        elif phase == "running":
            other.slave.doStep(0.0, H)
        else:
            assert f"`{phase}`" in other.refused("doStep", 0.0, H)


@pytest.mark.parametrize("time", [float("nan"), float("inf")])
def test_start_time_must_be_finite(time: float) -> None:
    assert "start time" in one().refused("enterInitializationMode", None, time, None)


def test_jump_is_refused() -> None:
    instance = one(phase="running")
    instance.slave.doStep(0.0, H)
    assert "where it is expected" in instance.refused("doStep", 3.0 * H, H)


@pytest.mark.parametrize(
    ("call", "arguments", "words"),
    [
        ("getFloat64", ([9999],), "no Float64 variable with value reference 9999"),
        ("getFloat64", ([2**32 - 1],), "reference 4294967295"),
        ("setFloat64", ([9999], [1.0]), "no Float64 variable"),
        ("getInt32", ([0],), "no Int32 variable with value reference 0"),
        ("getBoolean", ([0],), "no Boolean variable"),
        ("getString", ([0],), "no String variable"),
        ("getInt64", ([0],), "no Int64 or Enumeration variable"),
        ("getUInt64", ([0],), "no UInt64 variable"),
        ("getUInt8", ([0],), "no UInt8 variable"),
        ("setFloat32", ([0], [1.0]), "no Float32 variable"),
        ("getFloat64", ([0, 1], 3), "these variables have 2 values, but there is room for 3"),
        ("setFloat64", ([0, 1], [1.0]), "these variables have 2 values, but there is room for 1"),
    ],
)
def test_wrong_references_and_counts_are_refused(call: str, arguments: tuple[Any, ...], words: str) -> None:
    assert words in one(phase="initializing").refused(call, *arguments)


def test_nothing_for_no_references() -> None:
    instance = one(phase="running")
    assert instance.slave.getFloat32([]) == instance.slave.getFloat64([]) == []


def test_time_can_be_read_and_outputs_and_time_cannot_be_set() -> None:
    instance = one(phase="running")
    instance.slave.doStep(0.0, H)
    assert instance.get("time") == H
    for name in ("time", "resistance", "predicted_covariance"):
        fresh, count = one(), 4 if name == "predicted_covariance" else 1
        assert f"`{name}` is an output" in fresh.refused("setFloat64", [fresh.fmu[name]], [1.0] * count)


def test_what_is_not_provided_is_told_and_changes_nothing() -> None:
    instance = one(phase="running")
    for call in ("enterEventMode", "updateDiscreteStates"):
        assert "is not provided" in instance.refused(call)
    text = instance.refused("getDirectionalDerivative", [2], [0], [1.0])
    assert "fmi3GetDirectionalDerivative is not provided" in text
    instance.slave.doStep(0.0, H)


def test_choice_is_a_number_and_all_that_is_wrong_is_told_at_once() -> None:
    instance = one(DRIVE)
    assert instance.fmu.variables["waveform"].type == "Enumeration"
    instance.set({"waveform": 3, "pwm.high": -1.0})
    instance.slave.enterInitializationMode(startTime=0.0)
    assert instance.get("waveform") == 3
    instance.set({"waveform": 9})
    assert instance.get("waveform") == 9
    text = instance.refused("exitInitializationMode")
    assert "`waveform` is `9`; expected one of square, step" in text and "`pwm.low`" in text


def test_fixed_parameter_cannot_be_set_in_a_run() -> None:
    instance = one(DRIVE, "running")
    fmu3 = instance.fmu
    assert "`square.period` is fixed" in instance.refused("setFloat64", [fmu3["square.period"]], [1.0])
    instance.slave.reset()
    instance.start()
    assert "`waveform` is fixed" in instance.refused("setInt64", [fmu3["waveform"]], [1])


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [("guid", "{other}", "the GUID `{other}`"), ("unzipDirectory", "/nowhere", "/nowhere/resources")],
)
def test_instantiation_is_refused_with_one_sentence(attribute: str, value: str, words: str) -> None:
    slave, log = one(EKF).slave, []
    setattr(slave, attribute, value)
    with pytest.raises(Exception, match="instantiate"):
        slave.instantiate(loggingOn=False, logMessage=lambda _, status, category, text: log.append(text.decode()))
    (text,) = log
    assert words in text


@pytest.mark.parametrize("is_off_later", [False, True])
def test_error_is_told_even_without_logging(is_off_later: bool) -> None:
    instance = Instance(fmu(EKF), logging=is_off_later)
    if is_off_later:
        instance.slave.setDebugLogging(False, [])
    instance.set({"coil.resistance": -3.0})
    instance.slave.enterInitializationMode()
    assert "`coil.resistance` is -3.0" in instance.refused("exitInitializationMode")


def test_model_exchange_and_scheduled_execution_are_refused() -> None:
    slave, log = Instance(fmu(SEMERA)).slave, []
    kind = type(slave.logMessage)
    keep = kind(lambda _, status, category, text: log.append(text.decode()))
    for name, more in (("ModelExchange", 0), ("ScheduledExecution", 3)):
        function = getattr(slave.dll, f"fmi3Instantiate{name}")
        function.restype = ctypes.c_void_p
        function.argtypes = [
            *[ctypes.c_char_p] * 3,
            ctypes.c_bool,
            ctypes.c_bool,
            ctypes.c_void_p,
            kind,
            *[ctypes.c_void_p] * more,
        ]
        assert function(b"one", slave.guid.encode(), b"", False, False, None, keep, *[None] * more) is None
    assert "co-simulation" in log[0] and "scheduled execution is not provided" in log[1]


def test_bytes_that_are_not_whole_are_refused() -> None:
    instance = one(EKF, "running")
    data = instance.slave.serializeFMUState(instance.slave.getFMUState())
    for wrong in (data[:-8], data + b"\0" * 8, bytes(len(data)), data[:100] + bytes([data[100] ^ 1]) + data[101:]):
        fresh = one(EKF)
        with pytest.raises(FMICallException) as caught:
            fresh.slave.deserializeFMUState(wrong)
        assert caught.value.status == ERROR and len(fresh.log) == 1
