# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .identification.log_check import (
    LogCheck as LogCheck,
    check_against_logs as check_against_logs,
)
from .identification.vehicle_identification import (
    KEY_UNITS as KEY_UNITS,
    UNIDENTIFIABLE as UNIDENTIFIABLE,
    IdentifyResult as IdentifyResult,
    flight_card as flight_card,
    identify as identify,
    read_heard as read_heard,
)
from .identification.vehicle_logs import FlightLogs as FlightLogs
from .inference.law_inference import (
    InferResult as InferResult,
    ends_text as ends_text,
    infer as infer,
)
