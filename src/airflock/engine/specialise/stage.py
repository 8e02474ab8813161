"""Stage: its text for one plan, split into what is done once and what is done for the agents."""

import ast
from collections.abc import Callable
from typing import Any

from airflock.core.rules.nodes import walk
from airflock.engine.passes.build import Builder
from airflock.engine.specialise.dead import read, without_dead
from airflock.engine.specialise.statements import TABLES, Statements
from airflock.engine.specialise.text import Specialised
from airflock.engine.specialise.values import Components, StageError, kind_of


def specialise(build: Builder, stage: Callable[..., Any], **known: object) -> Specialised:
    """Text of a stage for a builder's plan.

    known : what parameters of the stage stand for; others keep their names. What a vector is given is kept.
    """
    made = Statements(build)
    once, body, answer = made.run(stage, known)
    where = made.owners.texts[0].where
    made.owners.part([*once, *body], answer, lambda told: StageError(f"{where}: {stage.__name__}: {told}"))
    kept = read([answer]) if answer is not None else set()
    kept |= {name for value in known.values() if isinstance(value, Components) for name in value.set.values()}
    whole = without_dead([*once, *body], kept)
    first = {id(statement) for statement in once}
    parts = whole if answer is None else [*whole, answer]
    names = [node for part in parts for node in walk(part) if kind_of(node)]
    for node in names:
        if kind_of(node) == "rule":
            node.id = build.source.name(node.item)  # type: ignore[attr-defined]
    return Specialised(
        _bindings(build, names),
        [statement for statement in whole if id(statement) in first],
        [statement for statement in whole if id(statement) not in first],
        "0" if answer is None else ast.unparse(answer),
    )


def _bindings(build: Builder, names: list[Any]) -> list[str]:
    """Lines that bind the rows, records and integers of these names."""
    found: dict[str, list[str]] = {kind: [] for kind in ("row", "number", "record", "whole", "scene", *TABLES)}
    for kind, name in dict.fromkeys((kind_of(node), node.id) for node in names):
        if kind in found:
            found[kind].append(name)
    lines = build.records(" ".join(found["record"])) + build.whole(*found["whole"]) + build.bind(found["row"])
    lines += build.scene(*found["scene"])
    lines += build.order() if found["number"] else []
    return lines + [f"{name} = {table}[{name[len(kind) :]}]" for kind, table in TABLES.items() for name in found[kind]]
