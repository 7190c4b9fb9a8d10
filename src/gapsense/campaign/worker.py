"""The runs of a campaign, as a worker process does them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from gapsense.cosim.result.result import Result
from gapsense.cosim.run.worker import Runs
from gapsense.cosim.scenario.signals import matching


class CampaignRuns(Runs):
    """Runs that answer with their wall time and the signals that are kept, too."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        super().__init__({**task, "measure": None, "keep": None})
        self.patterns, self.decimation = task["signals"], task["decimation"]

    def answer(self, result: Result, index: int) -> dict[str, Any]:
        """Metrics, wall time, and signals as bytes: time first, one after the other."""
        ended = {"ended": result.ended} if result.ended else {}
        answer = {"metrics": self.metrics(result), "wall": result.wall, **ended}
        if not self.patterns:
            return answer
        kept = [result.times, *(result[name] for name in matching(self.patterns, result.signals))]
        data = np.stack([signal[:: self.decimation] for signal in kept]).astype("<f8")
        return {**answer, "trajectory": b64encode(data.tobytes()).decode()}
