"""Topologies: rules that select, among the heard neighbours of an agent, those that it meets.

One kind per file, each a plain function over rows.

A kind is handed, of all others, their offsets as the agent believes them and the squares of their
distances, FAR (1e30) of whom it does not hear; it fills a row with 1.0 for whom it meets. All is
judged by what the agent knows: its own place as measured, the others' as heard. So a neighbour that
was near a second ago, and is heard of only now, is near. Whom a kind lets through the law may still
leave aside, by its own reach.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
