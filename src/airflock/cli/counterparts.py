"""Which function does what a command does, and which of its arguments stands for each option.

A test compares this table with the commands and with the functions, so that neither can grow alone.
"""

from collections.abc import Mapping
from typing import NamedTuple


class Counterpart(NamedTuple):
    """One command: how it is called in Python, the function, and option → argument (or what stands for it).

    A function without a dot is a public name of `airflock`; the others, with their module, take more preparation.
    """

    call: str
    function: str
    options: Mapping[str, str]


SETTINGS = {"changes": "settings", "agents": 'settings["agents"]', "duration": 'settings["duration"]'}
CODE = {"law": "law", "trust": "trust"}
LOADED = {"changes": "airflock.load(name, settings)", "agents": "airflock.load", "duration": "airflock.load"}
LOADED |= {"law": "airflock.load", "trust": "airflock.load"}
TABLE = {"as_json": "the value returned"}
SEARCH = (
    "algorithm", "population", "generations", "seeds", "seed", "restarts", "flights", "racing", "start", "averages",
)  # fmt: skip
SEEDS = {"seeds": "seeds", "first_seed": "seeds"}
FLOWN = {"threads": "threads", "precision": "precision", "device": "device"}
MANY = {**FLOWN, "scheduler": "scheduler"}

COUNTERPARTS: dict[str, Counterpart] = {
    "run": Counterpart(
        "airflock.score(scenario, seeds=4)", "score",
        {"scenario": "what", **SEEDS, **LOADED, **MANY, **TABLE, "save": "airflock.save", "plot": "airflock.plot"},
    ),
    "score": Counterpart(
        "airflock.score(recording)", "score",
        {
            "files": "what", "changes": "settings", "trust": "trust", **TABLE, "series": "airflock.over_time",
            "aero": "aero", "groups": "groups", "body_length": "body_length",
        },
    ),
    "sweep": Counterpart(
        'airflock.sweep(scenario, {"radio.delay": [0, 1, 2]})', "sweep",
        {
            "scenario": "what", "over": "over", **SEEDS, **SETTINGS, **CODE, **MANY, **TABLE,
            "table": "the table returned", "plot": "airflock.plots.heatmap", "show": "a column of the table returned",
        },
    ),
    "evolve": Counterpart(
        'airflock.evolve("vasarhelyi_2018/6ms", "study")', "evolve",
        {
            "scenario": "what", "out": "out", **SETTINGS, **TABLE, "resume": "resume", "scheduler": "scheduler",
            "timeout": "timeout", "sensitivity": "sensitivity", "device": "device", "threads": "threads",
            "quiet": "watch", "trust": "trust", "limit": "limit", "fast": "fast",
            **dict.fromkeys(SEARCH, "search_keys"),
        },
    ),
    "harden": Counterpart(
        'airflock.harden("study/best.toml", range(100))', "harden",
        {
            "scenario": "scenario", **SEEDS, "cost": "cost", "limit": "limit", "threads": "threads", **TABLE,
            "changes": LOADED["changes"],
            "trust": "airflock.load", "duration": "airflock.load", "out": "airflock.evolve.harden.document",
        },
    ),
    "certify": Counterpart(
        'airflock.certify("mine.toml", "r_min<1 at 1e-3/h")', "certify",
        {
            "scenario": "scenario", "limit": "limit", "out": "airflock.certify.certificate.Certificate.save",
            "tolerance_of": "tolerance", "check": "airflock.certify.check.check", "changes": "settings", **CODE,
            "agents": 'settings["agents"]', "duration": 'settings["duration"]', **TABLE,
            "plot": "airflock.plots.certificate.certificate",
            **{
                name: name
                for name in (
                    "confidence", "budget", "flights", "resume", "tolerance", "split", "over", "uncertain", "scheduler",
                    "timeout", "threads", "precision", "device",
                )
            },
        },
    ),
    "tune": Counterpart(
        'airflock.tune("mine.toml", "tuned")', "tune",
        {
            "scenario": "scenario", "out": "out", **SETTINGS, **TABLE,
            **{name: name for name in ("budget", "limit", "confidence", "like", "heard", "warm", "resume")},
            "threads": "threads", "trust": "trust",
        },
    ),
    "plot": Counterpart(
        'airflock.plot("flight.nc", "series")', "plot",
        {
            "what": "what", "kind": "kind", "seed": "seed", "begin": "start", "end": "stop", **SETTINGS, **CODE,
            "out": "airflock.plots.save_figure",
        },
    ),
    "video": Counterpart(
        'airflock.video(recording, "flight.mp4")', "video",
        {
            "what": "recording", "out": "path", "seed": "airflock.simulate", "begin": "start", "end": "stop",
            "fps": "fps", "speed": "speed", "space": "space", "chart": "chart", **LOADED,
        },
    ),
    "watch": Counterpart(
        'airflock.watch("vasarhelyi_2018/4ms")', "watch",
        {
            "scenario": "scenario", "changes": "settings", "agents": 'settings["agents"]', "seed": "seed",
            "host": "host", "port": "port", "against": "against", "radio": "radios", "key": "key", **CODE,
        },
    ),
    "replay": Counterpart(
        "airflock.replay(recording)", "replay",
        {
            "what": "recording", "page": "airflock.replays.Replay.save", "seed": "airflock.simulate", "rate": "rate",
            "colour": "colour", **LOADED,
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
    "import": Counterpart(
        'airflock.load_tracks("fish.csv", unit="mm")', "load_tracks",
        {
            "files": "what", "save": "airflock.save", **TABLE,
            **{
                name: name
                for name in (
                    "map", "unit", "scale", "time_unit", "fps", "keypoint", "axes", "origin", "rate", "bridge",
                    "begin", "end", "same_clock", "accept", "decimal", "delimiter", "precision",
                )
            },
        },
    ),
    "export": Counterpart(
        'airflock.export(recording, "flight.csv")', "export",
        {"recording": "recording", "out": "path", "layout": "layout"},
    ),
    "identify": Counterpart(
        'airflock.identify(files, "vasarhelyi_2018/real_6ms")', "identify",
        {
            "files": "what", "like": "like", "heard": "heard", "standing": "standing", "same_clock": "same_clock",
            "begin": "begin", "end": "end",
            "accept": "accept", "changes": "airflock.load", **TABLE,
            "out": "airflock.identify.run.Identified.document",
            **dict.fromkeys(("conservative", "uncertain"), "airflock.identify.run.Identified.document"),
            "plot": "airflock.plots.identified.identified", "plan": "airflock.identify.plan.flight_card",
            "flights": "airflock.identify.check.posterior",
            **dict.fromkeys(("map", "unit", "time_unit", "axes", "decimal", "delimiter"), "options"),
        },
    ),
    "infer": Counterpart(
        'airflock.infer(recording, ["couzin_2002", "vicsek_1995"])', "infer",
        {
            "tracks": "tracks", "models": "models", "changes": "settings", "flights": "check", "seed": "seed",
            "trust": "trust", **TABLE, "out": "airflock.infer.result.Inferred.document",
            "plot": "airflock.plots.inferred.inferred",
        },
    ),
    "fleet": Counterpart(
        'airflock.fleet("vasarhelyi_2018/real_4ms", seeds=5)', "fleet",
        {
            "scenario": "scenario", **SEEDS, **SETTINGS, "trust": "trust", **TABLE, "against": "beside",
            "card_file": "card", "save": "the recordings of the value returned",
            **{name: name for name in ("vehicle", "body", "mode", "join", "faults", "silence", "ground")},
        },
    ),
    "fly": Counterpart(  # missions, nodes and orders are commands' work; a program of one's own asks the law
        "airflock.core.pilot.Pilot(model, p, place, index=0, period=0.2)", "airflock.core.pilot.Pilot", {}
    ),
    "paper": Counterpart(
        'airflock.paper("vasarhelyi_2018", only="s2")', "paper",
        {"name": "name", "only": "only", "quick": "quick", "seeds": "seeds", "threads": "threads",
         "breaks": "airflock_papers.breaks.fly", "keep": "airflock_papers.quick.fly", **TABLE},
    ),
    "presets": Counterpart(
        "airflock.presets()", "presets",
        {"name": "airflock.load", "for_speed": "airflock.starting_set", **TABLE},
    ),
    "keys": Counterpart('airflock.keys("radio")', "keys", {"section": "section", **TABLE}),
    "validate": Counterpart(
        'airflock.validate("mine.toml")', "validate", {"files": "name", "changes": "settings", **CODE, **TABLE}
    ),
    "types": Counterpart('airflock.check_types("mine.py")', "check_types", {"files": "files", "out": "out", **TABLE}),
    "doctor": Counterpart("airflock.doctor()", "doctor", {**TABLE, "clear": "airflock.cache.clear_cache"}),
}  # fmt: skip
# public functions that no command needs: they are what a program does between two of them
LIBRARY = (
    "load", "simulate", "recording_of", "save", "load_recording", "over_time", "starting_set", "model", "body", "fault",
    "sensor", "radio", "metric", "metric_set", "check_model", "check_body", "check_metric", "check_sensor",
    "check_radio", "check_topology", "quantity", "choice",
)  # fmt: skip
