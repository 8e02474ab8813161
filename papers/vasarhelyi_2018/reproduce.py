"""Recompute Vásárhelyi et al. 2018 and rewrite claims.toml, README.md and figures in this folder."""

from pathlib import Path

from airflock_papers.claims import print_claims
from airflock_papers.vasarhelyi_2018.report import reproduce

if __name__ == "__main__":
    print_claims(reproduce(Path(__file__).parent))
