"""Evolve the boids of Zapotecatl et al. 2016 for quality and rewrite evolved.toml and EVOLVED.md in this folder."""

from pathlib import Path

from airflock.papers.claims import print_claims, write_page
from airflock.papers.zapotecatl_2016 import PAPER

if __name__ == "__main__":
    found = PAPER.run(only="evolved")
    title, command = (
        "Boids evolved for the quality of Zapotecatl et al. 2016",
        "airflock paper zapotecatl_2016 --only evolved",
    )
    write_page(Path(__file__).parent, title, command, found, ("evolved", "EVOLVED"), "study 0; paired flights 0 to 99")
    print_claims(found)
