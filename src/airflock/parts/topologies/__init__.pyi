# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import parameters as parameters
from .parameters import Parameters as Parameters
