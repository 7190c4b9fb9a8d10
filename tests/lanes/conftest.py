"""The helpers of tests/kernels can be imported here."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "kernels"))

from gapsense._os.native import own_compiler


@pytest.fixture
def compiler() -> tuple[str, ...]:
    found = own_compiler()
    if not found:
        pytest.skip("no C compiler (cc, gcc, clang)")
    return found
