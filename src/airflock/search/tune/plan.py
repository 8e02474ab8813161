"""Plan: how a budget of time is shared between searching, hardening and certifying; written once, then kept."""

from dataclasses import asdict, dataclass, field
from typing import Any

from airflock import __version__
from airflock.support import StudyError

SEARCH, HARDEN, CERTIFY_SHARE = 0.45, 0.15, 0.4  # shares of the budget
TRIED = 15  # rounds of flights that hardening is planned with; all whole and half steps and fresh seeds would be 19
POPULATION = 24  # reaches a good set in less time than 100 do: small flocks' flights are few
LEAST = 6  # generations
FLIGHTS = 2  # of a candidate: from two on, chance can be told from merit
AVERAGES = 2  # of the last means of the search, which also fly in its final
USUAL = 100  # flights of a finalist
DEFAULT_CONFIDENCE = 0.95


@dataclass(frozen=True)
class BudgetPlan:
    """Numbers of flights of each stage.

    search : keys of the table [search]; seeds: flights of each step of hardening; seconds: of certifying
    rate   : flights per second that the plan was made with
    limits, confidence : what is to be shown; goes on with these unless others are given
    """

    search: dict[str, Any]
    seeds: int
    seconds: float
    rate: float
    limits: list[str] = field(default_factory=list)
    confidence: float = DEFAULT_CONFIDENCE

    def document(self) -> dict[str, Any]:
        """The plan as plain values."""
        return {"airflock": __version__, **asdict(self)}


def make_plan(budget: float, rate: float, *, warm: bool = False, flights_for_limits: int = USUAL) -> BudgetPlan:
    """A plan for a budget (s) at a rate (flights per second), searching from the start's own numbers if `warm`.

    telling : flights that tell whether the rarest limit is kept: at most so many for each finalist and each step
    StudyError where nothing sensible fits into it.
    """
    flights = budget * SEARCH * rate
    finals = flights / 4.0
    top = 4
    final_seeds = int(min(max(finals / (2.0 * (top + AVERAGES + 2)), 8), max(flights_for_limits, USUAL)))
    pool = int(min(max(finals / 16.0, 2 * top), 100))
    spent = 8 * pool + (top + AVERAGES + 2) * final_seeds
    generations = int((flights - spent) / (POPULATION * FLIGHTS))
    seeds = int(min(budget * HARDEN * rate / TRIED, max(flights_for_limits, 2 * USUAL)))
    if generations < LEAST or seeds < 10:
        flown = max((LEAST * POPULATION * FLIGHTS + spent) / SEARCH, 10 * TRIED / HARDEN)
        raise StudyError(
            f"the budget of {budget:g} s is too small: one flight takes {1.0 / rate:.2g} s here; give at least "
            f"{1.1 * flown / rate:.2g} s, or shorten the flights with --duration"
        )
    search: dict[str, Any] = {
        "population": POPULATION, "generations": generations, "seeds": FLIGHTS, "pool": pool, "top": top,
        "averages": AVERAGES, "final_seeds": final_seeds,
    }  # fmt: skip
    if warm:
        search["start"] = "scenario"
    return BudgetPlan(search, seeds, budget * CERTIFY_SHARE, rate)
