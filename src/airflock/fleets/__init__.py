"""Fleets: many nodes with vehicles and a radio channel in software, on a virtual clock or the real one."""
