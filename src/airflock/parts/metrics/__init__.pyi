# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    nearest as nearest,
    parameters as parameters,
)
from .metric_sets import (
    POWER_SETTINGS as POWER_SETTINGS,
    metric_set as metric_set,
    reported_values as reported_values,
    scalar_names as scalar_names,
    to_metric_set as to_metric_set,
)
from .parameters import Parameters as Parameters
