"""A scenario for a person to read: one sentence, and a table for notebooks."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

from airflock.core import Quantity, declarations, format_with_unit
from airflock.scenarios.sections import SECTIONS

if TYPE_CHECKING:
    from airflock.scenarios.scenario import Scenario

SHOWN = 8  # lists of points longer than this are counted, not printed


def summary(scenario: "Scenario") -> str:
    """Name, size, law, body and arena in one line."""
    world = scenario.world
    size = {"square": f" of {world.side:g} m", "circle": f" of radius {world.radius:g} m"}.get(world.arena, "")
    arena = "no arena" if world.arena == "none" else f"{world.arena} arena{size}"
    return (
        f"{scenario.name}: {scenario.agents} agents, {scenario.flight.duration:g} s, model {scenario.model.name}, "
        f"{scenario.vehicle.name}, {arena}"
    )


def changed_values(record: object) -> list[tuple[str, str, str]]:
    """Key, value with unit, and meaning of what differs from its default."""
    rows = []
    for name, declared, default in declarations(record):
        value = getattr(record, name)
        if value == default:
            continue
        if isinstance(declared, Quantity):
            text = format_with_unit(f"{value:g}", declared.unit)
        elif isinstance(value, tuple):
            text = str(value) if len(value) <= SHOWN else f"{len(value)} entries"
        else:
            text = str(value)
        rows.append((name, text, declared.meaning))
    return rows


def format_number(value: float) -> str:
    """A number with four digits, as tables show it."""
    return f"{value:.4g}"


def html_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in HTML, of plain texts."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def scenario_html(scenario: "Scenario") -> str:
    """A table with everything that differs from the defaults, section by section, and the notes."""
    records = {"top": scenario.flight, "model": scenario.parameters, "body": scenario.body}
    records |= {name: getattr(scenario, name) for name in SECTIONS if name != "body"}
    rows = [
        (name if section == "top" else f"{section}.{name}", value, meaning)
        for section, record in records.items()
        for name, value, meaning in changed_values(record)
    ]
    notes = "".join(f"<li>{escape(note)}</li>" for note in scenario.notes)
    keys = html_table(("changed key", "value", "meaning"), rows)
    return f"<p><b>{escape(summary(scenario))}</b></p>{keys}{f'<ul>{notes}</ul>' if notes else ''}"
