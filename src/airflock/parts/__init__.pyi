# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .kinds import (
    BODIES as BODIES,
    FAULTS as FAULTS,
    LAWS as LAWS,
    RADIOS as RADIOS,
    SENSORS as SENSORS,
    TOPOLOGIES as TOPOLOGIES,
    default_body as default_body,
)
from .metrics.metric_sets import (
    KINDS as KINDS,
    METRICS as METRICS,
    SETS as SETS,
)
