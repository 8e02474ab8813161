# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .kinds import (
    BODIES as BODIES,
    FAULTS as FAULTS,
    KINDS as KINDS,
    LAWS as LAWS,
    METRICS as METRICS,
    RADIOS as RADIOS,
    SENSORS as SENSORS,
    SETS as SETS,
    TOPOLOGIES as TOPOLOGIES,
    default_body as default_body,
)
