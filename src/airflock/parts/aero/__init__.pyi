# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    descent as descent,
    filaments as filaments,
    wing as wing,
)
from .filaments import influences as influences
from .formation import (
    forward as forward,
    place_wings as place_wings,
)
from .gradients import slopes as slopes
from .lifting_line import (
    induced_drag as induced_drag,
    shapes as shapes,
    solo_drag as solo_drag,
    solve as solve,
)
from .wing import (
    Parameters as Parameters,
    pitch as pitch,
    profile_drag as profile_drag,
    rounded as rounded,
    segments_of as segments_of,
)
