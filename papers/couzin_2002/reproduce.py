"""Recompute Couzin et al. 2002 and rewrite claims.toml and README.md in this folder."""

from pathlib import Path

from airflock.papers import couzin_2002
from airflock.papers.claims import print_claims, write_page

if __name__ == "__main__":
    claims = couzin_2002.run()
    write_page(Path(__file__).parent, couzin_2002.TITLE, "airflock paper couzin_2002", claims)
    print_claims(claims)
