"""Recompute Dimock & Selig 2003 and rewrite claims.toml, README.md and figures in this folder."""

from pathlib import Path

from airflock_papers.claims import print_claims
from airflock_papers.dimock_2003.report import reproduce

if __name__ == "__main__":
    print_claims(reproduce(Path(__file__).parent))
