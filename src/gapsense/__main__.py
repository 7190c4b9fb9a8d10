"""The program, `gapsense` or `python -m gapsense`: a Ctrl-C ends it with a word from its first moment on."""

import _signal  # type: ignore[import-not-found]  # what `signal` is made of, which takes a while to load
import gc
import os
import sys

_signal.signal(_signal.SIGINT, lambda *_: (os.write(2, b"interrupted.\n"), os._exit(130)))
gc.set_threshold(200_000)  # loading makes many objects that stay: to look for others among them takes a while
# Matrices here are small, and to start threads for larger ones takes half the time of numpy, in each process of a run.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main() -> None:
    """Run the command that the arguments name; others are not loaded."""
    from gapsense.cli import start

    start(sys.argv[1:])


if __name__ == "__main__":
    main()
