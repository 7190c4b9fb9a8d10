"""Saved states with one number changed and the checksum made again: refused, or at least no wrong access to memory."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from parts import Part, some
from test_robust import gcc, sanitized  # noqa: F401
from unpacked_native import Unpacked, compiled_host

from gapsense.fmi.components import kernel_of
from gapsense.kernels.layout import fields, names

EVERY = 20_011  # numbers of large memories


def sizes_of(part: Part) -> list[int]:
    """Lengths of the component's memories, and what indices in them may be at most."""
    layout = fields(kernel_of(part.component).module.State).values()
    return [n for field in layout if field.kind == "memory" for n in (field.size - 1, field.size, field.size + 1)]


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("part", some(), indirect=True)
def test_no_number_of_a_state_leads_out_of_memory(part: Part, unpacked: Unpacked, tmp_path: Path) -> None:
    [library] = sanitized(unpacked, kernel=())  # which runs long
    host = compiled_host(("gcc",), tmp_path / "host", "-lm", source="forge.c")
    counts = [len(part.component.of(causality)) for causality in ("input", "output")]
    module, ports = kernel_of(part.component).module, len(part.component.ports)
    first = 12 + ports + len(names(module.Parameters)) + len(names(module.State))  # all but memories
    words = [host, unpacked.library(), unpacked.guid, unpacked.resources, part.folder / "reference.csv", *counts]
    environment = {**os.environ, "LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0"}
    command = [*map(str, (*words, first, EVERY, *sorted({*sizes_of(part)})))]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=1200, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    taken, refused = map(int, done.stdout.split())
    assert taken > 100 and refused > 100
