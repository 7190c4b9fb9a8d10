"""FMUs for loops between components, made of `coupled.c`; tests and benchmarks/coupling.py use them."""

import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
NO_VALUES: Mapping[str, float] = {}
HEADERS = Path(find_spec("fmpy").origin).parent / "c-code"
OPTIONS = ("-std=gnu11", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror")
# Name, causality, start, unit, nominal value: in the order of `coupled.c`.
MODELS = {
    "Node": [
        ("u", "input", 0, "V", 1),
        ("v", "input", 0, "V", 1),
        ("y", "output", 0, "V", 1),
        *((name, "parameter", 0, "", 1) for name in ("bias", "gain", "share", "bend", "lazy")),
        ("least", "parameter", -1e300, "", 1),
        ("noise", "parameter", 0, "", 1),
    ],
    "Mass": [
        ("force", "input", 0, "N", 1),
        ("x", "output", 0, "m", 1e-2),
        ("speed", "output", 0, "m/s", 1e-1),
        ("speed_mean", "output", 0, "m/s", 1e-1),
        *((n, "parameter", s, "", 1) for n, s in (("m", 1), ("d", 0), ("k", 0), ("x0", 0), ("parts", 100))),
    ],
    "Spring": [
        ("x", "input", 0, "m", 1e-2),
        ("speed", "input", 0, "m/s", 1e-1),
        ("force", "output", 0, "N", 1),
        ("x2", "output", 0, "m", 1e-2),
        ("speed2", "output", 0, "m/s", 1e-1),
        ("force_mean", "output", 0, "N", 1),
        *((n, "parameter", s, "", 1) for n, s in (("m", 1), ("d", 0), ("k", 0), ("x0", 0))),
        *((n, "parameter", s, "", 1) for n, s in (("dc", 0), ("kc", 0), ("parts", 100))),
    ],
    "Circuit": [
        ("current", "input", 0, "A", 1e-1),
        ("voltage", "output", 0, "V", 10),
        ("voltage_mean", "output", 0, "V", 10),
        *((n, "parameter", s, "", 1) for n, s in (("supply", 24), ("r", 20), ("c", 1e-5), ("parts", 100))),
    ],
}
DEPENDS = {"y": ("u", "v"), "force": ("x", "speed")}  # outputs on inputs at once
CAN = 'canGetAndSet{0}="true" canSerialize{0}="true"'


def description(name: str, fmi: int, values: Mapping[str, float], file: str) -> str:
    """Model description, with other start values where they are given."""
    variables = [(v, c, values.get(v, start), unit, nominal) for v, c, start, unit, nominal in MODELS[name]]
    places = {v[0]: k for k, v in enumerate(variables)}
    kind = "ScalarVariable" if fmi == 2 else "Float64"
    units = "".join(f'<Unit name="{unit}"/>' for unit in dict.fromkeys(v[3] for v in variables) if unit)
    lines, unknowns = [], []
    for variable, causality, start, unit, nominal in variables:
        variability = "fixed" if causality == "parameter" else "continuous"
        common = (
            f'name="{variable}" valueReference="{places[variable]}" causality="{causality}" variability="{variability}"'
        )
        own = f'nominal="{nominal!r}"' + f' unit="{unit}"' * bool(unit)
        own += f' start="{start!r}"' * (causality != "output")
        lines.append(f"<{kind} {common}><Real {own}/></{kind}>" if fmi == 2 else f"<{kind} {common} {own}/>")
        if causality == "output":
            on = " ".join(
                str(places[u] + (fmi == 2)) for u in DEPENDS.get(variable, ()) if u in places and name != "Mass"
            )
            at = f'index="{places[variable] + 1}"' if fmi == 2 else f'valueReference="{places[variable]}"'
            unknowns.append(f'<{"Unknown" if fmi == 2 else "Output"} {at} dependencies="{on}"/>')
    body, ends = "".join(lines), "".join(unknowns)
    if fmi == 2:
        can = CAN.format("FMUstate") + ' canInterpolateInputs="true" canHandleVariableCommunicationStepSize="true"'
        head = f'fmiVersion="2.0" modelName="{file}" guid="{file}"'
        ends = f"<Outputs>{ends}</Outputs>"
    else:
        can = CAN.format("FMUState") + ' canHandleVariableCommunicationStepSize="true"'
        head = f'fmiVersion="3.0" modelName="{file}" instantiationToken="{file}"'
        body = f'<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>{body}'
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription {head}>'
        f'<CoSimulation modelIdentifier="{file}" {can}/><UnitDefinitions>{units}</UnitDefinitions>'
        f"<ModelVariables>{body}</ModelVariables><ModelStructure>{ends}</ModelStructure></fmiModelDescription>"
    )


def build(folder: Path, fmi: int = 2) -> Path:
    """All of them, for Linux on x86-64, in a folder."""
    for name in MODELS:
        build_one(name, folder, fmi)
    return folder


def build_one(name: str, folder: Path, fmi: int = 2, values: Mapping[str, float] = NO_VALUES, file: str = "") -> Path:
    """One of them, with other start values and of another name where these are given."""
    folder.mkdir(parents=True, exist_ok=True)
    file = file or name
    library, platform = folder / f"{file}.so", "linux64" if fmi == 2 else "x86_64-linux"
    command = [shutil.which("gcc") or "cc", *OPTIONS, f"-DFMI={fmi}", f"-D{name.upper()}", f"-I{HEADERS}"]
    if values:
        command.append(f"-DSTARTS={{{','.join(repr(float(values.get(v[0], v[2]))) for v in MODELS[name])}}}")
    done = subprocess.run([*command, HERE / "coupled.c", "-o", library, "-lm"], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    with zipfile.ZipFile(folder / f"{file}.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description(name, fmi, values, file))
        archive.write(library, f"binaries/{platform}/{library.name}")
    return folder / f"{file}.fmu"
