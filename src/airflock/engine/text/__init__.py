"""Rules as text of a driver: their first call as plain Python, and their copies."""
