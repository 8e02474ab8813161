"""Sets of order parameters that are measured together, one file a set; some judge a flight by a fitness."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
