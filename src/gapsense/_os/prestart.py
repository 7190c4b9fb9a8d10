"""Processes that are started before it is known what for: they load modules while their task is prepared."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from gapsense._os.processes import Process

_waiting: deque[Process] = deque()
_again: list[Sequence[str]] = []  # modules of the next one, as long as each that is taken is to be followed by another


def process(guest: Callable[..., Any] | None = None, limit: float | None = None) -> Process:
    """A process; without a guest it is one that waits, where there is one."""
    if guest is None:
        with suppress(IndexError):
            taken = _waiting.popleft()
            taken.limit = limit
            with suppress(OSError):  # who needs the next one will start it, and tell
                _waiting.extend(Process(load=modules) for modules in _again)
            return taken
    return Process(guest, limit)


@contextmanager
def ahead(*modules: str, count: int = 1, again: bool = False) -> Iterator[None]:
    """Let the next processes start now, and `again` another one for each that is taken.

    Those that are left at the end are ended. A block inside of another one takes what that has.
    """
    if _waiting or _again:
        return (yield)
    try:
        _again.extend([modules] * again)
        _waiting.extend(Process(load=modules) for _ in range(min(count, os.cpu_count() or 1)))
        yield
    finally:
        _again.clear()
        while _waiting:
            left = _waiting.pop()
            left.kill()
            left.close()
