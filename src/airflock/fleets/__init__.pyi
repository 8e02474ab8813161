# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    compare as compare,
    flying as flying,
    realtime as realtime,
)
from .card_document import (
    DEFAULT_FENCE_MARGIN as DEFAULT_FENCE_MARGIN,
    default_safety as default_safety,
    deviation_notes as deviation_notes,
    make_card_document as make_card_document,
    omission_notes as omission_notes,
    site_notes as site_notes,
)
from .compare import fleet_recording as fleet_recording
from .drone_faults import (
    INJECTED_KINDS as INJECTED_KINDS,
    read_injected_faults as read_injected_faults,
)
from .fleet_observer import (
    DEFAULT_WATCH_ADDRESS as DEFAULT_WATCH_ADDRESS,
    FleetObserver as FleetObserver,
    scenario_fault_name as scenario_fault_name,
)
from .flying import (
    VEHICLE_BODIES as VEHICLE_BODIES,
    VEHICLE_KINDS as VEHICLE_KINDS,
)
from .lockstep import SECONDS_BEFORE_START as SECONDS_BEFORE_START
from .realtime import FLEET_MODES as FLEET_MODES
