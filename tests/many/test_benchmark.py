"""The benchmark of large results does what it says, on a small one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_summary_figure_and_report_of_a_made_up_result_are_measured() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "campaign.py"), "--only-rows", "--rows", "3000"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = ("3000 rows written", "summary of them", "figure of them", "report on them")
    assert all(row in done.stdout for row in rows)
