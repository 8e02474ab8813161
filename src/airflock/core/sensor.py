"""The contract of a sensor: what an agent measures of its own position and velocity, as plain rules.

A kind of sensor is a module with `Parameters` and one of two rules. `measure` turns the true state
into the one that is believed. `error` is the shorter form for errors that are added to the truth in
the same way along each axis. The argument names are the declaration, as of every rule
(`core.vocabulary`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from airflock.core import random
from airflock.core.contract import (
    State,
    along_axes,
    argument_names,
    call_rule,
    check_memory_record,
    gather,
    initial_values,
    merge_parameters,
    namespace_names,
)
from airflock.core.parameters import Parameters, quantity
from airflock.support import RuleError

SENSED = {
    **along_axes("", "true position", "m"),
    **along_axes("v", "true velocity", "m/s"),
    "memory": "the sensor's Memory of this agent",
    **{f"g{k}": "normal random number, new at each measurement" for k in range(12)},
    **{f"u{k}": "uniform random number between 0 and 1, new at each measurement" for k in range(4)},
    "time": "time of the measurement, s",
    "period": "time between two measurements, s",
}
AXIS_ERROR = {
    "dx": "error of the position along one axis at the last measurement, m",
    "dv": "error of the velocity along this axis at the last measurement, m/s",
    "g": "normal random number of this axis",
    "period": "time between two measurements, s",
}
RULES = {
    "measure": {**SENSED, "s": "the sensor's parameters"},
    "error": {**AXIS_ERROR, "s": "the sensor's parameters"},
    "exact": {"s": "the sensor's parameters"},
    "bounds": {"s": "the sensor's parameters", "period": "time between two measurements, s", "dt": "time step, s"},
}


FIRST_DRAW = (
    8  # draw of the stream SENSOR for g0 to g3; then g4 to g7, g8 to g11, u0 to u3. Before it: errors along axes
)
COMPONENTS = ("x", "y", "z", "vx", "vy", "vz")  # what `measure` returns, before its Memory


@dataclass(frozen=True, kw_only=True)
class SensorParameters(Parameters):
    """Parameters of every sensor: the period at which an agent measures, and so decides."""

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
    measure    : true state, Memory and random numbers → position (m), velocity (m/s) and, behind
                 them, Memory. It is called once for each agent and decision; what an agent sends
                 carries the errors of its last measurement
    error      : error of position (m) and of velocity (m/s) along one axis → the same after one
                 period. It is called for each axis, and again for what is sent, whose errors are
                 drawn apart (authors' program of Vásárhelyi et al. 2018)
    Memory     : NamedTuple of what `measure` keeps of one agent, each field with its value at the
                 start
    exact      : `exact(s)`, True if it has no error with these numbers; a flight then spends
                 nothing on it
    bounds     : `bounds` of any of s, period, dt → what of a scenario it cannot measure, one line
                 each
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
        """Return the value of each field of Memory at the start of a flight."""
        return initial_values(self.Memory)

    def is_exact(self, s: Any) -> bool:
        """Return True if the sensor has no error with these parameters."""
        return self.exact is not None and bool(self.exact(s))

    def bound_errors(self, **arguments: Any) -> list[str]:
        """Return what this sensor cannot measure, one line each, from the arguments that `bounds` may request."""
        return [] if self.bounds is None else list(call_rule(self.bounds, "bounds", arguments, self.name))


def sensor(namespace: Any, name: str = "") -> Sensor:
    """Gather a sensor from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds one of the rules measure and error; if it likes, Parameters, exact, bounds, and Memory (a NamedTuple
        whose fields have the values of the start), which measure takes as `memory` and returns behind the state.
    name : str, optional
        How the sensor is called; by default the namespace's.

    Returns
    -------
    Sensor
        To be given to `airflock.load(..., sensor=...)`.

    Raises
    ------
    RuleError
        If it has no rule or both, or a rule requests an unknown argument.

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
    arguments = argument_names(found[rules[0]], rules[0], name)
    check_memory_record(f"sensor {name}", "measure", arguments, found.get("Memory"))
    for kind in ("exact", "bounds"):
        if found.get(kind) is not None:
            argument_names(found[kind], kind, name)
    parameters = merge_parameters(SensorParameters, found.get("Parameters"), f"sensor {name}")
    return gather(Sensor, found, name=name, Parameters=parameters)


Words = Callable[[int, int], tuple[int, int, int, int]]


class SensorState:
    """Sensor of one agent, measurement after measurement.

    sensor, s   : kind of sensor and its numbers
    seed, agent : by which its random numbers are drawn, those of the same agent in a flight of this
                  seed
    flat        : whether the agent flies in a plane, where nothing is wrong along the third axis
    words       : four random words by the numbers of a measurement and a draw, where somebody has
                  them already
    """

    def __init__(self, sensor: Sensor, s: Any, seed: int, agent: int, *, flat: bool, words: Words | None = None):
        self.sensor, self.s, self.seed, self.agent, self.flat = sensor, s, seed, agent, flat
        self._words: Words = words or (
            lambda number, draw: random.random_words(seed, random.SENSOR, 0, number, agent, draw)
        )
        self.off = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._memory = sensor.Memory() if sensor.Memory is not None else None

    def measure(self, number: int, true: State, period: float) -> State:
        """Measurement `number`: what is believed minus the true state, m and m/s, until the next one."""
        if self.sensor.is_exact(self.s):
            return self.off
        x, v = self._errors(number, true, period)
        self.off = State(x[0], x[1], 0.0 if self.flat else x[2], v[0], v[1], 0.0 if self.flat else v[2])
        return self.off

    def _errors(self, number: int, true: State, period: float) -> tuple[Sequence[float], Sequence[float]]:
        """Errors of position (m) and velocity (m/s), all three axes."""
        if self.sensor.error is not None:
            low, high = (self._words(number, draw) for draw in (0, 1))
            normal = (*random.normal_pair(low[0], low[1]), random.normal_pair(high[0], high[1])[0])
            off = add_errors(self.sensor, self.s, self.off, normal, period)
            return off[:3], off[3:]
        # All numbers are drawn whether the rule requests them or not: a draw is a function of its
        # counter, so an unused one shifts nothing.
        draws = draw_numbers(self.seed, number, self.agent)
        time = number * period
        found, self._memory = call_measure(self.sensor, self.s, true, self._memory, time, period, draws)
        apart = [float(a - b) for a, b in zip(found, true, strict=True)]
        return apart[:3], apart[3:]


def add_errors(sensor: Sensor, s: Any, errors: State, normal: Sequence[float], period: float) -> State:
    """Errors (m, m/s) that a sensor adds along each axis, after `off` by the normal numbers of three axes."""
    assert sensor.error is not None
    steps = [
        call_rule(sensor.error, "error", {"dx": dx, "dv": dv, "g": g, "period": period, "s": s})
        for dx, dv, g in zip(errors[:3], errors[3:], normal, strict=True)
    ]
    return State(*(dx for dx, _ in steps), *(dv for _, dv in steps))


def call_measure(
    sensor: Sensor, s: Any, true: Sequence[float], memory: Any, time: float, period: float, draws: Mapping[str, float]
) -> tuple[State, Any]:
    """Return the state that the rule `measure` of a sensor makes of a true one (m, m/s), and its new Memory."""
    assert sensor.measure is not None
    given = {**State(*true)._asdict(), **draws, "memory": memory, "time": time, "period": period, "s": s}
    found = call_rule(sensor.measure, "measure", given, sensor.name)
    return State(*found[:6]), found[6] if sensor.Memory is not None else None


def draw_numbers(seed: int, number: int, agent: int, world: int = 0) -> dict[str, float]:
    """Random numbers that a rule `measure` may ask for at one measurement of one agent, by name."""
    found: dict[str, float] = {}
    for block in range(3):
        words = random.random_words(seed, random.SENSOR, world, number, agent, FIRST_DRAW + block)
        pairs = (*random.normal_pair(words[0], words[1]), *random.normal_pair(words[2], words[3]))
        found |= {f"g{4 * block + c}": value for c, value in enumerate(pairs)}
    words = random.random_words(seed, random.SENSOR, world, number, agent, FIRST_DRAW + 3)
    return found | {f"u{c}": random.uniform(word) for c, word in enumerate(words)}
