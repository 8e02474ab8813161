"""Stage: its text for one plan, split into what is done once and what is done for the agents."""

import ast
from collections.abc import Callable
from typing import Any

from airflock.core import walk_tree
from airflock.engine.passes.build import Builder
from airflock.engine.specialise.dead import read_names, without_dead
from airflock.engine.specialise.statements import TABLE_PREFIXES, StatementSpecialiser
from airflock.engine.specialise.text import SpecialisedText
from airflock.engine.specialise.values import LocalVector, StageError, name_kind


def specialise(build: Builder, stage: Callable[..., Any], **known: object) -> SpecialisedText:
    """Text of a stage for a builder's plan.

    known : what parameters of the stage stand for; others keep their names. What a vector is given is kept.
    """
    made = StatementSpecialiser(build)
    once, body, answer = made.run(stage, known)
    where = made.owners.texts[0].where
    made.owners.assign_names([*once, *body], answer, lambda told: StageError(f"{where}: {stage.__name__}: {told}"))
    kept = read_names([answer]) if answer is not None else set()
    kept |= {name for value in known.values() if isinstance(value, LocalVector) for name in value.set.values()}
    whole = without_dead([*once, *body], kept)
    first = {id(statement) for statement in once}
    parts = whole if answer is None else [*whole, answer]
    names = [node for part in parts for node in walk_tree(part) if name_kind(node)]
    for node in names:
        if name_kind(node) == "rule":
            node.id = build.source.name(node.item)  # type: ignore[attr-defined]
    return SpecialisedText(
        _bindings(build, names),
        [statement for statement in whole if id(statement) in first],
        [statement for statement in whole if id(statement) not in first],
        "0" if answer is None else ast.unparse(answer),
    )


def _bindings(build: Builder, names: list[Any]) -> list[str]:
    """Lines that bind the rows, records and integers of these names."""
    found: dict[str, list[str]] = {kind: [] for kind in ("row", "number", "record", "whole", "scene", *TABLE_PREFIXES)}
    for kind, name in dict.fromkeys((name_kind(node), node.id) for node in names):
        if kind in found:
            found[kind].append(name)
    lines = build.records(" ".join(found["record"])) + build.whole(*found["whole"]) + build.bind_rows(found["row"])
    lines += build.scene(*found["scene"])
    lines += build.order() if found["number"] else []
    return lines + [
        f"{name} = {table}[{name[len(kind) :]}]" for kind, table in TABLE_PREFIXES.items() for name in found[kind]
    ]
