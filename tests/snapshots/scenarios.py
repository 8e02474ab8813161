"""Scenarios of all presets and of 2,000 mutated files: a digest of every value and the notes, or the errors in full.

`python tests/snapshots/run.py scenarios --show PRESET` prints the values behind a digest, and `--show NUMBER` a mutated
file and what became of it.
"""

import json
import os
import random
import sys
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import airflock
from airflock import AirflockError

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "security"))

import mutations  # noqa: E402

SEED = 44
MUTANTS = 2000
FILE = "mutated.toml"

# Sections that are a part of a `Scenario`: a rule and its numbers. Whoever renames or merges fields changes these
# tables alone: the record stays as it is.
PARTS = ("body", "sensors", "radio", "metrics", "topology")
FIELDS = (
    "name", "wind", "world", "scene", "goals", "start", "wing", "aero", "silence", "flight", "groups", "faults",
    "published", "document",
)  # fmt: skip
TEXTS = ("notes",)  # fields that the record holds in full
RENAMED = {}  # name of a field inside these -> its name in the record


def plain(value):
    """Return a value as JSON knows it: a record by the names of its fields, a rule by its own name."""
    if isinstance(value, str | bool | None):
        return value
    if isinstance(value, int | float):
        return repr(float(value))
    names = [each.name for each in fields(value)] if is_dataclass(value) else getattr(value, "_fields", None)
    if names is not None:
        value = {RENAMED.get(name, name): getattr(value, name) for name in names}
        if "name" in value and any(map(callable, value.values())):  # a rule, whose text the drivers hold
            return value["name"]
    if hasattr(value, "items"):
        return {label(key): plain(one) for key, one in sorted(value.items(), key=lambda item: label(item[0]))}
    if isinstance(value, set | frozenset):
        return sorted(map(plain, value), key=json.dumps)
    if isinstance(value, list | tuple | range):
        return [plain(one) for one in value]
    assert type(value).__module__ == "datetime", f"{type(value)} is no plain value"
    return str(value)


def label(key):
    """Return the key of a mapping as text."""
    return key if isinstance(key, str) else json.dumps(plain(key))


def kind(rule):
    """Return the name of a rule; of a set of order parameters also their names."""
    if rule is None:
        return None
    return [rule.name, *(metric.name for metric in rule.metrics)] if hasattr(rule, "metrics") else rule.name


def values(scenario):
    """Return all values of a scenario."""
    covered = {*FIELDS, *TEXTS, *PARTS, "model", "parameters", "steer"}
    assert {each.name for each in fields(scenario)} == covered, "fields of a Scenario that this snapshot does not know"
    found = {name: plain(getattr(scenario, name)) for name in FIELDS}
    found["model"] = {"kind": kind(scenario.model), "numbers": plain(scenario.parameters)}
    for section in PARTS:
        part = getattr(scenario, section)
        # A topology of the package is a choice among its numbers.
        rule = scenario.own_topology if section == "topology" else part.rule
        found[section] = {"kind": kind(rule), "numbers": plain(part.numbers)}
    # How commands are converted counts where they are: most laws fly a body that takes theirs.
    return found | ({"steer": plain(scenario.resolved_steer())} if scenario.model.steer else {})


def outcome(*arguments):
    """Return the digest and the notes of a scenario that is loaded, or the lines of the error."""
    try:
        scenario = airflock.load(*arguments)
    except AirflockError as error:
        return {"error": str(error).splitlines()}
    digest = sha256(json.dumps(values(scenario), sort_keys=True).encode()).hexdigest()[:16]
    return {"digest": digest} | ({"notes": list(scenario.notes)} if scenario.notes else {})


def mutant(number):
    """Return the content of a mutated file and the settings that it is loaded with: every other one is nearly right."""
    rng = random.Random(f"scenario {SEED} {number}")
    document = rng.choice(mutations.scenarios())
    if number % 2:
        content = mutations.lines_of(nudge(rng, document)).encode()
    elif rng.random() < 0.8:
        content = mutations.lines_of(mutations.mutate(rng, document)).encode()
    else:
        content = mutations.damage(rng, mutations.lines_of(document).encode())
    return content, {"agents": rng.choice([5, mutations.numbers(rng)])} if rng.random() < 0.1 else {}


def nudge(rng, document):
    """Return a copy of a document with a few other numbers of the same size, or a key less."""
    document = json.loads(json.dumps(document, default=str))
    for _ in range(rng.choice([1, 2, 4, 8])):
        table = document
        while (inside := [one for one in table.values() if isinstance(one, dict)]) and rng.random() < 0.8:
            table = rng.choice(inside)
        key = rng.choice(sorted(table)) if table else None
        value = table.get(key)
        if isinstance(value, bool | str | None):
            if rng.random() < 0.1:
                table.pop(key, None)
        elif isinstance(value, int | float):
            table[key] = rng.choice([value, value * rng.uniform(0.5, 2.0), value * rng.choice([2, 3, 0.1, 10, 100])])
    return document


@contextmanager
def folder():
    """Work in an empty folder, so that no message names a place."""
    before = Path.cwd()
    with TemporaryDirectory() as path:
        os.chdir(path)
        try:
            yield
        finally:
            os.chdir(before)


def loaded(number):
    """Return what becomes of a mutated file."""
    content, settings = mutant(number)
    Path(FILE).write_bytes(content)
    return outcome(FILE, settings)


def take():
    """Return the outcome of every preset and every mutated file."""
    inputs = sha256()
    for number in range(MUTANTS):
        content, settings = mutant(number)
        inputs.update(content + repr(settings).encode())
    with folder():
        return {
            "presets": {name: outcome(name) for name in airflock.presets()},
            "mutated files, digest of all": inputs.hexdigest(),
            "mutated files": {f"{number:04}": loaded(number) for number in range(MUTANTS)},
        }


def show(name):
    """Return the values of a preset, or a mutated file with its outcome."""
    if name in airflock.presets():
        return json.dumps(values(airflock.load(name)), indent=1, sort_keys=True)
    content, settings = mutant(int(name))
    with folder():
        became = loaded(int(name))
        if "digest" in became:
            became["values"] = values(airflock.load(FILE, settings))
    return f"{content.decode(errors='replace')}\n{settings}\n{json.dumps(became, indent=1, sort_keys=True)}"
