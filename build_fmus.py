"""Build and validate the FMU of every folder in fmus/, or of those named, into build/fmus/.

python build_fmus.py [--out FOLDER] [--parameters FILE ...] [NAME ...]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent


def main(arguments: list[str] | None = None) -> int:
    """Exit code: 0 if every FMU was built and is valid, 1 if one is not, 2 for an unknown name or a wrong value."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="folder in fmus/, or name of an FMU")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "fmus", help="where to write them")
    parser.add_argument("--parameters", type=Path, action="append", default=[], help="TOML file of start values")
    options = parser.parse_args(arguments)
    from fmpy.validation import validate_fmu

    from gapsense.fmi.package import build, find_components

    failures = 0
    try:
        folders = find_components(ROOT / "fmus", options.names)
        values = start_values(options.parameters, folders)
        built = {folder: build(folder, options.out, values[folder]) for folder in folders}
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    for folder, path in built.items():
        problems = validate_fmu(str(path))
        given = f", {len(values[folder])} start values given" if options.parameters else ""
        print(f"{path.name:24} {path.stat().st_size / 1024:6.0f} kB  {'valid' if not problems else 'INVALID'}{given}")
        for problem in problems:
            print(f"  {problem}")
        failures += bool(problems)
    return 1 if failures else 0


def start_values(files: list[Path], folders: list[Path]) -> dict[Path, dict[str, Any]]:
    """Start values for the component of each folder; a ValueError tells everything that is wrong with them."""
    from gapsense.fmi.package import find_components, load_component
    from gapsense.fmi.start_values import unknown_names, with_start_values
    from gapsense.studies.identification.transfer import read_values, values_for

    values = read_values(files) if files else {}
    problems = unknown_names([load_component(folder) for folder in find_components(ROOT / "fmus")], values)
    taken: dict[Path, dict[str, Any]] = {}
    for folder in folders:
        component = load_component(folder)
        taken[folder] = dict(values_for([port.name for port in component.of("parameter")], values))
        try:
            with_start_values(component, taken[folder])
        except ValueError as error:
            problems.append(str(error))
    if problems:
        raise ValueError("\n".join(problems))
    return taken


if __name__ == "__main__":
    sys.exit(main())
