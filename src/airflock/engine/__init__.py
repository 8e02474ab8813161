"""Engine: the only place that knows compilers, arrays of flights and devices. What others use of it is named here.

Nothing else of it is imported from outside (import-linter sees to that), so that its rooms may
change. A name is imported when it is first asked for: no compiler is loaded before something is to
fly.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
