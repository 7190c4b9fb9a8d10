"""The error of a component, which keeps what was recorded before it."""

from __future__ import annotations

from typing import Any


class FmuError(RuntimeError):
    """A component failed while it was loaded or run.

    `time` [s] is that at the start of the failed step (None before the first), which would have ended at base step
    `step`; `cause` is one line, `log` all that the component said; `result` has what was recorded before.
    """

    def __init__(
        self, instance: str, cause: str, *, time: float | None = None, step: int | None = None, log: str = ""
    ) -> None:
        self.instance, self.time, self.step, self.cause, self.log = instance, time, step, cause, log
        self.result: Any = None  # a `Result`
        when = "" if time is None else f", t = {time:.9g} s (base step {step})"
        super().__init__(f"{instance}{when}: {cause}")
