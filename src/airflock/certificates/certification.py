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

from airflock.certificates.campaign import (
    CAMPAIGN_KIND,
    TOLERANCE_PURPOSE,
    Campaign,
    CampaignTask,
    campaign_from_request,
    certificate_seed,
    check_certify_budget,
    check_workers,
    limit_score_function,
    tolerance_keys,
)
from airflock.certificates.certificate import Certificate, EventTiming, event_timing
from airflock.certificates.counting import CampaignFlyer, CountResult, OnCountProgress, count_events
from airflock.certificates.splitting import check_split
from airflock.certificates.tolerance import check_map_axes, map_bounds
from airflock.runs import (
    DaskCluster,
    Executor,
    Flight,
    FlightStore,
    Interrupted,
    ThreadExecutor,
    open_folder,
    program_versions,
    read_toml_file,
    remove_unfinished,
    write_toml_file,
)
from airflock.scenarios import Scenario, formats, scenario_variant
from airflock.support import ErrorCollector, StudyError, expand_path

COUNT_BUDGET_SHARE = 2.0 / 3.0  # share of the budget that counting may take if tolerances are requested


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
    watch: OnCountProgress | None = None,
    trust: bool = False,
) -> Certificate:
    """Show by counting that an event is rare: exact bounds that hold over all looks, seeds fixed by the scenario.

    Parameters
    ----------
    scenario : Scenario, str or path
        What is flown.
    limit : str or list of str
        "r_min<1 at 1e-3/h", "n_coll>=1 at 1e-2/drone-h", "clearance<0 at 1%", "phi_vel>=3 in 99%"; without a rate the
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
        If the scenario, a limit or the folder cannot be used, or a flight fails.
    Interrupted
        At Ctrl-C.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 1.0})
    >>> found = airflock.certify(short, "r_min<0.01 at 20%", flights=14)
    >>> found.shown, found.verdicts[0].events
    (True, 0)
    """
    found = scenario_variant(scenario, settings, law, trust=trust)
    errors = ErrorCollector()
    chosen: dict[str, Any] = {"uncertain": uncertain, "precision": precision, "device": device}
    campaign = errors.read(campaign_from_request, found, limit, confidence, flights, **chosen)
    if split:
        errors.read(check_split, campaign)
    keys = errors.read(tolerance_keys, found, tolerance)
    axes = errors.read(check_map_axes, found, over) if over else {}
    errors.read(check_certify_budget, budget)
    errors.read(check_workers, timeout, scheduler, device)
    errors.raise_errors()
    with flight_folder(folder) as path:
        executor = campaign_executor(campaign, scheduler, threads, timeout)
        try:
            campaign = with_planned_flights(campaign, executor, budget, path, resume)
            open_folder(path, campaign, resume=resume, kind=CAMPAIGN_KIND)
            return run_campaign(
                campaign, path, executor, budget, watch, keys=keys, split=split, axes=axes, threads=threads,
                is_stored=folder is not None,
            )  # fmt: skip
        finally:
            executor.close()


def run_campaign(
    campaign: Campaign,
    folder: Path,
    executor: Executor,
    budget: float,
    on_progress: OnCountProgress | None = None,
    *,
    keys: Sequence[str] = (),
    split: bool = False,
    axes: Mapping[str, Sequence[float]] | None = None,
    threads: int | None = None,
    notify: Callable[[str], None] | None = None,
    is_stored: bool = True,
) -> Certificate:
    """Count, find tolerances of `keys`, split, and map over `axes`, in a folder that `open_folder` has accepted.

    notify    : called with a few words as each part begins
    is_stored : True if the folder stays
    """
    began = time.monotonic()
    where = str(folder / "scenario.toml") if is_stored else campaign.scenario.name

    def left(share: float = 1.0) -> float:
        return share * (budget if campaign.flights else max(0.0, budget - (time.monotonic() - began)))

    with FlightStore(folder) as store:
        store.begin(program_versions())
        remove_unfinished(folder)
        write_toml_file(folder / "scenario.toml", {formats.KEY: formats.FORMAT, **campaign.scenario.document})
        flyer = CampaignFlyer(campaign, store, executor, note=notify)
        try:
            # Counting first, with its share: splitting and tolerances start from its flights.
            part = COUNT_BUDGET_SHARE if keys or split or axes else 1.0
            counted = count_events(flyer if campaign.flights else flyer.with_budget(budget * part), on_progress)
            rare: Mapping[str, Any] = {}
            tolerances: Mapping[str, Any] = {}
            if split:
                from airflock.certificates.splitting import estimate_by_splitting as splitting

                rare = splitting(flyer.with_budget(left(0.5 if keys else 1.0)), counted, threads, where)
            if keys:
                from airflock.certificates.tolerance import find_tolerances

                tolerances = find_tolerances(flyer.with_budget(left(0.5 if axes else 1.0)), counted, keys)
            cells = map_bounds(flyer.with_budget(left()), axes) if axes else {}
        except KeyboardInterrupt as stop:
            done = f"interrupted: {store.count('count'):,} flights"
            if is_stored:
                raise Interrupted(f"{done} are stored in {folder}; continue with --resume") from stop
            raise Interrupted(f"{done} are not kept; with --out (in Python: folder=) they are, for --resume") from stop
    return Certificate(
        campaign, tuple(counted.verdicts), event_timings(campaign, counted), counted.rows, program_versions(),
        time.monotonic() - began, counted.rate, tolerances, rare, cells, where,
    )  # fmt: skip


def event_timings(campaign: Campaign, counted: CountResult) -> dict[int, EventTiming]:
    """Return the timing of events over a flight for each limit whose event has a moment."""
    found = {}
    timed = [i for i, limit in enumerate(campaign.limits) if limit.is_timed]
    for place, i in enumerate(timed):
        times = [row["first"][place] for row in counted.rows if row.get("first") and row["first"][place] is not None]
        found[i] = event_timing(times, len(counted.rows), campaign.scenario.flight.duration)
    return found


TRIAL = 16  # flights by which the time of one flight is measured


@contextmanager
def flight_folder(folder: str | os.PathLike[str] | None) -> Iterator[Path]:
    """Yield the folder of flights: the given one, or a temporary one."""
    if folder is not None:
        yield expand_path(folder)
        return
    with tempfile.TemporaryDirectory(prefix="airflock-certify-") as made:
        yield Path(made)


def campaign_executor(
    campaign: Campaign, scheduler: str | None = None, threads: int | None = None, timeout: float | None = None
) -> Executor:
    """Make the executor of a campaign: threads of this process, or the workers of a dask scheduler."""
    if scheduler is not None:
        task = CampaignTask(campaign.scenario, campaign.limits, campaign.bits)
        return DaskCluster([task], scheduler, timeout=timeout)
    from airflock.engine import compile_for
    from airflock.scenarios import uses_all_cores
    from airflock.support import available_cores

    score = limit_score_function(campaign.flown, campaign.limits, campaign.bits, campaign.device)
    if campaign.device != "cpu":
        return ThreadExecutor(score, 1)
    compile_for(campaign.flown, precision=campaign.bits)
    return ThreadExecutor(score, 1 if uses_all_cores(campaign.flown) else threads or available_cores())


def with_planned_flights(campaign: Campaign, executor: Executor, budget: float, folder: Path, resume: bool) -> Campaign:
    """Return the campaign with a number of flights if a limit has no rate: as many as the budget allows.

    A few flights on seeds of their own measure how long one takes; the number is fixed before the first one counts.
    """
    if campaign.flights is not None or all(limit.rate is not None for limit in campaign.limits):
        return campaign
    if resume and (folder / f"{CAMPAIGN_KIND}.toml").is_file():
        known = read_toml_file(folder / f"{CAMPAIGN_KIND}.toml").get("flights")
        return replace(campaign, flights=known if isinstance(known, int) else None)
    began = time.monotonic()
    # Seeds of their own, far behind those of tolerances: a flight that chose the number must not
    # count.
    own = [certificate_seed(campaign.hash, TOLERANCE_PURPOSE, (1 << 29) + i) for i in range(TRIAL)]
    for landed in executor.fly([Flight(0, i, campaign.parameters(s), s) for i, s in enumerate(own)]):
        if landed.values is None:
            raise StudyError(f"{campaign.scenario.name}: seed {landed.flight.seed}: {landed.reason}")
    able = 0.9 * budget * TRIAL / max(time.monotonic() - began, 1e-6)
    # Two digits: a round number shows that the count did not choose it. A tenth of the time is kept
    # as a margin.
    digits = 10.0 ** max(0, math.floor(math.log10(max(able, 1.0))) - 1)
    return replace(campaign, flights=max(1, min(int(able / digits) * int(digits), (1 << 30) - 1)))
