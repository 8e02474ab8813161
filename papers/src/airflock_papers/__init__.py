"""Papers: what publications report, recomputed. One module per publication; `airflock paper NAME` runs its PAPER.

A distribution of its own, airflock-papers, of the same version as airflock.
"""

__version__ = "0.1.0"

PAPERS = ("vasarhelyi_2018", "zapotecatl_2016", "dimock_2003", "kidger", "vicsek_1995", "couzin_2002")
