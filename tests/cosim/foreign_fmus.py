"""FMUs of somebody else: the model of `foreign/`, compiled for FMI 2.0 and for FMI 3.0."""

import subprocess
import zipfile
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent / "foreign"
HEADERS = Path(find_spec("fmpy").origin).parent / "c-code"
OPTIONS = ("-std=gnu11", "-O1", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function")
WHOLES = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
ITEMS = "".join(f'<Item name="{name}" value="{k}"/>' for k, name in enumerate(("Off", "Auto", "On"), 1))
INPUT, OUTPUT = 'causality="input" variability="{}"', 'causality="output" variability="{}"'
FIXED, START = (
    'causality="parameter" variability="fixed"',
    'causality="output" variability="continuous" initial="exact"',
)
# Name, type, reference in FMI 2.0 and 3.0, causality, attributes of the type.
VARIABLES = [
    ("u", "Real", 0, 1, INPUT, 'start="0" unit="V"'),
    ("y", "Real", 1, 2, OUTPUT, 'unit="V"'),
    ("gain", "Real", 2, 3, FIXED, 'start="2"'),
    ("level", "Real", 3, 4, START, 'start="1"'),
    ("end", "Real", 4, 5, FIXED, 'start="1e9"'),
    ("deed", "Real", 5, 6, FIXED, 'start="0"'),
    ("flag", "Boolean", 0, 44, INPUT, 'start="false"'),
    ("flag_out", "Boolean", 1, 45, OUTPUT, ""),
    ("on", "Boolean", 2, 46, FIXED, 'start="true"'),
    ("text", "String", 0, 50, INPUT, 'start=""'),
    ("text_out", "String", 1, 51, OUTPUT, ""),
    ("label", "String", 2, 52, FIXED, 'start="&lt;"'),
    ("shift", "Integer", 2, 40, FIXED, 'start="0"'),
    ("mode", "Enumeration", 3, 41, INPUT, 'start="1" declaredType="Mode"'),
    ("mode_out", "Enumeration", 4, 42, OUTPUT, 'declaredType="Mode"'),
    ("law", "Enumeration", 5, 43, FIXED, 'start="1" declaredType="Mode"'),
]
ONLY_2 = [("n", "Integer", 0, 0, INPUT, 'start="0"'), ("n_out", "Integer", 1, 0, OUTPUT, "")]
ONLY_3 = [
    ("single", "Float32", 0, 10, INPUT, 'start="0"'),
    ("single_out", "Float32", 0, 11, OUTPUT, ""),
    *((f"n{kind}", kind, 0, 20 + k, INPUT, 'start="0"') for k, kind in enumerate(WHOLES)),
    *((f"n{kind}_out", kind, 0, 30 + k, OUTPUT, "") for k, kind in enumerate(WHOLES)),
]
SIZES = {"Real": "Float64", "Integer": "Int32"}
DEPENDS = {name + "_out": name for name in ("flag", "text", "mode", "n", "single", *(f"n{kind}" for kind in WHOLES))}
DEPENDS |= {"y": "u", "level": ""}


def varies(text: str, kind: str) -> str:
    return text.format("continuous" if kind in ("Real", "Float32") else "discrete")


def description2() -> str:
    """Model description of FMI 2.0."""
    rows = VARIABLES + ONLY_2
    places = {row[0]: k for k, row in enumerate(rows, 1)}
    variables = "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" {varies(causality, kind)}>'
        f"<{kind} {attributes}/></ScalarVariable>"
        for name, kind, reference, _, causality, attributes in rows
    )
    outputs = [name for name, *_, causality, _ in rows if causality in (OUTPUT, START)]
    unknowns = "".join(
        f'<Unknown index="{places[name]}" dependencies="{places.get(DEPENDS[name], "")}"/>' for name in outputs
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="2.0" modelName="Types" guid="types"><CoSimulation modelIdentifier="types2"/>'
        '<UnitDefinitions><Unit name="V"/></UnitDefinitions><TypeDefinitions><SimpleType name="Mode">'
        f"<Enumeration>{ITEMS}</Enumeration></SimpleType></TypeDefinitions>"
        f"<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"
    )


def description3() -> str:
    """Model description of FMI 3.0."""
    rows = VARIABLES + ONLY_3
    references = {row[0]: row[3] for row in rows}
    time = '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>'
    variables = "".join(
        f'<{SIZES.get(kind, kind)} name="{name}" valueReference="{reference}" {varies(causality, kind)} '
        + (f"><Start value={attributes[6:]}/></String>" if kind == "String" and attributes else f"{attributes}/>")
        for name, kind, _, reference, causality, attributes in rows
    )
    outputs = [name for name, *_, causality, _ in rows if causality in (OUTPUT, START)]
    unknowns = "".join(
        f'<Output valueReference="{references[name]}" dependencies="{references.get(DEPENDS[name], "")}"/>'
        for name in outputs
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="3.0" modelName="Types" instantiationToken="types">'
        '<CoSimulation modelIdentifier="types3"/><UnitDefinitions><Unit name="V"/></UnitDefinitions>'
        f'<TypeDefinitions><EnumerationType name="Mode">{ITEMS}</EnumerationType></TypeDefinitions>'
        f"<ModelVariables>{time}{variables}</ModelVariables><ModelStructure>{unknowns}</ModelStructure>"
        "</fmiModelDescription>"
    )


ARRAYS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Arrays" instantiationToken="arrays">
<CoSimulation modelIdentifier="arrays"/><UnitDefinitions><Unit name="V"/></UnitDefinitions><ModelVariables>
<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>
<UInt64 name="n" valueReference="0" causality="structuralParameter" variability="fixed" start="2" min="0" max="4"/>
<Float64 name="K" valueReference="1" causality="parameter" variability="tunable" start="1 2 3 4">
<Dimension valueReference="0"/><Dimension start="2"/></Float64>
<Float64 name="bias" valueReference="2" causality="parameter" variability="fixed" start="0.5" unit="V">
<Dimension valueReference="0"/></Float64>
<Float64 name="u" valueReference="3" causality="input" start="0 0" unit="V"><Dimension start="2"/></Float64>
<Float64 name="y" valueReference="4" causality="output" unit="V"><Dimension valueReference="0"/></Float64>
<Float64 name="total" valueReference="5" causality="output" unit="V"/>
<Int32 name="count" valueReference="6" causality="input" start="1 2 3"><Dimension start="3"/></Int32>
<Int32 name="count_out" valueReference="7" causality="output"><Dimension start="3"/></Int32>
<Boolean name="flag" valueReference="8" causality="input" start="false true"><Dimension start="2"/></Boolean>
<Boolean name="flag_out" valueReference="9" causality="output"><Dimension start="2"/></Boolean>
<Float32 name="single" valueReference="10" causality="input" start="0.25"><Dimension start="2"/></Float32>
<Float32 name="single_out" valueReference="11" causality="output"><Dimension start="2"/></Float32>
<String name="words" valueReference="12" causality="output"><Dimension start="2"/></String>
</ModelVariables><ModelStructure>
<Output valueReference="4" dependencies="3"/><Output valueReference="5" dependencies="3"/>
<Output valueReference="7" dependencies="6"/><Output valueReference="9" dependencies="8"/>
<Output valueReference="11" dependencies="10"/><Output valueReference="12" dependencies=""/>
</ModelStructure></fmiModelDescription>"""


def build(gcc: str, version: int, folder: Path) -> Path:
    """`Types2.fmu` or `Types3.fmu` for Linux on x86-64."""
    about = description2() if version == 2 else description3()
    return packed(gcc, version, folder, f"fmi{version}.c", f"types{version}", about)


def build_arrays(gcc: str, folder: Path) -> Path:
    """`Arrays.fmu`, of FMI 3.0 too."""
    return packed(gcc, 3, folder, "arrays.c", "arrays", ARRAYS)


def packed(gcc: str, version: int, folder: Path, source: str, name: str, description: str) -> Path:
    """An FMU of a source."""
    library, platform = folder / f"{name}.so", "linux64" if version == 2 else "x86_64-linux"
    command = [gcc, *OPTIONS, f"-DFMI={version}", f"-I{HEADERS}", str(HERE / source), "-o", library, "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    path = folder / f"{name.capitalize()}.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{library.name}")
    return path
