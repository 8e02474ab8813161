"""Recompute Vicsek et al. 1995 and rewrite claims.toml and README.md in this folder."""

from pathlib import Path

from airflock.papers import vicsek_1995
from airflock.papers.claims import print_claims, write_page

if __name__ == "__main__":
    claims = vicsek_1995.run()
    write_page(Path(__file__).parent, vicsek_1995.TITLE, "airflock paper vicsek_1995", claims)
    print_claims(claims)
