"""The contract of a sensor: what an agent measures of its own position and velocity, as plain rules.

A kind of sensor is a module with `Parameters` and one of two rules. `measure` makes of the true state the one that is
believed. `error` is the shorter form for errors that are added to the truth, alike along each axis. The argument names
are the declaration, as of every rule (`core.vocabulary`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core.contract import namespace_names
from airflock.core.contract.own_records import check_memory_record, initial_values, merge_parameters
from airflock.core.parameters import Parameters, quantity
from airflock.core.vocabulary import argument_names, call_rule
from airflock.support import RuleError

FIRST_DRAW = (
    8  # draw of the stream SENSOR for g0 to g3; then g4 to g7, g8 to g11, u0 to u3. Before it: errors along axes
)
COMPONENTS = ("x", "y", "z", "vx", "vy", "vz")  # what `measure` returns, before its Memory


@dataclass(frozen=True, kw_only=True)
class SensorParameters(Parameters):
    """What every sensor has: how often an agent measures, and so decides."""

    period: float = quantity(
        0.2,
        "s",
        low=0.0,
        high=60.0,
        usual=(0.0, 1.0),
        source="Vásárhelyi et al. 2018, Table S5",
        meaning="time between decisions; 0: at every step dt",
    )


@dataclass(frozen=True)
class Sensor:
    """A kind of sensor: parameters and a rule, gathered from a module or any namespace.

    name       : how scenarios refer to it
    Parameters : record of its numbers; `period` is among them
    measure    : true state, Memory and random numbers → position (m), velocity (m/s) and, behind them, Memory. It is
                 asked once for each agent and decision; what an agent sends carries the errors of its last measurement
    error      : error of position (m) and of velocity (m/s) along one axis → the same after one period. It is asked
                 for each axis, and again for what is sent, whose errors are drawn apart (authors' program of
                 Vásárhelyi et al. 2018)
    Memory     : NamedTuple of what `measure` keeps of one agent, each field with its value at the start
    exact      : `exact(s)`, whether it tells the truth with these numbers; a flight then spends nothing on it
    bounds     : `bounds` of any of s, period, dt → what of a scenario it cannot measure, one line each
    violates   : truths of `airflock.check_sensor` that do not hold for it, and why (VIOLATES)
    """

    name: str
    Parameters: type
    measure: Callable[..., Any] | None = None
    error: Callable[..., Any] | None = None
    Memory: type | None = None
    exact: Callable[..., bool] | None = None
    bounds: Callable[..., list[str]] | None = None
    violates: Mapping[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, self.measure, self.error))

    @property
    def initial_memory(self) -> tuple[float, ...]:
        """What each field of its Memory is at the start of a flight."""
        return initial_values(self.Memory)

    def is_exact(self, s: Any) -> bool:
        """Whether it tells the truth with these numbers."""
        return self.exact is not None and bool(self.exact(s))

    def bound_errors(self, **arguments: Any) -> list[str]:
        """What this sensor cannot measure, by what `bounds` may ask for."""
        return [] if self.bounds is None else list(call_rule(self.bounds, "bounds", arguments, self.name))


def sensor(namespace: Any, name: str = "") -> Sensor:
    """Gather a sensor from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds one of the rules measure and error; if it likes, Parameters, exact, bounds, and Memory (a NamedTuple
        whose fields have the values of the start), which measure asks for as `memory` and returns behind the state.
    name : str, optional
        How the sensor is called; by default the namespace's.

    Returns
    -------
    Sensor
        To be given to `airflock.load(..., sensor=...)`.

    Raises
    ------
    RuleError
        If it has no rule or both, or a rule asks for what there is not.

    Examples
    --------
    >>> import airflock
    >>> class Coarse:
    ...     def error(g):
    ...         return 0.5 * g, 0.0
    >>> airflock.sensor(Coarse).Parameters().period
    0.2
    """
    found, name = namespace_names(namespace, name)
    rules = [kind for kind in ("measure", "error") if callable(found.get(kind))]
    if len(rules) != 1:
        raise RuleError(f"sensor {name} has {' and '.join(rules) or 'no rule'}; give measure, or error")
    memory = found.get("Memory")
    check_memory_record(f"sensor {name}", "measure", argument_names(found[rules[0]], rules[0], name), memory)
    for kind in ("exact", "bounds"):
        if found.get(kind) is not None:
            argument_names(found[kind], kind, name)
    parameters = merge_parameters(SensorParameters, found.get("Parameters"), f"sensor {name}")
    return Sensor(
        name, parameters, found.get("measure"), found.get("error"), memory,
        found.get("exact"), found.get("bounds"), dict(found.get("VIOLATES", {})),
    )  # fmt: skip
