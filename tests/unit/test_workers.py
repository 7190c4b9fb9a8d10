"""What workers have answered goes to the ledger, and no answer is lost to the failure that comes after it."""

from __future__ import annotations

from queue import Queue

import pytest

from gapsense._os.workers import awaited
from gapsense.ledger import Ledger


def never():
    return 0


def test_answers_that_wait_are_taken_together_and_a_failure_after_them():
    answers = Queue()
    for answer in ({"index": 3}, {"index": 1}, ValueError("torn"), {"index": 2}):
        answers.put(answer)
    assert awaited(answers, never, never) == [{"index": 3}, {"index": 1}]
    assert awaited(answers, never, never) == [{"index": 2}]
    with pytest.raises(ValueError, match="torn"):
        awaited(answers, never, never)


def test_nothing_is_taken_after_a_ctrl_c():
    answers = Queue()
    answers.put({"index": 0})
    assert awaited(answers, never, lambda: 1) == []


def test_entries_that_are_added_together_are_lines_of_their_own_also_after_a_torn_one(tmp_path):
    ledger = Ledger(tmp_path / "runs.jsonl", "key")
    ledger.append({"index": 0})
    ledger.file.write_bytes(ledger.file.read_bytes()[:-1])
    ledger.append({"index": 1}, {"index": 2, "metrics": {}})
    assert sorted(ledger.read()) == [0, 1, 2]
    assert len(ledger.file.read_text("utf-8").splitlines()) == 3
