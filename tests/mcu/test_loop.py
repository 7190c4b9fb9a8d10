"""Components on a board in a co-simulation: the bits of the FMUs, and what is told when the line is bad."""

from __future__ import annotations

import os
import socket
import struct
import subprocess
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from host import ROOT
from hypothesis import given as drawn
from hypothesis import strategies as st
from loop import built, exported, missing, served, written
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import Checkpoint, FmuError, Result, check, prepare, read_result, run
from gapsense.cosim.fmu.line import decode_cobs, encode_cobs, wrong_program
from gapsense.cosim.run.recording import Subject
from gapsense.embedded.design import make_design
from gapsense.embedded.export import export
from gapsense.report import runs
from gapsense.report.table import text
from gapsense.vectors.engine import obstacle

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"{', '.join(missing())} missing")
COUNT = 200  # base steps
Writer = Callable[..., Path]


@pytest.fixture(scope="module")
def double(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(exported(tmp_path_factory.mktemp("double"), ["sensor", "semera"]))


@pytest.fixture
def write(tmp_path: Path) -> Writer:
    return partial(written, tmp_path)


def same(a: Result, b: Result) -> bool:
    assert a.signals.keys() == b.signals.keys()
    return all(a[name].tobytes() == b[name].tobytes() for name in a.signals)


def test_two_components_on_one_board_have_the_bits_of_the_fmus(double: Path, write: Writer, fmus: Path) -> None:
    with served(double) as board:
        there, here = run(write(board), fmus=fmus), run(write(), fmus=fmus)
    assert same(there, here) and np.ptp(here["semera.resistance"]) > 0.0
    assert there.parameters == here.parameters and not there.run.remarks
    for of in there.run.boards.values():
        assert of["real"] == "double" and {worst for worst, _ in of["difference"].values()} == {0.0}
    assert there.run.boards["semera"]["period"] == 50e-6


def test_float_is_told_by_its_difference(write: Writer, fmus: Path, tmp_path: Path) -> None:
    program = built(exported(tmp_path / "float", ["semera"], "float"))
    with served(program) as board:
        there, here = run(write(board, on=["semera"]), fmus=fmus), run(write(), fmus=fmus)
    assert not same(there, here)
    worst, largest = there.run.boards["semera"]["difference"]["flux_linkage"]
    assert 0.0 < worst < 1e-3 * largest and largest == np.abs(here["semera.flux_linkage"]).max()
    shown = text(*runs.boards(there), width=400)
    row = next(line for line in shown.splitlines() if " semera " in line)
    assert "float" in row and " of " in row
    kept = read_result(there.save(tmp_path / "a.csv"))
    assert kept.run.boards == there.run.boards


class Bad:
    """A line that loses a byte now and then, and changes one."""

    def __init__(self, every: int) -> None:
        self.every, self.passed, self.hit = every, 0, 0

    def __call__(self, data: bytes) -> bytes:
        made = bytearray()
        for byte in data:
            self.passed += 1
            if self.passed % self.every:
                made.append(byte)
                continue
            self.hit += 1
            if self.hit % 2:
                made.append(byte ^ 0x10)
        return bytes(made)


def test_lost_and_damaged_bytes_are_asked_for_again_and_told(double: Path, write: Writer, fmus: Path) -> None:
    to, back = Bad(1009), Bad(1511)
    with served(double, to, back) as board:
        there = run(write(board), fmus=fmus)
    assert to.hit > 5 and back.hit > 5
    assert same(there, run(write(), fmus=fmus))
    first, second = (remark for remark in there.run.remarks if "had to be repeated, the first at t = " in remark)
    assert first.startswith("`sensor`: ") and second.startswith("`semera`: ")
    assert "request damaged" in first + second and "answer damaged" in first + second


def after(count: int, act: Callable[[], None] | None) -> Callable[[bytes], bytes]:
    """A line that does something before it passes on message number `count`, or without that passes on no more."""
    seen = 0

    def treat(data: bytes) -> bytes:
        nonlocal seen
        seen += 1
        if seen == count and act:
            act()
        return data if act or seen < count else b""

    return treat


@pytest.mark.parametrize("what", ["silent", "reset", "unplugged"])
def test_a_board_that_fails_ends_the_run_with_all_rows(what: str, double: Path, write: Writer, fmus: Path) -> None:
    with served(double) as board:
        acts = {"silent": None, "reset": board.restart, "unplugged": board.unplug}
        board.to = after(120, acts[what])
        with pytest.raises(FmuError) as caught:
            run(write(board), fmus=fmus, step_limit=4.0)
    error = caught.value
    words = {"silent": "cannot be asked", "reset": "has been reset", "unplugged": "the line was closed"}
    assert words[what] in str(error) and board.board in str(error)
    assert error.instance in ("sensor", "semera") and error.time is not None and error.time > 1e-3
    rows = error.result.times.size
    assert rows == round(error.time / 50e-6) + 1
    whole = run(write(), fmus=fmus)
    assert all(np.array_equal(error.result[name], whole[name][:rows]) for name in whole.signals)


def test_the_command_ends_with_exit_code_3(double: Path, write: Writer, fmus: Path, tmp_path: Path) -> None:
    with served(double) as board:
        board.to = after(120, board.unplug)
        options = ["--fmus", str(fmus), "--out", str(tmp_path / "out.csv")]
        done = CliRunner().invoke(app, ["run", str(write(board)), *options])
    assert done.exit_code == 3 and "the line was closed" in " ".join(done.output.split())
    assert len((tmp_path / "out.csv").read_text().splitlines()) > 20


def test_a_run_goes_on_from_a_checkpoint(double: Path, write: Writer, fmus: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.checkpoint"
    with served(double) as board:
        path = write(board)
        whole = run(path, fmus=fmus, checkpoint=Checkpoint(file, 5e-3))
        resumed = run(path, fmus=fmus, checkpoint=Checkpoint(file, resume=True))
    assert same(whole, resumed) and same(whole, run(write(), fmus=fmus))
    steps = [of["steps"] for of in (whole.run.boards["semera"], resumed.run.boards["semera"])]
    assert steps == [COUNT, COUNT // 2]


EVENTS = """
[events.stuck]
at = 2e-3
until = 5e-3
target = "semera.current"
action = "stuck"
[events.cold]
at = 4e-3
target = "semera.voltage"
action = "bias"
value = 1.5
"""


def test_faults_act_on_it(double: Path, write: Writer, fmus: Path) -> None:
    with served(double) as board:
        there, here = run(write(board, EVENTS), fmus=fmus), run(write("", EVENTS), fmus=fmus)
    assert same(there, here) and not np.array_equal(here["semera.current"], run(write(), fmus=fmus)["semera.current"])


def test_a_serial_port_is_a_line_too(double: Path, write: Writer, fmus: Path) -> None:
    own, other = os.openpty()
    program = subprocess.Popen([str(double)], stdin=own, stdout=own)
    try:
        there = run(write(f"serial:{os.ttyname(other)}:921600"), fmus=fmus)
    finally:
        program.kill()
        program.wait()
        os.close(own)
        os.close(other)
    assert same(there, run(write(), fmus=fmus))


def test_other_numbers_in_the_code_are_refused(write: Writer, fmus: Path, tmp_path: Path) -> None:
    program = built(exported(tmp_path / "baked", ["sensor", "semera"], is_baked=True))
    with served(program) as board, pytest.raises(FmuError, match="other tables or constants in its code"):
        run(write(board), fmus=fmus)


def test_baked_numbers_are_taken_if_they_are_those_of_the_scenario(write: Writer, fmus: Path, tmp_path: Path) -> None:
    given = {"sensor": {"sample_time": 50e-6, "noise.current": 2e-3, "seed": 3}}
    given["semera"] = {"sample_time": 50e-6, "coil.turns": 1140.0}
    folder = tmp_path / "baked"
    designs = [make_design(ROOT / "fmus" / name, "double", (), values, True) for name, values in given.items()]
    export(designs, folder, in_loop=True)
    with served(built(folder)) as board:
        there = run(write(board), fmus=fmus)
    assert same(there, run(write(), fmus=fmus))


def test_an_output_that_is_missing_and_read_is_told(write: Writer, fmus: Path, tmp_path: Path) -> None:
    program = built(exported(tmp_path / "few", ["semera"], outputs=("resistance",)))
    with served(program) as board:
        path = write(board)
        with pytest.raises(FmuError, match="has no `Sensor`"):
            run(path, fmus=fmus)
        path = write(board, on=["semera"])
        with pytest.raises(FmuError, match=r"has no output .*, which is connected or recorded"):
            run(path, fmus=fmus)
        path.write_text(path.read_text() + '[record]\nsignals = ["semera.resistance"]\n')
        there = run(path, fmus=fmus)
    assert np.array_equal(there["semera.resistance"], run(write(), fmus=fmus)["semera.resistance"])


@pytest.mark.parametrize(
    ("board", "words"),
    [
        ("usb:1", "`qemu:<machine>`, `serial:<device>[:<baud>]` or `tcp:<host>:<port>` expected"),
        ("tcp:localhost", "a port at its end expected"),
        ("tcp:localhost:99999", "a port at its end expected"),
        ("qemu:mps2-an386", "QEMU needs a file"),
        ('qemu:mps2-an386"\nfirmware = "no.elf', "there is no file"),
        ('serial:/dev/null"\nfirmware = "no.elf', "QEMU alone loads it"),
        ('tcp:localhost:1"\nisolation = "process', "a board is apart already"),
    ],
)
def test_check_finds_what_is_wrong_with_a_board(board: str, words: str, write: Writer, fmus: Path) -> None:
    problems = check(write(board), fmus=fmus)
    assert len(problems) == 2 and all(words in problem and "components.s" in problem for problem in problems)


@pytest.mark.parametrize("content", [b"", b"/* main.c */", b"\x7fELF\x01" + bytes(60)], ids=len)
def test_a_firmware_that_is_none_is_found(content: bytes, write: Writer, fmus: Path, tmp_path: Path) -> None:
    """QEMU loads anything, and dies with a page of registers or does nothing."""
    (tmp_path / "no.elf").write_bytes(content)
    problems = check(write(f'qemu:mps2-an386"\nfirmware = "{tmp_path / "no.elf"}'), fmus=fmus)
    assert len(problems) == 2 and all("is no ELF file for 32-bit Arm. Build it" in problem for problem in problems)


def test_a_firmware_that_is_cut_off_is_found(tmp_path: Path) -> None:
    whole = struct.pack("<5s13xH8xI10xHH8x", b"\x7fELF\x01", 40, 52, 32, 1) + struct.pack("<4xI8xI12x", 84, 9)
    for end, words in ((93, ""), (92, "ends after 92 bytes"), (60, "ends after 60 bytes")):
        (tmp_path / "a.elf").write_bytes((whole + bytes(9))[:end])
        assert wrong_program(tmp_path / "a.elf").startswith(words) and bool(words) == (end < 93)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (lambda heard: heard, "answers with 0 bytes, 28 expected"),
        (lambda heard: bytes(1 << 16), "tried 5 times within .* no answer"),
        (lambda heard: b"\1" * (1 << 16), "tried 5 times within .* no answer"),
        (lambda heard: b"HTTP/1.1 400 Bad Request\r\n\r\n\0", "tried 5 times within .* answer damaged"),
    ],
    ids=["echo", "zeros", "ones", "other"],
)
def test_what_listens_and_is_no_board_is_told(
    said: Callable[[bytes], bytes], words: str, write: Writer, fmus: Path
) -> None:
    """An endless answer was waited for for ever; an echo was an error of `struct`."""
    listening = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        line = listening.accept()[0]
        with suppress(OSError):
            while heard := line.recv(4096):
                for _ in range(1 if len(said(heard)) < 4096 else 10_000):
                    line.sendall(said(heard))

    Thread(target=answer, daemon=True).start()
    place = f"tcp:127.0.0.1:{listening.getsockname()[1]}"
    with listening, pytest.raises(FmuError, match=words + r".*It needs the program of `export-c --loop`\."):
        run(write(place), fmus=fmus, step_limit=0.4)


def test_firmware_of_a_variant_may_be_built_later(fmus: Path) -> None:
    scenario = ROOT / "scenarios" / "firmware"
    assert check(scenario, fmus=fmus) == []
    problems = check(scenario, "board", fmus)
    assert len(problems) == 2 and all("there is no file" in problem and "`make`" in problem for problem in problems)


def test_a_board_that_is_not_there_is_told(write: Writer, fmus: Path, tmp_path: Path) -> None:
    for board in ("tcp:127.0.0.1:1", f"serial:{tmp_path / 'tty'}"):
        with pytest.raises(FmuError, match=r"sensor: the board .* cannot be reached"):
            run(write(board), fmus=fmus)


def test_vectors_and_packages_of_other_tools_know_no_boards(write: Writer, fmus: Path, tmp_path: Path) -> None:
    path = write("tcp:127.0.0.1:1")
    assert obstacle(Subject(*prepare(path, fmus=fmus))) == "A component is on a board (`board`)."
    options = ["--fmus", str(fmus), "--out", str(tmp_path / "a.ssp")]
    done = CliRunner().invoke(app, ["export-ssp", str(path), *options])
    said = " ".join(done.output.split())
    assert done.exit_code == 0 and "board of `sensor`, `semera`: it is left out; the FMU runs in its place." in said


def test_a_page_refuses_it(write: Writer, fmus: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["page", str(write("tcp:127.0.0.1:1")), "--fmus", str(fmus), "--out", str(tmp_path / "a.html")]
    )
    assert done.exit_code == 2 and "run on boards" in " ".join(done.output.split())


@drawn(st.lists(st.one_of(st.binary(max_size=9), st.integers(1, 600).map(lambda n: b"\x01" * n))).map(b"".join))
def test_messages_survive_their_encoding(message: bytes) -> None:
    assert b"\0" not in encode_cobs(message)[:-1] and encode_cobs(message)[-1:] == b"\0"
    assert decode_cobs(encode_cobs(message)[:-1]) == message


def test_a_board_of_the_user_is_kept(tmp_path: Path) -> None:
    folder = exported(tmp_path, ["semera"])
    (folder / "qemu.c").write_text("/* mine */\n")
    done = CliRunner().invoke(app, ["export-c", "semera", "--loop", "--out", str(folder)])
    assert done.exit_code == 2 and "qemu.c" in done.output


DRIVE = """
title = "A drive"
[experiment]
stop = 6e-3
base_step = 30e-6
[components.drive]
fmu = "DriveVoltage"
{more}
[components.drive.set]
waveform = "{waveform}"
"square.period" = 1e-3
"step.time" = 1.01e-3
[inputs]
"drive.enable" = 1.0
"drive.reference" = 0.0
"""


@pytest.mark.parametrize("folder", [".", "fmi3"])
def test_choices_and_tables_are_those_of_either_version_of_fmi(folder: str, natives: Path, tmp_path: Path) -> None:
    """Also of a component that has no sample time."""
    program, file, found = built(exported(tmp_path / "board", ["drive_voltage"])), tmp_path / "scenario.toml", []
    with served(program) as board:
        for waveform in ("square", "soft_landing", "step"):
            for more in ("", f'board = "{board.board}"'):
                file.write_text(DRIVE.format(more=more, waveform=waveform))
                found.append(run(file, fmus=natives / folder))
    assert all(same(there, here) for here, there in zip(found[::2], found[1::2]))
    assert len({result["drive.voltage"].tobytes() for result in found}) == 3
