"""Ctrl-C as a question that is asked where it suits, instead of an exception anywhere."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def counted(at_most: int | None = None) -> Iterator[Callable[[], int]]:
    """Function that tells how many Ctrl-C there were; one above `at_most` is a KeyboardInterrupt after all.

    Outside the main thread Python delivers no signals, and nothing is changed.
    """
    noted: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        noted.append(number)
        if at_most is not None and len(noted) > at_most:
            raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    previous = signal.signal(signal.SIGINT, note) if is_main else None
    try:
        yield lambda: len(noted)
    finally:
        if previous is not None:
            signal.signal(signal.SIGINT, previous)
