"""The table [objective] of a study file: what is better, and the user's own fitness functions."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from airflock.certificates import EventLimit, parse_limits
from airflock.scenarios import Scenario, import_user_file
from airflock.search.fitness import OVER_SEEDS, Objective, UserFitness
from airflock.support import RuleError, ScenarioError, expand_path, is_file, suggest

KEYS = ("maximise", "minimise", "limits", "over_seeds", "quantile", "own", "source", "note")


def read_objectives(
    table: Any, scenario: Scenario, folder: Path | None = None, *, trust: bool = False
) -> tuple[tuple[Objective, ...], list[str]]:
    """Objectives from a table, by default the scenario's usual fitness; and all faults in it.

    trust : whether the file of functions that objective.own names may run
    """
    if not isinstance(table, Mapping):
        return (), [f"objective = {table!r} is not a table; write objective.maximise = {table!r}"]
    faults = []
    for key in table:
        if key not in KEYS:
            hint = suggest(key, KEYS, f"known: {', '.join(KEYS)}", prefix="objective.")
            faults.append(f"objective.{key}: unknown key; {hint}")
    over, quantile = table.get("over_seeds", "mean"), table.get("quantile", 0.1)
    if not isinstance(over, str) or over not in OVER_SEEDS:
        faults.append(f"objective.over_seeds = {over!r} is none of {', '.join(OVER_SEEDS)}")
    if not isinstance(quantile, (int, float)) or isinstance(quantile, bool) or not 0.0 <= quantile <= 1.0:
        faults.append(f"objective.quantile = {quantile!r} lies outside [0, 1]")
        quantile = 0.1
    own, text, more = _own(table.get("own"), folder, trust)
    faults += more
    found = []
    for key in ("maximise", "minimise"):
        named = table.get(key, [])
        names = [named] if isinstance(named, str) else named
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            faults.append(f"objective.{key} = {named!r} is neither a name nor a list of names")
            continue
        how = (key == "maximise", str(over), float(quantile))
        found += [Objective(n, *how, own.get(n), text if n in own else "") for n in names]
    if not found:
        name = scenario.measures.best or "fitness"
        found = [Objective(name, True, str(over), float(quantile), own.get(name), text if name in own else "")]
    if text and not any(objective.own for objective in found):
        names = [
            name
            for name, function in own.items()
            if getattr(function, "__module__", "") == Path(str(table["own"])).stem
        ]
        write = f"write objective.maximise = '{names[0]}'" if names else "it holds no function"
        others = f" (it holds {', '.join(names)})" if len(names) > 1 else ""
        faults.append(f"objective.own = {table['own']!r}: no objective names a function of this file; {write}{others}")
    return tuple(found), faults


def read_limits(table: Any, scenarios: Sequence[Scenario]) -> tuple[tuple[EventLimit, ...], list[str]]:
    """Limits that candidates are to keep in all scenarios, from the key `limits` of a table; and all faults in it."""
    texts = table.get("limits", []) if isinstance(table, Mapping) else []
    texts = [texts] if isinstance(texts, str) else texts
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in texts):
        return (), [f"objective.limits = {texts!r} is neither a limit nor a list of limits, as 'r_min<3 at 0.01/h'"]
    found: tuple[EventLimit, ...] = ()
    faults: list[str] = []
    for scenario in scenarios if texts else ():
        try:
            found = found or parse_limits(list(texts), scenario)
            parse_limits(list(texts), scenario)
        except ScenarioError as fault:
            faults += [f"objective.limits: {line}" for line in fault.faults]
    faults += [
        f"objective.limits: limit '{limit.text}': does not say how rarely; write {limit.event} at 0.01/h, for instance"
        for limit in found
        if limit.rate is None
    ]
    return found, list(dict.fromkeys(faults))


def _own(name: Any, folder: Path | None, trust: bool) -> tuple[dict[str, UserFitness], str, list[str]]:
    """Functions of a user's own file by name, a hash of its text, and faults."""
    if name is None:
        return {}, "", []
    path = expand_path(str(name)) if folder is None else folder / expand_path(str(name))
    if path.suffix != ".py" or not is_file(path):
        return {}, "", [f"objective.own = {name!r}: no such Python file"]
    try:
        text = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
        module = import_user_file(path, f"objective.own = {name!r}", trust=trust)
    except RuleError as fault:
        return {}, "", [f"objective.own: {fault}"]
    except ScenarioError as fault:
        return {}, "", fault.faults
    own = {key: value for key, value in vars(module).items() if callable(value) and not key.startswith("_")}
    return own, text, []
