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
    "score": "airflock.recordings.scores",
    "evolve": "airflock.evolve",
    "save": "airflock.recordings.files",
    "identify": "airflock.identify",
    "load_tracks": "airflock.recordings.imports.load",
    "load_recording": "airflock.recordings.files",
}
__all__ = [*_WHERE, "__version__"]


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        module = import_module(_WHERE[name])
        return module if name in ("evolve", "identify") else getattr(module, name)  # modules that can be called
    raise AttributeError(f"module 'airflock' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
