"""What the rules of an order parameter, and of a set of them, may ask for."""

from airflock.core.vocabulary.bodies import STATE
from airflock.core.vocabulary.laws import FLOCK, PAIR

MEASURED = {
    **STATE,
    "speed": "length of the velocity, m/s",
    "hx": "heading (unit vector; zero at rest), east",
    "hy": "heading (unit vector; zero at rest), north",
    "hz": "heading (unit vector; zero at rest), up",
    "excursion": "distance outside the arena or inside an obstacle, m; negative where flying is allowed",
    "touches": "1.0 if a sphere of radius metrics.r_body met the scene on its last step of motion, else 0.0",
    "rays": "rays that the agent cast at its last decision; 0.0 in a recording",
    "pair": "what this metric's `pair` gathered for this agent",
    "memory": "this metric's Memory of this agent",
    "mean": "Mean over the flock: x y z (m), vx vy vz (m/s), hx hy hz, and number n",
    "shared": "what this metric's `survey` found for this agent",
    "wing": "parameters of the wing (aero.wing)",
}
MEMBER = {
    name: text
    for name, text in MEASURED.items()
    if name not in ("excursion", "touches", "rays", "memory", "mean", "shared", "wing")
} | {
    "mean": "Mean over the agent's own cluster",
}
CLUSTER = {
    "n": "members of the cluster",
    "hx": "sum of their headings, east",
    "hy": "sum of their headings, north",
    "hz": "sum of their headings, up",
    "hh": "sum of the squared lengths of their headings: how many of them move",
    "members": "what `member` summed up over the members",
    "mean": "Mean over the members",
}
SAMPLE = {
    "n": "number of agents",
    "mean": "Mean over the flock",
    "agents": "what `agent` summed up over all agents",
    "clusters": "what `cluster` summed up over all clusters",
    "dimensions": "2.0 in a plane, 3.0 in space",
    "time": "since the start, s",
}
METRIC = {
    "pair": {name: PAIR[name] for name in ("dx", "dy", "dz", "r", "r2", "lower")} | {"q": "metric parameters"},
    "linked": {"r": "distance of two agents, m", "r2": "its square, m²; cheaper than r", "q": "metric parameters"},
    "agent": {**MEASURED, "q": "metric parameters"},
    "member": {**MEMBER, "q": "metric parameters"},
    "cluster": {**CLUSTER, "q": "metric parameters"},
    "sample": {**SAMPLE, "q": "metric parameters"},
    "survey": {**FLOCK, "q": "metric parameters"},
    "within": {"q": "metric parameters"},
    "linked_within": {"q": "metric parameters"},
    "settled": {
        "pair": "what the rule `pair` adds up to over all who are nearer than `beyond`, and perhaps some others",
        "beyond": "distance, m",
        "q": "metric parameters",
    },
}
METRIC_SET = {
    "fitness": {
        "values": "order parameters of one flight, by name",
        "agents": "number of agents",
        "duration": "time flown, s",
        "q": "metric parameters",
    },
    "faults": {
        "q": "metric parameters",
        "largest": "largest extension, m; 0.0 without an arena",
        "edges": "world.edges",
    },
}
