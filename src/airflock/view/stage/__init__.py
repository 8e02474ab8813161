"""Stage: what stands in a world as triangles and lines, agents as darts, and their colours; for any renderer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["colours", "shades"])
