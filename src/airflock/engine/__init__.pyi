# The door: what other rooms may use; the rest is private to the room.
from .c_printing import print_law as print_law
from .closed_flights import (
    compile_for as compile_for,
    driver_text as driver_text,
    fly_world as fly_world,
    pick_device as pick_device,
    score_flight as score_flight,
    score_flights as score_flights,
)
from .driver_state import DriverState as DriverState
from .drivers import load_loops as load_loops
from .flight import Flight as Flight, Snapshot as Snapshot
from .many_flights import open_many as open_many
from .measuring import measure_frames as measure_frames
from .plan import Plan as Plan, plan_of as plan_of
from .text.generate import DriverSource as DriverSource
