"""Displays: shapes of points in the sky, assignment of drones, a master that mends."""
