"""FMUs for loops between components, made of `coupled.c`; tests and benchmarks/coupling.py use them."""

import shutil
import subprocess
import zipfile
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
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
}
DEPENDS = {"y": ("u", "v"), "force": ("x", "speed")}  # outputs on inputs at once
CAN = 'canGetAndSet{0}="true" canSerialize{0}="true"'


def description(name: str, fmi: int) -> str:
    """Model description."""
    variables, places = MODELS[name], {v[0]: k for k, v in enumerate(MODELS[name])}
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
        head = f'fmiVersion="2.0" modelName="{name}" guid="{name}"'
        ends = f"<Outputs>{ends}</Outputs>"
    else:
        can = CAN.format("FMUState") + ' canHandleVariableCommunicationStepSize="true"'
        head = f'fmiVersion="3.0" modelName="{name}" instantiationToken="{name}"'
        body = f'<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>{body}'
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription {head}>'
        f'<CoSimulation modelIdentifier="{name}" {can}/><UnitDefinitions>{units}</UnitDefinitions>'
        f"<ModelVariables>{body}</ModelVariables><ModelStructure>{ends}</ModelStructure></fmiModelDescription>"
    )


def build(folder: Path, fmi: int = 2) -> Path:
    """All of them, for Linux on x86-64, in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in MODELS:
        library, platform = folder / f"{name}.so", "linux64" if fmi == 2 else "x86_64-linux"
        command = [shutil.which("gcc") or "cc", *OPTIONS, f"-DFMI={fmi}", f"-D{name.upper()}", f"-I{HEADERS}"]
        done = subprocess.run([*command, HERE / "coupled.c", "-o", library, "-lm"], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        with zipfile.ZipFile(folder / f"{name}.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", description(name, fmi))
            archive.write(library, f"binaries/{platform}/{library.name}")
    return folder
