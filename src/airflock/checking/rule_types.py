"""What the words of the vocabulary are: a number, a record, a column of numbers; and what each kind of rule returns."""

from airflock.core.vocabulary import bodies, faults, laws, metrics, radios, sensors

LAW, BODY, SENSOR, RADIO, FAULT = (tuple(each.RULES) for each in (laws, bodies, sensors, radios, faults))
LAW_NUMBERS = ("preferred_speed", "interaction_range")
MEASURES = (*metrics.METRIC, *metrics.METRIC_SET)
COLUMNS = "MutableSequence[float]"

# (module, name) behind the words that a rule file need not define itself
KNOWN = {
    "Own": ("airflock.core.vocabulary", "Own"),
    "Percept": ("airflock.core.vocabulary", "Percept"),
    "Mean": ("airflock.core.vocabulary", "Mean"),
    "Wing": ("airflock.aero.wing", "Parameters"),
    "Descent": ("airflock.aero.descent", "Parameters"),
    "Measured": ("airflock.metrics.parameters", "Parameters"),
    "Topology": ("airflock.topology.parameters", "Parameters"),
    "Any": ("typing", "Any"),
    "Literal": ("typing", "Literal"),
    "Mapping": ("collections.abc", "Mapping"),
    "MutableSequence": ("collections.abc", "MutableSequence"),
}
# names of the contract that are no numbers, wherever they stand
RECORDS = {
    "own": "Own", "percept": "Percept", "sums": "Sums", "walls": "Walls", "memory": "Memory", "shared": "Shared",
    "pair": "Pair", "agents": "Agent", "members": "Member", "clusters": "Cluster", "mean": "Mean", "wing": "Wing",
    "aero": "Descent", "p": "Parameters", "q": "Parameters", "b": "Parameters", "s": "Parameters", "f": "Parameters",
    "k": "Parameters", "packet": "Packet",
}  # fmt: skip
OF_FLOCK = {
    **dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), COLUMNS), "n": "int", "shared": "SharedColumns", "work": "Any",
}  # fmt: skip
ROWS = ("dx", "dy", "dz", "r2", "hidden", "fade", "met", "heap", "weak")
# where a word means something else than in the other kinds
SPECIAL = {
    "meet": {**dict.fromkeys(ROWS, COLUMNS), "n": "int", "t": "Topology"},
    "missed": {"fast": "int", "slow": "int"},
    "missed_few": {"fast": "int", "slow": "int"},
    "flock": OF_FLOCK,
    "survey": OF_FLOCK,
    "workspace": {"n": "int"},
    "fitness": {"values": "Mapping[str, float]", "agents": "int"},
    "faults": {"edges": "str"},
}
# of the record of parameters, by owner
LETTERS = {"p": LAW, "q": MEASURES, "b": BODY, "s": SENSOR, "k": RADIO, "f": FAULT}
STATE = f"tuple[{', '.join(['float'] * 6)}]"
VECTOR = "tuple[float, float, float]"
RESULTS = {
    **dict.fromkeys(("reach", "sight", "wall_reach", "within", "linked_within", *LAW_NUMBERS), "float"),
    "neighbour": "Sums", "boundary": "Walls", "decide": VECTOR, "move": VECTOR, "flock": "None", "survey": "None",
    "meet": "None",
    "pair": "Pair", "linked": "float", "agent": "Agent", "member": "Member", "cluster": "Cluster", "sample": "Sample",
    "fitness": "Mapping[str, float]", "faults": "list[str]", "limits": "list[str]", "endures": "float",
    "sense": STATE, "tell": STATE, "overrule": VECTOR, "motion": VECTOR, "clock": "float", "leaves": "float",
    "radio": "tuple[float, float]", "measure": STATE, "error": "tuple[float, float]", "exact": "bool",
    "settled": "bool", "bounds": "list[str]", "missed": "float", "missed_few": "float", "receive": "float",
    "late": "float", "see": STATE, "carry": VECTOR, "lasts": "float",
}  # fmt: skip


def kinds_of(functions: set[str]) -> dict[str, str]:
    """Name of a function → its kind; a helper has none."""
    kinds: dict[str, str] = {}
    if "decide" in functions:
        kinds |= {name: name for name in (*LAW, *LAW_NUMBERS, "workspace")}
    if "move" in functions:
        kinds |= {name: name for name in BODY}
    if "sample" in functions or "fitness" in functions:
        kinds |= {name: name for name in (*MEASURES, "workspace", "total")}
    if "meet" in functions:
        kinds |= {"meet": "meet"}
    if not kinds and functions & {"measure", "error"}:
        kinds = {name: name for name in SENSOR}
    if not kinds and functions & {"missed", "receive", "late", "see"}:
        kinds = {name: name for name in RADIO}
    if not kinds:  # elsewhere these are names of helpers
        kinds = {name: name for name in FAULT}
    return {name: kind for name, kind in kinds.items() if name in functions}
