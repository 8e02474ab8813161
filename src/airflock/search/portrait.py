"""Studies and what they found, for a person to read: one sentence, and a table for notebooks."""

from html import escape
from typing import TYPE_CHECKING

from airflock.core import Quantity, declarations
from airflock.scenarios import format_number, html_table

if TYPE_CHECKING:
    from airflock.search.result import EvolveResult
    from airflock.search.study import Study


def study_summary(study: "Study") -> str:
    """What is sought, and by how many flights."""
    q, goals = study.search, ", ".join(objective.name for objective in study.objectives)
    return (
        f"Study of {', '.join(s.name for s in study.scenarios)}: {len(study.space.axes)} parameters for {goals}, "
        f"{q.generations:g} generations of {q.population:g} candidates, {q.seeds:g} flight{'s' * (q.seeds > 1)} each"
    )


def study_html(study: "Study") -> str:
    """A table of what varies."""
    rows = [(a.key, f"{a.low:g} … {a.high:g}", a.unit, a.scale) for a in study.space.axes]
    return f"<p><b>{escape(study_summary(study))}</b></p>{html_table(('parameter', 'range', 'unit', 'scale'), rows)}"


def result_summary(result: "EvolveResult") -> str:
    """How good the winner is, on fresh seeds."""
    if result.dead_reason:
        return f"Result {result.folder}: nothing flies: {result.dead_reason}"
    span = f"{result.fitness:.3g} (95 %: {result.low:.3g} to {result.high:.3g}) on {result.seeds} fresh seeds"
    return f"Result {result.folder}: {result.scenario.name}, fitness {span}"


def result_html(result: "EvolveResult") -> str:
    """A table of the winner's parameters, and of the ranges in which candidates of the search were as good."""
    units = {
        f"{section}.{name}".lstrip("."): declared.unit
        for section, record in result.scenario.records.items()
        for name, declared, _ in declarations(record)
        if isinstance(declared, Quantity)
    }
    rows = [
        (key, format_number(value), units.get(key, ""), " … ".join(map(format_number, result.ranges.get(key, ()))))
        for key, value in result.parameters.items()
    ]
    heads = ("parameter", "winner", "unit", "candidates as good")
    return f"<p><b>{escape(result_summary(result))}</b></p>{html_table(heads, rows)}"
