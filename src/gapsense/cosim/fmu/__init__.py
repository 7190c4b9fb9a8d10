"""FMU files: what they say of themselves, and instances of them, here or in another process."""
