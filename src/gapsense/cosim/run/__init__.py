"""A run: the master, its loop over base steps, and the process that it may have of its own."""
