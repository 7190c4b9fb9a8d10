"""Drive voltage."""
