"""Ctrl-C as a question that is asked where it suits, instead of an exception anywhere."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130  # exit code
Handler = Callable[[int, FrameType | None], object]


@contextmanager
def handled(handler: Handler) -> Iterator[None]:
    """Let a function take every Ctrl-C; outside the main thread Python delivers none, and nothing is changed."""
    is_main = threading.current_thread() is threading.main_thread()
    previous = signal.signal(signal.SIGINT, handler) if is_main else None
    try:
        yield
    finally:
        if previous is not None:
            signal.signal(signal.SIGINT, previous)


@contextmanager
def counted(at_most: int | None = None, then: Callable[[], None] = lambda: None) -> Iterator[Callable[[], int]]:
    """Function that tells how many Ctrl-C there were; `then` is called at each.

    One above `at_most` is a KeyboardInterrupt after all.
    """
    noted: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        noted.append(number)
        then()
        if at_most is not None and len(noted) > at_most:
            raise KeyboardInterrupt

    with handled(note):
        yield lambda: len(noted)


def leave(number: int, _: FrameType | None) -> None:
    """End the program at once with a word; for where nothing has begun, but an exception would be shown."""
    os.write(2, b"interrupted.\n")
    os._exit(INTERRUPTED)
