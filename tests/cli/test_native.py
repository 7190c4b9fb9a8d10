"""Native FMUs on the command line: build them, take them."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from gapsense._os import native
from gapsense.fmi.native import platforms
from gapsense.fmi.native.platforms import PLATFORMS

WRONG_INPUT = 2


def test_run_takes_the_native_fmus(gapsense, write, fmus, natives, tmp_path):
    scenario = write()
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "native").symlink_to(natives)
    results = []
    for name, choice in (("native", ["--native"]), ("python", ["--fmus", fmus])):
        done = gapsense("run", scenario, *choice, "--out", tmp_path / name)
        assert done.exit_code == 0, done.output
        results.append(next((tmp_path / name).glob("*.csv")).read_bytes())
    assert results[0] == results[1]


def test_native_fmus_that_were_not_built_are_missed(gapsense, write, tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules["gapsense.cosim.check"], "ROOT", tmp_path)  # not those of the checkout
    done = gapsense("run", write(), "--native")
    assert done.exit_code == WRONG_INPUT
    assert "Make it with `gapsense build --native`." in done.output


def test_two_choices_of_fmus_are_refused(gapsense, write, tmp_path):
    done = gapsense("run", write(), "--native", "--fmus", tmp_path)
    assert done.exit_code == WRONG_INPUT
    assert "Leave one out." in done.output


def test_unknown_platform_is_named(gapsense):
    done = gapsense("build", "--native", "--platforms", "linux64,amiga", "semera")
    assert done.exit_code == WRONG_INPUT
    assert "there is no platform `amiga`" in done.output
    assert all(name in done.output for name in PLATFORMS)


@pytest.mark.parametrize("compiler", ["cc", None])
def test_other_platforms_need_ziglang(gapsense, monkeypatch, compiler):
    for module in (native, platforms):
        monkeypatch.setattr(module, "zig_version", lambda: None)
    monkeypatch.setattr(platforms, "here", lambda: "linux64")
    monkeypatch.setattr(shutil, "which", lambda name: compiler and str(Path("/bin", name)))
    done = gapsense("build", "--native", "--platforms", "here" if compiler is None else "win64", "semera")
    assert done.exit_code == WRONG_INPUT
    assert "Run `pip install ziglang==" in done.output
    assert ("no C compiler is installed either" in done.output) == (compiler is None)
