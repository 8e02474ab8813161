"""The standing list for a flocking law: symmetries, a lone agent, two agents, time step, units, single precision."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, NoReturn

import numpy as np

from airflock.check.truths import (
    HIDDEN,
    MIRROR,
    UNIT_SCALES,
    Array,
    Report,
    Trials,
    TruthTable,
    UnitScale,
    numbers_text,
    parameters_with_values,
    rescaled_scenario,
    rotation_about_vertical,
    unit_factor,
)
from airflock.core import (
    COMMANDS,
    HeardNeighbour,
    Model,
    Own,
    Percept,
    State,
    call_rule,
    choices,
    decide,
    initial_memory,
    model,
    pair_arguments,
    sum_neighbours,
    sum_surfaces,
)
from airflock.engine import fly_world, plan_of
from airflock.scenarios import CallerParts, Scenario, build_scenario, check_seed, find_law, settings_dict
from airflock.support import AirflockError

SCENES = 12  # random scenes that each symmetry is tried on
CLOSE_IN_FLIGHT = 1e-6  # of the flock's extent and speed: guards such as TINY, and what rounding grows to


RULES = ("neighbour", "boundary", "decide")


FlockSolver = Callable[[Sequence[State]], list[Any]]  # states of all agents → what the rule found for each


def flock_solver(scenario: Scenario) -> FlockSolver | None:
    """The flock rule of a scenario's model, with scratch that lasts for one flight; None if it has none."""
    model = scenario.model
    if model.flock is None or model.workspace is None:
        return None
    given = {"p": scenario.parameters, "wing": scenario.wing, "aero": scenario.aero}
    shapes = call_rule(model.workspace, "flock", given | {"n": scenario.agents}, model.name)
    return rule_solver(model.flock, "flock", model.Shared, shapes, given, model.name)


def rule_solver(
    rule: Callable[..., None], kind: str, record: Any, shapes: Any, arguments: dict[str, Any], owner: str
) -> FlockSolver:
    """A rule of the whole flock with scratch of these shapes; record : the columns that it fills."""
    work = type(shapes)(*[[[0.0] * columns for _ in range(rows)] for rows, columns in shapes])

    def solve(flock: Sequence[State]) -> list[Any]:
        shared = record(*[[0.0] * len(flock) for _ in record._fields])
        columns = dict(zip(State._fields, (list(column) for column in zip(*flock, strict=True)), strict=True))
        call_rule(rule, kind, {**arguments, **columns, "n": len(flock), "work": work, "shared": shared}, owner)
        return [record(*values) for values in zip(*shared, strict=True)]

    return solve


# Four agents: the fewest with pairs that do not share an agent.
AGENT_COUNT = 4  # in a flight


class WallPercept(Percept):
    """A percept that sees flat walls, as (distance, normal x y z)."""

    surfaces: Sequence[tuple[float, float, float, float]] = ()

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance along a unit vector, m."""
        return self.cast(ux, uy, uz, length, 0.0)

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance of a sphere along a unit vector, m."""
        free = length
        for distance, nx, ny, nz in self.surfaces:
            towards = -(ux * nx + uy * ny + uz * nz)
            if towards > 0.0:
                free = min(free, max(distance - radius, 0.0) / towards)
        return free


class Scene(NamedTuple):
    """Scene of one agent: positions and velocities (row 0 is its own), walls, its goal and the arena's centre."""

    states: Array
    walls: Array
    goal: Array
    centre: Array


@dataclass(frozen=True)
class TestedLaw:
    """A law with what its scenes are made of: lengths (m) and speeds (m/s) at which it does something."""

    model: Model
    scenario: Scenario
    length: float
    speed: float

    @property
    def p(self) -> Any:
        """Parameters."""
        return self.scenario.parameters

    def scene(self, rng: np.random.Generator, neighbours: int = 4) -> Scene:
        """A random scene: neighbours from a hundredth to one and a half of its range, two walls, a goal."""
        dims = self.scenario.dimensions
        away = self.length * rng.uniform(0.01, 1.5, (neighbours, 1)) * random_directions(rng, neighbours, dims)
        speeds = self.speed * rng.uniform(0.2, 1.5, (neighbours + 1, 1)) * random_directions(rng, neighbours + 1, dims)
        own = self.length * rng.normal(0.0, 1.0, 3) * (1.0, 1.0, float(dims == 3))
        states = np.hstack([np.vstack([own, own + away]), speeds])
        walls = np.hstack([self.length * rng.uniform(0.05, 1.0, (2, 1)), random_directions(rng, 2, dims)])
        return Scene(states, walls, self.length * random_directions(rng, 1, dims)[0], np.zeros(3))

    def command(self, scene: Scene, order: Sequence[int] | None = None) -> Array:
        """Command of agent 0; order: numbers that the agents go by, and the order in which it meets the others."""
        numbers = list(order) if order is not None else list(range(len(scene.states)))
        own = State(*scene.states[0].tolist())
        heard = [HeardNeighbour(numbers[j], State(*scene.states[j].tolist()), 0.0) for j in range(1, len(scene.states))]
        heard.sort(key=lambda each: each.who)
        walls = [(d, nx, ny, nz) for d, nx, ny, nz in scene.walls.tolist()]
        period = self.scenario.sensors.period
        percept = WallPercept(5.0 * period, *(scene.centre - scene.states[0, :3]).tolist(), *scene.goal.tolist())
        percept.surfaces = walls
        made = decide(
            self.model, self.p, own, heard, walls, time=5.0 * period, period=period, index=numbers[0], percept=percept,
            shared=self.flock_solution(scene), wing=self.scenario.wing, aero=self.scenario.aero,
        )  # fmt: skip
        return np.array(made.command) * (1.0, 1.0, float(self.scenario.dimensions == 3))

    def arguments(self, scene: Scene) -> dict[str, Any]:
        """Return everything that a scalar rule may ask for, by name: agent 0 with one neighbour and one wall."""
        p, own, other = self.p, State(*scene.states[0].tolist()), State(*scene.states[1].tolist())
        heard, wall = [HeardNeighbour(1, other, 0.0)], tuple(scene.walls[0].tolist())
        f = 1.0 / float(np.linalg.norm(scene.states[0, 3:]))
        given: dict[str, Any] = pair_arguments(own, heard[0], 0) | {"period": 0.2}
        given |= dict(zip(("distance", "nx", "ny", "nz"), wall, strict=True))
        given |= {"own": Own(*own[3:], *(f * v for v in own[3:])), "memory": initial_memory(self.model)}
        given |= {"sums": sum_neighbours(self.model, p, own, heard, 0), "shared": self.flock_solution(scene)}
        given |= {"walls": sum_surfaces(self.model, p, own, [wall]), "wing": self.scenario.wing}
        return given | {"aero": self.scenario.aero, "percept": Percept(1.0, *(-scene.states[0, :3]).tolist())}

    def flock_solution(self, scene: Scene) -> Any:
        """Return the result of the rule of the whole flock for agent 0."""
        count = replace(self.scenario.flight, agents=float(len(scene.states)))
        solve = flock_solver(replace(self.scenario, flight=count))
        return solve([State(*row) for row in scene.states.tolist()])[0] if solve else None


def tested_law(model: Model, parameters: Mapping[str, Any], dimensions: int) -> TestedLaw:
    """A law in a scene of its own size: a square arena of a few ranges, decisions every fifth step."""
    p = parameters_with_values(model.Parameters, parameters, "model")
    known = model.interaction_range or model.reach
    length = min(float(known(p)), 1e3) if known else 20.0
    keys = {f"model.{name}": value for name, value in parameters.items()}
    keys |= {"agents": AGENT_COUNT, "world.dimensions": str(dimensions), "wing.segments": "5", "start.separation": 0.0}
    keys |= {"world.arena": "none", "start.kind": "ball", "start.radius": length, "radio.range": 10.0 * length}
    scenario = build_scenario({"model": {}}, f"check of {model.name}", keys, caller_parts=CallerParts(law=model))
    speed = model.speed(p)
    speed = speed or min(float(getattr(scenario.body, "speed", getattr(scenario.body, "speed_max", 1.0))), 10.0)
    period = min(0.2, 0.05 * length / speed)
    dt = 0.2 * period
    times = {"dt": dt, "duration": 8.0 * period, "sensors.period": period, "metrics.period": period}
    side = {"world.arena": "square", "world.side": 4.0 * length, "world.height": 4.0 * length}
    keys |= times | side | {"radio.delay": period, "metrics.collision_period": dt}
    return TestedLaw(
        model,
        build_scenario({"model": {}}, f"check of {model.name}", keys, caller_parts=CallerParts(law=model)),
        length,
        speed,
    )


def random_directions(rng: np.random.Generator, count: int, dims: int) -> Array:
    """Random unit vectors (vector, axis)."""
    found = rng.normal(size=(count, 3)) * (1.0, 1.0, float(dims == 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def rotated(scene: Scene, rotation: Array) -> Scene:
    """A scene turned, or seen in a mirror."""
    states = np.hstack([scene.states[:, :3] @ rotation.T, scene.states[:, 3:] @ rotation.T])
    walls = np.hstack([scene.walls[:, :1], scene.walls[:, 1:] @ rotation.T])
    return Scene(states, walls, rotation @ scene.goal, rotation @ scene.centre)


def translated(scene: Scene, length: float) -> Scene:
    """A scene elsewhere, some lengths (m) away."""
    by = length * np.array([3.7, -1.9, 0.8])
    states = scene.states + np.hstack([by, np.zeros(3)])
    return scene._replace(states=states, centre=scene.centre + by)


def in_units(scene: Scene, units: UnitScale) -> Scene:
    """A scene in other units."""
    states = scene.states * np.repeat([units.metre, units.metre / units.second], 3)
    walls = scene.walls * (units.metre, 1.0, 1.0, 1.0)
    return Scene(states, walls, units.metre * scene.goal, units.metre * scene.centre)


def check_model(
    law: Any,
    parameters: Mapping[str, Any] | None = None,
    *,
    dimensions: int = 3,
    seed: int = 0,
    compiled: bool = False,
) -> Report:
    """Run the standing list of truths on a flocking law and return a report with one line a truth.

    Turned, shifted, renumbered and mirrored scenes must turn, shift, renumber and mirror the
    command; a lone agent flies straight on; two agents at any distance get finite commands; a
    halved time step halves the error; a flight in other units is the same flight; no rule leaves
    single precision. A law that rightly breaks one of them says which and why: VIOLATES =
    {"mirror": "neighbours are passed on the right"}.

    Parameters
    ----------
    law : Model, module, class, mapping, str or path
        A flocking law: a Model, a namespace such as globals(), a name of ours, or a file that ends in .py.
    parameters : mapping, optional
        Values that differ from the defaults, by name.
    dimensions : int
        2 or 3.
    seed : int
        Of the random scenes; it stands in every mismatch.
    compiled : bool
        Also fly the law compiled, which takes some seconds, and compare.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the law does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a value is none of its numbers.

    Examples
    --------
    >>> import airflock
    >>> report = airflock.check_model("vicsek_1995", dimensions=2)
    >>> report.broken
    ()
    """
    if isinstance(law, (str, os.PathLike)):
        law = find_law(str(law), trust=True)
    found = law if isinstance(law, Model) else model(law)
    made = tested_law(found, settings_dict(parameters, f"check of {found.name}"), dimensions)
    rng = np.random.default_rng(check_seed(seed))
    scenes = [made.scene(rng) for _ in range(SCENES)]
    orders = [rng.permutation(len(scene.states)).tolist() for scene in scenes]
    turn = rotation_about_vertical(rng.uniform(0.1, 6.2))

    def command(p: Any, case: tuple[Scene, TestedLaw, Sequence[int] | None]) -> Array:
        return case[1].command(case[0], case[2])

    def scale(units: UnitScale, case: Any) -> tuple[Any, Array]:
        other = replace(made, scenario=rescaled_scenario(made.scenario, units))
        return (in_units(case[0], units), other, None), np.array(unit_factor(COMMANDS[found.command], units))

    rules = {kind: rule for kind in RULES if (rule := getattr(found, kind)) is not None}
    size = max(1e-12, *(float(np.abs(made.command(scene)).max()) for scene in scenes))  # of the largest command
    plan = plan_of(made.scenario, precision=32)
    constants = plan.constants | {"p": dict(plan.model_choices) or choices(made.p)}
    givens = (made.arguments(scene) for scene in scenes[:5])  # by a rule that may fail
    trials = Trials(
        found, rules, "p", made.p, command, [(scene, made, None) for scene in scenes], seed, scale, givens, constants,
        floor=size, close=CLOSE_IN_FLIGHT,
    )  # fmt: skip

    def same(change: Callable[[Scene], Scene], back: Array) -> str:
        return trials.same(lambda case: (change(case[0]), *case[1:]), lambda answer: back @ answer)

    truths: TruthTable = {
        "rotation": (
            "a scene turned about the vertical turns the command",
            lambda: same(lambda scene: rotated(scene, turn), turn),
        ),
        "translation": (
            "shifting the scene does not change the command",
            lambda: same(lambda scene: translated(scene, made.length), np.eye(3)),
        ),
        "mirror": (
            "a scene seen in a mirror mirrors the command",
            lambda: same(lambda scene: rotated(scene, MIRROR), MIRROR),
        ),
        "renumbering": (
            "renumbering the agents does not change the command",
            lambda: trials.first_mismatch(
                (made.command(scene, order), made.command(scene)) for scene, order in zip(scenes, orders, strict=True)
            ),
        ),
        "lone agent": ("alone, an agent flies straight on at its preferred speed", lambda: _alone(made, rng)),
        "two agents": ("at any distance the command is finite", lambda: _pairs(made, rng)),
        "time step": ("halving dt shrinks the error", lambda: _time_step(made, seed)),
        "units": (
            "in other units of length and time it is the same flight",
            lambda: trials.units() or _units_in_flight(made, seed),
        ),
    }
    if compiled:
        truths["compiled"] = ("compiled, it flies as in plain Python", lambda: _compiled(made, seed))
    return trials.report("model", truths)


def _alone(law: TestedLaw, rng: np.random.Generator) -> str:
    """No neighbours, no walls, no goal: the command has no part across the heading."""
    for _ in range(10):
        scene = law.scene(rng, 0)
        scene = scene._replace(walls=np.zeros((0, 4)), goal=np.zeros(3), centre=scene.states[0, :3])
        heading = scene.states[0, 3:] / np.linalg.norm(scene.states[0, 3:])
        scene = scene._replace(states=np.hstack([scene.states[:, :3], law.speed * heading[None]]))
        command = law.command(scene)
        along = float(command @ heading)
        across = float(np.linalg.norm(command - along * heading))
        if across > 1e-6 * max(abs(along), 1.0):
            return f"flying along ({numbers_text(heading)}) it commands ({numbers_text(command)})"
        if law.model.command == "velocity" and law.model.preferred_speed is not None:
            speed = float(law.model.preferred_speed(law.p))
            if abs(along - speed) > 1e-6 * speed:
                return f"it commands {along:.4g} m/s; preferred_speed is {speed:.4g} m/s"
    return ""


def _pairs(law: TestedLaw, rng: np.random.Generator) -> str:
    """One neighbour from the same place to far away, and both at rest."""
    for distance in (0.0, 1e-9, 1e-3, 1.0, 1e3, 1e6):
        for still in (False, True):
            scene = law.scene(rng, 1)
            states = scene.states.copy()
            states[1, :3] = states[0, :3] + distance * np.array([0.6, 0.8, 0.0])
            states[:, 3:] *= 0.0 if still else 1.0
            command = law.command(scene._replace(states=states))
            if not (np.isfinite(command).all() and np.abs(command).max() < 1e20):
                return f"{distance:g} m apart{' at rest' if still else ''} it commands ({numbers_text(command)})"
    return ""


def _flown(scenario: Scenario, start: Array, seed: int) -> Array:
    """Frames (time, component, agent) of a flight without a compiler."""
    flown = fly_world(scenario, seed, precision=64, record=True, start=start, device="python")
    assert flown.frames is not None
    return flown.frames


def _start(law: TestedLaw, seed: int) -> Array:
    rng, dims = np.random.default_rng(seed), law.scenario.dimensions
    places = 0.6 * law.length * rng.uniform(-1.0, 1.0, (dims, AGENT_COUNT))
    return np.vstack([places, law.speed * random_directions(rng, AGENT_COUNT, dims)[:, :dims].T])


def _time_step(law: TestedLaw, seed: int) -> str:
    """Positions at the end, without noise: the difference of two time steps shrinks when both are halved."""
    noise = {"noise": 0.0} if hasattr(law.scenario.body, "noise") else {}
    quiet = replace(law.scenario.without_sensor_errors, body=law.scenario.body.with_numbers(**noise))
    start = _start(law, seed)
    ends = []
    for halvings in range(4):
        flight = replace(quiet.flight, dt=quiet.flight.dt / 2**halvings)
        metrics = quiet.metrics.with_numbers(collision_period=None)
        ends.append(_flown(replace(quiet, flight=flight, metrics=metrics), start, seed)[-1])
    dims = quiet.dimensions
    errors = [float(np.abs(a[:dims] - b[:dims]).max()) for a, b in zip(ends, ends[1:], strict=False)]
    if errors[-1] <= max(0.5 * errors[0], 1e-9 * law.length):
        return ""
    return f"seed {seed}: positions change by {errors[0]:.2g}, then {errors[1]:.2g}, then {errors[2]:.2g} m"


def _units_in_flight(law: TestedLaw, seed: int) -> str:
    dims, start = law.scenario.dimensions, _start(law, seed)
    frames = _flown(law.scenario, start, seed)
    sizes = np.abs(frames).max(axis=(0, 2)) + 1e-9
    for units in UNIT_SCALES:
        known = (unit_factor(unit, units) for unit in ("m", "m/s", COMMANDS[law.model.command]))
        scale = np.repeat(list(known), dims)[:, None]
        other = _flown(rescaled_scenario(law.scenario, units), start * scale[: 2 * dims], seed) / scale
        bad = np.argwhere(np.abs(other - frames) > CLOSE_IN_FLIGHT * sizes[:, None])
        if bad.size:
            time, component, agent = bad[0]
            what = ("position", "velocity", "command")[component // dims]
            was, became = frames[time, component, agent], other[time, component, agent]
            return (
                f"seed {seed}: the {what} of agent {agent} is {became:.6g} instead of {was:.6g} in sample {time}: "
                f"{HIDDEN}"
            )
    return ""


def _compiled(law: TestedLaw, seed: int) -> str:
    """Fly the same flight by a compiled driver, in double precision."""
    start = _start(law, seed)
    plain = _flown(law.scenario, start, seed)
    driver = fly_world(law.scenario, seed, precision=64, record=True, start=start).frames
    assert driver is not None
    apart = np.abs(driver - plain).max(axis=(0, 2)) / (np.abs(plain).max(axis=(0, 2)) + 1e-9)
    return "" if apart.max() <= CLOSE_IN_FLIGHT else f"seed {seed}: frames differ by {apart.max():.2g} of their size"


def check_types(files: Any = (), *, out: Any = None) -> NoReturn:
    """Raise AirflockError: this function was removed; use mypy and `airflock.check_model`.

    Parameters
    ----------
    files : str, Path or sequence of them (FILE.py...)
        Not read.
    out : str or Path (FOLDER), optional
        Not written.

    Returns
    -------
    NoReturn
        Nothing.

    Raises
    ------
    AirflockError
        Always, with what to use.

    Examples
    --------
    >>> import airflock
    >>> try:
    ...     airflock.check_types("mine.py")
    ... except airflock.AirflockError as error:
    ...     print(error)
    airflock types and airflock.check_types were removed; use mypy and airflock.check_model("mine.py")
    """
    raise AirflockError(
        'airflock types and airflock.check_types were removed; use mypy and airflock.check_model("mine.py")'
    )
