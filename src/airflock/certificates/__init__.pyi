# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import request as request
from .branches import check_split as check_split
from .campaign import (
    CAMPAIGN_KIND as CAMPAIGN_KIND,
    Campaign as Campaign,
)
from .certificate import (
    Certificate as Certificate,
    upper_bound_in_unit as upper_bound_in_unit,
)
from .chance import (
    ScoreRow as ScoreRow,
    estimated_probability as estimated_probability,
    reliability_index as reliability_index,
    reliability_indices as reliability_indices,
)
from .check import check_certificate as check_certificate
from .counting import (
    COUNT_BATCH as COUNT_BATCH,
    CountProgress as CountProgress,
    flights_to_show as flights_to_show,
)
from .environment import used_and_unused_keys as used_and_unused_keys
from .executing import (
    campaign_executor as campaign_executor,
    flight_folder as flight_folder,
    with_planned_flights as with_planned_flights,
)
from .limit import (
    EventLimit as EventLimit,
    parse_limits as parse_limits,
)
from .maps import check_map_axes as check_map_axes
from .request import (
    campaign_from_request as campaign_from_request,
    check_confidence as check_confidence,
)
from .run import (
    COUNT_BUDGET_SHARE as COUNT_BUDGET_SHARE,
    run_campaign as run_campaign,
)
from .seeds import scenario_identity as scenario_identity
