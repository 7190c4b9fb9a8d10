"""A worker process of a study: `python -m gapsense.studies.worker`, requests and answers as lines of JSON.

The first line holds function, setting and tasks (`tasks.compute`); every further line is the number of a task.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from gapsense.cosim.worker import imported, private_output, send
from gapsense.studies.tasks import answer


def main() -> None:
    """Answer requests until the input ends."""
    answers = private_output()
    request = json.loads(sys.stdin.readline())
    function: Any = imported(request["function"])
    send(answers, {"problems": []})
    for line in sys.stdin:
        send(answers, answer(function, request, int(line)))


if __name__ == "__main__":
    main()
