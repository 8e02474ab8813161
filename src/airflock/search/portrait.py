"""Studies and what they found, for a person to read: one sentence, and a table for notebooks."""

from html import escape
from typing import TYPE_CHECKING

from airflock.core.parameters import Quantity, declarations
from airflock.scenarios.portrait import number, table

if TYPE_CHECKING:
    from airflock.search.result import Result
    from airflock.search.study import Study


def study_sentence(study: "Study") -> str:
    """What is sought, and by how many flights."""
    q, goals = study.search, ", ".join(objective.name for objective in study.objectives)
    return (
        f"Study of {', '.join(s.name for s in study.scenarios)}: {len(study.space.axes)} parameters for {goals}, "
        f"{q.generations:g} generations of {q.population:g} candidates, {q.seeds:g} flight{'s' * (q.seeds > 1)} each"
    )


def study_html(study: "Study") -> str:
    """A table of what varies."""
    rows = [(a.key, f"{a.low:g} … {a.high:g}", a.unit, a.scale) for a in study.space.axes]
    return f"<p><b>{escape(study_sentence(study))}</b></p>{table(('parameter', 'range', 'unit', 'scale'), rows)}"


def result_sentence(found: "Result") -> str:
    """How good the winner is, on fresh seeds."""
    if found.dead:
        return f"Result {found.folder}: nothing flies: {found.dead}"
    span = f"{found.fitness:.3g} (95 %: {found.low:.3g} to {found.high:.3g}) on {found.seeds} fresh seeds"
    return f"Result {found.folder}: {found.scenario.name}, fitness {span}"


def result_html(found: "Result") -> str:
    """A table of the winner's parameters, and of the ranges in which candidates of the search were as good."""
    units = {
        f"{section}.{name}".lstrip("."): declared.unit
        for section, record in found.scenario.records.items()
        for name, declared, _ in declarations(record)
        if isinstance(declared, Quantity)
    }
    rows = [
        (key, number(value), units.get(key, ""), " … ".join(map(number, found.ranges.get(key, ()))))
        for key, value in found.parameters.items()
    ]
    heads = ("parameter", "winner", "unit", "candidates as good")
    return f"<p><b>{escape(result_sentence(found))}</b></p>{table(heads, rows)}"
