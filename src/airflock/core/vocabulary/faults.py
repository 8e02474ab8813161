"""What the rules of a kind of fault may ask for."""

from airflock.core.vocabulary.bodies import COMMAND, MOTION, STATE

ONSET = {
    "since": "time since the fault began, s",
    **{f"at_{name}": f"true {text}, when the fault began" for name, text in STATE.items()},
    **{f"at_{name}": f"{text}, when the fault began" for name, text in COMMAND.items()},
}
LAST = {f"at_{name}": f"{text}, as it was last before the fault began" for name, text in STATE.items()}
RULES = {
    "sense": {**STATE, **ONSET, **LAST, "f": "the fault's parameters"},
    "tell": {**STATE, **ONSET, **LAST, "f": "the fault's parameters"},
    "radio": {"reach": "radio.range, m", "since": ONSET["since"], "f": "the fault's parameters"},
    "clock": {"since": ONSET["since"], "f": "the fault's parameters"},
    "overrule": {**COMMAND, **ONSET, "f": "the fault's parameters"},
    "motion": {
        **{name: MOTION[name] for name in ("vx", "vy", "vz", "cx", "cy", "cz", "dt")},
        "nx": "velocity after the step as the body flew it, east, m/s",
        "ny": "velocity after the step as the body flew it, north, m/s",
        "nz": "velocity after the step as the body flew it, up, m/s",
        **ONSET,
        "f": "the fault's parameters",
    },
    "leaves": {"f": "the fault's parameters"},
}
