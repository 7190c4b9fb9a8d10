"""Ctrl-C is counted, and the count is asked for where it suits; no exception is raised at an arbitrary place."""

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
def handle(handler: Handler) -> Iterator[None]:
    """Let a function take every Ctrl-C; outside the main thread Python delivers none, and nothing is changed."""
    is_main = threading.current_thread() is threading.main_thread()
    previous = signal.signal(signal.SIGINT, handler) if is_main else None
    try:
        yield
    finally:
        if previous is not None:
            signal.signal(signal.SIGINT, previous)


@contextmanager
def count_interrupts(
    at_most: int | None = None, then: Callable[[], None] = lambda: None
) -> Iterator[Callable[[], int]]:
    """Function that tells how many Ctrl-C there were; `then` is called at each.

    One above `at_most` is a KeyboardInterrupt after all.
    """
    noted: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        noted.append(number)
        then()
        if at_most is not None and len(noted) > at_most:
            raise KeyboardInterrupt

    with handle(note):
        yield lambda: len(noted)


@contextmanager
def ended_like_ctrl_c() -> Iterator[None]:
    """Let what batch systems and closed terminals send act as a Ctrl-C, unless it is ignored, as after `nohup`."""
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()
    taken = [s for s in (getattr(signal, n) for n in names) if is_main and signal.getsignal(s) == signal.SIG_DFL]
    for number in taken:
        signal.signal(number, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def leave(number: int, _: FrameType | None) -> None:
    """End the program at once with a word; for where nothing has begun, but an exception would be shown."""
    os.write(2, b"interrupted.\n")
    os._exit(INTERRUPTED)
