"""Laws: the model that a scenario names, one of ours or of a file that may run, or one that the caller gives."""

import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from airflock.core import Model, model
from airflock.scenarios.own_code import build_from_file
from airflock.support import ScenarioError, shortened, suggest

MODELS = (
    "vasarhelyi_2018", "viragh_2014", "reynolds_1987", "vicsek_1995", "couzin_2002", "kidger", "formation",
    "dimock_2003", "chen_2014", "couzin_2005",
)  # fmt: skip


def find_law(kind: Any, folder: Path | None = None, *, where: str = "model.kind", trust: bool = False) -> Model:
    """Model by name, or from a user's own Python file (relative to the scenario file), which runs only with `trust`."""
    if kind is None:
        section, _, key = where.rpartition(".")
        how = f'write a law under [{section}], for instance {key} = "{MODELS[0]}"'
        others = f"known: {', '.join(MODELS)}, or a file that ends in .py"
        raise ScenarioError([f'{where} is missing; {how}, or begin the file with extends = "PRESET"; {others}'])
    if not isinstance(kind, str):
        raise ScenarioError([f"{where} = {shortened(repr(kind), 80)} is not a name; known: {', '.join(MODELS)}"])
    if kind in MODELS:
        return model(import_module(f"airflock.parts.laws.{kind}"), kind)
    if kind.endswith(".py"):
        return build_from_file(model, where, kind, folder, trust=trust)
    hint = suggest(kind, MODELS, f"known: {', '.join(MODELS)}, or a file that ends in .py", cutoff=0.4)
    raise ScenarioError([f"{where} = {kind!r}: unknown model; {hint}"])


def law_from_caller(law: Any) -> Model:
    """Model of a law that the caller gives: which is consent to run it."""
    if isinstance(law, Model):
        return law
    if isinstance(law, (str, os.PathLike)):
        return find_law(str(law), where="law", trust=True)
    if isinstance(law, Mapping) or hasattr(law, "__dict__"):
        return model(law)
    raise ScenarioError(
        [f"law = {law!r} is not a law; give a module, a class, a mapping, or one of {', '.join(MODELS)}"]
    )
