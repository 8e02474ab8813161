"""Infer: the law that explains tracks, with intervals and held-out parts."""
