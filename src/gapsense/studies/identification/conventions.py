"""What a recorded voltage was between two samples; apart from the rest, since the command's help names them."""

from __future__ import annotations

CONVENTIONS = ("trapezoid", "end", "start")
AUTO = "auto"  # the one that explains the records best
