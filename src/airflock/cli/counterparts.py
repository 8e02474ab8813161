"""Which function does what a command does, and which of its arguments stands for each option.

A test compares this table with the commands and with the functions, so that neither can grow alone.
"""

from collections.abc import Mapping
from typing import NamedTuple


class Counterpart(NamedTuple):
    """One command: how it is called in Python, the public function, and option → argument (or what stands for it)."""

    call: str
    function: str
    options: Mapping[str, str]


SETTINGS = {"changes": "settings", "agents": 'settings["agents"]', "duration": 'settings["duration"]'}
LOADED = {"changes": "airflock.load(name, settings)", "agents": "airflock.load", "duration": "airflock.load"}
TABLE = {"as_json": "the value returned"}
SEEDS = {"seeds": "seeds", "first_seed": "seeds"}
FLOWN = {"threads": "threads", "precision": "precision", "device": "device"}

COUNTERPARTS: dict[str, Counterpart] = {
    "run": Counterpart(
        "airflock.score(scenario, seeds=4)", "score",
        {"scenario": "what", **SEEDS, **LOADED, **FLOWN, **TABLE, "save": "airflock.save", "plot": "airflock.plot"},
    ),
    "score": Counterpart(
        "airflock.score(recording)", "score",
        {"files": "what", "changes": "settings", **TABLE, "series": "airflock.over_time", "aero": "aero"},
    ),
    "sweep": Counterpart(
        'airflock.sweep(scenario, {"radio.delay": [0, 1, 2]})', "sweep",
        {
            "scenario": "what", "over": "over", **SEEDS, **SETTINGS, **FLOWN, **TABLE, "table": "the table returned",
            "plot": "airflock.plots.heatmap", "show": "a column of the table returned",
        },
    ),
    "evolve": Counterpart(
        'airflock.evolve("vasarhelyi_2018/6ms", "study")', "evolve",
        {
            "scenario": "what", "out": "out", **SETTINGS, **TABLE, "resume": "resume", "scheduler": "scheduler",
            "timeout": "timeout", "sensitivity": "sensitivity", "device": "device", "threads": "threads",
            "quiet": "watch",
            **dict.fromkeys(("algorithm", "population", "generations", "seeds", "seed", "restarts"), "search_keys"),
        },
    ),
    "harden": Counterpart(
        'airflock.harden("study/best.toml", range(100))', "harden",
        {
            "scenario": "scenario", **SEEDS, "threads": "threads", **TABLE, "changes": LOADED["changes"],
            "duration": "airflock.load", "out": "airflock.evolve.harden.document",
            **dict.fromkeys(("r_coll", "delay", "generations"), "airflock.evolve.harden.evolved_again"),
        },
    ),
    "plot": Counterpart(
        'airflock.plot("flight.nc", "series")', "plot",
        {
            "what": "what", "kind": "kind", "seed": "seed", "begin": "start", "end": "stop", **SETTINGS,
            "out": "airflock.plots.save_figure",
        },
    ),
    "video": Counterpart(
        'airflock.video(recording, "flight.mp4")', "video",
        {
            "what": "recording", "out": "path", "seed": "airflock.simulate", "begin": "start", "end": "stop",
            "fps": "fps", "speed": "speed", **LOADED,
        },
    ),
    "display": Counterpart(
        'airflock.display(["AIR", "heart.png"], 200)', "display",
        {
            "shapes": "shapes", "drones": "drones", "failing": "failing", "failure": "failure", "points": "points",
            "spacing": "spacing", "seed": "seed", "changes": "settings", **TABLE,
            "save": "airflock.display.show.recording_of", "plot": "airflock.plots.stood",
        },
    ),
    "paper": Counterpart(
        'airflock.paper("vasarhelyi_2018", only="s2")', "paper",
        {"name": "name", "only": "only", "quick": "quick", "seeds": "seeds", "threads": "threads", **TABLE},
    ),
    "presets": Counterpart(
        "airflock.presets()", "presets",
        {"name": "airflock.load", "for_speed": "airflock.starting_set", **TABLE},
    ),
    "keys": Counterpart('airflock.keys("radio")', "keys", {"section": "section", **TABLE}),
    "validate": Counterpart(
        'airflock.validate("mine.toml")', "validate", {"files": "name", "changes": "settings"}
    ),
    "doctor": Counterpart("airflock.doctor()", "doctor", TABLE),
}  # fmt: skip
# public functions that no command needs: they are what a program does between two of them
LIBRARY = ("load", "simulate", "save", "load_recording", "over_time", "starting_set", "model", "quantity", "choice")
