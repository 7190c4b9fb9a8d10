"""What is no file, or no table, is refused with a sentence: it is not read for ever, and nobody sees what it holds."""

import os
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense._os.files import read_bytes
from gapsense.cli import app
from gapsense.cosim import check

SECRET = "hunter2"
CONTENTS = {
    "passwd": f"root:{SECRET}:0:0:root:/root:/bin/bash\nbin:x:1:1:bin:/bin:/sbin\n",
    "commas": f"# {SECRET}, {SECRET}x\nuser, {SECRET}\nother, {SECRET}\n",
    "twice": f"{SECRET},{SECRET}\nuser,{SECRET}\n",
    "token": f"{SECRET}\n",
    "dotted": f"{SECRET}.{SECRET}\n{SECRET}.{SECRET}\n",
    "key": f"-----BEGIN KEY-----\n{SECRET}\n{SECRET}\n-----END KEY-----\n",
    "setting": f"key = {SECRET}\n",
    "semicolons": f"a;{SECRET}\nb;{SECRET}\n",
}
PLACES = {"rows": '[sweep]\nrows = "{}"\n', "signal": '[inputs.gain.u]\nfile = "{}"\ncolumn = "y"\n', "parameters": ""}


def scenario(write, chain: str, place: str, file: object) -> Path:
    """A scenario that names the file there."""
    if place == "parameters":
        return write(chain.replace('fmu = "Lag"', f'fmu = "Lag"\nparameters = ["{file}"]'))
    text = chain if place == "rows" else chain[: chain.rindex("[[connections]]")]
    return write(text + PLACES[place].format(file))


def made(kind: str, folder: Path) -> Path:
    """Something that is no file."""
    path = folder / kind
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as opened:
            opened.bind(str(path))
    elif kind == "folder":
        path.mkdir()
    elif kind == "large":
        with path.open("wb") as file:
            file.truncate(10**11)
    elif kind == "link":
        path.symlink_to("/dev/zero")
    else:
        path = Path("/dev") / kind
    return path


KINDS = ["pipe", "socket", "folder", "large", "link", "zero", "stdin", "random"]


@pytest.fixture
def short(monkeypatch, tmp_path) -> Path:
    """The working folder, so that a socket has a short name."""
    monkeypatch.chdir(tmp_path)
    return Path()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_file_is_refused_before_it_is_read(write, chain, fmus, short, place, kind):
    path = made(kind, short).absolute()
    found = check(scenario(write, chain, place, path), fmus=fmus)
    told = [problem for problem in found if str(path) in problem]
    assert len(told) == 1 and ("a file is expected" in told[0] or "too large" in told[0]), found


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "command",
    [
        ("check", "{}"),
        ("run", "{}"),
        ("compare", "{}", "{}"),
        ("report", "{}"),
        ("identify", "{}"),
        ("inspect", "{}"),
        ("figure", "{}.csv"),
        ("compare", "{}.csv", "{}.csv"),
    ],
)
def test_commands_refuse_it_too(short, kind, command):
    path = made(kind, short).absolute()
    link = short / f"{kind}.csv"
    link.symlink_to(path)
    given = str(link.with_suffix("")) if any("csv" in word for word in command) else str(path)
    done = CliRunner().invoke(app, [word.format(given) for word in command])
    assert done.exit_code == 2 and isinstance(done.exception, SystemExit), done.output
    assert "Traceback" not in done.output


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("place", PLACES)
def test_file_that_is_no_table_is_not_quoted(write, chain, fmus, tmp_path, place, content):
    file = tmp_path / "stranger"
    file.write_text(CONTENTS[content])
    told = "\n".join(check(scenario(write, chain, place, file), fmus=fmus))
    assert str(file) in told or file.name in told
    assert SECRET not in told


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("command", [("identify",), ("inspect",), ("compare", "{}"), ("report",), ("check",)])
def test_commands_do_not_quote_it_either(tmp_path, content, command):
    file = tmp_path / "stranger.csv"
    file.write_text(CONTENTS[content])
    done = CliRunner().invoke(app, [command[0], str(file), *(word.format(file) for word in command[1:])])
    assert done.exit_code == 2 and isinstance(done.exception, SystemExit), done.output
    assert SECRET not in done.output


def test_misspelt_head_of_a_table_is_still_named(write, chain, fmus, tmp_path):
    (tmp_path / "rows.csv").write_text("source.slop,gain.gain\n1.0,2.0\n")
    assert "slop" in "\n".join(check(scenario(write, chain, "rows", tmp_path / "rows.csv"), fmus=fmus))


def test_file_of_the_system_without_a_size_is_read_up_to_the_limit(tmp_path):
    assert read_bytes(Path("/proc/self/status"))
    with pytest.raises(OSError, match="too large"):
        read_bytes(Path("/proc/self/status"), most=10)
