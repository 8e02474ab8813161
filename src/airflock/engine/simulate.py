"""Simulate: scenarios in, recordings or order parameters out. The only public door of the engine."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from numpy.typing import NDArray

from airflock.core.contract import Metric, Model
from airflock.core.parameters import choices
from airflock.core.radio import FEW
from airflock.core.vocabulary import asks
from airflock.engine import cpu, devices, failure, needs
from airflock.engine.passes.driver import flight as flight_text
from airflock.engine.plan import Build, OwnLaw, Plan
from airflock.engine.planning import constants_of, make_plan
from airflock.engine.probe import probe, probe_fault, probe_radio, probe_sensor, probe_topology
from airflock.engine.state import State
from airflock.engine.tables import tables
from airflock.errors import FlightError, ScenarioError
from airflock.scenarios.places import start_fault
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.seeds import sound_seed
from airflock.scenarios.timing import clock
from airflock.threads import in_threads
from airflock.world.place import half_sizes


def plan_of(
    scenario: Scenario,
    *,
    precision: int = 32,
    record: bool = False,
    metrics: tuple[Metric, ...] | None = None,
    grid: bool | None = None,
    given_start: bool = False,
    absence: bool = False,
) -> Plan:
    """Plan of a scenario's flight; its metrics are those that metrics.kind names, unless given.

    grid        : neighbours by cells or all pairs; by default what is faster, all pairs in a box too small for cells
    given_start : the start is handed over with each flight
    absence     : agents may be absent; where a fault takes agents out they may in any case
    """
    if precision not in (32, 64):
        raise ScenarioError([f"precision = {precision} is neither 32 nor 64"])
    laws = scenario.laws
    for law in laws:
        _probed(law.model, tuple(choices(law.parameters).items()))
    wind, kinds = scenario.wind, scenario.fault_kinds
    for kind in kinds:
        probe_fault(kind)
    if scenario.errs:
        probe_sensor(scenario.sensor)
    probe_radio(scenario.transceiver)
    if scenario.own_topology is not None:
        probe_topology(scenario.own_topology)
    return make_plan(
        scenario.model,
        scenario.parameters,
        scenario.order_parameters if metrics is None else metrics,
        scenario.world,
        scenario.numbers,
        build=Build(
            bits=precision,
            record=record,
            given_start=given_start,
            grid=(_pays(scenario) if grid is None else grid) and _has_room(scenario) and _by_cells(scenario),
            absence=absence or any(kind.leaves is not None for kind in kinds),
        ),
        body=scenario.vehicle,
        body_choices=tuple(sorted(choices(scenario.body).items())),
        **_sensing(scenario),
        start=scenario.start.kind,
        scene=scenario.scene.draw == "flight" or bool(len(scenario.stands().shapes)),
        meshed=scenario.scene.kind == "mesh",
        goals=scenario.goals.kind in ("points", "scene"),
        herd=scenario.goals.kind in ("points", "scene") and scenario.goals.role == "herd",
        own=scenario.goals.kind == "own",
        sequential=scenario.flight.update == "sequential",
        delayed=clock(scenario)["delay"] > 0,
        lossy=scenario.radio.loss > 0.0,
        stop=scenario.metrics.stop == "collision",
        wing_choices=_wing_choices(scenario, metrics),
        aero_choices=tuple(sorted(choices(scenario.aero).items())) if scenario.descends else (),
        radio=scenario.transceiver,
        radio_choices=_radio_choices(scenario),
        few=_few_packets(scenario),
        silent=scenario.silence.rule == "stop",
        faults=kinds,
        varied=scenario.varied,
        topology=scenario.meets if any(law.model.neighbour is not None for law in laws) else None,
        laws=tuple(OwnLaw(law.model, constants_of(*law[:2], law.varied), law.varied) for law in laws[1:]),
        grouped=bool(scenario.groups) and any(law.asks_for_groups for law in laws),
        fading=scenario.own_topology is not None or scenario.topology.fading > 0.0,
        windy=wind.kind == "dryden" or any((wind.east, wind.north, wind.up, wind.gust)),
        dryden=wind.kind == "dryden",
    )


def _sensing(scenario: Scenario) -> dict[str, Any]:
    """What a plan says of a sensor: nothing of one that tells the truth, so that all such flights share a driver."""
    if not scenario.errs:
        return {"noisy": False}
    chosen = tuple(sorted(choices(scenario.sensors).items()))
    return {"noisy": True, "sensor": scenario.sensor, "sensor_choices": chosen}


def _few_packets(scenario: Scenario) -> bool:
    """Whether each rate of the radio sends at most FEW packets between two decisions; True where it has none."""
    rates = [getattr(scenario.radio, name) for name in scenario.transceiver.rates]
    period = clock(scenario)["decide_every"] * scenario.flight.dt
    return max(rates, default=0.0) * period <= FEW - 0.1  # rounding may make it one packet more


def _radio_choices(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """Choices of the radio that its rules can read: the kind of those that share a record is none of them."""
    return tuple(sorted((k, v) for k, v in choices(scenario.radio).items() if k != "kind"))


def _wing_choices(scenario: Scenario, metrics: tuple[Metric, ...] | None) -> tuple[tuple[str, str], ...]:
    """Choices of the wing where a rule solves for the whole flock; elsewhere they are nobody's business."""
    found = scenario.order_parameters if metrics is None else metrics
    used = scenario.model.flock is not None or any(
        "wing" in asks(metric.survey, "survey") for metric in found if metric.survey
    )
    return tuple(sorted(choices(scenario.wing).items())) if used else ()


def driver_text(scenario: Scenario, *, precision: int = 32) -> str:
    """Text of the driver that flies a scenario: all rules are inside, so equal texts are equal physics."""
    return flight_text(plan_of(scenario, precision=precision))


@lru_cache
def _probed(model: Model, chosen: tuple[tuple[str, str], ...]) -> None:
    """Probe a model once per set of choices; its numbers decide nothing about the rules' text."""
    probe(model, model.Parameters(**dict(chosen)))


def fly(
    scenario: Scenario,
    seed: int = 0,
    *,
    precision: int = 32,
    record: bool = False,
    start: Any = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = None,
) -> cpu.Flown:
    """Fly one world. Raises FlightError where agents find no room or a state stops being finite.

    device : cpu, cuda, python (no compiler, double precision), or auto, which tells `say` what it picked
    """
    seed = sound_seed(seed)
    scenario = scenario.in_flight(seed)
    plan = plan_of(scenario, precision=precision, record=record)
    if start is not None:
        plan = plan.built(given_start=True)
        start = sound_start(scenario, plan, start)
    chosen = device if device == "cpu" else _choice(device, [scenario], [plan], say)
    if chosen != "cuda":
        needs.check(scenario, plan)
    return checked(scenario, seed, _route(chosen)(scenario, plan, seed, start), chosen, precision, start)


def picked(
    scenarios: Sequence[Scenario],
    device: str = "auto",
    *,
    precision: int = 32,
    record: bool = False,
    say: Callable[[str], None] | None = None,
) -> str:
    """Device on which these flights run: the one that is named if it can fly them, else what `auto` picks."""
    if device == "cpu":
        return device
    plans = [plan_of(scenario, precision=precision, record=record) for scenario in scenarios]
    return _choice(device, scenarios, plans, say)


def _choice(
    device: str, scenarios: Sequence[Scenario], plans: Sequence[Plan], say: Callable[[str], None] | None
) -> str:
    choice = devices.choose(device, scenarios, plans)
    if say is not None and choice.note:
        say(choice.note)
    return choice.device


def _route(device: str) -> Callable[[Scenario, Plan, int, Any], cpu.Flown]:
    """How one world is flown on a device."""
    if device == "cpu":
        return lambda scenario, plan, seed, start: cpu.fly(plan, tables(scenario, plan, seed), start)
    return lambda scenario, plan, seed, start: devices.fly_one(scenario, plan, seed, device, start)


def checked(
    scenario: Scenario, seed: int, flown: cpu.Flown, device: str = "cpu", precision: int = 32, start: Any = None
) -> cpu.Flown:
    """A flight that went well; raises FlightError for any other."""
    if flown.status < 0:
        raise FlightError(failure.no_place(scenario, seed, -flown.status - 1))
    bad = _first_bad(flown)
    if bad is not None:
        raise FlightError(
            failure.not_finite(scenario, seed, bad, _first_bad_step(scenario, seed, precision, start, device))
        )
    return flown


def _first_bad(flown: cpu.Flown) -> int | None:
    """First agent whose state is not finite."""
    import numpy as np

    bad = np.flatnonzero(~np.isfinite(flown.state).all(axis=0) & flown.present)
    return int(bad[0]) if bad.size else None


def _first_bad_step(scenario: Scenario, seed: int, precision: int, start: Any, device: str) -> int:
    """First step after which a state is not finite: flights are deterministic, so another one finds it by halves."""
    low, high = 0, clock(scenario)["steps"]
    if device != "cuda":
        return failure.first_bad_step(opened(scenario, seed, precision, False, start, device=device), low, high)
    plan = plan_of(scenario, precision=precision).built(given_start=start is not None)
    while high - low > 1:
        middle = (low + high) // 2
        shorter = replace(scenario, flight=replace(scenario.flight, duration=middle * scenario.flight.dt))
        if _first_bad(_route(device)(shorter, plan, seed, start)) is None:
            low = middle
        else:
            high = middle
    return high


def opened(
    scenario: Scenario,
    seed: int,
    precision: int = 32,
    record: bool = False,
    start: Any = None,
    world: int = 0,
    *,
    given_start: bool = False,
    absence: bool = False,
    device: str = "cpu",
) -> State:
    """State of a flight before its first step.

    start       : as in `fly`; given_start : whether agents have been given their places already, so that none are drawn
    absence     : as in `plan_of`
    device      : cpu, or python, in double precision and with all pairs
    Raises FlightError where `start` cannot be flown.
    """
    plan = plan_of(scenario, precision=precision, record=record, absence=absence)
    if device == "python":
        plan = plan.built(grid=False, bits=64)
    needs.check(scenario, plan)
    given = None
    if start is not None:
        given = sound_start(scenario, plan, start)
    plan = plan.built(given_start=given_start or start is not None)
    return State(plan, tables(scenario, plan, seed, world), cpu.driver_of(plan, device), given)


def sound_start(scenario: Scenario, plan: Plan, start: Any) -> NDArray[Any]:
    """Positions and velocities to start from, as a driver reads them: (component, agent), m and m/s.

    Raises FlightError, one line, where their shape, their kind or their values are wrong.
    """
    import numpy as np

    names = [*plan.axes, *(f"v{axis}" for axis in plan.axes)]
    shape, said = (len(names), scenario.agents), f"{scenario.name}: start: "
    try:
        given = np.asarray(start, np.float32 if plan.bits == 32 else np.float64)
    except (TypeError, ValueError) as fault:
        raise FlightError(f"{said}not an array of numbers: {fault}") from fault
    if given.shape != shape:
        wanted = f"{shape}, the rows {', '.join(names)} of {scenario.agents} agents in m and m/s"
        raise FlightError(f"{said}its shape is {given.shape}; give {wanted}")
    bad = np.argwhere(~np.isfinite(given))
    if len(bad):
        row, agent = bad[0]
        raise FlightError(f"{said}{names[row]} of agent {agent} is {given[row, agent]}, not a finite number")
    outside = start_fault(scenario, given)
    if outside:
        raise FlightError(f"{scenario.name}: {outside}")
    return given


def score_flight(scenario: Scenario, seed: int = 0, *, precision: int = 32) -> dict[str, float]:
    """Order parameters and fitness of one flight, from running sums: no trajectory is kept."""
    return finish(scenario, fly(scenario, seed, precision=precision).values)


def finish(scenario: Scenario, values: dict[str, Any]) -> dict[str, Any]:
    """Order parameters with what the scenario's metric set makes of them: partial fitnesses and fitness."""
    return scenario.measures.judged(values, scenario.agents, scenario.flight.duration, scenario.measured_by())


def compile_for(scenario: Scenario, *, precision: int = 32) -> None:
    """Compile what flies a scenario, if that has not been done; scenarios that differ by numbers share it."""
    driver = cpu.flight_driver(plan_of(scenario, precision=precision))
    if not cpu.is_loaded(driver):
        with cpu.compiling(scenario.model.name):
            opened(scenario, 0, precision).compile()


def score_flights(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    *,
    threads: int | None = None,
    precision: int = 32,
    done: Callable[[], None] | None = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = None,
) -> list[dict[str, float]]:
    """Order parameters of many flights, flight i with seeds[i]; side by side on all cores, or together on a GPU.

    device : cpu, cuda, python (no compiler, double precision), or auto, which tells `say` what it picked
    """
    seeds = [sound_seed(seed) for seed in seeds]
    if device != "cpu":
        plans = [plan_of(scenario, precision=precision) for scenario in scenarios]
        device = _choice(device, scenarios, plans, say)
        if device == "cuda":
            flown = devices.fly_on_gpu(scenarios, plans, seeds, None, done)
            together = zip(scenarios, seeds, flown, strict=True)
            return [finish(s, checked(s, seed, f, device, precision).values) for s, seed, f in together]
    if device == "python":
        return list(in_threads([_plainly(*pair) for pair in zip(scenarios, seeds, strict=True)], 1, done))
    for scenario in {plan_of(scenario, precision=precision): scenario for scenario in scenarios}.values():
        compile_for(scenario, precision=precision)  # once, before threads ask for it

    def job(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
        return lambda: score_flight(scenario, seed, precision=precision)

    jobs = [job(scenario, seed) for scenario, seed in zip(scenarios, seeds, strict=True)]
    if any(_pays(scenario) for scenario in scenarios):
        threads = 1  # each flight takes all cores by itself
    return list(in_threads(jobs, threads, done))


def _plainly(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
    """A flight in plain Python, yet to be flown."""
    return lambda: finish(scenario, fly(scenario, seed, precision=64, device="python").values)


def takes_all_cores(scenario: Scenario) -> bool:
    """Whether one flight of a scenario uses all cores by itself, so that several side by side gain nothing."""
    return _pays(scenario)


GRID_FROM = 1000  # agents; below, all pairs on one core are as fast, and flights side by side use the cores


def _pays(scenario: Scenario) -> bool:
    """Whether neighbours are found by cells: many agents, a model of finite reach, perception as things are."""
    perfect = not scenario.errs and clock(scenario)["delay"] == 0 and scenario.radio.loss == 0.0
    return (
        scenario.agents >= GRID_FROM
        and scenario.model.reach is not None
        and scenario.model.neighbour is not None
        and perfect
        and _by_cells(scenario)
        and not scenario.transceiver.keeps
        and scenario.silence.rule == "fly_on"
        and scenario.flight.update == "synchronous"
        and not any({"sense", "tell", "radio", "clock"} & set(kind.rules) for kind in scenario.fault_kinds)
        and not any(letter == "p" for letter, _ in scenario.varied)
        and _has_room(scenario)
    )


def _by_cells(scenario: Scenario) -> bool:
    """Whether cells as wide as the law's reach hold all who decide whom an agent meets."""
    if len(scenario.laws) > 1 or (scenario.groups and scenario.laws[0].asks_for_groups):
        return False
    kind = scenario.meets
    walls = scenario.scene.kind != "none" or bool(scenario.world.obstacles)
    return kind is None or (kind.near and not (walls and kind.asks("hidden")))


def _has_room(scenario: Scenario) -> bool:
    """Whether a periodic box is two reaches wide, so that a neighbour is in reach at one image only."""
    if scenario.world.edges != "periodic" or scenario.model.reach is None:
        return True
    halves = half_sizes(scenario.world)[: scenario.dimensions]
    return min(halves) >= float(scenario.model.reach(scenario.parameters))
