"""Papers: what publications report, recomputed. One module per publication; `airflock paper NAME` runs it."""
