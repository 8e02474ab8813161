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

from airflock.core.agent import State
from airflock.drones.mavlink import dialect
from airflock.drones.mavlink.orders import Do
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.resting import Rest, alone, take
from airflock.fleets.faults import Fault
from airflock.fleets.flown import Flown, Load
from airflock.fleets.live import WARM, Life, Plan, Ports, craft_life, ether_life, node_life
from airflock.fleets.starting import READY_TIME, Station
from airflock.scenarios.scenario import Scenario
from airflock.support.errors import LinkError, ScenarioError

MODES = ("lockstep", "tasks", "processes")
JOIN = ("127.0.0.1", 14540)  # where PX4's simulator calls its first client
AGAIN = 2.0  # s between two orders to start
STARTS = 60.0  # s in which all must have armed
HOME = 600.0  # s in which all must have landed
LONG = 1e6  # s; longer than anybody waits
WATCH = 0.1  # s between two looks at how the fleet is doing
ENDED = "a process of the fleet ended with status {}"
Begun = Generator[Rest, None, Life]
Watching = Callable[[Callable[[], None]], Coroutine[Any, Any, None]]
OURSELVES = 0  # place of the ether among the lives


def refused(faults: Sequence[Fault]) -> list[str]:
    """What flies in lock-step only, one line each."""
    gone = [f for f in faults if f.kind == "node" and f.end < 1e9]
    return ["fault node: on the real clock a node that died stays dead; leave out end"] * bool(gone)


def fly(
    scenario: Scenario, card: Card, seed: int, mode: str, *, start: Sequence[State] | None,
    faults: Sequence[Fault] = (), operator: bytes = b"", join: tuple[str, int] = JOIN,
    done: Callable[[], None] | None = None, watcher: tuple[str, int] | None = None,
) -> Flown:  # fmt: skip
    """Fly one fleet for the scenario's duration on the real clock, in the mode "tasks" or "processes".

    start : states in the air; None: from the ground by orders of the operator, and back
    join  : where vehicle 1 calls for a client that joins; vehicle 2 calls at the next port
    done  : called once for each second flown
    watcher : address that gets every packet, and what the ether tells (`fleets.teller`)

    Raises ScenarioError for what flies in lock-step only, LinkError where a process ends before its time.
    """
    wrong = refused(faults)
    if wrong:
        raise ScenarioError(wrong)
    ports = Ports.opened(len(card.members), join)
    try:
        now = time.monotonic()
        first = [
            now + LONG,
            now + 2.0 * LONG,
            *(0.0,) * len(card.members),
        ]  # the watch sets the clock when all are there
        kept: Callable[[list[float]], Any] = list if mode == "tasks" else partial(multiprocessing.RawArray, "d")
        clock, seen = kept(first), kept([0.0] * (4 * len(card.members)))
        epoch = time.time_ns() // 1000 - round(now * 1e6)
        plan = Plan(scenario, card, seed, start, tuple(faults), ports, clock, seen, epoch, watcher)
        lives: list[Callable[[], Begun]] = [partial(ether_life, plan)]
        lives += [partial(node_life, plan, i) for i in range(len(card.members))]
        lives += [partial(craft_life, plan, i) for i in range(len(card.members))]
        watching = partial(_watch, plan, operator, done)
        began = time.monotonic()
        ended, all_ = asyncio.run(_tasks(lives, watching)) if mode == "tasks" else _forked(lives, watching)
        return Flown(plan, ended, _load(ended, len(card.members), time.monotonic() - began, all_, mode == "tasks"))
    finally:
        ports.close()


async def _tasks(lives: Sequence[Callable[[], Begun]], watching: Watching) -> tuple[list[Life], float]:
    """All lives in one event loop; what is left of each, and the processor time of all, s."""
    began = time.process_time()
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(together(life())) for life in lives]
        await watching(lambda: None)
    return [task.result() for task in tasks], time.process_time() - began


async def together(life: Begun) -> Life:
    """Live a life among others in one event loop, as `alone` does in a process of its own."""
    loop, hears = asyncio.get_running_loop(), Rest(0.0).hears
    try:
        while True:
            try:
                rest = next(life)
            except StopIteration as end:
                found: Life = end.value
                return found
            if rest.hears is not hears:
                hears = rest.hears
                for port, hand in hears:
                    loop.add_reader(port.fileno(), take, port, hand)
            await asyncio.sleep(max(0.0, rest.until - time.monotonic()))
    finally:
        for port, _ in hears:
            loop.remove_reader(port.fileno())


def _forked(lives: Sequence[Callable[[], Begun]], watching: Watching) -> tuple[list[Life], float]:
    """Each life in a process of its own; what is left of each, and the processor time of all, s."""
    if not hasattr(os, "fork"):
        raise LinkError("mode = 'processes' forks, which this system does not do; give mode = 'tasks'")
    context, began = multiprocessing.get_context("fork"), time.process_time()
    dialect.common()  # once here, so that no process imports it for itself
    pipes = [context.Pipe() for _ in lives]
    processes = [
        context.Process(target=_child, args=(life, pipe[1]), daemon=True)
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
                raise LinkError(ENDED.format(processes[i].exitcode)) from fault
    return [received[i] for i in range(len(pipes))]


def _alive(processes: Sequence[Any]) -> None:
    """Raise LinkError if a process has failed."""
    for process in processes:
        if process.exitcode:
            raise LinkError(ENDED.format(process.exitcode))


def _child(life: Callable[[], Begun], pipe: Any) -> None:
    """A process: says that it is ready, waits for all others, lives, and hands over what is left."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends the fleet, and says why
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    pipe.send("ready")
    pipe.recv()
    pipe.send(alone(life()))


async def _watch(plan: Plan, operator: bytes, done: Callable[[], None] | None, check: Callable[[], None]) -> None:
    """Give the orders of a flight from the ground, end the flight, and tell how far it is; check raises what failed."""
    seconds = plan.scenario.flight.duration
    told = 0

    async def until(holds: Callable[[], bool]) -> None:
        nonlocal told
        while not holds():
            await asyncio.sleep(WATCH)
            check()
            while done is not None and told < min(plan.now, seconds + READY_TIME):
                told += 1
                done()

    await until(lambda: plan.ready)
    plan.clock[0] = time.monotonic() + plan.scenario.radio.delay + WARM
    if plan.start is not None:
        await until(lambda: plan.now > seconds + plan.card.period)
    else:
        await _from_the_ground(plan, Station(plan.card, operator), until)
    plan.clock[1] = time.monotonic()


async def _from_the_ground(plan: Plan, station: Station, until: Callable[..., Any]) -> None:
    """Order a start, a return when the time is over, and wait until all stand on the ground again."""

    def order(do: Do) -> None:
        utc = plan.utc(time.monotonic())
        plan.ports.station.send(station.order(do, utc, at=utc), plan.ports.ether.here)

    await until(lambda: plan.now > READY_TIME)
    begun = plan.now
    while not all(plan.armed) and plan.now < begun + STARTS:
        order(Do.START)
        next_ = plan.now + AGAIN
        await until(lambda: plan.now > next_ or all(plan.armed))  # noqa: B023
    begun = plan.now
    await until(lambda: plan.now > begun + plan.scenario.flight.duration)
    order(Do.RETURN)
    begun = plan.now
    await until(lambda: plan.now > begun + HOME or not any(plan.armed))


def _load(lives: Sequence[Life], count: int, seconds: float, all_: float, together: bool) -> Load:
    nodes, others = lives[1 : 1 + count], [lives[OURSELVES], *lives[1 + count :]]
    by = [None if together else sum(life.processor for life in part) / seconds for part in (nodes, others)]
    ticks = [life.ticks for life in nodes]
    total, late = sum(t.total for t in ticks), sum(t.late for t in ticks)
    others_ = os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan  # Windows counts none
    return Load(all_ / seconds, by[0], by[1], total, late, max(t.worst for t in ticks), others_)
