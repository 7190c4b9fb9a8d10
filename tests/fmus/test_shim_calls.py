"""The Linux binary under calls as no host should make them: refused with a sentence, and nothing worse."""

from __future__ import annotations

import os
import shutil
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from drivers import ROOT
from hosting import build_slaves, in_host, in_python, raw
from raw import KINDS

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the shim is for Linux")

Heard = list[tuple[int, str, str]]
ERROR, DISCARD = 3, 2
ODD = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real, String
from pythonfmu.enums import Fmi2Status

class Odd(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.y, self.text = -1, 1.0, ""
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(String("text", causality=Fmi2Causality.parameter))

    def do_step(self, current_time, step_size):
        self.k = int(current_time)
        return True

    def get_real(self, refs):
        if self.k == 5:
            raise SystemExit("leaving")
        if self.k == 6:
            raise KeyboardInterrupt
        if self.k == 7:
            self.log("\\ud800 \\0 %n", Fmi2Status.warning)
        return [[], (1.0,), None, ["text"], 1.0, [], [], [7.0]][self.k] if self.k >= 0 else [self.y]
"""


# Instantiation --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def instances(semera: Path) -> dict[str, Any]:
    return raw("instances", semera)  # type: ignore[no-any-return]


@pytest.mark.parametrize("way", ["right", "name in latin-1", "no name", "upper case", "host", "slash"])
def test_instance_is_made(instances: dict[str, Any], way: str) -> None:
    assert instances[way] == {"is_made": True, "said": []}


@pytest.mark.parametrize(
    ("way", "words"),
    [
        ("wrong guid", ["`one` (Semera)", "GUID", "{00000000-0000-0000-0000-000000000000}"]),
        ("no guid", ["`one` (Semera)", "GUID"]),
        ("model exchange", ["`one` (Semera)", "model exchange"]),
        ("no resources", ["does not find its resources"]),
    ],
)
def test_instance_is_refused_in_one_message_also_without_logging(
    instances: dict[str, Any], way: str, words: list[str]
) -> None:
    ((status, category, text),) = instances[way]["said"]
    assert not instances[way]["is_made"]
    assert (status, category) == (ERROR, "logStatusError")
    assert [word for word in words if word not in text] == []
    assert "Traceback" not in text


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ("no script", ["slavemodule.txt` should name the script", "says `lag_slave`", "Extract the whole FMU again"]),
        ("empty", ["slavemodule.txt` should name the script", "says ``"]),
        ("nothing", ["slavemodule.txt` should name the script", "says `no_such_script`"]),
        ("no note", ["slavemodule.txt` should name the script", "says ``"]),
        ("no class", ["no class derived from pythonfmu's Fmi2Slave"]),
        ("syntax", ["SyntaxError"]),
        ("exit", ["SystemExit: 5"]),
        ("abstract", ["no class derived from pythonfmu's Fmi2Slave"]),
    ],
)
def test_resources_that_are_not_whole_are_refused(
    c_host: Path, stock: Path, tmp_path: Path, damage: str, words: list[str]
) -> None:
    folder = copied(stock / "Lag", tmp_path / "Lag")
    note, script = folder / "resources" / "slavemodule.txt", folder / "resources" / "lag_slave.py"
    text = script.read_text()
    {
        "no script": script.unlink,
        "no note": note.unlink,
        "empty": lambda: note.write_text(""),
        "nothing": lambda: note.write_text("no_such_script"),
        "no class": lambda: script.write_text("import pythonfmu\n"),
        "syntax": lambda: script.write_text(text + "\nno Python"),
        "exit": lambda: script.write_text(text + "\nraise SystemExit(5)"),
        "abstract": lambda: script.write_text(text.replace("def do_step", "def step")),
    }[damage]()
    run = in_host(c_host, folder, options="-t 2 -q")
    assert run.returncode == 3, run.stdout + run.stderr
    assert run.stdout.count("LOG model 3 logStatusError ") == run.stdout.count("LOG ") == 2
    assert [word for word in words if word not in run.stdout] == []


def copied(folder: Path, target: Path) -> Path:
    return Path(shutil.copytree(folder, target))


def test_python_of_the_host_without_its_standard_library_is_told(stock: Path) -> None:
    code = """
import sys
sys.path.insert(0, sys.argv[1])
from raw import Host
sys.modules["traceback"] = None
host = Host(*sys.argv[2:], "")
print(host.instantiate(logging=0), *host.heard())
"""
    library, resources = stock / "Lag/binaries/linux64/Lag.so", (stock / "Lag/resources").as_uri()
    run = in_python(code, Path(__file__).parent, library, resources)
    assert run.stdout.startswith("None (3, 'logStatusError', 'This FMU cannot start, and Python cannot say why"), run


def test_folder_and_name_in_latin_1(c_host: Path, stock: Path, tmp_path: Path) -> None:
    folder = copied(stock / "Talker", tmp_path / os.fsdecode("Ventil für 5 %".encode("latin-1")))
    run = in_host(c_host, folder, options="-n 1", instance=os.fsdecode(b"f\xfcr %n"))
    assert run.returncode == 0, run.stdout + run.stderr
    assert os.fsdecode(b"LOG f\xfcr %n 1 logStatusWarning") in run.stdout


def test_name_in_latin_1_is_itself_in_messages(semera: Path) -> None:
    answer = raw("name_in_latin_1", semera)
    ((status, _, text),) = answer["said"]
    assert status == ERROR and text.startswith(f"`{answer['name']}` (Semera), t = 0 s, step = -1 s: ")


def test_parameters_in_latin_1(fmus: Path, tmp_path: Path) -> None:
    """A table in a folder with such a name is read; a choice that is none, and a file that is not there, are named."""
    with zipfile.ZipFile(fmus / "SolenoidValve.fmu") as archive:
        archive.extractall(tmp_path)
    variables = ElementTree.parse(tmp_path / "modelDescription.xml").getroot().iter("ScalarVariable")
    reference = {v.attrib["name"]: v.attrib["valueReference"] for v in variables}
    law, file = reference["gap.law"], reference["gap.file"]
    folder = tmp_path / os.fsdecode(b"H\xfcb %n")
    folder.mkdir()
    table = shutil.copy(ROOT / "fmus" / "solenoid_valve" / "fringing_19.csv", folder)
    missing = str(folder / "none.csv")
    cases = [[law, "table", file, str(table)], [law, os.fsdecode(b"\xfc %n")], [law, "table", file, missing]]
    good, choice, absent = raw("texts", tmp_path, cases)
    assert good == [0, []]
    assert choice[0] == ERROR and is_one_error(choice[1], "`gap.law` is `\udcfc %n`; expected one of")
    assert absent[0] == ERROR and is_one_error(absent[1], "`gap.file`", missing)


# Calls ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Semera", "Lag"])
def test_handles_and_buffers_of_states(semera: Path, stock: Path, name: str) -> None:
    facts = raw("states", semera if name == "Semera" else stock / name)
    assert facts["free NULL"] == facts["free nothing"] == 0
    assert facts["again"] == [0, True]
    status, size = facts["size"]
    assert status == 0 and size > 4
    assert facts["long"] == [0, "7f" * 8]  # nothing written behind the state
    assert facts["said"] == []
    assert facts["small"][:2] == [ERROR, "7f" * 8] and is_one_error(facts["small"][2], str(size), "4")
    for case in ("longer bytes", "set nothing"):
        assert facts[case][0] == ERROR and is_one_error(facts[case][1]), case
    assert facts["free"] == [0, None]


def is_one_error(heard: Heard, *words: str) -> bool:
    ((status, category, text),) = heard
    return (status, category) == (ERROR, "logStatusError") and all(word in text for word in words)


def test_saving_into_a_handle_again_does_not_leak(semera: Path) -> None:
    assert min(raw("handles", semera)["growth"]) < 200_000  # bytes in 5000 times; it were 2 MB


def test_instances_that_failed_do_not_leak(semera: Path) -> None:
    assert min(raw("failures", semera)["growth"]) < 500_000  # bytes in 500 times; it were 15 MB


def test_refusal_is_one_message_and_the_instance_can_be_reset(semera: Path) -> None:
    facts = raw("refusal", semera)
    assert facts["before"] == [0] * 5
    assert facts["refused"][0] == ERROR and is_one_error(facts["refused"][1], "`one` (Semera), t = 0.005 s")
    assert facts["reset"] == [0, []]
    assert facts["traces"][0] == facts["traces"][1]
    assert {status for status, _ in facts["traces"][0]} == {0}


def test_what_is_not_provided_is_refused_and_nothing_changes(semera: Path) -> None:
    facts = raw("missing", semera)
    for name, (status, heard) in facts["answers"].items():
        if name in {f"Get{kind}Status" for kind in KINDS}:
            assert (status, heard) == (DISCARD, [])
        else:
            assert status == ERROR and is_one_error(heard, "not provided", f"fmi2{name}")
    assert facts["step"] == 0


@pytest.mark.parametrize("name", ["Semera", "Lag"])
def test_references_beside_the_table_are_refused(semera: Path, stock: Path, name: str) -> None:
    answers = raw("references", semera if name == "Semera" else stock / name)
    assert {case: answer for case, answer in answers.items() if answer != [ERROR, 1]} == {}


def test_slave_that_answers_oddly(tmp_path: Path) -> None:
    facts = raw("odd_values", build_slaves(tmp_path, {"Odd": ODD}) / "Odd")
    for k in range(7):
        assert facts[str(k)][0] == ERROR and is_one_error(facts[str(k)][2]), k
    assert "SystemExit: leaving" in facts["5"][2][0][2] and "KeyboardInterrupt" in facts["6"][2][0][2]
    assert facts["7"] == [0, 7.0, [[1, "logStatusWarning", "\\ud800   %n"]]]
    assert facts["text"] == [0, True]


def test_host_chooses_what_it_hears(stock: Path) -> None:
    heard = raw("categories", stock / "Talker")
    warning = ["logStatusWarning"]
    assert heard == {"all": warning, "warnings": warning, "all by name": warning, "errors": [], "off": []}


def test_thousand_instances(semera: Path) -> None:
    facts = raw("many", semera)
    assert facts["stati"] == [0] and len(facts["values"]) == 1


def test_child_of_a_host_that_forks_goes_on(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Lag", stock / "Talker", options="-f -n 60 -t 2")
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.count("\n0 0.6 ") == 3  # two threads, then the child


def test_thousands_of_any_calls(semera: Path) -> None:
    stati = raw("fuzz", semera, 3000, 1)
    assert set(stati) == {"0", "3"} and sum(stati.values()) == 3000
