"""Sensor chain."""
