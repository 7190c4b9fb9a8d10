"""Imports point downwards only."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
import typer
from sources import MODULES, PYTHON, ROOT, SCENARIOS, SRC, circles, imports, lists, name_of, others, ours, part_of, tree

import gapsense
from gapsense import cosim
from gapsense.cli import app

OF_KERNELS = (  # in order: each may import those before it
    "version", "units", "ports", "layout", "interface", "trace", "elementary", "emit", "derivative", "linalg",
    "integrate", "random", "kernel",
)  # fmt: skip
OF_FILES = (  # likewise
    "version", "offered", "shipped", "native", "problems", "locks", "files", "tables", "parameters",
    "importable", "interrupts", "processes", "workers",
)  # fmt: skip
FOUNDATIONS, GENERAL = set(OF_KERNELS), set(OF_FILES)
SIDE_BY_SIDE = {"actuators", "estimators", "drive", "sensor"}
NUMBERS = FOUNDATIONS | GENERAL | SIDE_BY_SIDE | {"control", "cosim", "embedded", "fmi", "lanes", "many", "vectors"}
MAY_IMPORT = {
    **{part: {*order[: k + 1]} for order in (OF_KERNELS, OF_FILES) for k, part in enumerate(order)},
    "__init__": set(),  # of kernels and _os
    **{part: FOUNDATIONS | {part} for part in SIDE_BY_SIDE},
    "control": FOUNDATIONS | {"control", "estimators"},
    "lanes": FOUNDATIONS | {"lanes", "locks", "native"},
    "fmi": FOUNDATIONS | {"files", "fmi", "native", "problems", "shipped"},
    "cosim": GENERAL | {"cosim", "fmi", "ports", "random"},
    "vectors": NUMBERS - {"many", "control", "embedded"},
    "many": GENERAL | {"many", "cosim", "vectors"},
    "embedded": FOUNDATIONS | {"embedded", "fmi", "problems"},
    "ssp": GENERAL | {"cosim", "ssp", "units"},
    "report": NUMBERS | {"report"},
    "page": NUMBERS | {"report", "page"},
    "identification": NUMBERS | {"identification", "report"},
    "runnable": NUMBERS | {"report"},
    "components": {"runnable"},
    "functions": NUMBERS | {"identification", "report", "shipped"},
    "pytest_plugin": {"cosim", "report", "tables"},
    "cli": NUMBERS | {"identification", "report", "ssp", "studies", "cli", "page", "__main__", "functions", "runnable"},
    "studies": NUMBERS | {"report", "studies"},
    "scenarios": NUMBERS | {"identification", "report", "studies", "scenarios"},
    "command": NUMBERS | {"identification", "report", "studies", "scenarios", "cli"},
    "build_fmus": {"__main__"},
    "__main__": {"cli"},
}
REACHES_UP = {  # in functions
    "src/gapsense/cosim/show.py": {"report"},  # when someone wants to see a result
    "src/gapsense/cosim/run/engines.py": {"vectors"},  # when a scenario can do without FMUs
    "src/gapsense/cosim/scenario/build.py": {"many"},  # when it is swept
    "src/gapsense/cosim/__init__.py": {"many"},  # when `cosim.sweep` is asked for
}
PACKAGES = {  # beside the standard library
    "functions": {"matplotlib", "numpy", "rich"},
    **{part: {"numpy"} for part in FOUNDATIONS | SIDE_BY_SIDE | {"control", "lanes"}},
    "fmi": {"pythonfmu", "markdown_it"},
    **{part: set() for part in ("__init__", "embedded")},
    **{part: {"numpy", "tomli"} for part in GENERAL},
    **{part: {"numpy"} for part in ("vectors", "runnable", "components")},
    "cosim": {"numpy", "scipy", "fmpy", "tomli_w"},
    "many": {"fmpy", "numpy", "scipy", "pyarrow", "distributed"},
    "ssp": {"fmpy", "lxml", "tomli", "tomli_w"},
    "pytest_plugin": {"pytest"},
    "identification": {"numpy", "scipy", "matplotlib", "rich"},
    "studies": {"numpy", "scipy", "matplotlib", "fmpy", "rich"},
    "scenarios": {"numpy", "scipy", "matplotlib", "fmpy", "rich"},
    "report": {"bokeh", "jinja2", "markupsafe", "numpy", "scipy", "matplotlib", "fmpy", "rich", "pandas"},
    "page": {"bokeh", "markupsafe"},
    "cli": {"typer", "rich", "fmpy"},
    "command": {"typer"},
    "build_fmus": set(),
    "__main__": set(),
}
HEAVY = {"scipy", "matplotlib", "pythonfmu", "fmpy", "pandas", "pyarrow", "distributed", "bokeh", "jinja2", "lxml"}
SHOWING = {"rich", "typer"}
LOADED = "\nimport sys\nprint(*{name.partition('.')[0] for name in sys.modules})"
OWN = "failing life ports sentences slave state steps tables values variables"
TRAVELLERS = set(OWN.split())  # their copies are in every FMU


def test_every_part_of_the_package_has_its_place():
    assert {part_of(path) for path in MODULES} == set(MAY_IMPORT)


def test_imports_of_our_own_parts_point_downwards():
    wrong = [
        f"{name_of(path)}:{line} imports gapsense.{part}"
        for path in MODULES
        for part, line in ours(path)
        if part not in MAY_IMPORT[part_of(path)] | REACHES_UP.get(name_of(path), set())
    ]
    assert not wrong


def test_what_reaches_up_does_so_only_when_called():
    for name, parts in REACHES_UP.items():
        imported = [n.module for n in tree(ROOT / name).body if isinstance(n, ast.ImportFrom) and n.module]
        assert not [module for module in imported if module.split(".")[:2] in [["gapsense", part] for part in parts]]


def test_packages_of_others_stay_where_they_belong():
    wrong = [
        f"{name_of(path)}:{line} imports {package}"
        for path in MODULES
        for package, line in others(path)
        if package not in PACKAGES[part_of(path)]
    ]
    assert not wrong


@pytest.mark.parametrize("name", sorted(TRAVELLERS))
def test_what_travels_in_an_fmu_needs_only_the_standard_library_and_pythonfmu(name):
    path = SRC / "fmi" / f"{name}.py"
    assert {package for package, _ in others(path)} <= {"pythonfmu"}
    relative = {n.removeprefix("gapsense.fmi.").partition(".")[0] for n, _ in imports(path) if n[:8] == "gapsense"}
    assert relative <= TRAVELLERS
    assert all(n.level == 1 for n in ast.walk(tree(path)) if isinstance(n, ast.ImportFrom) and n.module in TRAVELLERS)


def test_cosim_takes_of_fmi_only_what_judges_values_of_parameters_and_what_falls_due_in_a_step():
    found = [name for path in (SRC / "cosim").rglob("*.py") for name, _ in imports(path)]
    names = {name.split(".")[2] for name in found if name.startswith("gapsense.fmi")}
    assert names == {"ports", "steps", "values"}  # `steps` for a board, which has no shell that asks it


def test_list_of_travellers_is_that_of_the_packager():
    from gapsense.fmi.package import SHELL

    assert {name.removesuffix(".py") for name in SHELL} == TRAVELLERS


def test_components_import_the_makers_of_port_tables_and_kernels_only():
    folder = SRC.parents[1] / "fmus"
    for path in sorted(folder.glob("*/component.py")):
        modules = {n.module for n in ast.walk(tree(path)) if isinstance(n, ast.ImportFrom) and n.module}
        others = modules - {"gapsense.fmi.ports", "gapsense.kernels.interface"}
        assert {name.split(".")[1] for name in others} <= SIDE_BY_SIDE | {"control"}, name_of(path)


def test_no_modules_import_each_other_in_a_circle():
    """Imports in functions and under TYPE_CHECKING count: whoever reads one of the modules needs all of them."""
    assert not circles()


def test_one_module_alone_says_how_another_python_is_started():
    """`-m`, `-c` or a script would each import from a folder that is not ours."""
    assert [path.name for path in PYTHON if "executable" in path.read_text("utf-8")] == ["importable.py"]


HELP = "from gapsense.cli import app\napp(['--help'], standalone_mode=False)"
STARTS = {  # and what they must not load
    "import gapsense, gapsense.cosim, gapsense.cosim.run.ahead": HEAVY | SHOWING | {"numpy"},
    "from gapsense.cli import app": HEAVY | {"numpy"},
    "from gapsense.cli import load_app; load_app('run')": HEAVY | {"numpy", "email", "argparse"},
    HELP: HEAVY | {"numpy"},
    "from gapsense.cosim import run, sweep": HEAVY | SHOWING,
    "import gapsense.cosim.run.apart, gapsense.many.worker": HEAVY | SHOWING,
}


@pytest.mark.parametrize("start", STARTS)
def test_what_starts_often_loads_no_package_that_it_does_not_need(start):
    environment = {**os.environ, "PYTHONPATH": str(SRC.parent)}
    done = subprocess.run([sys.executable, "-c", start + LOADED], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "gapsense" in loaded
    assert sorted(loaded & STARTS[start]) == []


@pytest.mark.parametrize(("package", "offered"), [(gapsense, gapsense._PLACES), (cosim, cosim.OFFERED)])
def test_what_a_package_offers_is_what_type_checkers_are_told(package, offered):
    blocks = [n for n in tree(Path(package.__file__)).body if isinstance(n, ast.If)]
    (block,) = (n for n in blocks if ast.unparse(n.test) == "TYPE_CHECKING")
    told = {alias.asname: n.module for n in block.body if isinstance(n, ast.ImportFrom) for alias in n.names}
    assert told == offered
    for name in told:
        assert not isinstance(getattr(package, name), ModuleType), name


def folders(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.is_dir() and not path.name.startswith(("_", "."))}


COMMANDS = typer.main.get_command(app).commands
FOUND_BY_WALKING = {
    "studies": {path.parent.name for path in SCENARIOS.glob("*/study.py")},
    "commands": set(COMMANDS),
    "commands of studies": set(COMMANDS["study"].commands),
    "components": folders(ROOT / "fmus"),
    "estimators": {path.stem for path in (SRC / "estimators").glob("[!_]*")},
    "scenarios": folders(ROOT / "scenarios"),
}


@pytest.mark.parametrize("kind", FOUND_BY_WALKING)
def test_no_list_kept_by_hand_names_most_of_what_is_found_by_walking(kind):
    names = FOUND_BY_WALKING[kind]
    assert len(names) > 5
    wrong = [
        f"{name_of(path)}:{line} lists {', '.join(sorted(words & names))}"
        for path in MODULES
        for line, words in lists(path)
        if 2 * len(words & names) > len(names)
    ]
    assert not wrong
