"""Many flights, open side by side: their agents seen and commanded as arrays, from decision to decision."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.closed_flights import not_finite_message
from airflock.engine.flight import FlightState, Percepts, observed_rows
from airflock.engine.plan import plan_of
from airflock.scenarios import Scenario, check_seed, check_seeds, load_if_named
from airflock.support import FlightError, available_cores, run_in_threads


class Flights:
    """Many flights, open side by side, that go on from decision to decision; arrays hold what all agents see and do.

    `open_many` opens them.

    commands   : of all agents, as their laws have decided, (flight, agent, axis): what is written
                 there is flown
    percepts   : what they decided from (`Percepts`), the same arrays all along: (flight, agent,
                 ...)
    over       : whether each flight has ended, (flight,)

    What is commanded is not noted, unlike that of `airflock.open`. Faults of commands, and the rule
    of silence, act on it as on a law's.
    """

    def __init__(
        self, scenarios: Any, seeds: Sequence[int], neighbours: int, rays: int | None, threads: int | None, device: str
    ):
        each = [*scenarios] if isinstance(scenarios, (list, tuple)) else [scenarios] * len(seeds)
        if len(each) != len(seeds):
            raise FlightError(f"open_many: {len(each)} scenarios for {len(seeds)} seeds; give one for all, or one each")
        named = {id(scenario): load_if_named(scenario) for scenario in each}
        self.scenarios: list[Scenario] = [named[id(scenario)] for scenario in each]
        if rays is None:
            rays = 8 if all(plan_of(scenario).bounded for scenario in named.values()) else 0
        self.observe, self.threads, self.device = (neighbours, rays), threads, device
        self.courses = [self._opened(number, seed) for number, seed in enumerate(seeds)]
        states = [course.state for course in self.courses]
        shapes = {(s.agents, s.plan.dimensions, s.plan.observed["neighbours"].stop) for s in states}
        if len(shapes) > 1:
            raise FlightError("open_many: the scenarios differ in agents, dimensions or goals; open them apart")
        ((agents, dims, columns),) = shapes
        real = states[0].tables.row.dtype
        self.commands: NDArray[Any] = np.zeros((len(states), agents, dims), real)
        self.percepts = Percepts.of(states[0].plan, np.zeros((len(states), agents, columns), real))
        self.over = np.zeros(len(states), bool)
        self._in_threads(self._sense)

    def _opened(self, number: int, seed: int) -> FlightState:
        """One flight before its first step."""
        seed = check_seed(seed)
        drawn = self.scenarios[number].with_drawn_scene(seed)
        return FlightState(drawn, seed, 32, False, None, self.device, False, self.observe)

    def reset(self, number: int, seed: int) -> "Flights":
        """Begin one of the flights anew with another seed."""
        self.courses[number] = self._opened(number, seed)
        self._sense(number)
        return self

    def advance(self) -> "Flights":
        """Fly all that are not over by their commands, up to their next decision. Raises FlightError."""
        bad = np.argwhere(~np.isfinite(self.commands))
        if len(bad):
            flight, agent, _ = bad[0]
            raise FlightError(f"commands[{flight}, {agent}] = {self.commands[flight, agent].tolist()} is not finite")
        self._in_threads(self._fly)
        return self

    def scores(self, number: int) -> dict[str, Any]:
        """Order parameters and fitness of one flight, up to now."""
        return self.courses[number].scenario.judged(self.courses[number].state.values())

    @property
    def fitness(self) -> NDArray[np.float64]:
        """Fitness of each flight so far, by its metrics, (flight,); nan where it is not defined yet."""
        bests = [scenario.metrics.rule.best for scenario in self.scenarios]
        return np.array([self.scores(number).get(best, np.nan) for number, best in enumerate(bests)])

    def _in_threads(self, work: Callable[[int], None]) -> None:
        """Do something to each flight that is not over."""
        due = np.flatnonzero(~self.over).tolist()
        team = max(1, min(self.threads or available_cores(), len(due)))

        def share(first: int) -> None:
            for number in due[first::team]:
                work(number)

        list(run_in_threads([partial(share, first) for first in range(team)], team))

    def _fly(self, number: int) -> None:
        """Fly one flight by its commands up to its next decision, which it senses."""
        course = self.courses[number]
        state = course.state
        state.set_rows([f"c{axis}" for axis in state.plan.axes], self.commands[number].T)
        course.advance(min(course.step + state.whole("decide_every"), course.steps))
        if not state.is_finite:
            bad = int(np.flatnonzero(~np.isfinite(state.motion).all(axis=0) & state.present)[0])
            raise FlightError(not_finite_message(course.scenario, course.seed, bad, course.step))
        self._sense(number)

    def _sense(self, number: int) -> None:
        """Let the agents of one flight decide, where they do now, and take its last sample at its end."""
        course = self.courses[number]
        state = course.state
        if not state.has_ended and course.step % state.whole("decide_every") == 0:
            course.call(course.step, course.step + 1, 2)
            course.has_sensed = True
        if course.step == course.steps:
            course.advance(course.steps + 1)
        self.over[number] = course.has_ended
        self.percepts.table[number] = observed_rows(state).T
        self.commands[number] = state.rows([f"c{axis}" for axis in state.plan.axes]).T


def open_many(
    scenarios: Any,
    seeds: int | Iterable[int],
    *,
    neighbours: int = 7,
    rays: int | None = None,
    threads: int | None = None,
    device: str = "cpu",
) -> Flights:
    """Open many flights side by side, which go on together from decision to decision, their agents seen as arrays.

    Parameters
    ----------
    scenarios : Scenario, str or list
        One for all flights, or one for each seed, of as many agents and axes: a Scenario, a preset's name or a file.
    seeds : int or iterable of int
        One for each flight; or how many flights, of the seeds 0, 1, ....
    neighbours : int, optional
        How many of the nearest that it hears each agent observes.
    rays : int, optional
        Ways around it that it observes; by default 8 where anything stands in the world.
    threads : int, optional
        How many fly them; all cores by default.
    device : str, optional
        cpu, or python: uncompiled, for debuggers, in double precision.

    Returns
    -------
    Flights
        With the arrays `percepts` and `commands`, and `advance()`.

    Raises
    ------
    ScenarioError, ParameterError, FlightError
        If a scenario cannot be loaded or cannot give what is observed, or a seed is none.

    Examples
    --------
    >>> import airflock
    >>> flights = airflock.open_many("vasarhelyi_2018/4ms", seeds=range(4), neighbours=7)
    >>> flights.commands[:] = flights.percepts.velocity  # everybody flies on
    >>> flights.advance().percepts.offset.shape
    (4, 100, 7, 2)
    """
    return Flights(scenarios, check_seeds(seeds), neighbours, rays, threads, device)
