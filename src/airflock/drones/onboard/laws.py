"""Law and body on a flight card: names of the package and numbers, never code."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from airflock.core.contract import Model, model
from airflock.core.maths import FAR
from airflock.drones.onboard.fields import record
from airflock.parts.bodies.registry import BODIES
from airflock.support.errors import AirflockError, CardError

PARTS = ("law", "body")  # of which members may have numbers of their own


def find_law(name: str) -> Model:
    """A law of the package by its name."""
    if not name.isidentifier():
        raise CardError([f"law.kind = {name!r} is not a law of this version"])
    try:
        return model(import_module(f"airflock.parts.laws.{name}"))
    except ModuleNotFoundError as fault:
        raise CardError([f"law.kind = {name!r} is not a law of this version"]) from fault


def law_of(table: Any, faults: list[str], where: str = "law") -> tuple[Model | None, Any]:
    """Law and parameters of a card; what is wrong is added to the faults."""
    try:
        found = find_law(str(table["kind"]))
    except (AirflockError, KeyError, TypeError) as fault:
        faults.append(str(fault) if isinstance(fault, AirflockError) else f"{where}.kind is missing")
        return None, None
    return found, record(found.Parameters, {k: v for k, v in table.items() if k != "kind"}, where, faults)


def body_of(table: Any, faults: list[str]) -> tuple[Any, Any]:
    """Body and parameters of a card; what is wrong is added to the faults."""
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in BODIES:
        faults.append(f"body.kind = {kind!r} is none of {', '.join(BODIES)}")
        return None, None
    return BODIES[kind], record(
        BODIES[kind].Parameters, {k: v for k, v in table.items() if k != "kind"}, "body", faults
    )  # fmt: skip


def own_of(d: Mapping[str, Any], law: Model | None, body: Any, faults: list[str]) -> tuple[tuple[Model, Any, Any], ...]:
    """Law, its numbers and those of the body of each member; none where all are alike."""
    rows = d["own"]
    if rows == [] or law is None or body is None:
        return ()
    if not isinstance(rows, list) or not isinstance(d["members"], list) or len(rows) != len(d["members"]):
        faults.append("own: give a table with law and body for each member, or an empty list")
        return ()
    found = []
    for number, row in enumerate(rows):
        sound = isinstance(row, dict) and all(isinstance(row.get(part), dict) for part in PARTS)
        if not sound:
            faults.append(f"own[{number}] = {row!r}: give the tables law and body")
            continue
        where, usual = f"own[{number}]", {part: {k: v for k, v in d[part].items() if k != "kind"} for part in PARTS}
        b = record(body.Parameters, usual["body"] | row["body"], f"{where}.body", faults)
        if "kind" in row["law"]:
            other, p = law_of(row["law"], faults, f"{where}.law")
            if other is not None and other.command != law.command:
                faults.append(f"{where}.law commands {other.command}, and law {law.command}; one body carries all")
        else:
            other, p = law, record(law.Parameters, usual["law"] | row["law"], f"{where}.law", faults)
        if other is not None:
            found.append((other, p, b))
    return tuple(found)


def look_of(law: Model, p: Any) -> float:
    """How far (m) a law with these numbers looks for what stands in the world."""
    return FAR if law.wall_reach is None else float(law.wall_reach(p))
