"""Keys of a scenario file that no record of parameters declares: names, lists and tables that are read as a whole."""

from collections.abc import Mapping
from typing import NamedTuple

from airflock.parts.bodies.registry import BODIES
from airflock.parts.faults.registry import KINDS
from airflock.parts.sensors.registry import SENSORS
from airflock.scenarios.laws import MODELS

OWN = "FILE.py"


class Whole(NamedTuple):
    """One such key: how it is written ("text", "choice", "list", "table"), its meaning, and what a choice may be."""

    kind: str
    meaning: str
    options: tuple[str, ...] = ()


# section → key → what it is; "" stands for the keys at the top of a file
WHOLE_KEYS: Mapping[str, Mapping[str, Whole]] = {
    "": {
        "title": Whole("text", "what the scenario is, for pictures and lists"),
        "extends": Whole("text", "a preset or a file to start from; keys that are left out here are taken from it"),
        "published": Whole(
            "table",
            "what a paper reports: order parameter → mean, [mean, SD] or { mean, sd }; shown beside ours",
        ),
        "model.kind": Whole("choice", "the law that all agents fly by", (*MODELS, OWN)),
        "body.kind": Whole("choice", "what turns commands into motion", (*BODIES, OWN)),
        "sensors.kind": Whole("choice", "how an agent knows its own state", (*SENSORS, OWN)),
    },
    "faults": {
        "kind": Whole("choice", "what happens to an agent", (*KINDS, OWN)),
        "agents": Whole("list", "numbers of the agents that the fault may hit; by default all"),
        "group": Whole("text", "name of the group that the fault may hit; give this or agents"),
    },
    "groups": {
        "name": Whole("text", "name of the group"),
        "agents": Whole(
            "list",
            'numbers of its agents, how many, or a share ("20 %"); by default all that are in no other group',
        ),
        "model": Whole("table", "kind, choices and numbers of its law; { value, spread } for a tolerance"),
        "body": Whole("table", "numbers of its agents' body; { value, spread } for a tolerance"),
        "sensors": Whole("table", "numbers of its agents' sensor; { value, spread } for a tolerance"),
    },
}
