"""Airflock: decentralised flocks of drones and birds. The public names load on first use; `__init__.pyi` lists them."""

import sys
from importlib.abc import MetaPathFinder

import lazy_loader

__version__ = "0.1.0"

# Packages that stood here before 0.1.0 → where their modules are now. A script that names one is
# told so in one line.
_MOVED = {
    "aero": "parts.aero",
    "body": "parts.bodies",
    "certify": "certificates",
    "checking": "check",
    "display": "displays",
    "evolve": "search",
    "executors": "runs",
    "faults": "parts.faults",
    "fleet": "fleets",
    "identify": "estimate",
    "infer": "estimate",
    "limits": "certificates",
    "mavlink": "drones.mavlink",
    "metrics": "parts.metrics",
    "models": "parts.laws",
    "onboard": "drones.onboard",
    "papers": "cli",
    "plots": "view",
    "radios": "parts.radios",
    "replays": "view",
    "rules": "core",
    "scenes": "world.scenes",
    "sensors": "parts.sensors",
    "stage": "view",
    "topology": "parts.topologies",
    "tune": "search",
    **dict.fromkeys(
        ("asked", "atomic", "cache", "errors", "gpu", "hardware", "locks", "machine", "memory", "numeric", "spelling"),
        "support",
    ),
    **dict.fromkeys(("suffixes", "threads", "untrusted"), "support"),
}

_attached, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ = [*__all__, "__version__"]


class _MovedFinder(MetaPathFinder):
    """Name the new place of a module that has moved; asked last, so that it costs nothing else."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name in ("airflock.engine.course", "airflock.engine.snapshots"):  # what old pickles ask for first
            raise ModuleNotFoundError("a flight or moment that was pickled before 0.1.0 cannot be read; fly it again")
        package, _, rest = name.partition(".")
        first = rest.partition(".")[0]
        if package == __name__ and first in _MOVED:
            raise ModuleNotFoundError(
                f"{name}: the modules of airflock.{first} are in airflock.{_MOVED[first]} now; "
                "public names are those of airflock itself"
            )
        if package == __name__:
            raise ModuleNotFoundError(f"{name}: no such module; public names are those of airflock itself", name=name)


sys.meta_path.append(_MovedFinder())


def __getattr__(name: str) -> object:
    if name == "open":  # not in __all__: `from airflock import *` would hide Python's own
        name = "Flight"
    if name not in __all__:
        raise AttributeError(f"module 'airflock' has no attribute {name!r}")
    return _attached(name)
