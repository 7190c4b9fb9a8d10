"""`gapsense export-c`: what it writes, and what it refuses with which words."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from host import compile_
from typer.testing import CliRunner

from gapsense.cli import app

RUNNER = CliRunner()


def run(*arguments: str) -> tuple[int, str]:
    result = RUNNER.invoke(app, ["export-c", *arguments])
    return result.exit_code, " ".join(result.output.split())


@pytest.mark.slow
def test_several_components_get_the_outputs_that_they_have(tmp_path: Path) -> None:
    code, text = run("semera", "ekf", "mhe", "--outputs", "resistance,flux_linkage", "--out", str(tmp_path))
    assert code == 0, text
    assert {p.name for p in tmp_path.iterdir()} == {
        *(f"{name}{ending}" for name in ("semera", "ekf", "mhe") for ending in (".c", ".h", "_main.c")),
        "cortex_m",
        "README.md",
    }
    outputs = (tmp_path / "ekf.h").read_text().partition("Outputs, valid")[2]
    assert "flux_linkage" in outputs and "position" not in outputs
    assert "resistance" in (tmp_path / "mhe.h").read_text().partition("Outputs, valid")[2]


def test_the_readme_says_how_to_build_it_and_that_works(tmp_path: Path) -> None:
    code, text = run("Semera", "--real", "double", "--out", str(tmp_path))
    assert code == 0, text
    line = next(line for line in (tmp_path / "README.md").read_text().splitlines() if line.startswith("    gcc "))
    done = subprocess.run(line, shell=True, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0].startswith("resistance,inductance,flux_linkage,quality,")


def test_values_come_from_files_and_from_the_command(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('[values]\n"noise.current" = 2e-3\n"coil.turns" = 1000.0\n')
    code, text = run(
        "semera", "--parameters", str(file), "--set", "coil.turns=1140", "--set", "gate.update=false",
        "--out", str(tmp_path / "out"),
    )  # fmt: skip
    assert code == 0, text
    made = (tmp_path / "out" / "semera.c").read_text()
    assert "par.noise_current = 0.002f;" in made
    assert "par.coil_turns = 1140.0f;" in made
    assert "par.gate_update = 0.0f;" in made


def test_a_table_of_the_user_is_in_the_code(tmp_path: Path) -> None:
    file = tmp_path / "gap.csv"
    file.write_text("gap,reluctance\n0,0\n1e-4,8e6\n5e-4,3e7\n1e-3,4.5e7\n2e-3,6e7\n")
    code, text = run(
        "ekf", "--set", f"gap.file={file}", "--set", "gap.law=table", "--bake", "--out", str(tmp_path / "out")
    )
    assert code == 0, text
    made = (tmp_path / "out" / "ekf.c").read_text()
    assert "0.0f, 8000000.0f, 30000000.0f, 45000000.0f, 60000000.0f," in made
    assert "gap_file_size = 5" in made
    compile_("gcc", "-std=c99", "-O0", "-c", str(tmp_path / "out" / "ekf.c"), "-o", str(tmp_path / "ekf.o"))


def test_lean_is_another_form_of_those_that_have_one(tmp_path: Path) -> None:
    code, text = run("semera", "integral_estimator", "--lean", "--out", str(tmp_path))
    assert code == 0, text
    assert "from gapsense.estimators.semera_lean;" in " ".join((tmp_path / "semera.c").read_text().split())
    assert "from gapsense.estimators.integral;" in " ".join((tmp_path / "integral_estimator.c").read_text().split())


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (("semera", "ekf", "--outputs", "resistanc"), "no output `resistanc`. Did you mean `resistance`?"),
        (("semera", "ekf", "--outputs", "resistance"), "`ekf` does not have these. Known: `current_error`"),
        (("semera", "--set", "noise.curent=1"), "no parameter `noise.curent`. Did you mean `noise.current`?"),
        (("semera", "--set", "noise.current"), "`parameter=value` expected. Correct it."),
        (("semera", "--set", "coil.turns=1", "--set", "coil.turns=2"), "coil.turns: given twice. Keep one."),
        (("semera", "--set", "noise.current=-1"), "semera: `noise.current` is -1; expected at least 0 A."),
        (("semra",), "there is no component `semra` in "),
        (("ekf", "--lean"), "--lean: `ekf`: only `semera` has such a form. Leave it out."),
    ],
)
def test_what_is_wrong_is_told_and_nothing_is_written(
    tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    code, text = run(*arguments, "--out", str(tmp_path / "out"))
    assert code == 2 and sentence in text
    assert not (tmp_path / "out").exists()


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    code, text = run("semera", "--set", "noise.current=-1", "--set", "x", "--out", str(tmp_path / "out"))
    assert code == 2 and "noise.current" in text and "--set, x:" in text


def test_what_does_not_fit_into_the_memory_is_refused(tmp_path: Path) -> None:
    code, text = run("semera", "--ram", "4200", "--out", str(tmp_path / "out"))
    assert code == 2 and "more than the 4,200 that there are. Take fewer `--outputs` or `--bake`" in text
    assert not (tmp_path / "out").exists()
    assert run("semera", "--ram", "65536", "--out", str(tmp_path))[0] == 0
    assert "LENGTH = 65536\n" in (tmp_path / "cortex_m" / "link.ld").read_text()


def test_an_earlier_export_is_replaced(tmp_path: Path) -> None:
    for outputs in ("resistance", "quality"):
        assert run("semera", "--outputs", outputs, "--out", str(tmp_path))[0] == 0
    assert "quality" in (tmp_path / "semera.h").read_text().partition("Outputs, valid")[2]
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_files_of_others_are_kept_and_own_ones_written_again(tmp_path: Path) -> None:
    assert run("semera", "--out", str(tmp_path))[0] == 0
    made = {path: path.read_bytes() for path in tmp_path.rglob("*.*") if path.is_file()}
    assert run("semera", "--out", str(tmp_path), "--bake")[0] == 0
    for path in made:
        path.write_text("mine")
        code, text = run("semera", "--out", str(tmp_path))
        assert code == 2 and f"{path.name}` exists and is not an exported file" in text
        assert path.read_text() == "mine"
        path.write_bytes(made[path])
