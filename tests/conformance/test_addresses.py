"""NULL where a host has to give an address: no process ends by it, and every such call is refused with a sentence."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from subjects import PLATFORM, Subject

HERE = Path(__file__).parent
HOST = HERE / "null_host.py"


def tried(library: Path, guid: str, resources: str, fmi: int) -> dict[str, list[object]]:
    """Of every call with one of its addresses NULL what it returned, and what was said."""
    command = [sys.executable, str(HOST), str(library), guid, resources, str(fmi)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout[-500:], done.stderr[-2000:])
    found: dict[str, list[object]] = json.loads(done.stdout)
    return found


def judge(answers: dict[str, list[object]], fewest: int) -> None:
    assert len(answers) >= fewest
    for call, (status, log) in answers.items():
        if call.startswith("taken"):
            assert (status, log) == (0, []), call
        elif call.startswith("nobody"):
            assert status != 0 and not log, call
        else:
            assert status == 3 and isinstance(log, list) and len(log) == 1, (call, status, log)
            assert "NULL for its" in log[0] or "no saved state was given" in log[0], (call, log)


def test_null_is_refused_with_a_sentence(subject: Subject) -> None:
    library = subject.folder / "binaries" / PLATFORM / f"{subject.component.name}.so"
    judge(tried(library, subject.guid, subject.resources, 2), 40)


@pytest.mark.skipif(sys.platform != "linux", reason="the path of the library is that of Linux")
def test_null_is_refused_with_a_sentence_by_fmi_3(native3: Subject) -> None:
    library = next(native3.folder.glob(f"binaries/*-linux/{native3.component.name}.so"))
    judge(tried(library, native3.guid, f"{native3.folder / 'resources'}/", 3), 80)
