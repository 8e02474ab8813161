"""Fleets on the real clock: as tasks of one process, or as processes that fork from a warm parent.

Processes wait behind a ready barrier: each says that it is there, and only when all have does the clock start. There
is no time-out: a process that ends before is named in one line, and ends the fleet.
"""

import asyncio
import math
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Coroutine, Generator, Sequence
from functools import partial
from multiprocessing.connection import wait
from typing import Any

from airflock.core import State
from airflock.drones import FlightCard, OrderKind, TaskRest, dialect, hand_on_data, run_alone
from airflock.fleets.faults import InjectedFault
from airflock.fleets.flown import ComputerLoad, RealtimeFleet
from airflock.fleets.live import (
    HOVER_SECONDS,
    FleetPorts,
    RealtimePlan,
    TaskResult,
    channel_task,
    node_task,
    vehicle_task,
)
from airflock.fleets.starting import SECONDS_BEFORE_START, OperatorStation
from airflock.scenarios import Scenario
from airflock.support import LinkError, ScenarioError

FLEET_MODES = ("lockstep", "tasks", "processes")
DEFAULT_CLIENT = ("127.0.0.1", 14540)  # where PX4's simulator calls its first client
START_ORDER_PERIOD = 2.0  # s between two orders to start
MAX_ARM_SECONDS = 60.0  # s in which all must have armed
MAX_RETURN_SECONDS = 600.0  # s in which all must have landed
FAR_FUTURE = 1e6  # s; longer than anybody waits
WATCH_PERIOD = 0.1  # s between two looks at how the fleet is doing
ENDED_MESSAGE = "a process of the fleet ended with status {}"
Task = Generator[TaskRest, None, TaskResult]
Supervisor = Callable[[Callable[[], None]], Coroutine[Any, Any, None]]
CHANNEL_TASK = 0  # place of the ether among the lives


def lockstep_only_errors(faults: Sequence[InjectedFault]) -> list[str]:
    """What flies in lock-step only, one line each."""
    gone = [f for f in faults if f.kind == "node" and f.end < 1e9]
    return ["fault node: on the real clock a node that died stays dead; leave out end"] * bool(gone)


def fly_in_realtime(
    scenario: Scenario, card: FlightCard, seed: int, mode: str, *, start: Sequence[State] | None,
    faults: Sequence[InjectedFault] = (), operator: bytes = b"", first_client: tuple[str, int] = DEFAULT_CLIENT,
    on_done: Callable[[], None] | None = None, watcher: tuple[str, int] | None = None,
) -> RealtimeFleet:  # fmt: skip
    """Fly one fleet for the scenario's duration on the real clock, in the mode "tasks" or "processes".

    start : states in the air; None: from the ground by orders of the operator, and back
    join  : where vehicle 1 calls for a client that joins; vehicle 2 calls at the next port
    done  : called once for each second flown
    watcher : address that gets every packet, and what the ether tells (`fleets.teller`)

    Raises ScenarioError for what flies in lock-step only, LinkError where a process ends before its time.
    """
    wrong = lockstep_only_errors(faults)
    if wrong:
        raise ScenarioError(wrong)
    ports = FleetPorts.open(len(card.members), first_client)
    try:
        now = time.monotonic()
        first = [
            now + FAR_FUTURE,
            now + 2.0 * FAR_FUTURE,
            *(0.0,) * len(card.members),
        ]  # the watch sets the clock when all are there
        kept: Callable[[list[float]], Any] = list if mode == "tasks" else partial(multiprocessing.RawArray, "d")
        clock, seen = kept(first), kept([0.0] * (4 * len(card.members)))
        epoch = time.time_ns() // 1000 - round(now * 1e6)
        plan = RealtimePlan(scenario, card, seed, start, tuple(faults), ports, clock, seen, epoch, watcher)
        lives: list[Callable[[], Task]] = [partial(channel_task, plan)]
        lives += [partial(node_task, plan, i) for i in range(len(card.members))]
        lives += [partial(vehicle_task, plan, i) for i in range(len(card.members))]
        watching = partial(_watch, plan, operator, on_done)
        began = time.monotonic()
        ended, all_ = asyncio.run(_tasks(lives, watching)) if mode == "tasks" else _forked(lives, watching)
        return RealtimeFleet(
            plan, ended, _computer_load(ended, len(card.members), time.monotonic() - began, all_, mode == "tasks")
        )
    finally:
        ports.close()


async def _tasks(lives: Sequence[Callable[[], Task]], watching: Supervisor) -> tuple[list[TaskResult], float]:
    """All lives in one event loop; what is left of each, and the processor time of all, s."""
    began = time.process_time()
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(run_in_event_loop(life())) for life in lives]
        await watching(lambda: None)
    return [task.result() for task in tasks], time.process_time() - began


async def run_in_event_loop(life: Task) -> TaskResult:
    """Live a life among others in one event loop, as `alone` does in a process of its own."""
    loop, hears = asyncio.get_running_loop(), TaskRest(0.0).handlers
    try:
        while True:
            try:
                rest = next(life)
            except StopIteration as end:
                found: TaskResult = end.value
                return found
            if rest.handlers is not hears:
                hears = rest.handlers
                for port, hand in hears:
                    loop.add_reader(port.fileno(), hand_on_data, port, hand)
            await asyncio.sleep(max(0.0, rest.until - time.monotonic()))
    finally:
        for port, _ in hears:
            loop.remove_reader(port.fileno())


def _forked(lives: Sequence[Callable[[], Task]], watching: Supervisor) -> tuple[list[TaskResult], float]:
    """Each life in a process of its own; what is left of each, and the processor time of all, s."""
    if not hasattr(os, "fork"):
        raise LinkError("mode = 'processes' forks, which this system does not do; give mode = 'tasks'")
    context, began = multiprocessing.get_context("fork"), time.process_time()
    dialect.common_dialect()  # once here, so that no process imports it for itself
    pipes = [context.Pipe() for _ in lives]
    processes = [
        context.Process(target=_process_main, args=(life, pipe[1]), daemon=True)
        for life, pipe in zip(lives, pipes, strict=True)
    ]
    try:
        for process, (_, theirs) in zip(processes, pipes, strict=True):
            process.start()
            theirs.close()
        ours = [pipe[0] for pipe in pipes]
        _all(ours, processes)  # the barrier
        for pipe in ours:
            pipe.send("go")
        asyncio.run(watching(partial(_alive, processes)))
        lives = _all(ours, processes)
        for process in processes:
            process.join()
        return lives, time.process_time() - began + sum(life.processor for life in lives)
    finally:
        for process in processes:
            if process.is_alive():
                process.terminate()


def _all(pipes: Sequence[Any], processes: Sequence[Any]) -> list[Any]:
    """One message of each process; LinkError if one ends without it."""
    received: dict[int, Any] = {}
    while len(received) < len(pipes):
        waiting = {pipe: i for i, pipe in enumerate(pipes) if i not in received}
        for pipe in wait(list(waiting)):
            i = waiting[pipe]  # type: ignore[index]
            try:
                received[i] = pipes[i].recv()
            except EOFError as fault:
                processes[i].join()
                raise LinkError(ENDED_MESSAGE.format(processes[i].exitcode)) from fault
    return [received[i] for i in range(len(pipes))]


def _alive(processes: Sequence[Any]) -> None:
    """Raise LinkError if a process has failed."""
    for process in processes:
        if process.exitcode:
            raise LinkError(ENDED_MESSAGE.format(process.exitcode))


def _process_main(life: Callable[[], Task], pipe: Any) -> None:
    """A process: says that it is ready, waits for all others, lives, and hands over what is left."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends the fleet, and says why
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    pipe.send("ready")
    pipe.recv()
    pipe.send(run_alone(life()))


async def _watch(
    plan: RealtimePlan, operator: bytes, on_done: Callable[[], None] | None, check: Callable[[], None]
) -> None:
    """Give the orders of a flight from the ground, end the flight, and tell how far it is; check raises what failed."""
    seconds = plan.scenario.flight.duration
    told = 0

    async def until(holds: Callable[[], bool]) -> None:
        nonlocal told
        while not holds():
            await asyncio.sleep(WATCH_PERIOD)
            check()
            while on_done is not None and told < min(plan.now, seconds + SECONDS_BEFORE_START):
                told += 1
                on_done()

    await until(lambda: plan.ready)
    plan.clock[0] = time.monotonic() + plan.scenario.radio.delay + HOVER_SECONDS
    if plan.start is not None:
        await until(lambda: plan.now > seconds + plan.card.period)
    else:
        await _from_the_ground(plan, OperatorStation(plan.card, operator), until)
    plan.clock[1] = time.monotonic()


async def _from_the_ground(plan: RealtimePlan, station: OperatorStation, until: Callable[..., Any]) -> None:
    """Order a start, a return when the time is over, and wait until all stand on the ground again."""

    def order(do: OrderKind) -> None:
        utc = plan.utc(time.monotonic())
        plan.ports.station.send(station.order(do, utc, at=utc), plan.ports.channel.here)

    await until(lambda: plan.now > SECONDS_BEFORE_START)
    begun = plan.now
    while not all(plan.armed) and plan.now < begun + MAX_ARM_SECONDS:
        order(OrderKind.START)
        next_ = plan.now + START_ORDER_PERIOD
        await until(lambda: plan.now > next_ or all(plan.armed))  # noqa: B023
    begun = plan.now
    await until(lambda: plan.now > begun + plan.scenario.flight.duration)
    order(OrderKind.RETURN)
    begun = plan.now
    await until(lambda: plan.now > begun + MAX_RETURN_SECONDS or not any(plan.armed))


def _computer_load(
    lives: Sequence[TaskResult], count: int, seconds: float, all_: float, together: bool
) -> ComputerLoad:
    nodes, others = lives[1 : 1 + count], [lives[CHANNEL_TASK], *lives[1 + count :]]
    by = [None if together else sum(life.processor for life in part) / seconds for part in (nodes, others)]
    ticks = [life.ticks for life in nodes]
    total, late = sum(t.total for t in ticks), sum(t.late for t in ticks)
    others_ = os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan  # Windows counts none
    return ComputerLoad(all_ / seconds, by[0], by[1], total, late, max(t.worst for t in ticks), others_)
