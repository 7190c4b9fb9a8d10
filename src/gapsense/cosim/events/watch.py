"""Conditions on signals, which the loop over base steps looks at: it comes back when one begins or ends to hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Buffer = npt.NDArray[np.float64]


@dataclass
class Watch:
    """Whether the value in a place of the buffer is above (or below) a level, as it was known last."""

    place: int
    level: float
    is_above: bool
    is_on: bool = False  # somebody wants to know
    holds: bool = False

    def look(self, buffer: Buffer) -> bool:
        """True if the condition holds now; NaN is neither above nor below."""
        value = buffer[self.place]
        return bool(value > self.level if self.is_above else value < self.level)


def reporter(watches: Sequence[Watch], buffer: Buffer) -> Callable[[], bool]:
    """Function that says if there is news of some conditions."""
    return lambda: any(watch.is_on and watch.look(buffer) != watch.holds for watch in watches)
