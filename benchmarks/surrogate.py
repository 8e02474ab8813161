"""lq-CMA-ES for flights: how well a linear-quadratic model of past flights ranks candidates of the next generation.

python benchmarks/surrogate.py STUDY                # the folder of a search by CMA-ES; Kendall's tau by generation
python benchmarks/surrogate.py STUDY --fly 60       # and so many fresh flights of each candidate of some generations

lq-CMA-ES (Hansen 2019; `cma.fitness_models` of pycma) flies a part of each generation, takes the rest from the model
where Kendall's tau between model and flights is at least 0.85, and flies all where it is not. Columns of the table:
tau between the model of all earlier generations and the flights of this one; tau between the means of one half of each
candidate's flights and of the other, which even the truth would hardly exceed; which share pycma's own rule would have
flown, and tau between its values and all flights. With --fly, the model and the flights that the search ranked by are
set against the mean of fresh flights. `LqCMAES` is that search, for `time_to_target.py`.
"""

import argparse
import warnings
from pathlib import Path

import numpy as np
from cma.fitness_models import LQModel, SurrogatePopulation, kendall_tau

from airflock.engine import score_flights
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import read_request
from airflock.runs.search_space import with_parameters
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search.optimisers import CMAES
from airflock.search.study import read_space
from airflock.support import ErrorCollector

TOLD = (2, 5, 10, 20, 30, 40, 50, 60, 71)  # generations
FIRST = 3_200_000_000  # seeds of fresh flights
AROUND = 3  # generations on each side whose taus are averaged


class LqCMAES(CMAES):
    """CMA-ES whose generations are asked for part by part, until the model ranks what was flown as the flights do.

    The rule of `SurrogatePopulation`, which calls a function, as ask and tell.
    """

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.surrogate = SurrogatePopulation(None)
        self.points, self.part, self.generations = [], [], 0

    def ask(self):
        """The next part (candidate, axis) of a generation."""
        model, rules = self.surrogate.model, self.surrogate.settings
        if not self.points:
            self.points = self.strategy.ask()
            model.settings.max_absolute_size = max(model.settings.max_absolute_size, len(self.points))
            self.flown = np.full(len(self.points), np.nan)
            least = max(
                len(self.points) * rules.min_evals_percent / 100, 3 / model.settings.truncation_ratio - model.size
            )
            self.number = int(1 + least)
        order = np.argsort([model.eval(x) for x in self.points]) if model.size > 1 else range(len(self.points))
        left = [int(i) for i in order if np.isnan(self.flown[i])]
        self.part = left[: min(self.number, len(self.points)) - int(np.isfinite(self.flown).sum())]
        return np.array([self.points[i] for i in self.part])

    def tell(self, points, losses):
        """Losses (candidate, 1) of that part; where model and flights agree, the generation is over."""
        model, rules = self.surrogate.model, self.surrogate.settings
        for i, loss in zip(self.part, losses[:, 0], strict=True):
            self.flown[i] = loss
            model.add_data_row(self.points[i], loss)
        model.sort(self.number)
        count = int(np.isfinite(self.flown).sum())
        tau = model.kendall(rules.n_for_tau(len(self.points), count))
        if tau < rules.tau_truth_threshold and count < len(self.points):
            self.number += int(np.ceil(self.number / 2))
            return
        model.sort(count)
        model.adapt_max_relative_size(tau)
        values = self.flown
        if count < len(self.points):
            values = np.array([model.eval(x) for x in self.points])
            values += np.nanmin(self.flown) - values.min()
        self.strategy.tell(self.points, values.tolist())
        self.points, self.generations = [], self.generations + 1


def generations(folder):
    """Points (candidate, axis) and losses (candidate, repeat) of each generation."""
    found = []
    with FlightStore(folder, write=False) as store:
        while points := store.asked(CandidateBatch("search", 0, len(found))):
            rows = store.flown(CandidateBatch("search", 0, len(found)))
            repeats = 1 + max(repeat for _, repeat in rows)
            losses = [[-rows[i, r]["fitness"] for r in range(repeats)] for i in range(len(points))]
            found.append((np.array(points), np.array(losses)))
    return found


def guessed(known):
    """What the model of all earlier generations says of each candidate (generation, candidate); nan: nothing."""
    model, found = LQModel(max_absolute_size=len(known[0][0])), []
    for points, losses in known:
        ready = model.size > points.shape[1]
        found.append([model.eval(x) if ready else np.nan for x in points])
        for x, loss in zip(points, losses.mean(axis=1), strict=True):
            model.add_data_row(x, loss)
        model.sort(len(points))
    return np.array(found)


def replayed(known):
    """(generation, 2): share of candidates that pycma's rule would have flown, tau of its values and all flights."""
    stored = {
        point.tobytes(): loss
        for points, losses in known
        for point, loss in zip(points, losses.mean(axis=1), strict=True)
    }
    surrogate, found = SurrogatePopulation(lambda x: stored[x.tobytes()]), []
    for points, losses in known:
        values = surrogate(list(points))
        found.append((surrogate.evals.evaluation_fraction, kendall_tau(values, losses.mean(axis=1))))
    return np.array(found)


def halves(losses):
    """Kendall's tau between the means of two halves of the flights of each candidate; nan where each flew once."""
    half = losses.shape[1] // 2
    return kendall_tau(losses[:, :half].mean(axis=1), losses[:, half:].mean(axis=1)) if half else np.nan


def flown(folder, points, flights):
    """Mean loss of fresh flights of candidates at these points."""
    scenario = build_scenario(read_request(folder, "study")["scenario"], str(folder))
    space = read_space(read_request(folder, "study")["space"], scenario, ErrorCollector())
    candidates = [with_parameters(scenario, space.parameters(point)) for point in points]
    seeds = [FIRST + i for i in range(flights)]
    rows = score_flights([s for s in candidates for _ in seeds], seeds * len(candidates), threads=1)
    return -np.array([row["fitness"] for row in rows]).reshape(len(candidates), -1).mean(axis=1)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fly", type=int, default=0, metavar="FLIGHTS", help="fresh flights of each candidate")
    parser.add_argument("--of", type=int, nargs="*", default=list(TOLD), metavar="GENERATION")
    asked = parser.parse_args()
    warnings.filterwarnings("ignore", module="cma")
    known = generations(asked.folder)
    guess = guessed(known)
    flew = [losses.mean(axis=1) for _, losses in known]
    model = np.array(
        [kendall_tau(*pair) if np.isfinite(pair[0]).all() else np.nan for pair in zip(guess, flew, strict=True)]
    )
    half = np.array([halves(losses) for _, losses in known])
    share, rule = replayed(known).T
    print(
        "| generation | flights of a candidate | model and flights | halves | flown by its rule | its values |", end=""
    )
    print(" model and truth | flights and truth |" if asked.fly else "")
    print("|---|---|---|---|---|---|" + ("---|---|" if asked.fly else ""))
    for number in (number for number in asked.of if number < len(known)):
        near = slice(max(0, number - AROUND), number + AROUND + 1)
        line = f"| {number} | {known[number][1].shape[1]} | {mean_of(model[near])} | {mean_of(half[near])} |"
        line += f" {100.0 * share[near].mean():.0f} % | {mean_of(rule[near])} |"
        if asked.fly:
            truth = flown(asked.folder, known[number][0], asked.fly)
            line += f" {kendall_tau(truth, guess[number]):.2f} | {kendall_tau(truth, flew[number]):.2f} |"
        print(line, flush=True)
    print(
        f"\ntau of at least 0.85 between model and flights: {np.sum(model >= 0.85)} of {len(known)} generations; ",
        end="",
    )
    print(f"flown by its rule: {100.0 * share.mean():.0f} % of candidates")


def mean_of(values):
    """The mean of those that are known, as text."""
    return f"{np.nanmean(values):.2f}" if np.isfinite(values).any() else ""


if __name__ == "__main__":
    main()
