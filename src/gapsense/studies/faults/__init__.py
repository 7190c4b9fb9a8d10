"""Faults of the current's sensor and of the coil, and what the estimators do with them."""
