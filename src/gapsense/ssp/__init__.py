"""Scenarios as SSP 1.0 for other tools, and SSP of other tools as scenarios. Modules are loaded where they are used."""
