"""Who flies the flights of a certificate, where they are kept, and how many there is time for."""

import math
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from airflock.certificates.campaign import CAMPAIGN_KIND, Campaign
from airflock.certificates.flights import CampaignTask, limit_score_function
from airflock.certificates.seeds import TOLERANCE_PURPOSE, certificate_seed
from airflock.runs import DaskCluster, Executor, Flight, ThreadExecutor, read_toml_file
from airflock.support import StudyError, expand_path

TRIAL = 16  # flights that tell how many there is time for


@contextmanager
def flight_folder(folder: str | os.PathLike[str] | None) -> Iterator[Path]:
    """The folder of flights: the one that is given, or one that is gone afterwards."""
    if folder is not None:
        yield expand_path(folder)
        return
    with tempfile.TemporaryDirectory(prefix="airflock-certify-") as made:
        yield Path(made)


def campaign_executor(
    campaign: Campaign, scheduler: str | None = None, threads: int | None = None, timeout: float | None = None
) -> Executor:
    """Who flies: this process, or the workers of a dask scheduler."""
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
    """The campaign with a number of flights where a limit has no rate: as many as there is time for.

    A few flights on seeds of their own tell how long one takes; the number then stands before the first one counts.
    """
    if campaign.flights is not None or all(limit.rate is not None for limit in campaign.limits):
        return campaign
    if resume and (folder / f"{CAMPAIGN_KIND}.toml").is_file():
        known = read_toml_file(folder / f"{CAMPAIGN_KIND}.toml").get("flights")
        return replace(campaign, flights=known if isinstance(known, int) else None)
    began = time.monotonic()
    own = [certificate_seed(campaign.hash, TOLERANCE_PURPOSE, (1 << 29) + i) for i in range(TRIAL)]
    for landed in executor.fly([Flight(0, i, campaign.parameters(s), s) for i, s in enumerate(own)]):
        if landed.values is None:
            raise StudyError(f"{campaign.scenario.name}: seed {landed.flight.seed}: {landed.reason}")
    able = 0.9 * budget * TRIAL / max(time.monotonic() - began, 1e-6)
    digits = 10.0 ** max(0, math.floor(math.log10(max(able, 1.0))) - 1)
    return replace(campaign, flights=max(1, min(int(able / digits) * int(digits), (1 << 30) - 1)))
