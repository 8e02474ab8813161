"""Keys of a scenario file that no record of parameters declares: names, lists and tables that are read as a whole."""

from collections.abc import Mapping
from typing import NamedTuple

from airflock.parts.bodies import BODIES
from airflock.parts.faults import KINDS
from airflock.parts.sensors import SENSORS
from airflock.scenarios.laws import MODELS

OWN = "FILE.py"


class UndeclaredKey(NamedTuple):
    """One such key: how it is written ("text", "choice", "list", "table"), its meaning, and what a choice may be."""

    kind: str
    meaning: str
    options: tuple[str, ...] = ()


# section → key → what it is; "" stands for the keys at the top of a file
UNDECLARED_KEYS: Mapping[str, Mapping[str, UndeclaredKey]] = {
    "": {
        "title": UndeclaredKey("text", "what the scenario is, for pictures and lists"),
        "extends": UndeclaredKey(
            "text", "a preset or a file to start from; keys that are left out here are taken from it"
        ),
        "published": UndeclaredKey(
            "table",
            "what a paper reports: order parameter → mean, [mean, SD] or { mean, sd }; shown beside ours",
        ),
        "model.kind": UndeclaredKey("choice", "the law that all agents fly by", (*MODELS, OWN)),
        "body.kind": UndeclaredKey("choice", "what turns commands into motion", (*BODIES, OWN)),
        "sensors.kind": UndeclaredKey("choice", "how an agent knows its own state", (*SENSORS, OWN)),
    },
    "faults": {
        "kind": UndeclaredKey("choice", "what happens to an agent", (*KINDS, OWN)),
        "agents": UndeclaredKey("list", "numbers of the agents that the fault may hit; by default all"),
        "group": UndeclaredKey("text", "name of the group that the fault may hit; give this or agents"),
    },
    "groups": {
        "name": UndeclaredKey("text", "name of the group"),
        "agents": UndeclaredKey(
            "list",
            'numbers of its agents, how many, or a share ("20 %"); by default all that are in no other group',
        ),
        "model": UndeclaredKey("table", "kind, choices and numbers of its law; { value, spread } for a tolerance"),
        "body": UndeclaredKey("table", "numbers of its agents' body; { value, spread } for a tolerance"),
        "sensors": UndeclaredKey("table", "numbers of its agents' sensor; { value, spread } for a tolerance"),
    },
}
