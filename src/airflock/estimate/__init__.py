"""Estimate: numbers and laws from logs and tracks."""
