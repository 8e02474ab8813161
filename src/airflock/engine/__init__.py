"""Engine: the only place that knows compilers, arrays of flights and devices. What others use of it is named here.

Nothing else of it is imported from outside (import-linter sees to that), so that its rooms may change. A name is
imported when it is first asked for: no compiler is loaded before something is to fly.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from airflock.engine.flight import Flight as Flight
    from airflock.engine.measuring import measure_frames as measure_frames
    from airflock.engine.plan import Plan as Plan
    from airflock.engine.planning import plan_of as plan_of
    from airflock.engine.simulate import compile_for as compile_for
    from airflock.engine.simulate import driver_text as driver_text
    from airflock.engine.simulate import fly as fly
    from airflock.engine.simulate import picked as picked
    from airflock.engine.simulate import score_flight as score_flight
    from airflock.engine.simulate import score_flights as score_flights
    from airflock.engine.snapshots import Snapshot as Snapshot
    from airflock.engine.state import State as State
    from airflock.engine.text.generate import Source as Source
    from airflock.engine.text.probe import shapes_of as shapes_of

_WHERE = {
    "Flight": "flight",
    "Plan": "plan",
    "Snapshot": "snapshots",
    "Source": "text.generate",
    "State": "state",
    "compile_for": "simulate",
    "driver_text": "simulate",
    "fly": "simulate",
    "measure_frames": "measuring",
    "picked": "simulate",
    "plan_of": "planning",
    "score_flight": "simulate",
    "score_flights": "simulate",
    "shapes_of": "text.probe",
}
__all__ = [*_WHERE]

if not TYPE_CHECKING:  # a type checker shall tell names that do not exist

    def __getattr__(name: str) -> Any:
        if name in _WHERE:
            return getattr(import_module(f"airflock.engine.{_WHERE[name]}"), name)
        raise AttributeError(f"module 'airflock.engine' has no attribute {name!r}")
