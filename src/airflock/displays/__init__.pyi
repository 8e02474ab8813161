# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .displays import plan_shapes as plan_shapes
from .shapes import shape_points as shape_points
from .show import (
    Show as Show,
    fly_show as fly_show,
    recording_of as recording_of,
)
