"""The line to a board that is a component: emulated by QEMU, at a serial port or at a TCP port, and its messages.

The protocol is that of `embedded/loop/loop.c`.  A request that was lost or damaged is sent again under the same number,
which the board does not do twice.
"""

from __future__ import annotations

import os
import select
import shutil
import socket
import struct
import subprocess
import tempfile
from pathlib import Path
from time import monotonic
from zlib import crc32

HELLO, ABOUT, SET, START, STEP, SAVE, LOAD = range(7)
DONE, DAMAGED, UNKNOWN, NOT_STARTED, OTHER_NUMBERS = range(5)
REASONS = {
    UNKNOWN: "does not know what it is asked for. Export its firmware again",
    NOT_STARTED: "has been reset and has forgotten all. Look at its supply and its watchdog",
    OTHER_NUMBERS: "has other tables or constants in its code. Export its firmware with the parameters of the scenario",
}
VERSION = 1
WAITS = (0.5, 1.0, 2.0, 4.0, 8.0)  # s, for one answer after the other
ELF, PART, ARM = struct.Struct("<5s13xH8xI10xHH"), struct.Struct("<4xI8xI"), 40  # first, size and number of parts
QEMU = "qemu-system-arm"
BAUD = 115200
LOOK = 0.2  # s between two looks at whether QEMU is still there
EMULATED = ("-display", "none", "-monitor", "none", "-serial", "none", "-icount", "shift=5", "-semihosting")
LONGEST = 1 << 17  # bytes of a message, and more than any has
REMEDIES = {  # by kind: if the board cannot be reached, and if the answer is not that of a board
    "qemu": (
        "Look at the machine and the firmware",
        "Build its firmware for this machine, as `make CPU=cortex-m3` does",
    ),
    "serial": (
        "Plug it in, and see whether you may use the device",
        "It needs the program of `export-c --loop`, and the line the same baud",
    ),
    "tcp": ("Start what listens there", "It needs the program of `export-c --loop`"),
}
PLACES = "`qemu:<machine>`, `serial:<device>[:<baud>]` or `tcp:<host>:<port>` expected"


class BoardError(RuntimeError):
    """A board cannot be reached, or does not do what it is asked for; the message is a sentence without its end."""


def wrong_board(board: str, firmware: Path | None) -> str:
    """What is wrong with the place of a board, or nothing; the board itself is not asked."""
    kind, _, place = board.partition(":")
    if kind not in ("qemu", "serial", "tcp") or not place:
        return f"board: `{board}` found, {PLACES}. Correct it."
    port = place.rpartition(":")[2]
    if kind == "tcp" and not (port.isdecimal() and int(port) < 1 << 16):
        return f"board: `{board}` found, a port at its end expected. Correct it."
    if kind != "qemu":
        return "firmware: QEMU alone loads it, a board has its own already. Leave it out." if firmware else ""
    if firmware is None:
        return "firmware: missing; QEMU needs a file. Make one with `gapsense export-c ... --loop`, and `make`."
    return ""


def absent(board: str, firmware: Path | None) -> str:
    """What a run with a board needs and this computer has not, or nothing."""
    if os.name != "posix":
        return "board: boards need Linux or macOS. Leave it out."
    if not board.startswith("qemu:") or firmware is None:
        return ""
    if not firmware.is_file():
        return f"firmware: there is no file `{firmware}`. Make it with `gapsense export-c ... --loop`, and `make`."
    if problem := wrong_program(firmware):
        return f"firmware: `{firmware}` {problem}. Build it again with `make`."
    return (
        "" if shutil.which(QEMU) else f"board: `{QEMU}` is not installed. Install QEMU for ARM, or leave `board` out."
    )


def wrong_program(file: Path) -> str:
    """What is wrong with an ELF file for Arm, or nothing: QEMU loads anything."""
    try:
        content = file.read_bytes()
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    if len(content) < ELF.size or ELF.unpack_from(content)[:2] != (b"\x7fELF\x01", ARM):
        return "is no ELF file for 32-bit Arm"
    _, _, first, size, count = ELF.unpack_from(content)
    parts = [content[first + k * size :][: PART.size] for k in range(count)]
    is_whole = all(len(part) == PART.size and sum(PART.unpack(part)) <= len(content) for part in parts)
    return "" if is_whole else f"ends after {len(content):,} bytes, before its parts do"


class Line:
    """Bytes to and from a board."""

    def __init__(self, board: str, firmware: Path | None) -> None:
        self.board, self.files = board, list[int]()
        self.process: subprocess.Popen[bytes] | None = None
        self.folder = Path(tempfile.mkdtemp(prefix="gapsense-board-"))
        kind, _, place = board.partition(":")
        try:
            if kind == "qemu":
                self.emulate(place, firmware)
            else:
                self.files = [serial(place) if kind == "serial" else connect_to(place).detach()]
        except (OSError, ImportError, ValueError) as error:
            self.close()
            why = getattr(error, "strerror", None) or error
            raise BoardError(f"cannot be reached: {why}. {REMEDIES[kind][0]}") from error

    def emulate(self, machine: str, firmware: Path | None) -> None:
        """Let QEMU emulate a machine; two pipes in its folder are the line, and it ends when they are closed."""
        for name in ("line.out", "line.in"):
            os.mkfifo(self.folder / name)
            self.files.append(os.open(self.folder / name, os.O_RDWR | os.O_CLOEXEC))
        with (self.folder / "errors.txt").open("wb") as errors:
            self.process = subprocess.Popen(
                (QEMU, "-M", machine, *EMULATED, "-kernel", str(firmware and firmware.resolve())),
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
            )

    def write(self, data: bytes) -> None:
        """Send all of this."""
        try:
            while data:
                data = data[os.write(self.files[-1], data) :]
        except OSError as error:
            raise self.gone() from error

    def read(self, wait: float) -> bytes:
        """What has come, nothing after so many seconds."""
        until = monotonic() + wait
        try:
            while not select.select(self.files[:1], [], [], max(0.0, min(LOOK, until - monotonic())))[0]:
                if self.process and self.process.poll() is not None:
                    raise self.gone()
                if monotonic() >= until:
                    return b""
            found = os.read(self.files[0], 65536)
        except OSError as error:
            raise self.gone() from error
        if not found:
            raise self.gone()
        return found

    def gone(self) -> BoardError:
        """That there is no line any more, and what QEMU says."""
        if not self.process:
            return BoardError("is gone: the line was closed. Plug it in")
        said = (self.folder / "errors.txt").read_text(errors="replace")
        words = " ".join(said.partition("\nR00=")[0].split())  # without the registers
        return BoardError(f"is gone: QEMU ended with {self.process.poll()}{words and f' and says: {words}'}")

    def close(self) -> None:
        """Close the line, and end QEMU."""
        if self.process:
            self.process.kill()
            self.process.wait()
        while self.files:
            os.close(self.files.pop())
        shutil.rmtree(self.folder, ignore_errors=True)


def connect_to(place: str) -> socket.socket:
    """Open a line to `host:port`."""
    host, _, port = place.rpartition(":")
    made = socket.create_connection((host.strip("[]"), int(port)), timeout=5.0)
    made.settimeout(None)
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return made


def serial(place: str) -> int:
    """A serial port, opened: 8 bits, no parity, nothing changed on the way."""
    import fcntl  # these are not on Windows
    import termios
    import tty

    device, _, last = place.rpartition(":")
    device, baud = (device, int(last)) if device and last.isdecimal() else (place, BAUD)
    if (speed := getattr(termios, f"B{baud}", None)) is None:
        raise ValueError(f"a serial port has no {baud} baud here")
    file = os.open(device, os.O_RDWR | os.O_NOCTTY)
    fcntl.ioctl(file, termios.TIOCEXCL)  # a board answers one program
    tty.setraw(file)
    settings = termios.tcgetattr(file)
    settings[2] |= termios.CLOCAL
    settings[4] = settings[5] = speed
    termios.tcsetattr(file, termios.TCSANOW, settings)
    termios.tcflush(file, termios.TCIOFLUSH)
    return file


# Messages: a head, data, CRC-32, as COBS with a zero at the end.


HEAD = struct.Struct("<BBHH")
HELLO_SIZE = 28  # bytes


def encode_cobs(message: bytes) -> bytes:
    """Encode without zeros, with a zero at the end: each run of others stands behind its length + 1."""
    made = bytearray()
    for run in message.split(b"\0"):
        while len(run) >= 254:
            made += b"\xff" + run[:254]
            run = run[254:]
        made += bytes((len(run) + 1,)) + run
    return bytes(made) + b"\0"


def decode_cobs(frame: bytes) -> bytes | None:
    """Decode what came before a zero; None if it is damaged."""
    made, at, size = bytearray(), 0, len(frame)
    while at < size:
        code = frame[at]
        made += frame[at + 1 : at + code]
        at += code
        if code < 255 and at < size:
            made.append(0)
    return bytes(made) if at == size else None


def unpack_message(message: bytes | None) -> tuple[int, int, bytes] | None:
    """Return what stands first, the sequence and the data; None if the message is damaged."""
    if message is None or len(message) < HEAD.size + 4:
        return None
    first, _, sequence, size = HEAD.unpack_from(message)
    body, sums = message[:-4], message[-4:]
    is_whole = len(body) == HEAD.size + size and struct.unpack("<I", sums)[0] == crc32(body)
    return (first, sequence, body[HEAD.size :]) if is_whole else None


class Link:
    """Requests to a board; `limit` [s] bounds how long all tries of one may take."""

    def __init__(self, board: str, firmware: Path | None, limit: float) -> None:
        self.waits = [min(wait, limit / 8.0) for wait in WAITS]
        self.line, self.sequence, self.came = Line(board, firmware), 0, b""
        self.troubles: list[str] = []  # of the last request, for which it had to be repeated
        self.is_lost = False  # the board no longer answers
        self.is_known = False  # it has answered as a board does
        try:
            self.line.write(b"\0")  # the end of what another program may have begun
            self.hello()
        except BaseException as error:
            self.line.close()
            if isinstance(error, BoardError) and not self.is_known:
                raise BoardError(f"{error}. {REMEDIES[board.partition(':')[0]][1]}") from error
            raise

    def hello(self) -> None:
        """Learn what the board is, and how much of its memory is used."""
        answer = self.ask(HELLO)
        if len(answer) != HELLO_SIZE:
            raise BoardError(f"answers with {len(answer)} bytes, {HELLO_SIZE} expected")
        self.is_known, facts = True, struct.unpack("<7I", answer)
        version, self.most, self.size, self.count, self.flash, self.ram, self.stack = facts
        if version != VERSION:
            raise BoardError(f"speaks version {version} of the protocol, {VERSION} expected. Export its firmware again")

    def ask(self, what: int, component: int = 0, data: bytes = b"") -> bytes:
        """The data of the answer; a BoardError if there is none, or if the board refuses."""
        self.sequence, self.is_lost = (self.sequence + 1) & 0xFFFF, True
        self.troubles.clear()
        body = HEAD.pack(what, component, self.sequence, len(data)) + data
        message = encode_cobs(body + struct.pack("<I", crc32(body)))
        for wait in self.waits:
            self.line.write(message)
            if (answer := self.answer(wait)) is not None:
                result, found = answer
                self.is_lost = False
                if result != DONE:
                    raise BoardError(REASONS.get(result, f"answers with {result}, which is unknown"))
                return found
            message = b"\0" + message.lstrip(b"\0")
        tried = f"{len(self.waits)} times within {sum(self.waits):g} s"
        raise BoardError(f"cannot be asked, tried {tried}: {', '.join(dict.fromkeys(self.troubles))}")

    def answer(self, wait: float) -> tuple[int, bytes] | None:
        """Result and data of the answer to the last request, or None with the trouble noted."""
        until = monotonic() + wait
        while True:
            frame, end, rest = self.came.lstrip(b"\0").partition(b"\0")
            if end:
                self.came, found = rest, unpack_message(decode_cobs(frame))
                if found is None or found[0] == DAMAGED:
                    self.troubles.append("answer damaged" if found is None else "request damaged")
                    return None
                if found[1] == self.sequence:
                    return found[0], found[2]  # other answers belong to requests that were repeated
            if monotonic() >= until or len(frame) > LONGEST:
                self.came = b"" if len(frame) > LONGEST else self.came
                self.troubles.append("no answer")
                return None
            if not end:
                self.came = frame + self.line.read(until - monotonic())

    def whole(self, what: int, component: int, begin: int = 0, count: int | None = None) -> bytes:
        """Everything that the board has from an offset on, `count` bytes or all, in as many requests as that takes."""
        found = b""
        while count is None or len(found) < count:
            if not (part := self.ask(what, component, struct.pack("<I", begin + len(found)))):
                break
            found += part
        return found
