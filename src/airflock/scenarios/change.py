"""Change: a scenario with some of its keys changed, as a flight in the air takes it."""

import os
from collections.abc import Mapping
from typing import Any

from airflock.core import Model
from airflock.scenarios.families import PART_KINDS, CallerParts
from airflock.scenarios.files import load, load_if_named
from airflock.scenarios.laws import MODELS
from airflock.scenarios.making import build_scenario
from airflock.scenarios.scenario import Scenario
from airflock.support import ScenarioError

FIXED_KEYS = {"agents": "the number of agents", "dt": "the motion step"}  # keys at the top that a flight cannot change


def rebuilt(scenario: Scenario, settings: Mapping[str, Any], *, started: bool = False) -> Scenario:
    """The scenario with keys changed, checked as a whole as if it came from a file.

    Its law, body, sensor, radio, topology and order parameters stay those that it has where they are no names of ours,
    unless their kind is changed. Nothing is asked about the start of a flight that has `started`.
    Raises ScenarioError with one line per fault.
    """
    document = {**scenario.document}
    if scenario.scene.kind == "mesh":  # which was looked for beside the scenario file
        document["scene"] = {**document.get("scene", {}), "file": scenario.scene.file}
    shipped = document.get("model", {}).get("kind") in MODELS
    if not shipped and scenario.is_aerodynamic:
        raise ScenarioError(["aero: a law of one's own with drag descent cannot be changed in flight"])
    own = {
        each.field: getattr(scenario, each.field)
        for each in PART_KINDS
        if f"{each.section}.kind" not in settings
        and document.get(each.section, {}).get("kind", "") not in ("", *each.shipped)
    }
    kinds = {entry.fault.name: entry.fault for entry in scenario.faults}
    if "faults" not in settings and "faults" in document:
        document["faults"] = named_fault_entries(scenario)
    law = None if shipped or "model.kind" in settings else scenario.model
    given = CallerParts(law=law, fault_kinds=kinds, laws=user_laws(scenario), **own)
    return build_scenario(document, scenario.name, settings, caller_parts=given, started=started)


def user_laws(scenario: Scenario) -> dict[str, Model]:
    """Laws of groups that are none of ours, by the names that the document has for them."""
    given = zip(scenario.document.get("groups", ()), scenario.groups, strict=True)
    kinds = {table.get("model", {}).get("kind"): group.law for table, group in given}
    return {kind: law[0] for kind, law in kinds.items() if law is not None and kind is not None and kind not in MODELS}


def named_fault_entries(scenario: Scenario) -> list[dict[str, Any]]:
    """The entries of [[faults]], with kinds from files of the user's own by the names that they have in the flight."""
    given = scenario.document.get("faults", ())
    return [{**entry, "kind": found.fault.name} for entry, found in zip(given, scenario.faults, strict=True)]


def with_faults_starting(scenario: Scenario, count: int, at: float) -> Scenario:
    """The scenario whose last faults, so many of them, begin at a time, s; itself where they do already."""
    entries = named_fault_entries(scenario)
    last = entries[len(entries) - count :]
    if all(entry["at"] == at for entry in last):
        return scenario
    return rebuilt(
        scenario, {"faults": [*entries[: len(entries) - count], *({**entry, "at": at} for entry in last)]}, started=True
    )


def scenario_variant(
    scenario: Scenario | str | os.PathLike[str],
    settings: Mapping[str, Any] | None,
    law: Any = None,
    *,
    trust: bool = False,
) -> Scenario:
    """A scenario, or the one that a name or file stands for, with keys changed; law and trust as in `load`."""
    if not isinstance(scenario, (Scenario, str, os.PathLike)):
        return load_if_named(scenario)
    if not isinstance(scenario, Scenario):
        return load(scenario, settings, law, trust=trust)
    if law is not None:
        raise ScenarioError([f"{scenario.name}: is a Scenario already; give its law to load(name, law=...)"])
    return rebuilt(scenario, settings) if settings else scenario


def with_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """The scenario with keys like "model.p_rep" changed, for a flight in the air.

    A flight can take everything that a scenario file says but the number of agents, the dimensions, the motion step and
    the start. Raises ScenarioError with one line per fault.
    """
    new = rebuilt(scenario, settings, started=True)
    faults = [
        f"{key} = {getattr(new.flight, key):g}: {what} cannot change in flight; open another flight"
        for key, what in FIXED_KEYS.items()
        if getattr(new.flight, key) != getattr(scenario.flight, key)
    ]
    if new.dimensions != scenario.dimensions:
        faults.append(f"world.dimensions = {new.dimensions}: cannot change in flight; open another flight")
    if new.start != scenario.start:
        faults.append("start: the flight has started; open another flight")
    if faults:
        raise ScenarioError([f"{scenario.name}: {fault}" for fault in faults])
    return new
