"""What every FMU must do in any tool.  The components are found in fmus/; everything runs in fresh processes."""

from __future__ import annotations

import ast
import csv
import filecmp
import json
import math
import os
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
from drivers import call, communication_step, fresh
from fmpy.validation import validate_fmu
from parts import EASY, FEW, FOLDERS, Part, some

from gapsense.units import UNITS

ERROR = 3
FAULTS = ("exception", "nothing", "nan", "infinite")  # of drivers.FAULTS
ALIKE = pytest.mark.parametrize("part", some(*FEW), indirect=True)  # of code that all FMUs share
EXITS = [4, pytest.param(50, marks=pytest.mark.slow)]  # processes that end


# What is in the file --------------------------------------------------------------------------------------------------


def description(path: Path) -> Element:
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def members(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def test_fmpy_finds_nothing_to_complain_about(part: Part) -> None:
    assert validate_fmu(str(part.path)) == []


def test_port_table_is_sound(part: Part) -> None:
    inputs, parameters = part.names("input"), part.names("parameter")
    names = [p.name for p in part.component.ports]
    assert len(set(names)) == len(names)
    assert names == [*inputs, *part.names("output"), *parameters]
    assert all(name in parameters for pair in part.component.rising for name in pair)
    for port in part.component.ports:
        assert port.description and port.unit in UNITS and port.nominal > 0.0, port
        assert set(port.feedthrough) <= set(inputs), port
        if port.kind in ("Real", "Integer") and port.causality != "output":
            low, high = -math.inf if port.min is None else port.min, math.inf if port.max is None else port.max
            assert low <= port.start <= high, port


def test_every_real_has_unit_and_nominal(part: Part) -> None:
    defined = {unit.get("name") for unit in description(part.path).iterfind("UnitDefinitions/Unit")}
    for variable in description(part.path).iterfind("ModelVariables/ScalarVariable"):
        real = variable.find("Real")
        if real is not None:
            assert real.get("unit") in defined, variable.get("name")
            assert float(real.attrib["nominal"]) > 0.0, variable.get("name")


def test_capabilities(part: Part) -> None:
    flags = description(part.path).find("CoSimulation")
    assert flags is not None
    for name in ("CanHandleVariableCommunicationStepSize", "CanGetAndSetFMUstate", "CanSerializeFMUstate"):
        assert flags.get("c" + name[1:]) == "true", name
    assert flags.get("needsExecutionTool") == "true"
    assert flags.get("canBeInstantiatedOnlyOncePerProcess") == "false"


def test_outputs_and_initial_unknowns_are_complete_with_their_dependencies(part: Part) -> None:
    root, ports = description(part.path), part.component.ports
    index = {port.name: k for k, port in enumerate(ports, 1)}
    parameters = part.names("parameter")
    for tag, more in (("Outputs", []), ("InitialUnknowns", parameters)):
        found = {
            int(unknown.attrib["index"]): [int(k) for k in unknown.attrib["dependencies"].split()]
            for unknown in root.iterfind(f"ModelStructure/{tag}/Unknown")
        }
        expected = {
            index[p.name]: sorted(index[n] for n in (*p.feedthrough, *more)) for p in part.component.of("output")
        }
        assert found == expected, tag


def test_outputs_follow_only_declared_inputs_at_once(part: Part, life: dict[str, Any]) -> None:
    declared = {p.name: p.feedthrough for p in part.component.of("output")}
    for name, outputs in life["follows"].items():
        assert [o for o in outputs if name not in declared[o]] == [], name


def test_page_licence_and_icon_are_present(part: Part) -> None:
    names = members(part.path)
    licenses = {"documentation/licenses/license.txt", "documentation/licenses/pythonfmu.txt"}
    assert {"documentation/index.html", "model.png", *licenses} <= set(names)
    with zipfile.ZipFile(part.path) as archive:
        page = archive.read("documentation/index.html").decode().replace("<wbr>", "")  # where a line may break
    assert [p.name for p in part.component.ports if f"<code>{p.name}</code>" not in page] == []


@ALIKE
def test_guid_and_bytes_are_the_same_in_a_second_build(part: Part, rebuilt: Path) -> None:
    assert filecmp.cmp(rebuilt / part.path.name, part.path, shallow=False)  # to show how bytes differ takes minutes


@ALIKE
def test_changed_source_changes_the_guid(part: Part, second: tuple[Path, dict[str, str]]) -> None:
    assert description(second[0] / part.path.name).get("guid") != description(part.path).get("guid")


def test_module_names_belong_to_one_build(fmus: Path, second: tuple[Path, dict[str, str]]) -> None:
    names = []
    for path in (*fmus.glob("*.fmu"), *second[0].glob("*.fmu")):
        names += {Path(name).parts[1] for name in members(path) if name.startswith("resources/") and ".py" in name}
    assert len(names) >= 3 * (len(FOLDERS) + len(FEW))  # the script, its package, pythonfmu
    assert len({n for n in names if n != "pythonfmu"}) == len([n for n in names if n != "pythonfmu"])


def test_imports_only_the_standard_library_and_pythonfmu(part: Part) -> None:
    with zipfile.ZipFile(part.path) as archive:
        for name in archive.namelist():
            if name.endswith(".py") and not name.startswith("resources/pythonfmu/"):
                other = imports(archive.read(name).decode()) - {*sys.stdlib_module_names, "pythonfmu"}
                assert all(imported.startswith("_gapsense_") for imported in other), f"{name} imports {other}"


def imports(source: str) -> set[str]:
    """Top-level names of all absolute imports."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add((node.module or "").partition(".")[0])
    return found


# The lives of an instance: numpy cannot be imported in any of them, see fmu_host.py --------------------------------


def test_start_values_are_those_of_a_fresh_instance(part: Part, life: dict[str, Any]) -> None:
    assert set(life["starts"]) == {*part.names("input"), *part.names("parameter")}
    assert life["read"] == life["starts"]


def test_stimulus_moves_at_least_half_of_the_outputs(part: Part, life: dict[str, Any]) -> None:
    """Or else equal traces would say little."""
    moving = sum(len({row[k] for row in life["first"]}) > 1 for k in range(len(part.names("output"))))
    assert moving >= (len(part.names("output")) + 1) // 2


def test_other_process_gives_the_same_bits(elsewhere: dict[str, Any], life: dict[str, Any]) -> None:
    assert elsewhere["first"] == life["first"]


def test_all_fmus_in_one_process_do_not_mix(fmu: str, life: dict[str, Any], all_traces: dict[str, Any]) -> None:
    assert all_traces[fmu] == life["first"]


@pytest.fixture
def all_traces(all_fmus: list[str]) -> dict[str, Any]:
    return dict(zip(all_fmus, fresh("together", *all_fmus)))


@ALIKE
def test_two_versions_in_one_process_do_not_mix(
    part: Part, fmu: str, life: dict[str, Any], second: tuple[Path, dict[str, str]]
) -> None:
    """First, second, first of each component, and in another process second, first of each."""
    names, other = names_in(second[0]), second[0] / part.path.name
    k, alone = names.index(other.name), second_traces(second[0])[other.name]
    assert alone != life["first"]
    pairs = [(part.path.parent / name, second[0] / name) for name in names]
    threes = fresh("together", *(path for one, two in pairs for path in (one, two, one)))
    assert threes[3 * k :][:3] == [life["first"], alone, life["first"]]
    twos = fresh("together", *(path for one, two in pairs for path in (two, one)))
    assert twos[2 * k :][:2] == [alone, life["first"]]


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.fmu"))


def second_traces(folder: Path) -> dict[str, Any]:
    """Of the second versions by name, with no first one in the process."""
    return dict(zip(names_in(folder), fresh("together", *(folder / name for name in names_in(folder)))))


@ALIKE
def test_second_version_has_its_own_description_and_start_value(
    part: Part, second: tuple[Path, dict[str, str]]
) -> None:
    folder, changed = second
    roots = [description(path) for path in (part.path, folder / part.path.name)]
    starts = [root.find(f".//ScalarVariable[@name='{changed[part.component.name]}']/Real") for root in roots]
    assert roots[1].get("description") == "Second version" != roots[0].get("description")
    assert starts[0].get("start") != starts[1].get("start")  # type: ignore[union-attr]


@ALIKE
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_loading_and_freeing_does_not_leak(fmu: str) -> None:
    growth = fresh("memory", fmu, 100)
    assert growth["paths"] == growth["modules"] == 0
    assert growth["bytes"] < 1e6  # 0.1 to 0.3 MB, however many there are


# Saving the state -----------------------------------------------------------------------------------------------------


def test_continues_from_bytes_in_another_instance(saved: dict[str, Any]) -> None:
    assert saved["values_in_another"]
    assert saved["in_another"] == saved["straight"]
    assert saved["bytes_again"] == saved["bytes"]


def test_continues_from_bytes_in_another_process(elsewhere: dict[str, Any], saved: dict[str, Any]) -> None:
    assert elsewhere["restored"] == saved["straight"]


# Messages -------------------------------------------------------------------------------------------------------------


def logged(answer: dict[str, Any]) -> str:
    """What the component itself logged as an error."""
    return "\n".join(text for _, status, category, text in answer["log"] if (status, category) == (3, "logStatusError"))


def test_lost_readings_are_survived_where_the_port_table_says_so(part: Part) -> None:
    if not part.component.survives:
        pytest.skip("inputs that are not finite are refused")
    nominal = [port.nominal for port in part.component.of("input")]
    rows = [list(nominal) for _ in range(max(60, 12 * len(nominal) + 20))]
    for k, value in enumerate((math.nan, math.inf, -math.inf) * len(nominal)):
        rows[5 + 4 * k][k % len(nominal)] = value
    rows[50] = [math.nan] * len(nominal)
    run = fresh("reference", part.path, part.component.step_size, len(rows) - 1, rows)
    assert len(run["outputs"]) == len(rows)
    assert all(math.isfinite(value) for row in run["outputs"] for value in row)


# Kernels that fail ----------------------------------------------------------------------------------------------------


@pytest.fixture
def faults(part: Part, broken: Path) -> dict[str, Any]:
    return fresh("faults", broken / part.path.name, len(FAULTS))  # type: ignore[no-any-return]


@ALIKE
def test_failing_kernel_fails_the_call_and_every_later_one(faults: dict[str, Any]) -> None:
    assert [answer["status"] >= ERROR for answer in faults["answers"]] == [True] * len(FAULTS)
    assert [answer["again"] >= ERROR for answer in faults["answers"]] == [True] * len(FAULTS)


@ALIKE
@pytest.mark.parametrize("fault", FAULTS[:2])
def test_exception_is_logged_with_traceback_inputs_and_time(part: Part, faults: dict[str, Any], fault: str) -> None:
    k = FAULTS.index(fault)
    text = logged(faults["answers"][k])
    step = communication_step(part.component.step_size, part.component.stop_time)
    assert f"`broken {k}` ({part.component.name}), t = 0 s, step = {step:g} s: " in text
    words = {
        "exception": ("in advance", "ArithmeticError: kaputt: für 100 %s %d %n\n"),
        "nothing": ("slave.py", "TypeError"),
    }
    assert all(word in text for word in ("Traceback", *words[fault]))
    for name, value in zip(part.names("input"), faults["inputs"]):
        assert f"{name} = {value!r}" in text


@ALIKE
@pytest.mark.parametrize("fault", FAULTS[2:])
def test_output_that_is_not_finite_is_an_error(part: Part, faults: dict[str, Any], fault: str) -> None:
    text = logged(faults["answers"][FAULTS.index(fault)])
    assert all(f"`{name}`" in text for name in part.names("output"))
    assert "not finite" in text and "t = 0 s" in text


@ALIKE
def test_other_instance_works_after_exceptions(faults: dict[str, Any], life: dict[str, Any]) -> None:
    assert faults["afterwards"] == life["first"]


# Exit -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", EXITS)
def test_processes_always_exit_cleanly(all_fmus: list[str], broken: Path, count: int) -> None:
    """Heaps are damaged or not by chance, so there are many: one FMU, two, after an exception, freed or not."""
    failing = [str(broken / Path(path).name) for path in all_fmus]
    jobs = []
    for k in range(count):
        one, two = all_fmus[k % len(all_fmus)], all_fmus[(k // 2 + 1) % len(all_fmus)]
        paths = ([one], [one, two], [failing[k % len(failing)]], [failing[k % len(failing)], two])[k % 4]
        jobs.append((paths, 20 + k, k % 3 > 0))
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(lambda job: call("end", *job), jobs))
    assert [run.returncode for run in runs] == [0] * count, [run.stderr for run in runs if run.returncode]
    failed = [json.loads(run.stdout)[0] >= ERROR for run in runs]
    assert failed == [paths[0] in failing for paths, *_ in jobs]


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_c_host_always_exits_cleanly(c_host: Path, all_fmus: list[str], tmp_path: Path, every: bool) -> None:
    """Eight at once; in the long tests each alone, too, and beside both its neighbours."""
    folders = []
    for path in all_fmus:
        folders.append(tmp_path / Path(path).stem)
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folders[-1])
    step = 1e-3  # a whole multiple of all sample times
    pairs = map(list, zip(folders, folders[1:] + folders[:1]))
    eights = [folders[k : k + 8] for k in range(0, len(folders), 8)]
    groups = [*eights[:1], *([folder] for folder in folders), *pairs] if every else eights
    with ThreadPoolExecutor(2) as pool:
        codes = list(pool.map(lambda group: in_c_host(c_host, group, step), groups))
    assert codes == [0] * len(groups)


def in_c_host(program: Path, folders: list[Path], step: float) -> int:
    fmus = []
    for folder in folders:
        guid = ElementTree.parse(folder / "modelDescription.xml").getroot().attrib["guid"]
        fmus += [f"{folder}/binaries/linux64/{folder.name}.so", (folder / "resources").as_uri(), guid]
    env = {k: v for k, v in os.environ.items() if k not in ("GAPSENSE_LIBPYTHON", "PYTHONPATH")}
    env["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), env.get("PATH", os.defpath)))
    command = [str(program), "-n", "50", "-h", repr(step), *fmus, "--", "0"]
    return subprocess.run(command, env=env, capture_output=True, timeout=60).returncode


# Expected results -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", some(*EASY), indirect=True)
def test_reproduces_its_reference(part: Part, fmu: str) -> None:
    """The file holds what the FMU gave when `python tests/fmus/make_references.py` was last run."""
    file = part.folder / "reference.csv"
    assert file.is_file(), f"{file} is missing. Run `python tests/fmus/make_references.py {part.folder.name}`."
    with file.open(newline="", encoding="utf-8") as lines:
        header, *rows = csv.reader(lines)
    inputs, outputs = part.names("input"), part.names("output")
    assert header == ["time", *inputs, *outputs]
    table = [[float(cell) for cell in row] for row in rows]
    given = [row[1 : 1 + len(inputs)] for row in table]
    found = fresh("reference", fmu, table[1][0], len(table) - 1, given)
    for row, values in zip(table, found["outputs"], strict=True):
        for name, expected, value, nominal in zip(outputs, row[1 + len(inputs) :], values, found["nominal"]):
            assert abs(value - expected) <= 1e-9 * max(nominal, abs(expected)), f"{name} at {row[0]} s"
