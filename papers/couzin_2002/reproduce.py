"""Recompute Couzin et al. 2002 and rewrite claims.toml and README.md in this folder."""

from pathlib import Path

from airflock.papers.claims import print_claims, write_page
from airflock.papers.couzin_2002 import PAPER

if __name__ == "__main__":
    claims = PAPER.run()
    write_page(Path(__file__).parent, PAPER.title, "airflock paper couzin_2002", claims)
    print_claims(claims)
