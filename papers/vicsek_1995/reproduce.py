"""Recompute Vicsek et al. 1995 and rewrite claims.toml and README.md in this folder."""

from pathlib import Path

from airflock_papers import page
from airflock_papers.claims import print_claims
from airflock_papers.vicsek_1995 import PAPER

ABOUT = "The paper's text is not at hand: nothing is quoted, and nothing counts as a sentence of the paper."

if __name__ == "__main__":
    claims = PAPER.run()
    page.write(Path(__file__).parent, PAPER.title, "airflock paper vicsek_1995", claims, (), ABOUT)
    print_claims(claims)
