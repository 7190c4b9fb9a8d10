"""Whatever lies in the working folder under the name of a module: no command, nor what it starts, imports it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gapsense._os.native import ZIG
from gapsense.fmi.native import platforms

SCRIPT = [Path(sys.executable).with_name("gapsense")]
MODULE = [sys.executable, "-m", "gapsense"]
NAMES = ("numpy", "csv", "queue", "json", "typing", "signal", "subprocess", "ziglang", "rich", "fmpy", "platform")
STUDY = """
title = "Amplitudes"
scenario = "short"
[grid]
"drive.square.amplitude" = [24.0, 30.0]
"""
COMMANDS = {
    "test": ["test", "."],
    "sweep": ["sweep", "short", "--seeds", "2", "--workers", "1"],
    "campaign": ["campaign", "study.toml", "--workers", "1"],
    "study": ["study", "observability-rts"],
    "long study": ["study", "monte-carlo", "--runs", "2", "--widths", "1", "--workers", "1"],
    "info": ["info", "Sensor"],
}
QUICK = [(MODULE, "test"), (MODULE, "info"), (SCRIPT, "sweep")]
STARTS = [
    pytest.param(start, name, id=f"{name}-{kind}", marks=[] if (start, name) in QUICK else pytest.mark.slow)
    for kind, start in (("script", SCRIPT), ("module", MODULE))
    for name in COMMANDS
]


@pytest.fixture
def shadows(tmp_path):
    """Puts modules into the working folder that leave a mark; tells if one of them was imported."""
    for name in NAMES:
        for file in (tmp_path / f"{name}.py", tmp_path / name / "__init__.py"):
            file.parent.mkdir(exist_ok=True)
            file.write_text('open("PWNED", "w"); raise ImportError("shadowed")\n', encoding="utf-8")
    return tmp_path / "PWNED"


@pytest.mark.parametrize(("start", "command"), STARTS)
def test_command_imports_nothing_from_the_working_folder_and_leaves_no_temporary_files(
    write, fmus, shadows, tmp_path, start, command
):
    write(("bounds = [0.0, 0.01]", "bounds = [0.0, 1.0]"))
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    chosen = [] if "study" in command else ["--fmus", fmus]
    (temporary := tmp_path / "temporary").mkdir()
    words, environment = [*start, *COMMANDS[command], *chosen], {**os.environ, "TMPDIR": str(temporary)}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert not shadows.exists() and not list(temporary.iterdir())


ZIG_PROGRAM = f"""#!{sys.executable} -I
import os, sys
left_out = ("-target", "x86_64-linux-gnu.2.17", "-fno-sanitize=all")
os.execvp("cc", ["cc", *(word for word in sys.argv[2:] if word not in left_out), "-O0"])
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="a script stands in for the compiler")
def test_compiler_of_zig_is_found_without_the_working_folder(gapsense, shadows, tmp_path, monkeypatch):
    about = tmp_path / "site" / f"ziglang-{ZIG}.dist-info" / "METADATA"
    program = tmp_path / "site" / "ziglang" / "zig"
    for file, text in {about: f"Metadata-Version: 2.1\nName: ziglang\nVersion: {ZIG}\n", program: ZIG_PROGRAM}.items():
        file.parent.mkdir(parents=True)
        file.write_text(text, encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.syspath_prepend(about.parents[1])
    assert platforms.compilers("linux64")[0].command[:2] == (str(program), "cc")
    done = gapsense("build", "--native", "--platforms", "linux64", "Semera", "--out", tmp_path / "out")
    assert done.exit_code == 0 and "valid" in done.output, done.output
    assert not shadows.exists()
