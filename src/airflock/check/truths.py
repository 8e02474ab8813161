"""The truths that checks test: the runner with its report, and the scenes, units and precision that checks need."""

import copy
import math
import re
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from airflock.core import (
    HeardNeighbour,
    Model,
    Percept,
    Points,
    Quantity,
    State,
    call_rule,
    choices,
    component_names,
    decide,
    declarations,
    number_names,
)
from airflock.engine import DriverSource, scratch_shapes
from airflock.scenarios import CallerParts, Scenario, build_scenario, schema, settings_dict
from airflock.support import AirflockError, RuleError, ScenarioError

# name → what it says, and a check that returns what is wrong, empty if nothing is
TruthTable = dict[str, tuple[str, Callable[[], str]]]
Part = TypeVar("Part")


class CheckError(AirflockError, AssertionError):
    """A law, an order parameter, a body, a sensor or a radio breaks a truth that it does not declare (VIOLATES)."""


@dataclass(frozen=True)
class Truth:
    """One truth: its name, what it says, what was found against it (empty: it holds), and the declared reason why."""

    name: str
    statement: str
    mismatch: str = ""
    reason: str = ""

    @property
    def is_broken(self) -> bool:
        """Return True if the truth is broken without being declared in VIOLATES."""
        return bool(self.mismatch) and not self.reason

    def __str__(self) -> str:
        """One line for a person."""
        if not self.mismatch:
            return f"holds   {self.name}: {self.statement}"
        if self.reason:
            return f"breaks  {self.name}, as declared: {self.reason}"
        return f"BREAKS  {self.name}: {self.statement}; {self.mismatch}"


@dataclass(frozen=True)
class Report:
    """Report of the checks of one law, order parameter, body, sensor or radio."""

    name: str
    truths: tuple[Truth, ...]

    def __str__(self) -> str:
        """One line a truth."""
        return "\n".join([f"{self.name}:", *(f"  {truth}" for truth in self.truths)])

    @property
    def broken(self) -> tuple[str, ...]:
        """Names of the truths that do not hold, declared or not."""
        return tuple(truth.name for truth in self.truths if truth.mismatch)


def require_part(part_and_errors: tuple[Part | None, list[str]]) -> Part:
    """Return the part that was read; raise a ScenarioError that lists the errors if there are any."""
    part, errors = part_and_errors
    if errors or part is None:
        raise ScenarioError(errors)
    return part


def run_truths(name: str, truths: TruthTable, violates: Mapping[str, str]) -> Report:
    """Run all truths and report them; raises CheckError where one breaks that is not declared.

    violates : name → why a truth does not hold here. One that no list knows is an error, so that none is misspelled.
    """
    unknown = sorted(set(violates) - set(truths))
    if unknown:
        raise RuleError(f"{name}: VIOLATES names {', '.join(unknown)}; known: {', '.join(truths)}")
    made = []
    for key, (says, check) in truths.items():
        try:
            mismatch = check()
        except RuleError as error:
            mismatch = str(error).splitlines()[0]
        except (ArithmeticError, ValueError) as error:  # of the rule itself: a division by zero, a root of -1
            mismatch = f"{type(error).__name__}: {error}"
        made.append(Truth(key, says, mismatch, violates.get(key, "")))
    report = Report(name, tuple(made))
    if any(truth.is_broken for truth in made):
        raise CheckError("\n".join(f"{name}: {truth}" for truth in made if truth.is_broken))
    return report


def parameters_with_values(record: type, values: Any, section: str) -> Any:
    """A record of parameters with the values that a caller gives by name; the others keep their defaults."""
    made, errors = schema.read_section(section, settings_dict(values, f"check of {section}"), record)
    if errors:
        raise ScenarioError(errors)
    return made


class UnitScale(NamedTuple):
    """Factors by which numbers of metres and of seconds grow."""

    metre: float
    second: float


# Powers of two round nothing, so only guards such as TINY and numbers with hidden units can tell
# the flights apart.
UNIT_SCALES = (UnitScale(2.0, 4.0), UnitScale(0.5, 0.25))
DIMENSIONS = {
    "": (0, 0), "1": (0, 0), "dB": (0, 0), "rad": (0, 0), "deg": (0, 0), "kg": (0, 0), "m": (1, 0), "cm": (1, 0),
    "km": (1, 0), "s": (0, 1), "Hz": (0, -1), "N": (1, -2), "Pa": (-1, -2), "J": (2, -2), "W": (2, -3),
}  # fmt: skip


def unit_factor(unit: str, units: UnitScale) -> float:
    """By how much a number in this unit grows: "m/s^2" → metre / second². Raises RuleError for an unknown unit."""
    text = unit.replace("²", "^2").replace("³", "^3").replace("·", " ").strip()
    over, _, under = re.sub(r"\((\d+)/(\d+)\)", r"\1:\2", text).partition("/")
    return _product(over, unit, units) / _product(under, unit, units)


def _product(text: str, unit: str, units: UnitScale) -> float:
    result = 1.0
    for name, power, over in re.findall(r"([A-Za-z]+|\b1\b)(?:\^(\d+)(?::(\d+))?)?", text):
        if name not in DIMENSIONS:
            raise RuleError(f"the unit {unit!r} has a part {name!r} that is none of {', '.join(DIMENSIONS)}")
        metres, seconds = DIMENSIONS[name]
        result *= (units.metre**metres * units.second**seconds) ** (int(power or 1) / int(over or 1))
    return result


def rescaled(record: Any, units: UnitScale) -> Any:
    """A record of parameters in the other units; ranges, which are about sense and not about units, are left out."""
    made = copy.copy(record)
    for name, declared, _ in declarations(record):
        value = getattr(record, name)
        if isinstance(declared, Quantity) and value is not None:
            object.__setattr__(made, name, value * unit_factor(declared.unit, units))
        elif isinstance(declared, Points):
            object.__setattr__(made, name, _points(value, declared.unit, units))
    return made


def _points(value: Any, unit: str, units: UnitScale) -> Any:
    """Points, or rows whose last number has another unit ("m and s")."""
    if value and not isinstance(value[0], tuple):
        first, _, last = unit.partition(" and ")
        return tuple(x * unit_factor(first, units) for x in value[:-1]) + (
            value[-1] * unit_factor(last or first, units),
        )
    return tuple(_points(each, unit, units) for each in value)


def rescaled_scenario(scenario: Scenario, units: UnitScale) -> Scenario:
    """A scenario in the other units."""
    return scenario.with_records({key: rescaled(record, units) for key, record in scenario.records.items()})


# The generated text runs on numbers that refuse integers and uncast literals: `2 * k` is detected
# by running, not guessed from the text.
class SinglePrecision(float):
    """A number that only meets its like."""


def _refusing(name: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def operator(self: SinglePrecision, *other: Any) -> Any:
        for each in other:
            if type(each) is not SinglePrecision and not (name.endswith("pow__") and type(each) is int):
                raise RuleError(f"float32 meets {each!r} of type {type(each).__name__}: a kernel would turn to doubles")
        result = plain(self, *other)
        return SinglePrecision(result) if type(result) is float else result

    return operator


for _name in ("add", "sub", "mul", "truediv", "mod", "pow", "floordiv"):
    setattr(SinglePrecision, f"__{_name}__", _refusing(f"__{_name}__"))
    setattr(SinglePrecision, f"__r{_name}__", _refusing(f"__r{_name}__"))
for _name in ("neg", "abs", "pos"):
    setattr(SinglePrecision, f"__{_name}__", _refusing(f"__{_name}__"))

MATHS = SimpleNamespace(
    **{
        name: (lambda function: lambda *numbers: SinglePrecision(function(*numbers)))(getattr(math, name))
        for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "fabs", "fmod")
    },
    floor=math.floor,
    ceil=math.ceil,
)


def run_in_single_precision(
    rule: Callable[..., Any], constants: Mapping[str, Any], arguments: Mapping[str, Any], names: Any
) -> Any:
    """Run the generated text of a rule, arguments by name; raise RuleError where it would leave single precision.

    constants : choices by record name, as a plan has them
    """
    source = DriverSource("", constants)
    name = source.name(rule)
    space: dict[str, Any] = {
        "real": SinglePrecision, "math": MATHS, "namedtuple": namedtuple, "least": min, "most": max,
        "percept_cast": lambda percept, ux, uy, uz, length, radius: to_single_precision(length),
        "percept_ray": lambda percept, ux, uy, uz, length: to_single_precision(length),
        "percept_normal": lambda percept, draw: SinglePrecision(0.3),
        "percept_uniform": lambda percept, draw: SinglePrecision(0.4),
    }  # fmt: skip
    exec(compile("\n".join(source.blocks), f"<single precision: {name}>", "exec"), space)
    answer = space[name](*(to_single_precision(arguments[each]) for each in names))
    for value in answer if isinstance(answer, tuple) else (answer,):
        if isinstance(value, float) and type(value) is not SinglePrecision:
            raise RuleError(f"rule {rule.__name__} answers {value!r}, which a kernel would hold as a double")
    return answer


def to_single_precision(value: Any) -> Any:
    """A float, a record of parameters or a NamedTuple of floats as `SinglePrecision`s."""
    if type(value) is float:
        return SinglePrecision(value)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return value._replace(**{name: to_single_precision(getattr(value, name)) for name in value._fields})  # type: ignore[attr-defined]
    if hasattr(value, "__dataclass_fields__"):
        numbers = {name: SinglePrecision(getattr(value, name) or 0.0) for name in number_names(value)}
        whole = {
            key: tuple(numbers[part] for part in component_names(key, n)) for key, n in type(value).VECTORS.items()
        }
        return SimpleNamespace(**choices(value), **numbers, **whole)
    return value


FlockSolver = Callable[[Sequence[State]], list[Any]]  # states of all agents → what the rule found for each


def flock_solver(scenario: Scenario) -> FlockSolver | None:
    """The flock rule of a scenario's model, with scratch that lasts for one flight; None if it has none."""
    model = scenario.model
    if model.flock is None or model.workspace is None:
        return None
    given = {"p": scenario.parameters, "wing": scenario.wing, "aero": scenario.aero}
    shapes = scratch_shapes(model.workspace, scenario.agents, given)
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
Rotation = NDArray[np.float64]
MIRROR: Rotation = np.diag([1.0, -1.0, 1.0])


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

    states: NDArray[np.float64]
    walls: NDArray[np.float64]
    goal: NDArray[np.float64]
    centre: NDArray[np.float64]


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

    def command(self, scene: Scene, order: Sequence[int] | None = None) -> NDArray[np.float64]:
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


def random_directions(rng: np.random.Generator, count: int, dims: int) -> NDArray[np.float64]:
    """Random unit vectors (vector, axis)."""
    found = rng.normal(size=(count, 3)) * (1.0, 1.0, float(dims == 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def rotation_about_vertical(angle: float) -> Rotation:
    """A turn about the vertical by an angle, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotated(scene: Scene, rotation: Rotation) -> Scene:
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
