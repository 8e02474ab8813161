"""Race: from thousands of candidates that flew once to the few that are worth a hundred flights.

One flight a candidate says little where chance moves fitness by more than candidates differ. First a candidate is
judged by the mean over its neighbours in the space, then the best of them fly in rounds, ever fewer with ever more
seeds (successive halving, Jamieson & Talwalkar 2016).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.runs import CandidateBatch
from airflock.search.evaluator import Evaluator
from airflock.search.fitness import candidate_losses as losses_of
from airflock.search.safe import batch_excess, rank_by_excess

NEIGHBOURS = 10
RACE_ROUNDS = ((1.0, 4), (0.25, 16))  # share of the pool that flies, and with how many seeds
UPPER = 0.2  # share of all candidates whose spread tells what near means


def smoothed_losses(points: NDArray[np.float64], losses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean loss (candidate,) over each candidate's nearest neighbours and itself; points (candidate, axis)."""
    good = points[np.argsort(losses, kind="stable")[: max(2, int(UPPER * len(points)))]]
    scale = np.maximum(good.std(axis=0), 1e-9)
    tree = cKDTree(points / scale)
    _, near = tree.query(points / scale, k=min(NEIGHBOURS, len(points)))
    return np.asarray(losses[np.asarray(near).reshape(len(points), -1)].mean(axis=1))


def race_candidates(
    evaluator: Evaluator, points: NDArray[np.float64], losses: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Indices of the candidates that win, the best first, at most `search.top`.

    points : (candidate, axis) of all candidates that did not fail
    losses : (candidate,), less is better; who broke limits comes after all others
    """
    study = evaluator.study
    pool, top = study.whole("pool"), study.whole("top")
    alive = np.argsort(smoothed_losses(points, losses), kind="stable")[:pool]
    number = 0
    for k, (share, seeds) in enumerate(RACE_ROUNDS):
        alive = alive[: max(top, round(share * pool))]
        numbers = [[study.seed(4, number + j) for j in range(seeds)]] * len(alive)
        number += seeds
        batch = CandidateBatch("race", 0, k)
        found = losses_of(evaluator.evaluate(batch, points[alive], seeds=numbers), study.objectives)
        if study.limits:
            found = rank_by_excess(found, batch_excess(study, evaluator.store, batch))
        alive = alive[np.argsort(found[:, 0], kind="stable")]
    return alive[:top]
