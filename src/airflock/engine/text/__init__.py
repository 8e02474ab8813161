"""Rules as text of a driver: their first call as plain Python, and what drivers and firmware hold of them."""
