"""Scores of many flights, in their order: flown in this process, or on the workers of a scheduler."""

from collections.abc import Callable, Sequence
from numbers import Integral
from typing import Any

from airflock.engine import pick_device, score_flights
from airflock.runs.executors import Flight
from airflock.scenarios import Scenario
from airflock.support import FlightError


def score_scenarios(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    *,
    scheduler: str | None = None,
    threads: int | None = None,
    precision: int = 32,
    on_done: Callable[[], None] | None = None,
    device: str = "cpu",
    notify: Callable[[str], None] | None = None,
) -> list[dict[str, Any]]:
    """Order parameters of flight i of scenarios[i] with seeds[i].

    scheduler : address of a dask scheduler whose workers fly; None: this process, with so many threads on a device
    Raises FlightError for a flight that goes wrong, StudyError for a scheduler that does not answer.
    """
    if threads is not None and not isinstance(threads, Integral):
        raise FlightError(f"threads = {threads!r} is not a whole number of flights side by side")
    if scheduler is not None:
        return _on_workers(scheduler, scenarios, seeds, precision, device, on_done)
    device = pick_device(scenarios, device, precision=precision, notify=notify)
    return score_flights(scenarios, seeds, threads=threads, precision=precision, on_done=on_done, device=device)


def _on_workers(
    scheduler: str, scenarios: Sequence[Scenario], seeds: Sequence[int], precision: int, device: str,
    done: Callable[[], None] | None,
) -> list[dict[str, Any]]:  # fmt: skip
    from airflock.runs.executors.cluster import DaskCluster, ScenarioTask, check_worker_device

    check_worker_device(scheduler, device)
    distinct = {id(scenario): scenario for scenario in scenarios}
    places = {key: place for place, key in enumerate(distinct)}
    tasks = [ScenarioTask(scenario, precision) for scenario in distinct.values()]
    pairs = zip(scenarios, seeds, strict=True)
    flights = [Flight(i, 0, {}, seed, places[id(scenario)]) for i, (scenario, seed) in enumerate(pairs)]
    rows: dict[int, dict[str, Any]] = {}
    cluster = DaskCluster(tasks, scheduler, is_stored=False)
    try:
        for landed in cluster.fly(flights):
            if landed.values is None:
                raise FlightError(landed.reason)
            rows[landed.flight.candidate_index] = dict(landed.values)
            if done is not None:
                done()
    finally:
        cluster.close()
    return [rows[i] for i in range(len(flights))]
