"""Evolve the boids of Zapotecatl et al. 2016 for quality and rewrite evolved.toml and EVOLVED.md in this folder."""

from pathlib import Path

from airflock_papers import page
from airflock_papers.claims import print_claims
from airflock_papers.zapotecatl_2016 import PAPER

TITLE = "Boids evolved for the quality of Zapotecatl et al. 2016"

if __name__ == "__main__":
    found = PAPER.run(only="evolved")
    command, told = "airflock paper zapotecatl_2016 --only evolved", "study 0; paired flights 0 to 99"
    page.write(Path(__file__).parent, TITLE, command, found, (), told=told, names=("evolved.toml", "EVOLVED.md"))
    print_claims(found)
