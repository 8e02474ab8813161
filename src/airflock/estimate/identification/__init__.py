"""Identify: the numbers of a scenario from flight logs."""
