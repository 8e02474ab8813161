"""Scenarios and presets: everything about a flight but the seed."""
