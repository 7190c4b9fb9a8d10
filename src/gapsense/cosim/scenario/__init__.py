"""What a scenario says: its records, its keys, how it is read, built and written."""
