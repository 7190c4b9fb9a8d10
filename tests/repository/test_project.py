"""What a project has beside its code: files for hosts and for those who cite, the version, the hosted CI."""

from __future__ import annotations

import re

import pytest
import yaml
from check_jsonschema import main
from click.testing import CliRunner
from sources import ROOT

import gapsense

SCHEMAS = {
    ".github/workflows/ci.yml": "github-workflows",
    ".github/ISSUE_TEMPLATE/bug.yml": "github-issue-forms",
    ".github/ISSUE_TEMPLATE/wish.yml": "github-issue-forms",
    ".github/ISSUE_TEMPLATE/config.yml": "github-issue-config",
    "CITATION.cff": "citation-file-format",
}
WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("file", SCHEMAS)
def test_file_follows_the_schema_of_its_kind(file):
    done = CliRunner().invoke(main, ["--builtin-schema", f"vendor.{SCHEMAS[file]}", str(ROOT / file)])
    assert done.exit_code == 0, done.output


def test_a_workflow_that_is_wrong_is_found(tmp_path):
    wrong = tmp_path / "ci.yml"
    wrong.write_text("on: push\njobs:\n  one:\n    steps:\n      - run: make\n", encoding="utf-8")  # on no machine
    assert CliRunner().invoke(main, ["--builtin-schema", "vendor.github-workflows", str(wrong)]).exit_code == 1


def test_hosted_ci_covers_all_pythons_and_systems_and_names_what_there_is():
    jobs = WORKFLOW["jobs"].values()
    pythons = {v for job in jobs for v in job.get("strategy", {}).get("matrix", {}).get("python", [])}
    steps = [step for job in jobs for step in job["steps"]]
    pythons |= {str(step["with"]["python-version"]) for step in steps if "python-version" in step.get("with", {})}
    assert {f"3.{minor}" for minor in range(10, 15)} <= pythons
    assert {job["runs-on"] for job in jobs} == {"ubuntu-latest", "windows-latest", "macos-latest"}
    commands = "\n".join(step["run"] for step in steps if "run" in step)
    targets = {target for line in re.findall(r"^make (.+)$", commands, re.MULTILINE) for target in line.split()}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert targets and all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
    folders = re.findall(r"\b(?:tests|\.ci)/\w+", commands)
    assert len(folders) > 10 and all((ROOT / folder).exists() for folder in folders)


def test_pre_commit_does_what_make_lint_does():
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0]["hooks"]
    assert [hook["entry"] for hook in hooks] == ["make lint"]


def test_version_stands_in_one_place():
    named = [ROOT / name for name in ("pyproject.toml", "CITATION.cff", "setup.py", "mkdocs.yml")]
    assert not [file.name for file in named if gapsense.__version__ in file.read_text(encoding="utf-8")]
    assert f"\n## {gapsense.__version__}\n" in (ROOT / "docs" / "changelog.md").read_text(encoding="utf-8")
