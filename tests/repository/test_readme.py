"""The README and the other pages tell the truth."""

from __future__ import annotations

import re
import runpy
import sys
from functools import cache
from pathlib import Path

import pytest
import typer
from matplotlib.image import imread
from sources import MODULES, PYTHON, ROOT, SRC, others, texts

from gapsense.cli import app
from gapsense.fmi.components import find_components, load_component

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PAGE_OF_COMMANDS = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
PAGE_OF_SEMERA = (ROOT / "docs" / "semera.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "fmus").glob("*/page.md")),
]
COMMANDS = typer.main.get_command(app).commands


def package(requirement: str) -> str:
    """Normal name of the package in a requirement."""
    return re.match(r"[\w.-]+", requirement).group().lower().replace("_", "-")


def python_blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def written_by_commands() -> set[str]:
    """Files that commands write where no other name is given."""
    return {str(p.default) for each in COMMANDS.values() for p in each.params if isinstance(p.default, Path)}


def anchors(text: str) -> set[str]:
    """Names of the headings of a page; of equal ones those of both renderers."""
    found: set[str] = set()
    for heading in re.findall(
        r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE
    ):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\s-]", "", words).strip().lower()
        dashed = re.sub(r"\s", "-", name)
        found |= {f"{dashed}_1", f"{dashed}-1"} if dashed in found else {dashed}
    return found


def command(words: list[str]):
    """The command that words on a command line name, in its group if it has one."""
    assert words[0] in COMMANDS, words
    group = COMMANDS[words[0]]
    if not hasattr(group, "commands"):
        return group
    name = "run" if words[0] == "campaign" and words[1] not in group.commands else words[1]
    assert name in group.commands, words
    return group.commands[name]


def test_python_examples_run_and_end_in_a_plot(fmus, tmp_path, monkeypatch, capsys):
    example = "\n".join(python_blocks(README))
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    monkeypatch.chdir(tmp_path)
    exec(example, {"__name__": "__main__"})
    printed = capsys.readouterr().out
    assert re.fullmatch(r"<Ertss: 1000 samples, outputs position, .*>\n", printed), printed
    assert imread(tmp_path / "found.png").std() > 0.01


def test_readme_is_short():
    assert len(README.splitlines()) <= 140
    assert len(README.split()) < 1300


def test_figure_of_the_readme_is_made_by_its_script(fmus, tmp_path, monkeypatch):
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "docs" / "overview.py"))["make"](tmp_path / "overview.png")
    made, kept = imread(tmp_path / "overview.png"), imread(ROOT / "docs" / "overview.png")
    assert made.shape == kept.shape and abs(made - kept).mean() < 0.02


def test_targets_of_make_that_the_readme_names_exist():
    assert {"demo", "test"} <= set(re.findall(r"`?\bmake (\w+)(?:`|$)", README, re.MULTILINE))
    named = re.findall(r"`?\bmake (\w+)(?:`|$)", README + CONTRIBUTING, re.MULTILINE)
    assert {"bench", "demo", "slow", "test"} <= set(named)
    for target in named:
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE), target


def test_variants_and_scenarios_of_the_readme_exist():
    scenario = tomllib.loads((ROOT / "scenarios" / "semera_valve" / "scenario.toml").read_text("utf-8"))
    table = PAGE_OF_SEMERA.partition("| `--variant` |")[2].partition("\n\n")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == set(scenario["variants"])
    assert all(
        (ROOT / path / "scenario.toml").is_file() for path in re.findall(r"scenarios/\w+", README + CONTRIBUTING)
    )


def test_every_command_and_option_is_on_the_page_of_commands():
    chapters = dict(
        re.findall(r"^## `gapsense ([\w -]+)`\n(.*?)(?=^## |^<!--)", PAGE_OF_COMMANDS, re.MULTILINE | re.DOTALL)
    )
    assert set(COMMANDS) == {name.split()[0] for name in chapters}
    for name, chapter in chapters.items():
        for parameter in command(name.split()).params:
            assert parameter.param_type_name == "argument" or all(f"`{option}" in chapter for option in parameter.opts)


def test_tour_names_every_folder_and_module_at_the_top_of_the_package():
    tour = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    paths = [path for path in (ROOT / "src" / "gapsense").iterdir() if not path.name.startswith("_")]
    names = [path.name + "/" for path in paths if path.is_dir()] + [path.stem for path in paths if path.suffix == ".py"]
    assert len(names) > 20
    assert not [name for name in names if f"`{name}`" not in tour]


def test_exit_codes_of_the_page_of_commands_are_those_of_the_program():
    from gapsense.cli import console as cli

    for code, words in (
        (cli.FAILED, "failed"),
        (cli.WRONG_INPUT, "wrong input"),
        (cli.COMPONENT_FAILED, "a component"),
    ):
        assert re.search(rf"\b{code} [^,]*{words}", " ".join(PAGE_OF_COMMANDS.split())), (code, words)
    assert re.search(rf"\b{cli.INTERRUPTED} interrupted", PAGE_OF_COMMANDS)


def test_every_component_is_in_the_readme():
    names = {load_component(folder).name for folder in find_components(ROOT / "fmus")}
    assert names == set(re.findall(r"^\| \[`(\w+)`\]\(fmus/", README, re.MULTILINE))
    table = (ROOT / "docs" / "components.md").read_text(encoding="utf-8")
    assert names == set(re.findall(r"^\| \[`(\w+)`\]\(../fmus/", table, re.MULTILINE))
    for name, folder in re.findall(r"\[`(\w+)`\]\((?:\.\./)?fmus/(\w+)/page.md\)", README + table):
        assert load_component(ROOT / "fmus" / folder).name == name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if not re.match(r"https?://|mailto:", target):
            file, _, anchor = target.partition("#")
            linked = page.parent / file if file else page
            assert linked.exists(), target
            assert not anchor or anchor in anchors(linked.read_text(encoding="utf-8")), target


def test_anchors_are_found_and_wrong_ones_are_not():
    text = "# What it *is*, `A_b`\n\n```sh\n# no heading\n```\n\n## Twice\n\n## Twice\n"
    assert anchors(text) == {"what-it-is-a_b", "twice", "twice_1", "twice-1"}


@cache
def files():
    """Files of the repository, and those that commands write."""
    known = {path.relative_to(ROOT).as_posix() for path in (*texts(), *PYTHON)}
    return known | {path.name for path in (ROOT / "records").iterdir()} | written_by_commands()


@pytest.mark.parametrize(
    "page", PAGES[:2] + [p for p in PAGES if p.parent == ROOT / "docs"], ids=lambda page: page.name
)
def test_files_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    known = files() | {*re.findall(r"<!-- file: (\S+) -->", text)}  # that the reader writes
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
    names = {"markdown_it": "markdown-it-py", "markupsafe": "jinja2"}  # which comes with jinja2
    used = {names.get(name, name).lower().replace("_", "-") for path in MODULES for name, _ in others(path)}
    extras = PROJECT["optional-dependencies"]
    optional = {package(r) for extra in ("pandas", "campaign", "report", "dev") for r in extras[extra]}
    assert used <= declared | optional
    assert declared <= used | {"tomli", "scipy"}
