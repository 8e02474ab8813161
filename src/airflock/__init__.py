"""Airflock: decentralised flocks of drones and birds. The public names below load on first use."""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_WHERE = {
    "AirflockError": "airflock.errors",
    "Scenario": "airflock.scenarios.scenario",
    "load": "airflock.scenarios.files",
    "presets": "airflock.scenarios.files",
    "model": "airflock.core.contract",
    "body": "airflock.body",
    "metric": "airflock.core.contract",
    "metric_set": "airflock.metrics.registry",
    "quantity": "airflock.core.parameters",
    "choice": "airflock.core.parameters",
    "Parameters": "airflock.core.parameters",
    "check_model": "airflock.checking.models",
    "check_metric": "airflock.checking.metrics",
    "check_body": "airflock.checking.bodies",
    "simulate": "airflock.recordings.flights",
    "Flight": "airflock.engine.flight",
    "recording_of": "airflock.recordings.flights",
    "score": "airflock.recordings.scores",
    "evolve": "airflock.evolve",
    "save": "airflock.recordings.files",
    "identify": "airflock.identify",
    "load_tracks": "airflock.recordings.imports.load",
    "load_recording": "airflock.recordings.files",
}
__all__ = [*_WHERE, "__version__"]
_WHERE["open"] = "airflock.engine.flight"  # not in __all__: `from airflock import *` would hide Python's own


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        module = import_module(_WHERE[name])
        if name in ("evolve", "body", "identify"):
            return module  # which can be called
        return getattr(module, "Flight" if name == "open" else name)
    raise AttributeError(f"module 'airflock' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
