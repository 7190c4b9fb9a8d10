"""The studies of the smoother paper, [RTS] Section IV."""
