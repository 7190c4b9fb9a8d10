"""Estimators: one algorithm per module, each a kernel."""
