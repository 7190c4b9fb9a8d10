"""Studies of the papers."""
