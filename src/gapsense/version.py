"""The version of the package, for who needs nothing else of it."""

__version__ = "0.1.0"
