"""Condition of a device: what `Mhe` says of each operation, compared with what is usual, and what has moved."""
