"""`gapsense info` tells what a component, or any FMU file, takes and gives; the shell completes names."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cli.common import scenario_names
from gapsense.cli.components import component_names
from gapsense.fmi.components import find_components, load_component
from gapsense.shipped import COMPONENTS, FMUS

HEAD = '<?xml version="1.0"?><fmiModelDescription fmiVersion="{}" modelName="Odd" description="Of  others." {}>'
TEXT_3 = (
    HEAD.format("3.0", 'instantiationToken="x"')
    + """<CoSimulation modelIdentifier="odd"/><UnitDefinitions><Unit name="V"/></UnitDefinitions><TypeDefinitions>
<EnumerationType name="Way"><Item name="Up" value="1"/><Item name="Down" value="2"/></EnumerationType>
</TypeDefinitions><ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
<Float64 name="u" valueReference="1" causality="input" start="1.5" unit="V" min="-2" max="3" description="[V] in"/>
<Binary name="raw" valueReference="2" causality="input"><Start value="00"/></Binary>
<UInt64 name="n" valueReference="3" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="A" valueReference="4" causality="parameter" variability="fixed" start="1 2"><Dimension valueReference="3"
/></Float64>
<Enumeration name="way" valueReference="5" causality="parameter" variability="fixed" declaredType="Way" start="2"/>
<Boolean name="on" valueReference="6" causality="parameter" variability="fixed" start="true"/>
<Clock name="tick" valueReference="7" causality="output" intervalVariability="triggered"/>
<Float64 name="x" valueReference="8" causality="local"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"""
)
TEXT_2 = (
    HEAD.format("2.0", 'guid="x"')
    + """<ModelExchange modelIdentifier="odd"/><ModelVariables>
<ScalarVariable name="u" valueReference="1" causality="input"><Real start="1.5"/></ScalarVariable>
<ScalarVariable name="s" valueReference="1" causality="parameter" variability="fixed"><String start="hi"/>
</ScalarVariable></ModelVariables><ModelStructure/></fmiModelDescription>"""
)


def info(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["info", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, SystemExit)
    assert all(len(line) <= 80 for line in done.stdout.splitlines())
    return done.exit_code, " ".join(done.output.split())


def packed(path: Path, text: str) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
    return path


@pytest.mark.parametrize("folder", find_components(COMPONENTS), ids=lambda folder: folder.name)
def test_every_port_of_every_component_is_shown(folder):
    component = load_component(folder)
    code, said = info(folder.name)
    assert code == 0 and said.startswith(f"{component.name}. ")
    assert not [port.name for port in component.ports if port.name not in said]
    assert info(FMUS / f"{component.name}.fmu") == (code, said)


@pytest.mark.parametrize("name", ["snsor", "Sesnor", "sensor_"])
def test_misspelt_component_is_guessed(name):
    code, said = info(name)
    assert code == 0 if name == "sensor_" else code == 2 and "Did you mean `Sensor`?" in said


def test_what_is_no_fmu_is_told(tmp_path):
    other = tmp_path / "other.fmu"
    other.write_text("no archive")
    assert info(other)[0] == 2 and "not a readable FMU" in info(other)[1]
    code, said = info(tmp_path / "othre.fmu")
    assert code == 2 and "Did you mean `other.fmu`?" in said
    code, said = info("Sensor", "--fmus", tmp_path / "none")
    assert code == 2 and "gapsense build" in said


def test_fmu_of_others_is_shown_also_where_it_cannot_run(tmp_path):
    code, said = info(packed(tmp_path / "odd.fmu", TEXT_3))
    assert code == 0 and "Odd. Of others. FMI 3.0, co-simulation." in said
    for words in (
        "u V 1.5 -2 to 3 [V] in",
        "raw 00 Binary",
        "Structural parameters",
        "n 2 Integer",
        "A 1 2 Float64, array of 2",
        'way "Down" Up, Down',
        "on true Boolean",
        "tick Clock",
        "1 more variable is",
        "It cannot run here",
    ):
        assert words in said
    code, said = info(packed(tmp_path / "old.fmu", TEXT_2))
    assert code == 0 and "model exchange" in said and 's "hi" String' in said and "without co-simulation" in said


def test_names_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    CliRunner().invoke(app, ["new", "my_valve"])
    assert "semera_valve" in scenario_names("sem") and scenario_names("my") == ["my_valve"]
    assert scenario_names("my_valve/") == ["my_valve/scenario.toml"]
    assert component_names("sens") == ["Sensor"]
    words = {"COMP_WORDS": "gapsense run semera_v", "COMP_CWORD": "2", "_GAPSENSE_COMPLETE": "complete_bash"}
    script = "import sys; sys.argv = ['gapsense']; from gapsense.cli import app; app(prog_name='gapsense')"
    done = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, **words}, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["semera_valve"]
