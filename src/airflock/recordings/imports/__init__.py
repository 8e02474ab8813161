"""Tracks of others: one reader per format, one set of checks, one time grid, and the door `load_tracks`."""
