"""Collisions, and contacts with walls, obstacles and the scene. Our choice."""

METRICS = ["speed", "polarisation", "nearest", "collisions", "contacts", "excursion"]
