"""Tables of a page, as HTML: order parameters of a window, two flights side by side, and how two scenarios differ."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

from airflock.core import Quantity, declarations, format_with_unit
from airflock.engine import Flight
from airflock.parts.metrics import reported_values
from airflock.scenarios import Scenario

COLUMN_STYLE = "text-align:right;padding-left:0.8em"


def score_table_html(flights: Sequence[Flight], scores: Sequence[Mapping[str, Any]]) -> str:
    """Order parameters of this window, of the window before, and of the paper, as HTML; of two flights side by side."""
    flight, two = flights[0], len(flights) > 1
    about, published = reported_values(flight.scenario.measures), {} if two else flight.scenario.published
    before = flight.windows[-1].scores if flight.windows and not two else {}
    heads = ["A", "B", "B − A"] if two else ["now", *(["before"] if before else []), *(["paper"] if published else [])]
    rows = [_header_row(["", *heads])]
    for name, value in scores[0].items():
        if not isinstance(value, (int, float)):
            continue
        unit, meaning = about.get(name, ("", ""))
        cells = [_number_text(value)]
        if two:
            other = scores[1].get(name)
            gap = other - value if isinstance(other, (int, float)) else None
            cells += [_number_text(other), _number_text(gap)]
        if before:
            cells.append(_number_text(before.get(name)))
        if published:
            mean, spread = published.get(name, (None, None))
            cells.append(_number_text(mean) + (f" ± {spread:.2g}" if spread is not None else ""))
        rows.append(_table_row(f"{name} ({unit})" if unit else name, cells, meaning))
    since = " and ".join(f"{flight.windows[-1].end if flight.windows else 0.0:.3g} s" for flight in flights)
    return _table_html(rows, f"since t = {since}")


def difference_table_html(a: Scenario, b: Scenario) -> str:
    """What two scenarios do not have in common, as HTML."""
    found = scenario_differences(a, b)
    if not found:
        return _table_html([], "no difference, only chance that has grown")
    units = _key_units(b) | _key_units(a)
    rows = [
        _table_row(format_with_unit(key, units.get(key, "")), [_value_text(one), _value_text(other)])
        for key, one, other in found
    ]
    return _table_html(
        [_header_row(["", "A", "B"]), *rows], f"{len(found)} parameter{'s' if len(found) > 1 else ''} with other values"
    )


def scenario_differences(a: Scenario, b: Scenario) -> list[tuple[str, Any, Any]]:
    """Keys whose values differ, with both values; None where a scenario has no such key."""
    found: list[tuple[str, Any, Any]] = []
    if a.model.name != b.model.name:
        found.append(("model.kind", a.model.name, b.model.name))
    for section, mine in a.records.items():
        theirs = b.records[section]
        names = dict.fromkeys([*mine.__dataclass_fields__, *theirs.__dataclass_fields__])
        for name in names:
            one, other = getattr(mine, name, None), getattr(theirs, name, None)
            if one != other and (section, name) != ("", "duration"):
                found.append((f"{section}.{name}".strip("."), one, other))
    return found


def _key_units(scenario: Scenario) -> dict[str, str]:
    """Key of each number of a scenario that has a unit → the unit, in brackets."""
    return {
        f"{section}.{name}".strip("."): f"({declared.unit})"
        for section, record in scenario.records.items()
        for name, declared, _ in declarations(record)
        if isinstance(declared, Quantity) and declared.unit not in ("", "1")
    }


def _header_row(titles: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<th style='{COLUMN_STYLE}'>{title}</th>" for title in titles) + "</tr>"


def _table_row(title: str, cells: Sequence[str], meaning: str = "") -> str:
    body = "".join(f"<td style='{COLUMN_STYLE}'>{html.escape(cell)}</td>" for cell in cells)
    return f"<tr title='{html.escape(meaning, quote=True)}'><td>{html.escape(title)}</td>{body}</tr>"


def _table_html(rows: Sequence[str], caption: str) -> str:
    table = f"<table style='font-size:0.8em;font-variant-numeric:tabular-nums'>{''.join(rows)}</table>"
    return f"<div style='padding:0 0.75em'><small>{caption}</small>{table}</div>"


def _value_text(value: Any) -> str:
    if isinstance(value, (int, float)):
        return _number_text(value)
    return "–" if value is None else str(value) if isinstance(value, str) else f"{len(value)} given"


def _number_text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, (int, float)) and math.isfinite(value) else "–"
