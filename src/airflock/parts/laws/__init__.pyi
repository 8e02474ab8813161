# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    kidger as kidger,
    vasarhelyi_2018 as vasarhelyi_2018,
)
from .network import network_weights as network_weights
from .vasarhelyi_2018 import Parameters as Parameters
