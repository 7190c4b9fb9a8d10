"""Build the stock test FMUs into a folder: `python stock_fmus.py FOLDER`. Run in a process of its own."""

import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

from pythonfmu.builder import FmuBuilder

UNITS = {
    "Source": {"y": "V", "level": "V", "slope": "V/s", "steps": "1"},
    "Lag": {"u": "V", "y": "V", "time.constant": "s"},
    "Gain": {"u": "V", "y": "A"},
    "Noise": {"y": "V", "sample_time": "s"},
    "Faulty": {"u": "V", "y": "s", "at": "s"},
    "Types": {},
    "Tuned": {"u": "V", "seen": "V"},
    "Switch": {},
}
ATTRIBUTES = {
    ("Lag", "time.constant"): {"min": "0.001", "max": "1000"},
    ("Lag", "y"): {"nominal": "10"},
    ("Noise", "seed"): {"min": "0"},
    ("Tuned", "gain"): {"min": "0", "max": "100"},
    ("Gain", "u"): {"min": "-1000", "max": "1000"},
}
DEPENDENCIES = {
    ("Lag", "y"): "",
    ("Source", "y"): "",
    ("Source", "steps"): "",
    ("Faulty", "y"): "",
    ("Tuned", "y"): "",
    ("Tuned", "seen"): "",
}


def finish(root: ElementTree.Element) -> None:
    """Add units, limits, nominal values and output dependencies to a model description."""
    model = root.get("modelName")
    definitions = ElementTree.Element("UnitDefinitions")
    for unit in sorted({"V", "A", "s", "1", "V/s"}):
        ElementTree.SubElement(definitions, "Unit", name=unit)
    root.insert(1, definitions)
    variables = root.find("ModelVariables")
    for index, element in enumerate(variables, start=1):
        name = element.get("name")
        unit = UNITS[model].get(name)
        if unit:
            element[0].set("unit", unit)
        element[0].attrib.update(ATTRIBUTES.get((model, name), {}))
        if (model, name) in DEPENDENCIES:
            unknown = root.find(f"ModelStructure/Outputs/Unknown[@index='{index}']")
            unknown.set("dependencies", DEPENDENCIES[model, name])


def build(script: Path, folder: Path) -> None:
    """Package one slave and rewrite its model description."""
    stock = FmuBuilder.build_FMU(script, dest=folder, canGetAndSetFMUstate=script.stem == "stock_switch")
    with zipfile.ZipFile(stock) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    root = ElementTree.fromstring(members["modelDescription.xml"])
    finish(root)
    members["modelDescription.xml"] = ElementTree.tostring(root)
    with zipfile.ZipFile(stock, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


if __name__ == "__main__":
    for file in sorted((Path(__file__).parent / "stock").glob("*.py")):
        build(file, Path(sys.argv[1]))
