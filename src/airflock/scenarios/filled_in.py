"""What a scenario may leave open, filled in from the rest of it."""

from typing import TYPE_CHECKING, Any

from airflock.core import Model, SilenceParameters, with_defaults
from airflock.parts.metrics import Parameters as MetricParameters
from airflock.scenarios.geometry import largest_extension
from airflock.world import arena, start

if TYPE_CHECKING:
    from airflock.scenarios.scenario import Scenario


def default_metrics(scenario: "Scenario") -> MetricParameters:
    """The numbers of its order parameters."""
    given = {name: getattr(scenario.metrics, name) for name in scenario.metrics.__dataclass_fields__}
    p, model = scenario.parameters, scenario.model
    if given["v_flock"] is None:
        given["v_flock"] = 1.0 if model.preferred_speed is None else model.speed(p)
    if given["v_tol"] is None:
        given["v_tol"] = 0.375 * given["v_flock"]
    if given["r_comm"] is None:
        given["r_comm"] = scenario.radio.range
    if given["r_cluster"] is None:
        known = model.interaction_range or model.reach
        given["r_cluster"] = min(float(known(p)), 1e6) if known else min(scenario.radio.range, 1e6)
    if given["collision_period"] is None:
        given["collision_period"] = scenario.flight.dt
    if given["max_e"] is None:
        given["max_e"] = largest_extension(scenario.world) or None
    if given["k"] is None:
        given["k"] = given["max_e"]
    return type(scenario.metrics)(**given)


def default_silence(scenario: "Scenario") -> SilenceParameters:
    """The rule of silence."""
    return with_defaults(scenario.silence, scenario.model.speed(scenario.parameters), scenario.radio.delay)


def default_separation(model: Model, parameters: Any, start_record: start.Parameters, world: arena.Parameters) -> float:
    """Default of start.separation, m: 2 s of flight at the preferred speed, at least 3 m (authors' program).

    In a ball, a box or a periodic world agents may start anywhere: 0.
    """
    if start_record.kind != "arena" or world.edges == "periodic":
        return 0.0
    return max(3.0, 2.0 * model.speed(parameters))
