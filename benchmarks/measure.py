"""One measurement, in a process of its own: `python measure.py ROW FMUS` prints it as one line of JSON at the end."""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path
from typing import Any


def measure(row: str, fmus: Path) -> dict[str, Any]:
    """Microseconds per component-step and the last outputs, or what package is missing."""
    try:
        import actuator_steps
        import c_loop
        import ours
        import peers

        if row == "alone":
            return {"alone": ours.alone(fmus)}
        if row == "actuator":
            return {"actuator": actuator_steps.actuator_steps(fmus)}
        function = next(getattr(module, row) for module in (ours, peers, c_loop) if hasattr(module, row))
        seconds, steps, last = function(fmus)
    except ImportError as error:
        return {"missing": str(error.name or error)}
    return {"microseconds": 1e6 * seconds / steps, "last": last}


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    print(json.dumps(measure(sys.argv[1], Path(sys.argv[2]).resolve())), flush=True)
