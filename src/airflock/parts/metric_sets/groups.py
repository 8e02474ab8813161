"""Quality of a flock (set `zapotecatl`), with its sub-groups told apart and its shape. Our choice."""

from airflock.parts.metrics.metric_sets import named
from airflock.parts.metrics.quality import errors as errors

METRICS = ["quality", "polarisation", "groups", "shape"]
BEST = "quality"


def chosen(q):
    """Metrics that count collisions as the key metrics.count says: each agent, or as the authors' program does."""
    return named(*("marks" if name == "quality" and q.count == "program" else name for name in METRICS))
