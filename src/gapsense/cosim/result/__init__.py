"""Results: files, metrics, comparisons."""
