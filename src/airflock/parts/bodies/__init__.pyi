# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    dryden as dryden,
    held as held,
    motion as motion,
    wind as wind,
)
from .falling import fall as fall
from .motion import Parameters as Parameters
