from .law import *
from .law import __doc__ as __doc__
