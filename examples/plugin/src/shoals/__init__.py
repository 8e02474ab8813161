"""Parts of our own for Airflock, which finds them by the entry point `airflock.parts`."""
