"""A publication that can be recomputed: its parts, and what flies them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from airflock.support import AirflockError
from airflock_papers.claims import Claim, Measured, judge, unmeasured
from airflock_papers.flights import Flights
from airflock_papers.progress import Progress, progress_bar
from airflock_papers.statements import load

Flown = tuple[list[Measured], dict[str, Any]]  # measurements, and by part what is behind them
Found = tuple[list[Claim], dict[str, Any]]  # claims, and by part what is behind them


@dataclass(frozen=True)
class Paper:
    """A publication.

    title   : as printed, with its authors
    package : where its statements.toml lies, airflock_papers.NAME
    parts   : what is flown when no part is asked for by name
    fly     : called with the parts wanted and how to fly
    long    : parts of hours, flown only when asked for by name
    """

    title: str
    package: str
    parts: tuple[str, ...]
    fly: Callable[[Sequence[str], Flights], Flown]
    long: tuple[str, ...] = ()

    def run(
        self,
        only: str | None = None,
        quick: bool = False,
        seeds: int | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> list[Claim]:
        """Recompute the paper's numbers.

        only    : one part; quick : few seeds and coarse maps; seeds : flights per number instead of the paper's
        threads : flights side by side; progress : called with (title, flights done, flights in all), else a bar
        """
        return self.recompute(only, quick, seeds, threads, progress)[0]

    def recompute(
        self,
        only: str | None = None,
        quick: bool = False,
        seeds: int | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Found:
        """Claims as of `run`, and by part what is behind them; of all parts also the sentences that nothing tests."""
        known = (*self.long, *self.parts)
        if only is not None and only not in known:
            raise AirflockError(f"only = {only!r}: unknown part; known: {', '.join(known)}")
        statements = load(self.package)  # a fault in it is told before anything flies
        if progress is None:
            with progress_bar() as bar:
                return self.recompute(only, quick, seeds, threads, bar)
        flights = Flights(quick=quick, seeds=seeds, threads=threads, progress=progress)
        measured, flown = self.fly((only,) if only else self.parts, flights)
        return judge(statements, measured) + ([] if only else unmeasured(statements)), flown


def by_modules(modules: dict[str, Any]) -> Callable[[Sequence[str], Flights], Flown]:
    """Fly a paper whose parts are modules with `fly(flights)` and `measured(data)`."""

    def fly(wanted: Sequence[str], flights: Flights) -> Flown:
        found: list[Measured] = []
        flown: dict[str, Any] = {}
        for part in wanted:
            flown[part] = modules[part].fly(flights)
            found += modules[part].measured(flown[part])
        return found, flown

    return fly
