"""The table of hosts is made of what the tests kept."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

HOSTS = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "hosts_page.py"))
RESULT = {"host": "some host", "version": "1.2", "platform": "some system", "kind": "native"}


def test_row_counts_same_bits_and_names_the_largest_difference(tmp_path: Path) -> None:
    differences = {"Ekf": 0.0, "Mhe": 3e-7, "Semera": 2e-9}
    (tmp_path / "host-native.json").write_text(json.dumps({**RESULT, "differences": differences}))
    HOSTS["main"](str(tmp_path), str(tmp_path))
    text = (tmp_path / HOSTS["PAGE"]).read_text(encoding="utf-8")
    assert "| some host | 1.2 | some system | native FMU | 3 | 1 | 3e-07 (Mhe) |\n" in text
    assert all(f"| {name} |" in text for name, _ in HOSTS["NOT_TRIED"])


def test_page_in_the_docs_is_of_this_table() -> None:
    """Its words; the numbers are those of the machine that ran the hosts last."""
    text = (Path(__file__).parents[2] / "docs" / HOSTS["PAGE"]).read_text(encoding="utf-8")
    assert text.startswith(HOSTS["ABOUT"]) and text.endswith(HOSTS["page"]([]).partition("## Not tried")[2])
