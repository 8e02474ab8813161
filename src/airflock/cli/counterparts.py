"""Python counterparts of the commands: the function of each, and the argument that stands for each option.

A test compares this table with the commands and with the functions, so that neither can grow alone.
"""

from collections.abc import Mapping
from typing import NamedTuple


class PythonCounterpart(NamedTuple):
    """Counterpart of one command: the call in Python, the function, and option → argument (or a replacement).

    A function without a dot is a public name of `airflock`; the others, with their module, take more preparation.
    """

    call: str
    function: str
    options: Mapping[str, str]


SETTINGS_OPTIONS = {"changes": "settings", "agents": 'settings["agents"]', "duration": 'settings["duration"]'}
CODE_OPTIONS = {"law": "law", "trust": "trust"}
LOAD_OPTIONS = {"changes": "airflock.load(name, settings)", "agents": "airflock.load", "duration": "airflock.load"}
LOAD_OPTIONS |= {"law": "airflock.load", "trust": "airflock.load"}
JSON_OPTIONS = {"as_json": "the value returned"}
SEARCH_OPTIONS = (
    "algorithm", "population", "generations", "seeds", "seed", "restarts", "flights", "start", "averages",
)  # fmt: skip
SEED_OPTIONS = {"seeds": "seeds", "first_seed": "seeds"}
FLIGHT_OPTIONS = {"threads": "threads", "precision": "precision", "device": "device"}
MANY_FLIGHT_OPTIONS = {**FLIGHT_OPTIONS, "scheduler": "scheduler"}

# One row per command and option: an option without an argument of a public function fails a test.
COUNTERPARTS: dict[str, PythonCounterpart] = {
    "run": PythonCounterpart(
        "airflock.score(scenario, seeds=4)",
        "score",
        {
            "scenario": "scenario_or_recording",
            **SEED_OPTIONS,
            **LOAD_OPTIONS,
            **MANY_FLIGHT_OPTIONS,
            **JSON_OPTIONS,
            "save": "airflock.save",
            "plot": "airflock.plot",
        },
    ),
    "score": PythonCounterpart(
        "airflock.score(recording)",
        "score",
        {
            "files": "scenario_or_recording",
            "changes": "settings",
            "trust": "trust",
            **JSON_OPTIONS,
            "series": "airflock.over_time",
            "aero": "aero",
            "groups": "groups",
            "body_length": "body_length",
        },
    ),
    "sweep": PythonCounterpart(
        'airflock.sweep(scenario, {"radio.delay": [0, 1, 2]})',
        "sweep",
        {
            "scenario": "scenario",
            "over": "over",
            **SEED_OPTIONS,
            **SETTINGS_OPTIONS,
            **CODE_OPTIONS,
            **MANY_FLIGHT_OPTIONS,
            **JSON_OPTIONS,
            "out": "out",
            "resume": "resume",
            "table": "the table returned",
            "plot": "airflock.plots.heatmap",
            "show": "a column of the table returned",
        },
    ),
    "evolve": PythonCounterpart(
        'airflock.evolve("vasarhelyi_2018/6ms", "study")',
        "evolve",
        {
            "scenario": "scenario",
            "out": "out",
            **SETTINGS_OPTIONS,
            **JSON_OPTIONS,
            "resume": "resume",
            "scheduler": "scheduler",
            "timeout": "timeout",
            "sensitivity": "sensitivity",
            "device": "device",
            "threads": "threads",
            "quiet": "watch",
            "trust": "trust",
            "limit": "limit",
            "fast": "fast",
            **dict.fromkeys(SEARCH_OPTIONS, "search_keys"),
        },
    ),
    "harden": PythonCounterpart(
        'airflock.harden("study/best.toml", range(100))',
        "harden",
        {
            "scenario": "scenario",
            **SEED_OPTIONS,
            "cost": "cost",
            "limit": "limit",
            "threads": "threads",
            **JSON_OPTIONS,
            "changes": LOAD_OPTIONS["changes"],
            "trust": "airflock.load",
            "duration": "airflock.load",
            "out": "airflock.search.hardening.hardened_document",
        },
    ),
    "certify": PythonCounterpart(
        'airflock.certify("mine.toml", "r_min<1 at 1e-3/h")',
        "certify",
        {
            "scenario": "scenario",
            "limit": "limit",
            "out": "airflock.certificates.certificate.Certificate.save",
            "tolerance_of": "tolerance",
            "check": "airflock.certificates.certificate.check_certificate",
            "changes": "settings",
            **CODE_OPTIONS,
            "agents": 'settings["agents"]',
            "duration": 'settings["duration"]',
            **JSON_OPTIONS,
            "plot": "airflock.view.result_plots.plot_certificate",
            **{
                name: name
                for name in (
                    "confidence",
                    "budget",
                    "flights",
                    "resume",
                    "tolerance",
                    "split",
                    "over",
                    "uncertain",
                    "scheduler",
                    "timeout",
                    "threads",
                    "precision",
                    "device",
                )
            },
        },
    ),
    "tune": PythonCounterpart(
        'airflock.tune("mine.toml", "tuned")',
        "tune",
        {
            "scenario": "scenario",
            "out": "out",
            **SETTINGS_OPTIONS,
            **JSON_OPTIONS,
            **{name: name for name in ("budget", "limit", "confidence", "like", "heard", "warm", "resume")},
            "threads": "threads",
            "trust": "trust",
        },
    ),
    "plot": PythonCounterpart(
        'airflock.plot("flight.nc", "series")',
        "plot",
        {
            "what": "source",
            "kind": "kind",
            "seed": "seed",
            "begin": "start",
            "end": "stop",
            **SETTINGS_OPTIONS,
            **CODE_OPTIONS,
            "out": "airflock.plots.save_figure",
        },
    ),
    "video": PythonCounterpart(
        'airflock.video(recording, "flight.mp4")',
        "video",
        {
            "source": "recording",
            "out": "path",
            "seed": "airflock.simulate",
            "begin": "start",
            "end": "stop",
            "fps": "fps",
            "speed": "speed",
            "space": "space",
            "chart": "chart",
            **LOAD_OPTIONS,
        },
    ),
    "watch": PythonCounterpart(
        'airflock.watch("vasarhelyi_2018/4ms")',
        "watch",
        {
            "scenario": "scenario",
            "changes": "settings",
            "agents": 'settings["agents"]',
            "seed": "seed",
            "host": "host",
            "port": "port",
            "against": "against",
            "radio": "radios",
            "key": "key",
            **CODE_OPTIONS,
        },
    ),
    "replay": PythonCounterpart(
        "airflock.replay(recording)",
        "replay",
        {
            "source": "recording",
            "page": "airflock.view.replay_page.Replay.save",
            "seed": "airflock.simulate",
            "rate": "rate",
            "colour": "colour",
            **LOAD_OPTIONS,
        },
    ),
    "display": PythonCounterpart(
        'airflock.display(["AIR", "heart.png"], 200)',
        "display",
        {
            "shapes": "shapes",
            "drones": "drones",
            "failing": "failing",
            "failure": "failure",
            "points": "points",
            "spacing": "spacing",
            "seed": "seed",
            "changes": "settings",
            **JSON_OPTIONS,
            "save": "airflock.displays.shows.recording_of",
            "plot": "airflock.plots.stood",
        },
    ),
    "import": PythonCounterpart(
        'airflock.load_tracks("fish.csv", unit="mm")',
        "load_tracks",
        {
            "files": "source",
            "save": "airflock.save",
            **JSON_OPTIONS,
            **{
                name: name
                for name in (
                    "map",
                    "unit",
                    "scale",
                    "time_unit",
                    "fps",
                    "keypoint",
                    "axes",
                    "origin",
                    "rate",
                    "bridge",
                    "begin",
                    "end",
                    "same_clock",
                    "accept",
                    "decimal",
                    "delimiter",
                    "precision",
                )
            },
        },
    ),
    "export": PythonCounterpart(
        'airflock.export(recording, "flight.csv")',
        "export",
        {"recording": "recording", "out": "path", "layout": "layout"},
    ),
    "identify": PythonCounterpart(
        'airflock.identify(files, "vasarhelyi_2018/real_6ms")',
        "identify",
        {
            "files": "flight_logs",
            "like": "like",
            "heard": "heard",
            "standing": "standing",
            "same_clock": "same_clock",
            "begin": "begin",
            "end": "end",
            "accept": "accept",
            "changes": "airflock.load",
            **JSON_OPTIONS,
            "out": "airflock.estimate.identification.vehicle_identification.IdentifyResult.document",
            **dict.fromkeys(
                ("conservative", "uncertain"),
                "airflock.estimate.identification.vehicle_identification.IdentifyResult.document",
            ),
            "plot": "airflock.view.result_plots.plot_identified",
            "plan": "airflock.estimate.identification.vehicle_identification.flight_card",
            "flights": "airflock.estimate.identification.log_check.check_against_logs",
            **dict.fromkeys(("map", "unit", "time_unit", "axes", "decimal", "delimiter"), "options"),
        },
    ),
    "infer": PythonCounterpart(
        'airflock.infer(recording, ["couzin_2002", "vicsek_1995"])',
        "infer",
        {
            "tracks": "tracks",
            "models": "models",
            "topologies": "topologies",
            "changes": "settings",
            "flights": "check",
            "seed": "seed",
            "trust": "trust",
            **JSON_OPTIONS,
            "out": "airflock.estimate.inference.law_inference.InferResult.document",
            "plot": "airflock.view.result_plots.plot_inferred",
        },
    ),
    "fleet": PythonCounterpart(
        'airflock.fleet("vasarhelyi_2018/real_4ms", seeds=5)',
        "fleet",
        {
            "scenario": "scenario",
            **SEED_OPTIONS,
            **SETTINGS_OPTIONS,
            "trust": "trust",
            **JSON_OPTIONS,
            "against": "beside",
            "card_file": "card",
            "save": "the recordings of the value returned",
            **{name: name for name in ("vehicle", "body", "mode", "join", "faults", "silence", "ground")},
        },
    ),
    "fly": PythonCounterpart(  # missions, nodes and orders are commands' work; a program of one's own calls the law
        "airflock.core.pilot.Pilot(model, p, place, index=0, period=0.2)", "airflock.core.pilot.Pilot", {}
    ),
    "paper": PythonCounterpart(
        'airflock.paper("vasarhelyi_2018", only="s2")',
        "paper",
        {
            "name": "name",
            "only": "only",
            "quick": "quick",
            "seeds": "seeds",
            "threads": "threads",
            "breaks": "airflock_papers.breaks.fly",
            "keep": "airflock_papers.quick.fly",
            **JSON_OPTIONS,
        },
    ),
    "presets": PythonCounterpart(
        "airflock.presets()",
        "presets",
        {"name": "airflock.load", "for_speed": "airflock.starting_set", **JSON_OPTIONS},
    ),
    "keys": PythonCounterpart(
        'airflock.keys("radio")',
        "keys",
        {"section": "section", "schema": "airflock.scenarios.keys.json_schema()", **JSON_OPTIONS},
    ),
    "validate": PythonCounterpart(
        'airflock.validate("mine.toml")',
        "validate",
        {"files": "name", "changes": "settings", **CODE_OPTIONS, **JSON_OPTIONS},
    ),
    "types": PythonCounterpart(
        'airflock.check_types("mine.py")', "check_types", {"files": "files", "out": "out", **JSON_OPTIONS}
    ),
    "doctor": PythonCounterpart(
        "airflock.doctor()", "doctor", {**JSON_OPTIONS, "clear": "airflock.support.cache.clear_cache"}
    ),
}
# public functions that no command needs: they are what a program does between two of them
LIBRARY_FUNCTIONS = (
    "load", "simulate", "recording_of", "save", "load_recording", "over_time", "starting_set", "model", "body", "fault",
    "sensor", "radio", "metric", "metric_set", "check_model", "check_body", "check_metric", "check_sensor",
    "check_radio", "check_topology", "check_fault", "quantity", "choice",
)  # fmt: skip
