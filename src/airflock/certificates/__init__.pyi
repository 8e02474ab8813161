# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .campaign import (
    Campaign as Campaign,
    campaign_from_request as campaign_from_request,
    check_confidence as check_confidence,
    check_flight_count as check_flight_count,
    check_flight_options as check_flight_options,
    check_workers as check_workers,
    scenario_identity as scenario_identity,
    tolerance_keys as tolerance_keys,
    used_and_unused_keys as used_and_unused_keys,
)
from .causes import (
    HitCauses as HitCauses,
    WhyResult as WhyResult,
    why as why,
)
from .certificate import (
    Certificate as Certificate,
    check_certificate as check_certificate,
    upper_bound_in_unit as upper_bound_in_unit,
)
from .certification import (
    COUNT_BUDGET_SHARE as COUNT_BUDGET_SHARE,
    check_map_axes as check_map_axes,
    fly_campaign as fly_campaign,
    resumed_campaign as resumed_campaign,
)
from .counting import (
    COUNT_BATCH as COUNT_BATCH,
    flights_to_show as flights_to_show,
)
from .disturbances import (
    AttackResult as AttackResult,
    attack as attack,
)
from .limits import (
    EventLimit as EventLimit,
    ScoreRow as ScoreRow,
    estimated_probability as estimated_probability,
    parse_limits as parse_limits,
    reliability_index as reliability_index,
    reliability_indices as reliability_indices,
)
from .splitting import check_split as check_split
