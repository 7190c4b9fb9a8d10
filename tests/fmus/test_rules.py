"""What our FMUs state in their annotations: `check` refuses what the FMU would refuse in a run, in the same words."""

import re
import zipfile
from pathlib import Path

import pytest

from gapsense.cosim import FmuError, check, prepare
from gapsense.cosim.fmu.archive import UnusableError
from gapsense.cosim.fmu.descriptions import describe
from gapsense.cosim.fmu.instance import Instance, unpack_fmu
from gapsense.fmi.components import load_component

ROOT = Path(__file__).parents[2]
FOLDERS = sorted(path.parent for path in ROOT.glob("fmus/*/component.py"))
TABLE = "gap,reluctance\n0,1\n1e-3,2e7\n2e-3,3e7\n3e-3,4e7\n"


@pytest.fixture
def problems(tmp_path, fmus):
    """Problems of a scenario with one component of ours, given some lines."""

    def problems(fmu, values, more=""):
        path = tmp_path / "scenario.toml"
        inputs = "".join(f'"a.{v.name}" = 0.0\n' for v in describe(fmus / f"{fmu}.fmu").of("input"))
        path.write_text(
            f'title = "t"\n[experiment]\nstop = 1e-3\nbase_step = 25e-6\n[components.a]\nfmu = "{fmu}"\n'
            f"set = {{ {values} }}\n[inputs]\n{inputs}{more}",
            encoding="utf-8",
        )
        return check(path, fmus=fmus)

    return problems


@pytest.mark.parametrize(
    ("fmu", "values", "words"),
    [
        ("DriveVoltage", 'waveform = "squar"', "`waveform` is `squar`; expected one of square, step, table"),
        ("DriveVoltage", "pwm.low = 30.0, pwm.high = 20.0", "`pwm.low` is 30.0; expected less than `pwm.high` = 20.0"),
        ("ReluctanceActuator", "stop.lower = 0.01", "`stop.lower` is 0.01; expected less than `stop.upper`"),
        ("DriveVoltage", 'waveform = "table", table.file = "missing.csv"', "there is no file"),
        ("ReluctanceActuator", 'gap.law = "table", gap.file = "short.csv"', "2 rows, but at least 4"),
        ("ReluctanceActuator", 'gap.law = "table", gap.file = "text.csv"', "`reluctance` is `x`, not a finite number"),
        ("ReluctanceActuator", 'gap.law = "table", gap.file = "good.csv"', ""),
        ("DriveVoltage", 'waveform = "pwm"', ""),
    ],
)
def test_check_tells_what_the_run_would(problems, tmp_path, fmu, values, words):
    (tmp_path / "good.csv").write_text(TABLE)
    (tmp_path / "short.csv").write_text("\n".join(TABLE.splitlines()[:3]))
    (tmp_path / "text.csv").write_text(TABLE.replace("2e7", "x"))
    found = problems(fmu, values)
    assert len(found) == bool(words), found
    assert all(words in problem and problem.endswith(".") for problem in found)


def test_limit_of_a_product_is_checked(problems, fmus):
    rules = describe(fmus / "Mhe.fmu").rules
    (name, power), *_ = rules.limits[0].powers
    assert problems("Mhe", f'"{name}" = {1e30 if power > 0 else 1e-30}')


def test_combinations_of_a_sweep_are_judged(problems):
    lines = '[sweep]\n"a.pwm.low" = [1.0, 5.0]\n"a.pwm.high" = [2.0, 6.0]\n"a.waveform" = ["pwm", "pmw"]\n'
    found = problems("DriveVoltage", "", lines)
    assert sum("`pwm.low` is 5.0; expected less than `pwm.high` = 2.0" in problem for problem in found) == 1
    assert sum("sweep, components.a: `waveform` is `pmw`; expected one of" in problem for problem in found) == 1
    assert len(found) == 2


@pytest.mark.parametrize("place", [1_000, 1_300, 2_999])
@pytest.mark.parametrize(("name", "good", "wrong"), [("waveform", "pwm", "pmw"), ("pwm.low", "1.0", "low")])
def test_value_beyond_the_first_thousand_rows_is_judged(problems, tmp_path, place, name, good, wrong):
    cells = [good] * 3_000
    cells[place] = wrong
    rows = [f"{cell},{10.0 + k}" for k, cell in enumerate(cells)]
    (tmp_path / "rows.csv").write_text("\n".join([f"a.{name},a.pwm.high", *rows]))
    found = problems("DriveVoltage", 'waveform = "pwm"', '[sweep]\nrows = "rows.csv"\n')
    assert len(found) == 1 and wrong in found[0], found


def test_value_beyond_the_first_thousand_combinations_of_lists_is_judged(problems):
    many = ", ".join(str(1.0 + k) for k in range(2_000))
    found = problems("DriveVoltage", "", f'[sweep]\n"a.waveform" = ["pwm", "pmw"]\n"a.pwm.high" = [{many}]\n')
    assert len(found) == 1 and "`waveform` is `pmw`" in found[0], found


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_annotations_say_what_the_port_table_says(folder, fmus):
    component = load_component(folder)
    rules = describe(fmus / f"{component.name}.fmu").rules
    stated = {port.name: port for port in rules.ports}
    for port in component.of("parameter"):
        assert (stated[port.name].choices, stated[port.name].columns) == (port.choices, port.columns)
        assert stated[port.name].start == port.start and stated[port.name].kind == port.kind
    assert (rules.rising, rules.limits) == (component.rising, component.limits)


def test_words_are_those_of_the_fmu_itself(problems, tmp_path, fmus):
    (told,) = problems("DriveVoltage", "pwm.low = 30.0, pwm.high = 20.0")
    description = describe(fmus / "DriveVoltage.fmu")
    instance = Instance("a", description, unpack_fmu(description))
    with pytest.raises(FmuError) as caught:
        instance.initialize({"pwm.low": 30.0, "pwm.high": 20.0}, 0.0, 1.0)
        instance.call("fmi2ExitInitializationMode")
    assert told.partition("components.a: ")[2].partition(" Correct")[0] in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('lower="pwm.low"', 'lower="pwm.lo"'),
        ('lower="pwm.low"', 'lowr="pwm.low"'),
        ("</Rules>", '<Limit below="x" reason="r"><Factor variable="pwm.low" power="1"/></Limit></Rules>'),
        ("</Rules>", '<Limit below="1" reason="r"><Factor variable="pwm.low" power="1000000"/></Limit></Rules>'),
    ],
)
def test_annotations_that_make_no_sense_are_refused(tmp_path, fmus, old, new):
    path = tmp_path / "Wrong.fmu"
    with zipfile.ZipFile(fmus / "DriveVoltage.fmu") as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            text = source.read(name)
            assert name != "modelDescription.xml" or old.encode() in text
            target.writestr(name, text.replace(old.encode(), new.encode()) if name == "modelDescription.xml" else text)
    with pytest.raises(UnusableError, match=re.escape("its annotations for Gapsense are wrong")):
        describe(path)


def test_every_scenario_of_ours_passes(fmus):
    for folder in sorted(ROOT.joinpath("scenarios").iterdir()):
        assert prepare(folder, None, fmus)
