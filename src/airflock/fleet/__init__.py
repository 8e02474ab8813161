"""Fleets in software: vehicles that speak MAVLink, the ether between them, and a clock for all."""
