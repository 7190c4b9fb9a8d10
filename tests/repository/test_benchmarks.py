"""Every benchmark that `make bench` runs still runs, and the ones that miss a bound do not stop the others."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest
from sources import ROOT

ALL = ROOT / "benchmarks" / "all.py"


@pytest.mark.slow
def test_all_benchmarks_run_to_their_end_when_small(natives):
    shutil.copytree(natives, ROOT / "build" / "native", dirs_exist_ok=True)
    done = subprocess.run([sys.executable, str(ALL), "--small"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Bounds missed:" in done.stdout
    assert len(re.findall(r"^benchmarks/\w+\.py$", done.stdout, re.MULTILINE)) == 10


def test_missed_bound_is_told_and_broken_benchmark_is_named(tmp_path, monkeypatch, capfd):
    monkeypatch.syspath_prepend(str(ALL.parent))
    monkeypatch.setattr(sys, "argv", ["all.py"])
    scripts = {"bad.py": "raise SystemExit(3)", "late.py": "from bounds import hold\nhold('step', 7.0, 6.0, 'us')"}
    for name, text in scripts.items():
        (tmp_path / name).write_text(f"import sys\nsys.path.append({str(ALL.parent)!r})\n{text}\n")
    import importlib

    every = importlib.import_module("all")
    monkeypatch.setattr(every, "HERE", tmp_path)
    monkeypatch.setattr(every, "SMALL", dict.fromkeys(scripts, ()))
    assert every.main() == 1
    said = capfd.readouterr().out
    assert "late.py: step: 7 us, bound 6 us" in said and "bad.py: ended with exit code 3" in said
