"""The public door: a scenario and limits in, a certificate out; begun or continued in a folder of flights."""

import math
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.certify.campaign import FOLDER, Campaign
from airflock.certify.certificate import Certificate
from airflock.certify.counting import Count, Watch, count
from airflock.certify.flights import Task, score_of
from airflock.certify.hazard import Hazard, hazard
from airflock.certify.limits import read_all
from airflock.certify.maps import bounds_over, sound_axes
from airflock.certify.seeds import TOLERANCE, seed
from airflock.errors import ScenarioError, StudyError
from airflock.evolve.executors import Executor, Flight
from airflock.evolve.executors.here import Here
from airflock.evolve.folder import open_folder, read, sweep, versions, write
from airflock.evolve.run import Interrupted
from airflock.evolve.store import Store
from airflock.scenarios import formats
from airflock.scenarios.change import variant
from airflock.scenarios.scenario import Scenario

PILOT = 16  # flights that tell how many there is time for
COUNTED = 2.0 / 3.0  # share of the budget that counting may take where tolerance is asked for


def certify(
    scenario: Scenario | str | os.PathLike[str],
    limit: str | Sequence[str],
    *,
    confidence: float = 0.95,
    budget: float = 600.0,
    flights: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    uncertain: bool = False,
    tolerance: bool | Sequence[str] = False,
    split: bool = False,
    over: Mapping[str, Sequence[float]] | None = None,
    precision: int = 32,
    device: str = "cpu",
    scheduler: str | None = None,
    threads: int | None = None,
    timeout: float | None = None,
    watch: Watch | None = None,
    trust: bool = False,
) -> Certificate:
    """Show by counting that an event is rare: exact bounds, all looks paid for, seeds fixed by the scenario.

    Parameters
    ----------
    scenario : Scenario, str or path
        What is flown.
    limit : str or list of str
        "r_min<1 at 1e-3/h", "n_coll>=1 at 1e-2/drone-h", "phi_wall>0 at 1%", "phi_vel>=3 in 99%"; without a rate the
        event is bounded as well as the flights allow. All limits hold together.
    confidence : float
        Of all that is shown, in (0, 1).
    budget : float
        Time that may be spent, s.
    flights : int, optional
        Fly so many, whatever the time, and look once.
    folder : str or path, optional
        Folder that keeps every flight, so that what was interrupted can be continued.
    resume : bool
        Continue the campaign in the folder.
    settings : mapping, optional
        Keys of the scenario to change.
    law : optional
        A flocking law of your own, as `airflock.load` takes it.
    uncertain : bool
        Each flight draws its numbers from the intervals in the scenario file (`airflock identify --uncertain`).
    tolerance : bool or list of str
        Also find how far each number of the environment may move; or only the keys that are named.
    split : bool
        Also estimate limits on r_min by splitting, which finds and ranks rare flights but shows nothing.
    over : mapping, optional
        Two keys with their values, {"radio.delay": [0.5, 1.0], "body.noise": [0.2, 0.4]}: also bounds over this grid.
    precision : int
        Bits per number: 32 or 64.
    device : str
        cpu, or python (no compiler, double precision).
    scheduler : str, optional
        Address of a dask scheduler; by default flights fly in this process.
    threads : int, optional
        Flights side by side; by default one per core.
    timeout : float, optional
        Time that a flight may take on a dask worker, s.
    watch : callable, optional
        Called with a Progress now and then.
    trust : bool
        Whether code that files name may run.

    Returns
    -------
    Certificate
        Verdicts, bounds, worst flights; `save` writes certificate.toml, `check` flies one flight in a hundred again.

    Raises
    ------
    ScenarioError, StudyError
        If the scenario, a limit or the folder cannot be used, or a flight fails; Interrupted at Ctrl-C.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 1.0})
    >>> found = airflock.certify(short, "r_min<0.01 at 20%", flights=14)
    >>> found.shown, found.verdicts[0].events
    (True, 0)
    """
    found = variant(scenario, settings, law, trust=trust)
    campaign = campaign_of(found, limit, confidence, flights, uncertain=uncertain, precision=precision, device=device)
    keys = asked(campaign, tolerance, split)
    axes = sound_axes(campaign.scenario, over) if over else {}
    check_options(budget, timeout, scheduler, device)
    with folder_of(folder) as path:
        executor = executor_for(campaign, scheduler, threads, timeout)
        try:
            campaign = planned(campaign, executor, budget, path, resume)
            open_folder(path, campaign, resume=resume, kind=FOLDER)
            return run(
                campaign, path, executor, budget, watch, keys=keys, split=split, axes=axes, threads=threads,
                kept=folder is not None,
            )  # fmt: skip
        finally:
            executor.close()


def campaign_of(
    scenario: Scenario,
    limit: str | Sequence[str],
    confidence: float = 0.95,
    flights: int | None = None,
    *,
    uncertain: bool = False,
    precision: int = 32,
    device: str = "cpu",
) -> Campaign:
    """The campaign that is asked for. Raises ScenarioError, all faults together."""
    faults: list[str] = []
    limits: tuple[Any, ...] = ()
    try:
        limits = read_all([limit] if isinstance(limit, str) else list(limit), scenario)
    except ScenarioError as fault:
        faults += fault.faults
    if not 0.5 <= confidence < 1.0:
        faults.append(f"confidence = {confidence:g} lies outside [0.5, 1); 0.95 is usual")
    if flights is not None and not 1 <= flights < 1 << 30:
        faults.append(f"flights = {flights} lies outside [1, {(1 << 30) - 1}]")
    if precision not in (32, 64):
        faults.append(f"precision = {precision} is neither 32 nor 64")
    if device not in ("cpu", "python"):
        faults.append(f"device = {device!r}: a certificate flies on cpu or python")
    campaign = Campaign(
        scenario, limits, confidence, 64 if device == "python" else precision, flights, uncertain, device
    )
    if uncertain and not campaign.intervals:
        faults.append(f"{scenario.name}: no number has an interval; airflock identify --uncertain writes them")
    if faults:
        raise ScenarioError(faults)
    return campaign


def asked(campaign: Campaign, tolerance: bool | Sequence[str], split: bool = False) -> tuple[str, ...]:
    """Keys whose tolerance is asked for; ScenarioError where one cannot be varied, or nothing can be split."""
    if split:
        from airflock.certify.branches import refuse

        refuse(campaign)
    if not tolerance:
        return ()
    from airflock.certify.tolerance import sound_keys, usual_keys

    return usual_keys(campaign.scenario) if tolerance is True else sound_keys(campaign.scenario, list(tolerance))


def check_options(budget: float, timeout: float | None, scheduler: str | None, device: str) -> None:
    """Refuse times in which nothing could fly, and a scheduler's workers in plain Python."""
    if not budget > 0.0:
        raise StudyError(f"budget = {budget:g} s is not positive")
    if timeout is not None and not timeout > 0.0:
        raise StudyError(f"timeout = {timeout:g} s is not positive")
    if scheduler is not None and device != "cpu":
        raise StudyError(f"device = {device}: workers of a scheduler fly on their cpu; leave out one of the two")


@contextmanager
def folder_of(folder: str | os.PathLike[str] | None) -> Iterator[Path]:
    """The folder of flights: the one that is given, or one that is gone afterwards."""
    if folder is not None:
        yield Path(folder)
        return
    with tempfile.TemporaryDirectory(prefix="airflock-certify-") as made:
        yield Path(made)


def executor_for(
    campaign: Campaign, scheduler: str | None = None, threads: int | None = None, timeout: float | None = None
) -> Executor:
    """Who flies: this process, or the workers of a dask scheduler."""
    if scheduler is not None:
        from airflock.evolve.executors.cluster import Cluster

        task = Task(campaign.scenario, campaign.limits, campaign.precision)
        return Cluster(None, scheduler, timeout=timeout, task=task)
    from airflock.engine.simulate import compile_for, takes_all_cores
    from airflock.threads import cores

    score = score_of(campaign.flown, campaign.limits, campaign.precision, campaign.device)
    if campaign.device != "cpu":
        return Here(score, 1)
    compile_for(campaign.flown, precision=campaign.precision)
    return Here(score, 1 if takes_all_cores(campaign.flown) else threads or cores())


def planned(campaign: Campaign, executor: Executor, budget: float, folder: Path, resume: bool) -> Campaign:
    """The campaign with a number of flights where a limit has no rate: as many as there is time for.

    A few flights on seeds of their own tell how long one takes; the number then stands before the first one counts.
    """
    if campaign.flights is not None or all(limit.rate is not None for limit in campaign.limits):
        return campaign
    if resume and (folder / f"{FOLDER}.toml").is_file():
        known = read(folder / f"{FOLDER}.toml").get("flights")
        return replace(campaign, flights=known if isinstance(known, int) else None)
    began = time.monotonic()
    own = [seed(campaign.hash, TOLERANCE, (1 << 29) + i) for i in range(PILOT)]
    for landed in executor.fly([Flight(0, i, campaign.parameters(s), s) for i, s in enumerate(own)]):
        if landed.values is None:
            raise StudyError(f"{campaign.scenario.name}: seed {landed.flight.seed}: {landed.reason}")
    able = 0.9 * budget * PILOT / max(time.monotonic() - began, 1e-6)
    digits = 10.0 ** max(0, math.floor(math.log10(max(able, 1.0))) - 1)
    return replace(campaign, flights=max(1, min(int(able / digits) * int(digits), (1 << 30) - 1)))


def run(
    campaign: Campaign,
    folder: Path,
    executor: Executor,
    budget: float,
    watch: Watch | None = None,
    *,
    keys: Sequence[str] = (),
    split: bool = False,
    axes: Mapping[str, Sequence[float]] | None = None,
    threads: int | None = None,
    note: Callable[[str], None] | None = None,
    kept: bool = True,
) -> Certificate:
    """Count, find tolerances of `keys`, split, and map over `axes`, in a folder that `open_folder` has accepted.

    note : told in a few words what begins; kept: whether the folder stays
    """
    began = time.monotonic()
    where = str(folder / "scenario.toml") if kept else campaign.scenario.name
    with Store(folder) as store:
        store.begin(versions())
        sweep(folder)
        write(folder / "scenario.toml", {formats.KEY: formats.FORMAT, **campaign.scenario.document})
        try:
            part = COUNTED if keys or split or axes else 1.0
            counted = count(campaign, store, executor, math.inf if campaign.flights else budget * part, watch)
            tolerances: Mapping[str, Any] = {}
            rare: Mapping[str, Any] = {}

            def left() -> float:
                return budget if campaign.flights else max(0.0, budget - (time.monotonic() - began))

            if split:
                from airflock.certify.branches import split as splitting

                rare = splitting(
                    campaign, store, executor, counted, left() * (0.5 if keys else 1.0), threads, note, where
                )
            if keys:
                from airflock.certify.tolerance import tolerance

                tolerances = tolerance(campaign, store, executor, counted, keys, left() * (0.5 if axes else 1.0), note)
            cells = bounds_over(campaign, store, executor, axes, left(), note) if axes else {}
        except KeyboardInterrupt as stop:
            told = f"{store.count('count'):,} flights are stored in {folder}; continue with --resume"
            raise Interrupted(f"interrupted: {told}") from stop
    return Certificate(
        campaign, tuple(counted.verdicts), hazards(campaign, counted), counted.rows, versions(),
        time.monotonic() - began, counted.rate, tolerances, rare, cells, where,
    )  # fmt: skip


def hazards(campaign: Campaign, counted: Count) -> dict[int, Hazard]:
    """Whether events came evenly over a flight, for each limit whose event has a moment."""
    found = {}
    timed = [i for i, limit in enumerate(campaign.limits) if limit.timed]
    for place, i in enumerate(timed):
        times = [row["first"][place] for row in counted.rows if row.get("first") and row["first"][place] is not None]
        found[i] = hazard(times, len(counted.rows), campaign.scenario.flight.duration)
    return found
