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
    "quantity": "airflock.core.parameters",
    "choice": "airflock.core.parameters",
    "Parameters": "airflock.core.parameters",
    "simulate": "airflock.recordings.flights",
    "Flight": "airflock.engine.flight",
    "recording_of": "airflock.recordings.flights",
    "score": "airflock.recordings.scores",
    "evolve": "airflock.evolve",
    "replay": "airflock.replays",
    "save": "airflock.recordings.files",
    "load_recording": "airflock.recordings.files",
}
__all__ = [*_WHERE, "__version__"]
_WHERE["open"] = "airflock.engine.flight"  # not in __all__: `from airflock import *` would hide Python's own


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        module = import_module(_WHERE[name])
        if name == "evolve":
            return module  # which can be called
        return getattr(module, "Flight" if name == "open" else name)
    raise AttributeError(f"module 'airflock' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
