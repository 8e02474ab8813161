"""Law and body on a flight card: names of the package and numbers, never code."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from airflock.body.registry import BODIES
from airflock.core.contract import Model, model
from airflock.core.maths import FAR
from airflock.errors import AirflockError, CardError
from airflock.onboard.fields import record


def find_law(name: str) -> Model:
    """A law of the package by its name."""
    if not name.isidentifier():
        raise CardError([f"law.kind = {name!r} is not a law of this version"])
    try:
        return model(import_module(f"airflock.models.{name}"))
    except ModuleNotFoundError as fault:
        raise CardError([f"law.kind = {name!r} is not a law of this version"]) from fault


def law_of(table: Any, faults: list[str]) -> tuple[Model | None, Any]:
    """Law and parameters of a card; what is wrong is added to the faults."""
    try:
        found = find_law(str(table["kind"]))
    except (AirflockError, KeyError, TypeError) as fault:
        faults.append(str(fault) if isinstance(fault, AirflockError) else "law.kind is missing")
        return None, None
    return found, record(found.Parameters, {k: v for k, v in table.items() if k != "kind"}, "law", faults)


def body_of(table: Any, faults: list[str]) -> tuple[Any, Any]:
    """Body and parameters of a card; what is wrong is added to the faults."""
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in BODIES:
        faults.append(f"body.kind = {kind!r} is none of {', '.join(BODIES)}")
        return None, None
    return BODIES[kind], record(
        BODIES[kind].Parameters, {k: v for k, v in table.items() if k != "kind"}, "body", faults
    )  # fmt: skip


def own_of(d: Mapping[str, Any], law: Model | None, body: Any, faults: list[str]) -> tuple[tuple[Any, Any], ...]:
    """Numbers of law and body of each member; none where all are alike."""
    rows = d["own"]
    parts = {"law": getattr(law, "Parameters", None), "body": getattr(body, "Parameters", None)}
    if rows == [] or None in parts.values():
        return ()
    if not isinstance(rows, list) or not isinstance(d["members"], list) or len(rows) != len(d["members"]):
        faults.append("own: give a table with law and body for each member, or an empty list")
        return ()
    found = []
    for number, row in enumerate(rows):
        sound = isinstance(row, dict) and all(isinstance(row.get(part), dict) for part in parts)
        if not sound:
            faults.append(f"own[{number}] = {row!r}: give the tables law and body")
            continue
        made = []
        for part, kind in parts.items():
            usual = {key: value for key, value in d[part].items() if key != "kind"}
            made.append(record(kind, usual | row[part], f"own[{number}].{part}", faults))
        found.append((made[0], made[1]))
    return tuple(found)


def look_of(law: Model, p: Any) -> float:
    """How far (m) a law with these numbers looks for what stands in the world."""
    return FAR if law.wall_reach is None else float(law.wall_reach(p))
