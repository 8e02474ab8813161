"""Airflock: decentralised flocks of drones and birds. The public names below load on first use."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what a type checker and an editor see; at run time __getattr__ below loads each on first use
    from airflock import plots as plots
    from airflock.certify.run import certify as certify
    from airflock.checking.bodies import check_body as check_body
    from airflock.checking.metrics import check_metric as check_metric
    from airflock.checking.models import check_model as check_model
    from airflock.checking.radios import check_radio as check_radio
    from airflock.checking.sensors import check_sensor as check_sensor
    from airflock.checking.topologies import check_topology as check_topology
    from airflock.checking.types import check_types as check_types
    from airflock.core.contract import body as body
    from airflock.core.contract import metric as metric
    from airflock.core.contract import model as model
    from airflock.core.fault import fault as fault
    from airflock.core.parameters import Parameters as Parameters
    from airflock.core.parameters import choice as choice
    from airflock.core.parameters import quantity as quantity
    from airflock.core.radio import radio as radio
    from airflock.core.sensor import sensor as sensor
    from airflock.display.displays import display as display
    from airflock.engine import Flight as Flight
    from airflock.engine import Flight as open  # noqa: F401
    from airflock.errors import AirflockError as AirflockError
    from airflock.evolve.harden import harden as harden
    from airflock.evolve.run import evolve as evolve
    from airflock.evolve.validation import validate as validate
    from airflock.fleet.flying import fleet as fleet
    from airflock.identify.run import identify as identify
    from airflock.infer.run import infer as infer
    from airflock.metrics.registry import metric_set as metric_set
    from airflock.papers import paper as paper
    from airflock.plots.picture import plot as plot
    from airflock.plots.video import video as video
    from airflock.recordings import measures as measures
    from airflock.recordings.exports.export import export as export
    from airflock.recordings.files import load_recording as load_recording
    from airflock.recordings.files import save as save
    from airflock.recordings.flights import recording_of as recording_of
    from airflock.recordings.flights import simulate as simulate
    from airflock.recordings.health import doctor as doctor
    from airflock.recordings.imports.load import load_tracks as load_tracks
    from airflock.recordings.scores import over_time as over_time
    from airflock.recordings.scores import score as score
    from airflock.recordings.sweeps import sweep as sweep
    from airflock.replays import replay as replay
    from airflock.scenarios.files import load as load
    from airflock.scenarios.files import presets as presets
    from airflock.scenarios.keys import keys as keys
    from airflock.scenarios.scaling import starting_set as starting_set
    from airflock.scenarios.scenario import Scenario as Scenario
    from airflock.studio.watch import watch as watch
    from airflock.tune.run import tune as tune

__version__ = "0.1.0"

_WHERE = {
    "AirflockError": "airflock.errors",
    "Scenario": "airflock.scenarios.scenario",
    "load": "airflock.scenarios.files",
    "presets": "airflock.scenarios.files",
    "keys": "airflock.scenarios.keys",
    "starting_set": "airflock.scenarios.scaling",
    "validate": "airflock.evolve.validation",
    "model": "airflock.core.contract",
    "body": "airflock.body",
    "metric": "airflock.core.contract",
    "fault": "airflock.core.fault",
    "sensor": "airflock.core.sensor",
    "radio": "airflock.core.radio",
    "metric_set": "airflock.metrics.registry",
    "quantity": "airflock.core.parameters",
    "choice": "airflock.core.parameters",
    "Parameters": "airflock.core.parameters",
    "check_model": "airflock.checking.models",
    "check_metric": "airflock.checking.metrics",
    "check_body": "airflock.checking.bodies",
    "check_sensor": "airflock.checking.sensors",
    "check_topology": "airflock.checking.topologies",
    "check_radio": "airflock.checking.radios",
    "check_types": "airflock.checking.types",
    "simulate": "airflock.recordings.flights",
    "Flight": "airflock.engine",
    "recording_of": "airflock.recordings.flights",
    "score": "airflock.recordings.scores",
    "over_time": "airflock.recordings.scores",
    "sweep": "airflock.recordings.sweeps",
    "evolve": "airflock.evolve",
    "harden": "airflock.evolve.harden",
    "certify": "airflock.certify",
    "tune": "airflock.tune",
    "display": "airflock.display",
    "fleet": "airflock.fleet",
    "plot": "airflock.plots.picture",
    "plots": "airflock.plots",
    "video": "airflock.plots.video",
    "replay": "airflock.replays",
    "watch": "airflock.studio.watch",
    "export": "airflock.recordings.exports.export",
    "save": "airflock.recordings.files",
    "identify": "airflock.identify",
    "infer": "airflock.infer",
    "load_tracks": "airflock.recordings.imports.load",
    "measures": "airflock.recordings.measures",
    "load_recording": "airflock.recordings.files",
    "paper": "airflock.papers",
    "doctor": "airflock.recordings.health",
}
# packages; all but plots and measures can be called: see callable_module
_MODULES = ("evolve", "certify", "tune", "display", "fleet", "identify", "infer", "body", "plots", "measures")
__all__ = [*_WHERE, "__version__"]
_WHERE["open"] = "airflock.engine"  # not in __all__: `from airflock import *` would hide Python's own


if not TYPE_CHECKING:  # a type checker shall tell names that do not exist

    def __getattr__(name: str) -> Any:
        if name in _WHERE:
            module = import_module(_WHERE[name])
            return module if name in _MODULES else getattr(module, "Flight" if name == "open" else name)
        raise AttributeError(f"module 'airflock' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
