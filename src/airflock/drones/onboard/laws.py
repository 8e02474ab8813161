"""Law and body on a flight card: names of the package and numbers, never code."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from airflock.core import FAR, Model, model
from airflock.drones.onboard.fields import read_record
from airflock.parts.bodies import BODIES
from airflock.support import AirflockError, CardError

MEMBER_PARTS = ("law", "body")  # of which members may have numbers of their own


def law_of_package(name: str) -> Model:
    """A law of the package by its name."""
    if not name.isidentifier():
        raise CardError([f"law.kind = {name!r} is not a law of this version"])
    try:
        return model(import_module(f"airflock.parts.laws.{name}"))
    except ModuleNotFoundError as fault:
        raise CardError([f"law.kind = {name!r} is not a law of this version"]) from fault


def read_law(table: Any, errors: list[str], section: str = "law") -> tuple[Model | None, Any]:
    """Law and parameters of a card; what is wrong is added to the faults."""
    try:
        found = law_of_package(str(table["kind"]))
    except (AirflockError, KeyError, TypeError) as fault:
        errors.append(str(fault) if isinstance(fault, AirflockError) else f"{section}.kind is missing")
        return None, None
    return found, read_record(found.Parameters, {k: v for k, v in table.items() if k != "kind"}, section, errors)


def read_body(table: Any, errors: list[str]) -> tuple[Any, Any]:
    """Body and parameters of a card; what is wrong is added to the faults."""
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in BODIES:
        errors.append(f"body.kind = {kind!r} is none of {', '.join(BODIES)}")
        return None, None
    return BODIES[kind], read_record(
        BODIES[kind].Parameters, {k: v for k, v in table.items() if k != "kind"}, "body", errors
    )  # fmt: skip


def read_member_parts(
    d: Mapping[str, Any], law: Model | None, body: Any, errors: list[str]
) -> tuple[tuple[Model, Any, Any], ...]:
    """Law, its numbers and those of the body of each member; none where all are alike."""
    rows = d["own"]
    if rows == [] or law is None or body is None:
        return ()
    if not isinstance(rows, list) or not isinstance(d["members"], list) or len(rows) != len(d["members"]):
        errors.append("own: give a table with law and body for each member, or an empty list")
        return ()
    found = []
    for number, row in enumerate(rows):
        sound = isinstance(row, dict) and all(isinstance(row.get(part), dict) for part in MEMBER_PARTS)
        if not sound:
            errors.append(f"own[{number}] = {row!r}: give the tables law and body")
            continue
        where, usual = (
            f"own[{number}]",
            {part: {k: v for k, v in d[part].items() if k != "kind"} for part in MEMBER_PARTS},
        )
        b = read_record(body.Parameters, usual["body"] | row["body"], f"{where}.body", errors)
        if "kind" in row["law"]:
            other, p = read_law(row["law"], errors, f"{where}.law")
            if other is not None and other.command != law.command:
                errors.append(f"{where}.law commands {other.command}, and law {law.command}; one body carries all")
        else:
            other, p = law, read_record(law.Parameters, usual["law"] | row["law"], f"{where}.law", errors)
        if other is not None:
            found.append((other, p, b))
    return tuple(found)


def wall_reach(law: Model, p: Any) -> float:
    """How far (m) a law with these numbers looks for what stands in the world."""
    return FAR if law.wall_reach is None else float(law.wall_reach(p))
