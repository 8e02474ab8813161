"""Papers: what publications report, recomputed. One module per publication; `airflock paper NAME` runs its PAPER."""

PAPERS = ("vasarhelyi_2018", "zapotecatl_2016", "dimock_2003", "kidger", "vicsek_1995", "couzin_2002")
