"""Build and validate the FMU of every folder in fmus/, or of those named, into build/fmus/.

python build_fmus.py [--out FOLDER] [NAME ...]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent


def main(arguments: list[str] | None = None) -> int:
    """Exit code: 0 if every FMU was built and is valid, 1 if one is not, 2 for an unknown name."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="folder in fmus/, or name of an FMU")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "fmus", help="where to write them")
    options = parser.parse_args(arguments)
    from fmpy.validation import validate_fmu

    from gapsense.fmi.package import build, find_components

    try:
        folders = find_components(ROOT / "fmus", options.names)
    except FileNotFoundError as error:
        print(error, file=sys.stderr)
        return 2
    failures = 0
    for folder in folders:
        path = build(folder, options.out)
        problems = validate_fmu(str(path))
        print(f"{path.name:24} {path.stat().st_size / 1024:6.0f} kB  {'valid' if not problems else 'INVALID'}")
        for problem in problems:
            print(f"  {problem}")
        failures += bool(problems)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
