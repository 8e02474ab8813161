# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .shows import (
    Show as Show,
    fly_show as fly_show,
    plan_shapes as plan_shapes,
    recording_of as recording_of,
    shape_points as shape_points,
)
