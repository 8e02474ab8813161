"""Flights as environments for learning: PettingZoo for one flight, Gymnasium for one or for many side by side.

Every agent observes what it has measured and heard (`airflock.engine.flight.Percepts`, a row of
it), with the delay, noise, loss and faults of the scenario, and commands what its law would: a
velocity, an acceleration or a direction. All agents share one reward, by the fitness of the
scenario's metrics. With F the fitness of the flight so far (0 where it is not defined yet) and t /
T the part of it that is flown, a step is rewarded by the gain of F t / T. So an instant that lasts
counts the same early and late, and the rewards of an episode add up to its fitness.

`info["law"]` is what each agent's own law commands in the present state: a published law as a
policy. Flown by it, a flight has the bits of the closed one.

Examples
--------
>>> import airflock.learn
>>> envs = airflock.learn.make_vec("vasarhelyi_2018/4ms", 4, settings={"agents": 20, "duration": 60.0})
>>> observations, info = envs.reset(seed=1)
>>> observations, rewards, ended, stopped, info = envs.step(info["law"])
>>> observations.shape, rewards.shape
((4, 20, 52), (4,))
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import COMMANDS
from airflock.engine import open_many
from airflock.scenarios import Scenario, check_seed, scenario_variant
from airflock.support import AirflockError, FlightError

try:
    import gymnasium
    import pettingzoo
    from gymnasium.spaces import Box
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise AirflockError("environments need gymnasium and pettingzoo: pip install 'airflock[learn]'") from error

# Preset, settings and law of the registered ids.
SCENARIOS: dict[str, tuple[str, dict[str, Any], str | None]] = {
    "Flock": ("vasarhelyi_2018/4ms", {"agents": 20, "duration": 120.0, "world.side": 120.0}, None),
    "Corridor": (
        "vasarhelyi_2018/obstacles",
        {
            "agents": 10, "duration": 120.0,
            "world.arena": "polygon", "world.walls": "every_edge", "world.obstacles": [],
            "world.corners": [[-150.0, -20.0], [150.0, -20.0], [150.0, 20.0], [-150.0, 20.0]],
            "goals.kind": "points", "goals.points": [[130.0, 0.0, 0.0], [-130.0, 0.0, 0.0]], "metrics.kind": "kidger",
            "metrics.r_coll": 1.0,
        },
        "formation",  # the law of the preset knows no goals
    ),
    "City": ("vasarhelyi_2018/city", {"agents": 10, "duration": 120.0}, None),
}  # fmt: skip
LARGEST = {  # numbers of the laws, else of the body, that bound a command: the largest of them
    "velocity": ("v_max", "v_flock", "speed", "speed_max"),
    "acceleration": ("a_max",),
}
# Rounding: a law that cuts a vector to its largest length may exceed that by a bit.
MARGIN = 1.0 + 1e-5


def largest_command(scenario: Scenario) -> float:
    """Return how large a component of a command can be, in its unit.

    Raises FlightError where no number says so.
    """
    kind = scenario.model.command
    if kind == "heading":
        return 1.0
    laws = [law.parameters for law in scenario.laws] + [scenario.resolved_steer()] * scenario.steers
    for records in (laws, [scenario.body.numbers]):
        found = [float(value) for name in LARGEST[kind] for each in records if (value := getattr(each, name, None))]
        if found:
            return max(found)
    raise FlightError(
        f"{scenario.name}: no number of the law or the body says how large a command can be; give largest, in "
        f"{COMMANDS[kind]}"
    )


class Episodes:
    """Flights of one scenario as episodes: spaces, checked actions, rewards, and which have ended.

    largest : bound of a component of an action, in the unit of the law's command; by default
              `largest_command`
    """

    def __init__(
        self, scenario: Any, count: int, settings: Mapping[str, Any] | None = None, *, law: Any = None,
        neighbours: int | None = None, rays: int | None = None, largest: float | None = None,
        threads: int | None = None, device: str = "cpu",
    ):  # fmt: skip
        self.scenario = scenario_variant(scenario, settings, law)
        if not self.scenario.metrics.rule.best:
            kind = self.scenario.metrics.kind
            raise FlightError(f"{self.scenario.name}: metrics.kind = {kind!r} has no fitness; it rewards nothing")
        most = min(7, self.scenario.agents - 1) if neighbours is None else neighbours
        self.flights = open_many(self.scenario, count, neighbours=most, rays=rays, threads=threads, device=device)
        bound = float(np.float32(largest_command(self.scenario) if largest is None else largest))
        if not 0.0 < bound < np.inf:
            raise FlightError(f"largest = {largest!r}: give a positive number, the bound of a component of an action")
        agents, dims = self.scenario.agents, self.scenario.dimensions
        self.action_space = Box(-bound, bound, (dims,), np.float32)
        self.observation_space = Box(-np.inf, np.inf, self.flights.percepts.table.shape[2:], np.float32)
        self.worth, self.fitness, self.waiting = np.zeros(count), np.full(count, np.nan), True
        self.joint_action = Box(-bound, bound, (agents, dims), np.float32)
        self.joint_observation = batch_space(self.observation_space, agents)

    @property
    def observations(self) -> NDArray[np.float32]:
        """Observations of all agents, (flight, agent, column); a copy."""
        return self.flights.percepts.table.astype(np.float32)

    @property
    def info(self) -> dict[str, Any]:
        """What all laws command now, (flight, agent, axis), and the fitness of each flight so far."""
        return {"law": self.flights.commands.astype(np.float32), "fitness": self.fitness.copy()}

    def reset(self, seeds: Mapping[int, int]) -> None:
        """Begin these flights anew: seed by number."""
        for number, seed in seeds.items():
            self.flights.reset(number, seed)
        self.worth[[*seeds]], self.fitness[[*seeds]], self.waiting = 0.0, np.nan, False

    def step(self, actions: Any) -> tuple[NDArray[Any], NDArray[np.bool_], NDArray[np.bool_]]:
        """Fly to the next decision by actions, (flight, agent, axis); return rewards, and which ended or were cut off.

        Raises FlightError for an action that does not fit its space, and for an episode that is
        over.
        """
        flights = self.flights
        if self.waiting:
            raise FlightError("step: the episode is over, or has not begun; reset() begins one")
        self.check(actions)
        flights.commands[:] = actions
        flights.advance()
        parts = np.array([course.step / course.steps for course in flights.courses])
        self.fitness = flights.fitness
        worth = np.nan_to_num(self.fitness) * np.where(flights.over, 1.0, parts)
        rewards, self.worth = worth - self.worth, worth
        ended = np.array([course.state.has_ended for course in flights.courses])
        self.waiting = bool(flights.over.all())
        return rewards, ended, flights.over & ~ended

    def check(self, actions: Any) -> None:
        """Raise FlightError, one line, for actions of another shape, and for one outside of its space."""
        shape = self.flights.commands.shape
        try:
            numbers = np.asarray(actions, float)
        except (TypeError, ValueError):
            numbers = np.zeros(0)
        if numbers.shape != shape:
            due, has = (each[shape[0] == 1 :] for each in (shape, numbers.shape))
            raise FlightError(f"action: its shape is {has}; give {due}, of each agent one in {self.action_space}")
        bad = np.argwhere(~(np.abs(numbers) <= MARGIN * self.action_space.high))
        if len(bad):
            flight, agent, _ = bad[0]
            raise FlightError(
                f"agent_{agent}{f' of flight {flight}' * (len(numbers) > 1)}: action {numbers[flight, agent].tolist()} "
                f"is not in {self.action_space}"
            )


class FlockEnv(gymnasium.Env[Any, Any]):
    """One flight, all agents at once: observations (agent, column), actions (agent, axis), one reward.

    scenario, settings : a Scenario, a preset or a file, and what is changed in it
    options            : law, neighbours, rays, largest: as of `parallel_env`

    `reset(seed=s)` begins the flight that `airflock.open(scenario, seed=s)` opens. Raises
    ScenarioError and FlightError.
    """

    metadata = {"render_modes": []}

    def __init__(self, scenario: Any, settings: Mapping[str, Any] | None = None, **options: Any):
        self.episodes = Episodes(scenario, 1, settings, threads=1, **options)
        self.action_space, self.observation_space = self.episodes.joint_action, self.episodes.joint_observation

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a flight; without a seed the next one that the last seed leads to."""
        super().reset(seed=seed)
        self.episodes.reset({0: int(self.np_random.integers(2**63)) if seed is None else seed})
        return self.episodes.observations[0], self._info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Fly to the next decision."""
        rewards, ended, cut = self.episodes.step(np.asarray(action)[None])
        return self.episodes.observations[0], float(rewards[0]), bool(ended[0]), bool(cut[0]), self._info()

    def _info(self) -> dict[str, Any]:
        return {name: value[0] for name, value in self.episodes.info.items()}


class VectorFlock(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Many flights side by side, in threads: observations (flight, agent, column), actions (flight, agent, axis).

    Options as of `parallel_env`, and threads (all cores). A flight that is over begins anew at the
    next step, whose action it ignores and whose reward is 0 (`AutoresetMode.NEXT_STEP`).
    """

    metadata = {"render_modes": [], "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(self, scenario: Any, num_envs: int = 1, settings: Mapping[str, Any] | None = None, **options: Any):
        self.episodes, self.num_envs = Episodes(scenario, num_envs, settings, **options), num_envs
        self.single_action_space = self.episodes.joint_action
        self.single_observation_space = self.episodes.joint_observation
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin all flights: with one seed s those of the seeds s, s + 1, ...; or with one for each."""
        given: Any = seed
        each = given if np.ndim(given) else (check_seed(given) + number for number in range(self.num_envs))
        seeds = None if seed is None else [check_seed(one) for one in each]
        super().reset(seed=seeds[0] if seeds else None)
        seeds = self._drawn(self.num_envs) if seeds is None else seeds
        if len(seeds) != self.num_envs:
            raise FlightError(f"reset: {len(seeds)} seeds for {self.num_envs} flights; give one, or one each")
        self.episodes.reset(dict(zip(range(self.num_envs), seeds, strict=True)))
        return self.episodes.observations, self.episodes.info

    def _drawn(self, count: int) -> list[int]:
        """Seeds of flights that begin without one."""
        return [int(seed) for seed in self.np_random.integers(2**63, size=count)]

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Fly all to their next decisions."""
        # They stay where they are, and earn nothing.
        over = np.flatnonzero(self.episodes.flights.over)
        rewards, ended, cut = self.episodes.step(actions)
        self.episodes.reset(dict(zip(over.tolist(), self._drawn(len(over)), strict=True)))
        ended[over] = cut[over] = False
        return self.episodes.observations, rewards, ended, cut, self.episodes.info


class ParallelFlock(pettingzoo.ParallelEnv[str, Any, Any]):  # type: ignore[misc]
    """One flight for PettingZoo: dictionaries by agent. An agent that drops out is terminated and leaves `agents`."""

    metadata = {"name": "airflock_v0", "render_modes": []}

    def __init__(
        self, scenario: Any, settings: Mapping[str, Any] | None = None, seed: int | None = None, **options: Any
    ):
        self.episodes, self.seed, self.render_mode = Episodes(scenario, 1, settings, threads=1, **options), seed, None
        self.possible_agents = [f"agent_{i}" for i in range(self.episodes.scenario.agents)]
        self.agents: list[str] = []
        self.observation_spaces = {agent: deepcopy(self.episodes.observation_space) for agent in self.possible_agents}
        self.action_spaces = {agent: deepcopy(self.episodes.action_space) for agent in self.possible_agents}

    def observation_space(self, agent: str) -> Box:
        """Return the space of what an agent observes."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Return the space of what an agent commands."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Begin a flight: of this seed, else of the one behind that of the last."""
        self.seed = check_seed((0 if self.seed is None else self.seed) if seed is None else seed)
        self.episodes.reset({0: self.seed})
        self.agents = self._present()
        answer = self._by_agent(self.agents)
        self.seed = (self.seed + 1) % 2**64
        return answer

    def _present(self) -> list[str]:
        present = self.episodes.flights.courses[0].state.present
        return [agent for agent, there in zip(self.possible_agents, present, strict=True) if there]

    def _by_agent(self, agents: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Observations and infos of some agents."""
        seen, law = self.episodes.observations[0], self.episodes.info["law"][0]
        numbers = {agent: int(agent.rpartition("_")[2]) for agent in agents}
        return {a: seen[i] for a, i in numbers.items()}, {a: {"law": law[i]} for a, i in numbers.items()}

    def step(self, actions: Mapping[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
        """Fly to the next decision. Raises FlightError where an action is missing, or does not fit its space."""
        wanted = self.episodes.flights.commands[0].copy()  # whoever is absent commands nothing
        for agent in {**dict.fromkeys(self.agents), **actions}:
            action = np.asarray(actions.get(agent))
            if agent not in self.agents or action.shape != wanted.shape[1:] or action.dtype.kind not in "fiu":
                raise FlightError(f"{agent}: {action}; each of env.agents acts, in {self.episodes.action_space}")
            wanted[int(agent.rpartition("_")[2])] = action
        rewards, ended, cut = self.episodes.step(wanted[None])
        acted, there = self.agents, set(self._present())
        observations, infos = self._by_agent(acted)
        terminated = {agent: bool(ended[0]) or agent not in there for agent in acted}
        self.agents = [] if ended[0] or cut[0] else [agent for agent in acted if agent in there]
        reward, truncated = float(rewards[0]), bool(cut[0])
        return observations, dict.fromkeys(acted, reward), terminated, dict.fromkeys(acted, truncated), infos


def parallel_env(scenario: Any, *, agents: int | None = None, seed: int | None = None, **options: Any) -> ParallelFlock:
    """Open a flight as a `ParallelEnv` of PettingZoo.

    scenario : a Scenario, a preset or a file; agents: how many, instead of what it says
    seed     : of the first episode; each one without a seed of its own takes the next
    options  : settings and law, as in `load`; neighbours, of how many of the nearest that it hears
               each agent observes offset, relative velocity, age and 1 (7); rays, ways around it (8
               where anything stands); largest, bound of a component of an action (what law and body
               say)

    Raises ScenarioError and FlightError.
    """
    settings = {**(options.pop("settings", None) or {}), **({} if agents is None else {"agents": agents})}
    return ParallelFlock(scenario, settings, seed, **options)


make_vec = VectorFlock

for _name, (_preset, _settings, _law) in SCENARIOS.items():
    gymnasium.register(
        f"airflock/{_name}-v0", entry_point="airflock.learn:FlockEnv", vector_entry_point="airflock.learn:VectorFlock",
        kwargs={"scenario": _preset, "settings": _settings, "law": _law},
    )  # fmt: skip
