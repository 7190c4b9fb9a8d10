"""The experiment in cofmupy: `python cofmupy_peer.py TASK.json`, in an environment of its own.

It wants other versions of fmpy and pythonfmu than we do, so it cannot be installed beside us (`make bench` makes the
environment).  Prints one line of JSON: seconds of the loop, and the values of what is watched.
"""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

from cofmupy import Coordinator


def run(task: dict[str, Any]) -> dict[str, Any]:
    """Each step of all components is one call; the coordinator records every output."""
    coordinator = Coordinator()
    coordinator.start(task["config"])
    begin = perf_counter()
    for _ in range(task["count"]):
        coordinator.do_step(task["step"])
    seconds = perf_counter() - begin
    results = coordinator.get_results()
    rows = {f"{name}.{variable}": [*map(float, results[name, variable])] for name, variable in task["watched"]}
    return {"seconds": seconds, "last": {name: own[-1] for name, own in rows.items()}, "rows": rows}


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    print(json.dumps(run(json.loads(Path(sys.argv[1]).read_text()))), flush=True)
