"""Coils, valves and actuators from measured records: what a record gives, identification, estimators on records."""
