"""The README and the other pages tell the truth."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest
import typer
from sources import MODULES, PYTHON, ROOT, SRC, others, texts

from gapsense.cli import app
from gapsense.fmi.components import find_components, load_component

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGE_OF_SEMERA = (ROOT / "docs" / "semera.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "fmus").glob("*/page.md"))]
COMMANDS = typer.main.get_command(app).commands


def package(requirement: str) -> str:
    """Normal name of the package in a requirement."""
    return re.match(r"[\w.-]+", requirement).group().lower().replace("_", "-")


def python_blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def command(words: list[str]):
    """The command that words on a command line name, in its group if it has one."""
    assert words[0] in COMMANDS, words
    group = COMMANDS[words[0]]
    if not hasattr(group, "commands"):
        return group
    name = "run" if words[0] == "campaign" and words[1] not in group.commands else words[1]
    assert name in group.commands, words
    return group.commands[name]


def test_python_examples_run_and_print_a_number(fmus, tmp_path):
    example = "\n".join(python_blocks(README))
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    done = subprocess.run([sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = re.match(r"largest error of .*: (\S+) Wb\n<Result 'my valve': 1601 rows .*>\n$", done.stdout)
    assert found and 1e-5 < float(found.group(1)) < 1e-2, done.stdout


def test_targets_of_make_that_the_readme_names_exist():
    named = re.findall(r"`?\bmake (\w+)(?:`|$)", README, re.MULTILINE)
    assert {"bench", "demo", "slow", "test"} <= set(named)
    for target in named:
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE), target


def test_variants_and_scenarios_of_the_readme_exist():
    scenario = tomllib.loads((ROOT / "scenarios" / "semera_valve" / "scenario.toml").read_text("utf-8"))
    assert set(re.findall(r"--variant (\w+)", PAGE_OF_SEMERA)) == set(scenario["variants"])
    assert all((ROOT / path / "scenario.toml").is_file() for path in re.findall(r"scenarios/\w+", README))


def test_every_command_is_named_in_the_readme():
    section = README.partition("\n## Commands\n")[2].partition("\n## ")[0]
    named = set(re.findall(r"`(?:gapsense )?([a-z-]+)`", section))
    assert set(COMMANDS) <= named


def test_exit_codes_of_the_readme_are_those_of_the_program():
    from gapsense.cli import common as cli

    for code, words in (
        (cli.FAILED, "failed"),
        (cli.WRONG_INPUT, "wrong input"),
        (cli.COMPONENT_FAILED, "a component"),
    ):
        assert re.search(rf"\b{code} [^,]*{words}", " ".join(README.split())), (code, words)
    assert re.search(rf"\b{cli.INTERRUPTED} interrupted", README)


def test_every_component_is_in_the_readme():
    names = {load_component(folder).name for folder in find_components(ROOT / "fmus")}
    assert names == set(re.findall(r"^\| `(\w+)` \|", README, re.MULTILINE))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if not re.match(r"https?://|mailto:", target):
            assert (page.parent / target.partition("#")[0]).exists(), target


@pytest.mark.parametrize("page", PAGES[:1] + [p for p in PAGES if p.parent.name == "docs"], ids=lambda page: page.name)
def test_files_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    known = {path.relative_to(ROOT).as_posix() for path in (*texts(), *PYTHON)}
    known |= set(re.findall(r"<!-- file: (\S+) -->", text))  # that the reader writes
    for span in re.findall(r"`([^`\n]+)`", text):
        name = span.split()[-1]
        if re.fullmatch(r"[\w./-]+\.(py|md|toml|txt|c|h)", name):
            assert any(path == name or path.endswith(f"/{name}") for path in known), span
        elif re.fullmatch(r"[\w./-]+/", name):
            assert (ROOT / name).is_dir() or (SRC / name).is_dir(), span


def test_every_dependency_has_a_row_that_says_why():
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.+?) \| .+ \| .+ \|$", page, re.MULTILINE)
    named = {word.lower() for row in rows for word in re.findall(r"[\w.-]+", row)}
    assert {package(r) for r in PROJECT["dependencies"]} <= named
    groups = PROJECT["optional-dependencies"].values()
    assert all(re.match(r"[\w.-]+", r).group() in page for group in groups for r in group)


def test_constraints_cover_every_dependency_and_fit_it():
    from packaging.requirements import Requirement

    locked: dict[str, list[str]] = {}
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        if found := re.match(r"([\w.-]+)==([\w.]+)", line):
            locked.setdefault(package(found.group(1)), []).append(found.group(2))
    wanted = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["dev"]]
    wanted = [r for r in wanted if package(r) != "gapsense"]  # its own extras
    assert {package(r) for r in wanted} <= set(locked)
    for requirement in map(Requirement, wanted):
        versions = locked[package(requirement.name)]
        assert all(requirement.specifier.contains(version) for version in versions), (str(requirement), versions)


def test_imports_of_the_package_are_declared():
    declared = {package(r) for r in PROJECT["dependencies"]}
    names = {"markdown_it": "markdown-it-py"}
    used = {names.get(name, name).lower().replace("_", "-") for path in MODULES for name, _ in others(path)}
    extras = PROJECT["optional-dependencies"]
    optional = {package(r) for extra in ("pandas", "campaign", "report", "dev") for r in extras[extra]}
    assert used <= declared | optional
    assert declared <= used | {"tomli", "scipy"}
