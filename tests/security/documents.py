"""Documents that the fuzz changes: between them they have every section of a scenario and every table of a study."""

SCENARIOS = (
    {
        "model": {"kind": "vasarhelyi_2018", "p_rep": 0.1}, "agents": 6, "duration": 4.0,
        "body": {"kind": "quadrotor"}, "sensors": {"kind": "gnss", "period": 0.2}, "radio": {"kind": "links"},
        "topology": {"kind": "nearest", "k": 4}, "silence": {"rule": "stop", "patience": 1.5},
        "wind": {"kind": "dryden", "east": 3.0}, "metrics": {"kind": "contacts", "period": 0.5},
        "groups": [{"name": "slow", "agents": 2, "model": {"v_flock": 3.0}},
                   {"name": "rest", "agents": 4, "body": {"tau": {"value": 1.0, "spread": 0.1}}}],
        "faults": [{"kind": "motor", "at": 1.0, "agents": [0, 2]},
                   {"kind": "gnss_drift", "per_hour": 3.0, "number": 1}],
    },
    {
        "extends": "vasarhelyi_2018/real_6ms", "agents": 5, "duration": "5 s",
        "sensors": {"kind": "delayed"}, "topology": {"kind": "visible"},
        "world": {"dimensions": "2", "arena": "polygon", "walls": "every_edge",
                  "corners": [[-90, -90], [90, -90], [90, 90], [0, 10], [-90, 90]],
                  "obstacles": [[[-40, -40], [-20, -40], [-20, -20]]]},
        "faults": [{"kind": "radio_range", "at": 0.5, "until": 2.0}],
    },
    {
        "model": {"kind": "vasarhelyi_2018", "v_flock": 16.0}, "agents": 4, "duration": 2.0,
        "body": {"kind": "fixed_wing"}, "start": {"speed": 16.0},
        "world": {"dimensions": "3", "arena": "square", "side": 900.0, "floor": 20.0, "ceiling": 200.0},
        "aero": {}, "wing": {"span": 1.5}, "topology": {"kind": "strongest", "k": 3, "fading": 4.0},
    },
    {
        "model": {"kind": "kidger"}, "agents": 5, "duration": 2.0,
        "world": {"dimensions": "3", "arena": "none"},
        "scene": {"kind": "boxes", "boxes": [[100, 0, 0, 110, 10, 20, 0], [130, 0, 0, 140, 10, 20, 5]], "draw": "once"},
        "goals": {"kind": "points", "points": [[50, 0, 10], [0, 50, 10]]}, "start": {"kind": "ball", "radius": 10.0},
    },
    {"model": {"kind": "vicsek_1995"}, "agents": 20, "world": {"arena": "square", "edges": "periodic", "side": 7.0},
     "topology": {"kind": "voronoi"}, "update": "sequential", "dt": 1.0, "duration": 10.0, "title": "a", "format": 1,
     "sensors": {"kind": "perfect", "period": 1.0}, "radio": {"delay": 0.0},
     "metrics": {"period": 1.0}},
)  # fmt: skip

STUDIES = (
    {
        "scenarios": ["vasarhelyi_2018/4ms", {"scenario": "vasarhelyi_2018/real_6ms", "set": {"radio.delay": 0.5}}],
        "over_scenarios": "worst",
        "objective": {"over_seeds": "mean", "maximise": "fitness"},
        "space": {"model": {"p_rep": {"low": 0.01, "high": 0.5}, "r0_rep": {"low": 10.0, "high": 60.0}}},
        "search": {"population": 12, "generations": 9, "seeds": 2, "averages": 2, "start": "scenario"},
    },
    {
        "scenario": "vasarhelyi_2018/real_4ms",
        "set": {"topology.kind": "nearest", "sensors.kind": "gnss", "agents": 8},
        "objective": {"maximise": ["phi_vel", "r_min"]},
        "space": {"model": {"p_rep": {"low": 0.01, "high": 0.5, "scale": "log"}}, "body": {"tau": {"fixed": 0.5}}},
        "search": {"algorithm": "nsga2", "seeds": 2},
    },
)
