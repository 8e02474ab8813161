# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .identification.check import (
    LogCheck as LogCheck,
    check_against_logs as check_against_logs,
)
from .identification.logs import FlightLogs as FlightLogs
from .identification.numbers import (
    KEY_UNITS as KEY_UNITS,
    UNIDENTIFIABLE as UNIDENTIFIABLE,
)
from .identification.plan import flight_card as flight_card
from .identification.run import (
    IdentifyResult as IdentifyResult,
    identify as identify,
    read_heard as read_heard,
)
from .inference.result import (
    InferResult as InferResult,
    ends_text as ends_text,
)
from .inference.run import infer as infer
