"""The table of hosts is made of what the tests kept."""

from __future__ import annotations

import json
from pathlib import Path

from gapsense.report import hosts

RESULT = {"host": "some host", "version": "1.2", "platform": "some system", "kind": "native"}


def test_row_counts_same_bits_and_names_the_largest_difference(tmp_path: Path) -> None:
    differences = {"Ekf": 0.0, "Mhe": 3e-7, "Semera": 2e-9}
    (tmp_path / "host-native.json").write_text(json.dumps({**RESULT, "differences": differences}))
    hosts.main(str(tmp_path), str(tmp_path))
    text = (tmp_path / hosts.PAGE).read_text(encoding="utf-8")
    assert "| some host | 1.2 | some system | native FMU | 3 | 1 | 3e-07 (Mhe) |\n" in text
    assert all(f"| {name} |" in text for name, _ in hosts.NOT_TRIED)


def test_page_in_the_docs_is_of_this_table() -> None:
    """Its words; the numbers are those of the machine that ran the hosts last."""
    text = (Path(__file__).parents[2] / "docs" / hosts.PAGE).read_text(encoding="utf-8")
    assert text.startswith(hosts.ABOUT) and text.endswith(hosts.page([]).partition("## Not tried")[2])
