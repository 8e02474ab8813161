"""An open flight for a person to read in a notebook: where it stands, what was done to it, and its scores so far."""

from html import escape
from typing import TYPE_CHECKING

from airflock.parts.metrics import reported_values
from airflock.scenarios import format_number, html_table

if TYPE_CHECKING:
    from airflock.engine.flight import Flight


def flight_html(flight: "Flight") -> str:
    """Its sentence, and a table of order parameters since the last change, with units and meanings."""
    done = [event.kind for event in flight.events]
    told = [f"{done.count(kind)} × {kind}" for kind in dict.fromkeys(done)]
    absent = int((~flight.present).sum())
    told += [f"{absent} absent"] if absent else []
    beside = f" ({escape(', '.join(told))})" if told else ""
    head = f"<p><b>{escape(repr(flight).strip('<>'))}</b>{beside}</p>"
    if not flight.step:
        return f"{head}<p>nothing is flown yet</p>"
    known = reported_values(flight.scenario.measures)
    scores = {name: value for name, value in flight.scores().items() if isinstance(value, (int, float))}
    rows = [(name, format_number(value), *known.get(name, ("", ""))) for name, value in scores.items()]
    return head + html_table(("order parameter", "value", "unit", "meaning"), rows)
