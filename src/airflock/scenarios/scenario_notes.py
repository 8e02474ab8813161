"""Notes on scenarios that are valid but probably not meant; nothing here stops a flight."""

from typing import Any

from airflock.core import CLOCKS, Metric, Model, Quantity, declarations, telling_digits
from airflock.parts import METRICS
from airflock.parts.steering import STEERING
from airflock.scenarios.cost import cell_notes, metrics_use_cells, uses_all_cores
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.scenario_checks import largest_extension, stall_errors, uses_lifting_line
from airflock.world import edge_rows, obstacle


def _after_battery(scenario: Scenario) -> str:
    """Return the end of a note: the fate of a drone whose motors have stopped."""
    if scenario.can_land:
        return ", and on the ground it is absent"
    if scenario.dimensions == 3:
        return ", and it falls without end, and counts; give a ground: world.arena with world.floor, or scene.ground"
    return ", and it stays in the plane and counts"


def _steer_note(scenario: Scenario, law: Model) -> str:
    """Return a note: how a law's command is converted for the body, and the numbers that count."""
    q, body = scenario.resolved_steer(), scenario.body
    gives, taken = next(pair for pair, rule in STEERING.items() if rule is law.steer)
    if taken == "heading":  # such a body flies at a speed of its own, whatever the law wants
        own = getattr(body.numbers, "speed", None)
        how = f"by its direction alone, at the body's speed{'' if own is None else f', body.speed = {own:g} m/s'}"
    else:
        how = f"by [steer]: speed = {q.speed:g} m/s, response = {q.response:g} s"
    return f"the {gives} that model {law.name} commands becomes the {taken} that body {body.rule.name} takes, {how}"


def setting_notes(scenario: Scenario) -> list[str]:
    """Return notes on costs, rounded times and numbers that contradict each other."""
    cells = uses_all_cores(scenario) and metrics_use_cells(scenario)
    notes = pair_notes(scenario.flight, scenario.metrics.numbers, scenario.order_parameters, cells)
    notes += timing_notes(scenario) + wing_notes(scenario) + cell_notes(scenario)
    if nan := scenario.unmeasured & {name for item in scenario.order_parameters for name in item.Sample._fields}:
        notes.append(
            f"metrics.max_e is missing: without an arena the largest extension is unknown, so {', '.join(sorted(nan))} "
            "are nan; give metrics.max_e in m"
        )
    notes += [_steer_note(scenario, law.model) for law in scenario.laws if law.model.steer is not None]
    p = scenario.parameters
    body, duration = scenario.body.numbers, scenario.flight.duration
    if getattr(body, "battery", "endless") == "lithium" and getattr(body, "hover_power", 0.0) > 0.0:
        lasts = body.capacity / body.hover_power
        if lasts < duration:
            notes.append(
                f"body.capacity = {body.capacity:g} J lasts about {lasts:.3g} s of hovering, less than duration = "
                f"{duration:g} s: then its motors stop{_after_battery(scenario)}"
            )
    if getattr(p, "r0_frict", None) is not None and p.r0_frict < getattr(p, "r0_rep", 0.0):
        notes.append(
            f"model.r0_frict = {p.r0_frict:g} m lies below model.r0_rep = {p.r0_rep:g} m: agents may not flock"
        )
    if getattr(p, "v_shill", None) is not None and p.v_shill < p.v_flock:
        notes.append(
            f"model.v_shill = {p.v_shill:g} m/s lies below model.v_flock = {p.v_flock:g} m/s: walls may not hold"
        )
    return notes


APART = 100.0  # factor between the lengths of a law and of its arena above which one of them is hardly meant
ON_EDGE = 1e-3  # m inside an arena up to which a point counts as on its edge: `obstacle` rounds by 1e-6 there
SEES_WALLS = {"ray", "cast"}


def dubious_setting_notes(scenario: Scenario) -> list[str]:
    """Return notes that a person should read before flying a scenario."""
    checks = (_speed_alone, _no_walls, _lengths, _all_met, _unsent, _too_late, _about_an_edge)
    return [note for note in (check(scenario) for check in checks) if note]


def _speed_alone(scenario: Scenario) -> str:
    """Note a changed preferred speed beside gains that are those of the default speed."""
    model, p = scenario.model, scenario.parameters
    numbers = {name: default for name, declared, default in declarations(p) if isinstance(declared, Quantity)}
    changed = [name for name, default in numbers.items() if getattr(p, name) != default]
    # Laws of fewer than four numbers have no set of gains that could belong to one speed.
    if changed != ["v_flock"] or len(numbers) < 4:
        return ""
    hint = f"; airflock presets --for-speed {p.v_flock:.4g} gives a starting set"
    return (
        f"model.v_flock = {p.v_flock:.4g} m/s, but the other {len(numbers) - 1} numbers of {model.name} are its set "
        f"for {numbers['v_flock']:g} m/s{hint if model.name == 'vasarhelyi_2018' else ''}"
    )


def _no_walls(scenario: Scenario) -> str:
    """Note an arena with walls that the law does not read."""
    model, world = scenario.model, scenario.world
    code = getattr(model.decide, "__code__", None)
    # A law may look at walls inside its `decide` as well; a callable without code may do anything
    # and is given the benefit of the doubt.
    names = set(code.co_names) if code is not None else SEES_WALLS
    if world.arena == "none" or world.edges != "open" or model.boundary or model.sight or names & SEES_WALLS:
        return ""
    return (
        f"model {model.name} has no rule for walls (boundary), so agents leave the arena; "
        "world.edges = 'bounce' or 'periodic' keeps them in a square, world.arena = 'none' needs no walls"
    )


def _lengths(scenario: Scenario) -> str:
    """Note a law in millimetres in an arena of kilometres, or the other way round."""
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
    """Note a rotation about a point that the flock cannot circle: a corner of the field, or a point outside of it."""
    world, q = scenario.world, scenario.metrics.numbers
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
    """Note faults of messages where agents see each other and send none."""
    if scenario.radio.rule.see is None:
        return ""
    unsent = [kind for kind in scenario.fault_kinds if set(kind.rules) <= {"tell"} or kind.name == "radio_silent"]
    if not unsent:
        return ""
    return (
        f"radio.kind = {scenario.radio.rule.name!r}: agents send nothing, so these faults have no effect: "
        + ", ".join(kind.name for kind in unsent)
    )


def _too_late(scenario: Scenario) -> str:
    """Note faults that begin after the flight is over."""
    duration = scenario.flight.duration
    late = [(number, entry.at) for number, entry in enumerate(scenario.faults) if (entry.at or 0.0) >= duration]
    if not late:
        return ""
    named = ", ".join(f"faults[{number}].at = {at:g} s" for number, at in late[:3])
    return f"{named}: the flight is over by then, after duration = {duration:g} s; nothing happens"


def _all_met(scenario: Scenario) -> str:
    """Note numbers of a topology by which everybody is met."""
    if scenario.own_topology is not None:
        return ""
    topology, given = scenario.topology.numbers, scenario.document.get("topology", {})
    numbers = [f"topology.{key}" for key in given if key != "kind"]
    if topology.kind == "range" and numbers:
        return (
            f"topology.kind = 'range' does not read {', '.join(numbers)}: agents meet all that they hear; set a kind, "
            "such as topology.kind = 'nearest'"
        )
    if topology.kind in ("nearest", "strongest") and topology.k >= scenario.agents - 1 > 0:
        return f"topology.k = {topology.k:g}: each of {scenario.agents} agents meets all that it hears"
    return ""


MANY = 5000  # agents; below, a look at all pairs costs less than 10 ms


def pair_notes(flight: Any, q: Any, metrics: tuple[Metric, ...], cells: bool) -> list[str]:
    """Note the cost of order parameters over all pairs in a large flock.

    cells : True if neighbours are found by cells. Then order parameters look at pairs by cells if all of a clock are
        `settled`, and at links if they have a largest length of links
    """
    # Metrics of one clock are summed in one pass over pairs: one that needs all pairs makes the
    # others as slow.
    near = {
        clock: cells and all(item.settled for item in metrics if item.pair and item.clock == clock) for clock in CLOCKS
    }
    paired = [
        item.name
        for item in metrics
        if (item.pair and not near[item.clock]) or (item.cluster and not (cells and item.linked_within)) or item.survey
    ]
    if flight.agents < MANY or not paired:
        return []
    seconds = 0.4e-9 * flight.agents**2  # measured: 0.4 ns a pair, one core, in vectors
    return [
        f"metrics.kind = {q.kind!r} looks at all pairs of {flight.agents:g} agents ({', '.join(paired)}), about "
        f"{seconds:.2g} s for each sample; metrics.kind = 'order' does not, a longer metrics.period looks less often"
    ]


def timing_notes(scenario: Scenario) -> list[str]:
    """Note times that are rounded to steps."""
    notes, dt = [], scenario.flight.dt
    times = {
        "duration": scenario.flight.duration,
        "sensors.period": scenario.sensors.period,
        "radio.delay": scenario.radio.delay,
        "body.delay": scenario.body.delay,
        "metrics.period": scenario.metrics.period,
        "metrics.collision_period": scenario.metrics.collision_period or dt,
    }
    for key, value in times.items():
        steps = round(value / dt)
        if abs(steps * dt - value) > 1e-9 * max(value, dt):
            rounded = f"{steps * dt:g}"
            text = telling_digits(value, float(rounded).__ne__)
            notes.append(f"{key} = {text} s is rounded to {rounded} s, {steps} steps of dt = {dt:g} s")
    period, delay = scenario.sensors.period, scenario.radio.delay
    if period > 0.0 and abs(delay / period - round(delay / period)) > 1e-9:
        notes.append(
            f"radio.delay = {delay:g} s is not a multiple of sensors.period = {period:g} s: decisions use "
            "states exactly that old, which lie between two measurements"
        )
    return notes


def wing_notes(scenario: Any) -> list[str]:
    """Note wings that are probably not meant."""
    wing = scenario.wing
    if not uses_lifting_line(scenario.model, scenario.order_parameters):
        return []
    lines = stall_errors(wing) if wing.stall == "noted" else []
    if wing.core == 0.0 and wing.positions == "free" and scenario.model.flock is not None:
        lines.append("wing.core = 0 with wing.positions = 'free': the drag has no lower bound where wings overlap")
    return lines
