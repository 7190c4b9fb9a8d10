"""The loop over base steps of a run: `compiled` does it in C, `reference` in Python, with the same bits."""
