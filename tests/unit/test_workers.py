"""What workers have answered is taken as it comes, and no answer is lost to the failure that comes after it."""

from __future__ import annotations

from queue import Queue

import pytest

from gapsense._os.workers import wait_for_answers


def never():
    return 0


def test_answers_that_wait_are_taken_together_and_a_failure_after_them():
    answers = Queue()
    for answer in ({"index": 3}, {"index": 1}, ValueError("torn"), {"index": 2}):
        answers.put(answer)
    assert wait_for_answers(answers, never, never) == [{"index": 3}, {"index": 1}]
    assert wait_for_answers(answers, never, never) == [{"index": 2}]
    with pytest.raises(ValueError, match="torn"):
        wait_for_answers(answers, never, never)


def test_nothing_is_taken_after_a_ctrl_c():
    answers = Queue()
    answers.put({"index": 0})
    assert wait_for_answers(answers, never, lambda: 1) == []
