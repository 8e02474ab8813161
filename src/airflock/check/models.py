"""The standing list for a flocking law: symmetries, a lone agent, two agents, time step, units, single precision."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.check.truths import (
    AGENT_COUNT,
    MIRROR,
    UNIT_SCALES,
    Report,
    Rotation,
    Scene,
    TestedLaw,
    TruthTable,
    in_units,
    random_directions,
    rescaled_scenario,
    rotated,
    rotation_about_vertical,
    run_in_single_precision,
    run_truths,
    tested_law,
    translated,
    unit_factor,
)
from airflock.core import (
    COMMANDS,
    HeardNeighbour,
    Model,
    Own,
    Percept,
    State,
    argument_names,
    choices,
    initial_memory,
    model,
    pair_arguments,
    sum_neighbours,
    sum_surfaces,
)
from airflock.engine import fly_world, plan_of
from airflock.scenarios import Scenario, check_seed, find_law, settings_dict

SCENES = 12  # random scenes that each symmetry is tried on
CLOSE = 1e-9  # of the largest command: more than rounding
CLOSE_IN_FLIGHT = 1e-6  # of the flock's extent and speed: guards such as TINY, and what rounding grows to
HIDDEN = "a unit is declared wrongly, or a rule contains a number that has a unit"


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
    turns = [rotation_about_vertical(rng.uniform(0.1, 6.2)) for _ in scenes]
    truths: TruthTable = {
        "rotation": (
            "a scene turned about the vertical turns the command",
            lambda: _same(made, scenes, [rotated(s, t) for s, t in zip(scenes, turns, strict=True)], turns, seed),
        ),
        "translation": (
            "shifting the scene does not change the command",
            lambda: _same(made, scenes, [translated(s, made.length) for s in scenes], [np.eye(3)] * SCENES, seed),
        ),
        "mirror": (
            "a scene seen in a mirror mirrors the command",
            lambda: _same(made, scenes, [rotated(s, MIRROR) for s in scenes], [MIRROR] * SCENES, seed),
        ),
        "renumbering": (
            "renumbering the agents does not change the command",
            lambda: _renumbered(made, scenes, rng, seed),
        ),
        "lone agent": ("alone, an agent flies straight on at its preferred speed", lambda: _alone(made, rng)),
        "two agents": ("at any distance the command is finite", lambda: _pairs(made, rng)),
        "time step": ("halving dt shrinks the error", lambda: _time_step(made, seed)),
        "units": ("in other units of length and time it is the same flight", lambda: _units(made, scenes, seed)),
        "single precision": ("no rule turns float32 into doubles", lambda: _single(made, scenes)),
    }
    if compiled:
        truths["compiled"] = ("compiled, it flies as in plain Python", lambda: _compiled(made, seed))
    return run_truths(f"model {found.name}", truths, found.violates)


def _worst(
    answers: Sequence[NDArray[np.float64]], expected: Sequence[NDArray[np.float64]], seed: int, close: float = CLOSE
) -> str:
    """The first scene in which two answers differ by more than rounding."""
    size = max(1e-12, *(float(np.abs(each).max()) for each in expected))
    for number, (answer, wanted) in enumerate(zip(answers, expected, strict=True)):
        apart = float(np.abs(answer - wanted).max())
        if not apart <= close * size:
            return (
                f"scene {number} of seed {seed}: the command is off by {apart / size:.2g} of the largest command "
                f"({_vector(answer)} instead of {_vector(wanted)})"
            )
    return ""


def _vector(values: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"


def _same(
    law: TestedLaw, scenes: Sequence[Scene], others: Sequence[Scene], turns: Sequence[Rotation], seed: int
) -> str:
    expected = [turn @ law.command(scene) for scene, turn in zip(scenes, turns, strict=True)]
    return _worst([law.command(scene) for scene in others], expected, seed)


def _renumbered(law: TestedLaw, scenes: Sequence[Scene], rng: np.random.Generator, seed: int) -> str:
    orders = [rng.permutation(len(scene.states)).tolist() for scene in scenes]
    answers = [law.command(scene, order) for scene, order in zip(scenes, orders, strict=True)]
    return _worst(answers, [law.command(scene) for scene in scenes], seed)


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
            return f"flying along {_vector(heading)} it commands {_vector(command)}"
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
                return f"{distance:g} m apart{' at rest' if still else ''} it commands {_vector(command)}"
    return ""


def _flown(scenario: Scenario, start: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Frames (time, component, agent) of a flight without a compiler."""
    flown = fly_world(scenario, seed, precision=64, record=True, start=start, device="python")
    assert flown.frames is not None
    return flown.frames


def _start(law: TestedLaw, seed: int) -> NDArray[np.float64]:
    rng, dims = np.random.default_rng(seed), law.scenario.dimensions
    places = 0.6 * law.length * rng.uniform(-1.0, 1.0, (dims, AGENT_COUNT))
    return np.vstack([places, law.speed * random_directions(rng, AGENT_COUNT, dims)[:, :dims].T])


def _time_step(law: TestedLaw, seed: int) -> str:
    """Positions at the end, without noise: the difference of two time steps shrinks when both are halved."""
    quiet, start = _quiet(law.scenario), _start(law, seed)
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


def _quiet(scenario: Scenario) -> Scenario:
    """The scenario without noise."""
    noise = {"noise": 0.0} if hasattr(scenario.body, "noise") else {}
    return replace(scenario.without_sensor_errors, body=scenario.body.with_numbers(**noise))


def _units(law: TestedLaw, scenes: Sequence[Scene], seed: int) -> str:
    """Every declared number in other units: commands, and frames of a flight with the same random numbers."""
    expected = [law.command(scene) for scene in scenes]
    for units in UNIT_SCALES:
        other = replace(law, scenario=rescaled_scenario(law.scenario, units))
        by = unit_factor(COMMANDS[law.model.command], units)
        answers = [other.command(in_units(scene, units)) / by for scene in scenes]
        mismatch = _worst(answers, expected, seed, CLOSE_IN_FLIGHT)
        if mismatch:
            return f"{mismatch}: {HIDDEN}"
    return _units_in_flight(law, seed)


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


def _single(law: TestedLaw, scenes: Sequence[Scene]) -> str:
    """Every scalar rule of the law, on the numbers of a few scenes."""
    plan = plan_of(law.scenario, precision=32)
    constants = plan.constants | {"p": dict(plan.model_choices) or choices(law.p)}
    found = law.model
    for scene in scenes[:5]:
        own, other = State(*scene.states[0].tolist()), State(*scene.states[1].tolist())
        heard = [HeardNeighbour(1, other, 0.0)]
        wall = tuple(scene.walls[0].tolist())
        f = 1.0 / float(np.linalg.norm(scene.states[0, 3:]))
        given: dict[str, Any] = pair_arguments(own, heard[0], 0) | {"p": law.p, "period": 0.2}
        given |= dict(zip(("distance", "nx", "ny", "nz"), wall, strict=True))
        given |= {"own": Own(*own[3:], *(f * v for v in own[3:])), "memory": initial_memory(found)}
        given |= {"sums": sum_neighbours(found, law.p, own, heard, 0), "shared": law.flock_solution(scene)}
        given |= {"walls": sum_surfaces(found, law.p, own, [wall]), "wing": law.scenario.wing}
        given |= {"aero": law.scenario.aero, "percept": Percept(1.0, *(-scene.states[0, :3]).tolist())}
        for kind in ("neighbour", "boundary", "decide"):
            rule = getattr(found, kind)
            if rule is not None:
                run_in_single_precision(rule, constants, given, argument_names(rule, kind, found.name))
    return ""
