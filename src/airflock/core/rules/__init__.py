"""Rules as text: what a rule may hold, what it reads of a record, which of its numbers are integers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["law"])
