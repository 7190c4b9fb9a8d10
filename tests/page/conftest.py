"""A browser without a network, and pages of scenarios; the helpers of this folder can be imported by its tests."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gapsense._os.native import ZIG, zig_version

sys.path.insert(0, str(Path(__file__).parent))
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    if BROWSER is None:
        pytest.skip("no Chromium to open a page in")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def zig() -> None:
    """The compiler of pages."""
    if zig_version() != ZIG:
        pytest.skip(f"no ziglang {ZIG}, which compiles pages")
