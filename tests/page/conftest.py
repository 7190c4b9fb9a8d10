"""The compiler of pages; the helpers of this folder can be imported by its tests."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gapsense._os.native import ZIG, zig_version

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def zig() -> None:
    """The compiler of pages."""
    if zig_version() != ZIG:
        pytest.skip(f"no ziglang {ZIG}, which compiles pages")
