"""Notes on scenarios that are valid but hardly meant; nothing here stops a flight."""

from airflock.core import Quantity, declarations
from airflock.parts.metrics import METRICS
from airflock.scenarios.geometry import largest_extension
from airflock.scenarios.scenario import Scenario
from airflock.world import edge_rows, obstacle

APART = 100.0  # factor between the lengths of a law and of its arena above which one of them is hardly meant
ON_EDGE = 1e-3  # m inside an arena up to which a point counts as on its edge: `obstacle` rounds by 1e-6 there
SEES_WALLS = {"ray", "cast"}


def dubious_setting_notes(scenario: Scenario) -> list[str]:
    """What a person should know before flying a scenario."""
    asked = (_speed_alone, _no_walls, _lengths, _all_met, _unsent, _too_late, _about_an_edge)
    return [note for note in (ask(scenario) for ask in asked) if note]


def _speed_alone(scenario: Scenario) -> str:
    """The preferred speed is another one, and all gains are those of the default's speed."""
    model, p = scenario.model, scenario.parameters
    numbers = {name: default for name, declared, default in declarations(p) if isinstance(declared, Quantity)}
    changed = [name for name, default in numbers.items() if getattr(p, name) != default]
    if changed != ["v_flock"] or len(numbers) < 4:
        return ""
    hint = f"; airflock presets --for-speed {p.v_flock:.4g} gives a starting set"
    return (
        f"model.v_flock = {p.v_flock:.4g} m/s, but the other {len(numbers) - 1} numbers of {model.name} are its set "
        f"for {numbers['v_flock']:g} m/s{hint if model.name == 'vasarhelyi_2018' else ''}"
    )


def _no_walls(scenario: Scenario) -> str:
    """An arena with walls that the law does not know."""
    model, world = scenario.model, scenario.world
    code = getattr(model.decide, "__code__", None)
    names = set(code.co_names) if code is not None else SEES_WALLS
    if world.arena == "none" or world.edges != "open" or model.boundary or model.sight or names & SEES_WALLS:
        return ""
    return (
        f"model {model.name} has no rule for walls (boundary), so agents leave the arena; "
        "world.edges = 'bounce' or 'periodic' keeps them in a square, world.arena = 'none' needs no walls"
    )


def _lengths(scenario: Scenario) -> str:
    """A law in millimetres in an arena of kilometres, or the other way round."""
    model, size = scenario.model, largest_extension(scenario.world)
    known = model.interaction_range or model.reach
    if not known or not size:
        return ""
    reach = float(known(scenario.parameters))
    if not 0.0 < reach < float("inf") or 1.0 / APART <= reach / (2.0 * size) <= APART:
        return ""
    return (
        f"agents of {model.name} interact within {reach:.3g} m in an arena {2.0 * size:.3g} m across, a factor of "
        f"{max(reach / (2.0 * size), 2.0 * size / reach):.0f}: the lengths of one of them are probably wrong"
    )


def _about_an_edge(scenario: Scenario) -> str:
    """A rotation about a point that the flock cannot fly round: a corner of the field, or outside of it."""
    world, q = scenario.world, scenario.metrics
    measured = METRICS["rotation"] in scenario.order_parameters and hasattr(q, "centre_x")
    if world.arena != "polygon" or not measured:
        return ""
    edges, corners = edge_rows(world)[:2]
    if obstacle(q.centre_x, q.centre_y, 0.0, edges, 0, corners).distance < -ON_EDGE:
        return ""
    return (
        f"phi_lap measures the rotation about ({q.centre_x:g}, {q.centre_y:g}) m, which does not lie inside the arena; "
        "set metrics.centre_x and metrics.centre_y to another point"
    )


def _unsent(scenario: Scenario) -> str:
    """Faults of what agents send, where they see each other and send nothing."""
    if scenario.transceiver.see is None:
        return ""
    told = [kind for kind in scenario.fault_kinds if set(kind.rules) <= {"tell"} or kind.name == "radio_silent"]
    if not told:
        return ""
    return (
        f"radio.kind = {scenario.transceiver.name!r}: agents send nothing, so these faults have no effect: "
        + ", ".join(kind.name for kind in told)
    )


def _too_late(scenario: Scenario) -> str:
    """Faults that begin when the flight is over."""
    duration = scenario.flight.duration
    late = [(number, entry.at) for number, entry in enumerate(scenario.faults) if (entry.at or 0.0) >= duration]
    if not late:
        return ""
    named = ", ".join(f"faults[{number}].at = {at:g} s" for number, at in late[:3])
    return f"{named}: the flight is over by then, after duration = {duration:g} s; nothing happens"


def _all_met(scenario: Scenario) -> str:
    """Numbers of a topology by which everybody is met."""
    if scenario.own_topology is not None:
        return ""
    topology, given = scenario.topology, scenario.document.get("topology", {})
    numbers = [f"topology.{key}" for key in given if key != "kind"]
    if topology.kind == "range" and numbers:
        return (
            f"topology.kind = 'range' does not read {', '.join(numbers)}: agents meet all that they hear; set a kind, "
            "such as topology.kind = 'nearest'"
        )
    if topology.kind in ("nearest", "strongest") and topology.k >= scenario.agents - 1 > 0:
        return f"topology.k = {topology.k:g}: each of {scenario.agents} agents meets all that it hears"
    return ""
