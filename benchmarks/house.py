"""What the code weighs, and what one has to open to follow three walks through it, beside the figures it began with.

python benchmarks/house.py

(a) a parameter from its TOML file to the kernel and through a run; (b) a current through the kernel of `Mhe`; (c) a run
of a campaign. A module counts if one of its functions was called, and is found while the program runs.
"""

from __future__ import annotations

import ast
import io
import sys
import tempfile
import threading
import tokenize
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "repository"))
from sources import circles  # noqa: E402

SRC = ROOT / "src" / "gapsense"
FORMER = {  # at the end of the second round of work
    "lines of Python": 50_562,
    "modules": 465,
    "modules in circles": 52,
    "(a) a parameter through a run": 34,
    "(b) a current through Mhe": 11,
    "(c) a run of a campaign": 73,
}
AIMS = {**dict.fromkeys(FORMER, 0), "lines of Python": 38_000, "modules": 300}
AIMS |= {"(a) a parameter through a run": 18, "(b) a current through Mhe": 8, "(c) a run of a campaign": 45}
SCENARIO = """
title = "One valve"
[experiment]
stop = 1e-3
base_step = 25e-6
[components.valve]
fmu = "SolenoidValve"
parameters = ["valve.toml"]
[inputs]
"valve.voltage" = 24.0
[metrics.least]
kind = "min"
signal = "valve.position"
"""
STUDY = """
title = "Dampings"
scenario = "scenario.toml"
[grid]
"valve.damping" = [0.2, 0.4]
"""


def main() -> None:
    """Print the table."""
    files = sorted(SRC.rglob("*.py"))
    found = {
        "lines of Python": sum(len(file.read_text("utf-8").splitlines()) for file in files),
        "modules": len(files),
        "modules in circles": sum(map(len, circles())),
    }
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
        (Path(folder) / "valve.toml").write_text("[values]\ndamping = 0.4\n", encoding="utf-8")
        (Path(folder) / "study.toml").write_text(STUDY, encoding="utf-8")
        walks = {
            "(a) a parameter through a run": walked(lambda: run(Path(folder))),
            "(b) a current through Mhe": walked(trace_mhe),
            "(c) a run of a campaign": walked(lambda: campaign(Path(folder))),
        }
    found |= {name: len({file for file, _ in functions}) for name, functions in walks.items()}
    print("| what | former | now | aim |\n| --- | --- | --- | --- |")
    print(f"| of the lines, code | - | {sum(map(code, files)):,} | - |")
    for name, value in found.items():
        more = f", {len(walks[name])} functions" if name in walks else ""
        print(f"| {name} | {FORMER[name]:,} | {value:,}{more} | {AIMS[name]:,} |")


def code(file: Path) -> int:
    """Lines that are neither blank nor comment nor docstring."""
    text, lines = file.read_text("utf-8"), set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.NAME, tokenize.NUMBER, tokenize.STRING, tokenize.OP):
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            lines.difference_update(range(node.body[0].lineno, node.body[0].end_lineno + 1))  # type: ignore[operator]
    return len(lines)


def run(folder: Path) -> None:
    """A run of a scenario with a parameter-set file."""
    from gapsense import cosim

    cosim.run(folder, fmus=ROOT / "build" / "fmus")


def trace_mhe() -> None:
    """The kernel of `Mhe`, called with symbols."""
    from gapsense.estimators.mhe import mhe
    from gapsense.kernels.kernel import Kernel

    Kernel(mhe).trace()


def campaign(folder: Path) -> None:
    """A campaign of two runs, with the default engine."""
    from gapsense import campaign

    out = tempfile.mkdtemp(dir=folder)  # another one each time, for what is there is not run again
    campaign(folder / "study.toml", 1, out, ROOT / "build" / "fmus")


def walked(walk: Callable[[], None]) -> set[tuple[str, str]]:
    """Functions of ours, by file and name, that a walk calls; what it takes to import and compile does not count."""
    with noted() as found:
        walk()  # imports, and compiles what is to be compiled
        found.clear()
        walk()
    return found


@contextmanager
def noted() -> Iterator[set[tuple[str, str]]]:
    """The functions of ours that are called meanwhile, in all threads."""
    found: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _: Any) -> None:
        """Note a call of ours."""
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(SRC)) and code.co_name[0] != "<":
            found.add((code.co_filename, code.co_name))

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        yield found
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
