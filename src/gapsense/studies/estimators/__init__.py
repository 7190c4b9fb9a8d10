"""One benchmark for all estimators: what they are told, what is measured, tables."""
