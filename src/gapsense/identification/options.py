"""Names of what an identification may try; apart from the rest, since the commands' help names them."""

from __future__ import annotations

CONVENTIONS = ("trapezoid", "end", "start")  # what a recorded voltage was between two samples
FORMS = ("eddy", "hysteresis", "fringing")  # what the plain model may have added
PLAIN = "plain"  # nothing of it
AUTO = "auto"  # what explains the records best
