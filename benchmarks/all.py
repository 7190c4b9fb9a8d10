"""All benchmarks one after the other, and at the end which bounds were missed: `python benchmarks/all.py [--small]`.

Each is a process of its own. A line that begins with `Missed:` says that a bound was missed, which fails nothing: the
machine may have been busy. Exit code 1 if a benchmark did not run to its end; the others run all the same.
`--small` measures as little as each allows, to see that all of them still run.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from bounds import MISSED

HERE = Path(__file__).resolve().parent
SMALL = {  # options of each that make it small
    "runner.py": ("--repeats", "1"),
    "filters.py": (),
    "identify.py": ("--records", "1", "--periods", "3.8"),
    "campaign.py": ("--only-rows", "--rows", "3000"),
    "native.py": ("Semera",),
    "coupling.py": ("--small",),
    "whole.py": ("--seeds", "0", "--repeats", "1", "--runs", "1"),
    "run_to_run.py": ("--times", "1"),
    "mcu.py": ("--only", "drive_voltage"),
    "house.py": (),
}


def main() -> int:
    """Run them, then say what was missed and what broke."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="measure as little as each allows")
    is_small = parser.parse_args().small
    missed: list[str] = []
    broken: list[str] = []
    for name, small in SMALL.items():
        print(f"\nbenchmarks/{name}", flush=True)
        code, lines = run([name, *(small if is_small else ())])
        missed += [f"{name}: {line.removeprefix(MISSED).strip()}" for line in lines if line.startswith(MISSED)]
        broken += [f"{name}: ended with exit code {code}"] if code else []
    print("\nBounds missed:", *(missed or ["none"]), sep="\n  ")
    if broken:
        print("Benchmarks that did not run to their end:", *broken, sep="\n  ")
    return 1 if broken else 0


def run(words: list[str]) -> tuple[int, list[str]]:
    """Exit code and lines of a benchmark, which are printed as they come."""
    command = [sys.executable, str(HERE / words[0]), *words[1:]]
    with subprocess.Popen(command, cwd=HERE.parent, stdout=subprocess.PIPE, text=True, encoding="utf-8") as process:
        lines = []
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line)
    return process.returncode, lines


if __name__ == "__main__":
    sys.exit(main())
