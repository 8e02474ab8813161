"""Who flies the flights of a certificate, where they are kept, and how many there is time for."""

import math
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from airflock.certificates.campaign import FOLDER, Campaign
from airflock.certificates.flights import CampaignTask, score_of
from airflock.certificates.seeds import TOLERANCE, seed
from airflock.runs.executors import Executor, Flight
from airflock.runs.executors.cluster import Cluster
from airflock.runs.executors.in_process import InProcess
from airflock.runs.folder import read
from airflock.support.errors import StudyError
from airflock.support.untrusted import own_path

TRIAL = 16  # flights that tell how many there is time for


@contextmanager
def folder_of(folder: str | os.PathLike[str] | None) -> Iterator[Path]:
    """The folder of flights: the one that is given, or one that is gone afterwards."""
    if folder is not None:
        yield own_path(folder)
        return
    with tempfile.TemporaryDirectory(prefix="airflock-certify-") as made:
        yield Path(made)


def executor_for(
    campaign: Campaign, scheduler: str | None = None, threads: int | None = None, timeout: float | None = None
) -> Executor:
    """Who flies: this process, or the workers of a dask scheduler."""
    if scheduler is not None:
        task = CampaignTask(campaign.scenario, campaign.limits, campaign.precision)
        return Cluster([task], scheduler, timeout=timeout)
    from airflock.engine import compile_for
    from airflock.scenarios.cells import takes_all_cores
    from airflock.support.threads import cores

    score = score_of(campaign.flown, campaign.limits, campaign.precision, campaign.device)
    if campaign.device != "cpu":
        return InProcess(score, 1)
    compile_for(campaign.flown, precision=campaign.precision)
    return InProcess(score, 1 if takes_all_cores(campaign.flown) else threads or cores())


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
    own = [seed(campaign.hash, TOLERANCE, (1 << 29) + i) for i in range(TRIAL)]
    for landed in executor.fly([Flight(0, i, campaign.parameters(s), s) for i, s in enumerate(own)]):
        if landed.values is None:
            raise StudyError(f"{campaign.scenario.name}: seed {landed.flight.seed}: {landed.reason}")
    able = 0.9 * budget * TRIAL / max(time.monotonic() - began, 1e-6)
    digits = 10.0 ** max(0, math.floor(math.log10(max(able, 1.0))) - 1)
    return replace(campaign, flights=max(1, min(int(able / digits) * int(digits), (1 << 30) - 1)))
