"""Checks of wings: stall, overlap at the start, and what the gradient of the drag needs."""

from collections.abc import Callable, Mapping
from typing import Any

from airflock.core import Metric, MetricSet, Model, add_laws, argument_names, composition_errors as misfits, model
from airflock.parts.aero import descent, wing as wings
from airflock.world import start

FormationPlace = Callable[[int, float, float, float], tuple[float, float, float]]
FORMATIONS: dict[str, FormationPlace] = {"vee": start.in_vee, "echelon": start.in_echelon}  # by the key start.kind
THIN = 0.1  # of a span: wings farther apart in height do not meet


DESCENT = model(descent, "drag_descent")


def with_drag_descent(model: Model) -> Model:
    """A model with drag descent added to what it commands."""
    return add_laws(model, DESCENT)


def drag_descent_errors(model: Model) -> list[str]:
    """Why drag descent cannot be added to a model, one line."""
    if model.flock is not None:
        return [f"aero: model {model.name} goes down the gradient of the drag by itself; leave the section [aero] out"]
    return [f"aero: {fault}" for fault in misfits(model, DESCENT)]


def uses_lifting_line(law: Model | None, metrics: tuple[Metric, ...]) -> bool:
    """Whether a rule of this scenario solves for the wings of the flock."""
    return (law is not None and law.flock is not None) or any(
        "wing" in argument_names(m.survey, "survey") for m in metrics if m.survey
    )


def wing_errors(parts: Mapping[str, Any], law: Model | None, measures: MetricSet, started: bool = False) -> list[str]:
    """Everything that is wrong with the wings of a scenario, one line each; not of its start once it has started."""
    q, wing = parts["metrics"], parts["wing"]
    if q is None or wing is None:
        return []
    lines, metrics = [], measures.of(q)
    if q.stop == "collision" and not any("n_coll" in m.Sample._fields for m in metrics):
        lines.append(f"metrics.stop = 'collision' needs collisions, which metrics.kind = {q.kind!r} does not count")
    if not uses_lifting_line(law, metrics):
        return lines
    lines += _stalled(wing) if wing.stall == "refused" else []
    lines += [] if started else _overlapping(parts)
    place = "aero" if law is not None and law.flock is descent.flock else "model"
    gradient = getattr(parts["aero"] if place == "aero" else parts.get("parameters"), "gradient", "none")
    if gradient in ("analytic", "frozen") and wing.positions == "grid":
        lines.append(f"{place}.gradient = {gradient!r} is a derivative; it needs wing.positions = 'free', not 'grid'")
    flight = parts["flight"]
    if law is not None and law.flock is not None and flight is not None and flight.update == "sequential":
        lines.append(f"update = 'sequential': model {law.name} solves for the whole flock at once")
    return lines


def wing_notes(scenario: Any) -> list[str]:
    """What cannot be meant, but flies."""
    wing = scenario.wing
    if not uses_lifting_line(scenario.model, scenario.order_parameters):
        return []
    lines = _stalled(wing) if wing.stall == "noted" else []
    if wing.core == 0.0 and wing.positions == "free" and scenario.model.flock is not None:
        lines.append("wing.core = 0 with wing.positions = 'free': the drag has no lower bound where wings overlap")
    return lines


def _stalled(wing: wings.Parameters) -> list[str]:
    lift = wings.lift_coefficient(wing)
    if lift <= wing.cl_max:
        return []
    fast = wing.speed * (lift / wing.cl_max) ** 0.5
    return [
        f"wing.speed = {wing.speed:g} m/s: the wing stalls, its lift coefficient of {lift:.3g} is beyond wing.cl_max = "
        f"{wing.cl_max:g}; fly at {fast:.3g} m/s or more"
    ]


def _overlapping(parts: Mapping[str, Any]) -> list[str]:
    """The first two wings of a start formation that are in each other's place."""
    begin, wing, flight = parts["start"], parts["wing"], parts["flight"]
    if begin is None or flight is None or begin.kind not in FORMATIONS:
        return []
    place = FORMATIONS[begin.kind]
    # formations repeat themselves: if any two wings overlap, two of the first four do
    spots = [place(i, begin.spacing_x, begin.spacing_y, begin.spacing_z) for i in range(min(int(flight.agents), 4))]
    for j in range(len(spots)):
        for i in range(j):
            dx, dy, dz = (abs(a - b) for a, b in zip(spots[i], spots[j], strict=True))
            if dx < wing.chord and dy < wing.span and dz < THIN * wing.span:
                return [
                    f"start.spacing_y = {begin.spacing_y:g} m: the wings of agents {i} and {j} overlap by "
                    f"{wing.span - dy:.3g} m; keep wing.span = {wing.span:g} m apart sideways, or wing.chord = "
                    f"{wing.chord:g} m behind"
                ]
    return []
