"""Totals: what a flight's sums over time say, as named order parameters."""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.passes.build import sampled_columns
from airflock.engine.plan import Plan
from airflock.engine.stages.words import REDUCTION_START, ZERO


def initial_sums(plan: Plan) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values of an instant and sums over time at their start; the sums end with the counts of both clocks."""
    found = [float(REDUCTION_START.get(how, ZERO)) for _, how, _ in sampled_columns(plan.metrics)]
    return np.zeros(len(found)), np.array([*found, 0.0, 0.0])


def combine_sums(plan: Plan, sums: NDArray[np.float64]) -> dict[str, float]:
    """Named order parameters from the sums over time, which end with the counts of both clocks; more may follow."""
    found = _columns(plan)
    totals: list[float] = sums.tolist()  # numbers of Python's are divided in a fifth of the time
    samples, looks = totals[len(found) : len(found) + 2]
    counts = {"sample": max(samples, 1.0), "collision": max(looks, 1.0)}
    over_time = {
        name: total / counts[when] if how == "mean" else total
        for total, (name, how, when) in zip(totals, found, strict=False)
    }
    named: dict[str, float] = {}
    for metric in plan.metrics:
        own = {name: over_time[name] for name in metric.Sample._fields}
        named |= metric.total(own) if metric.total else own
    return named


@lru_cache(maxsize=64)
def _columns(plan: Plan) -> list[tuple[str, str, str]]:
    return sampled_columns(plan.metrics)


def goal_times(plan: Plan, reached: NDArray[Any]) -> dict[str, Any]:
    """When each goal was reached, s (nan: never), and how many were."""
    if not plan.goals:
        return {}
    times = [float(t) if t >= 0.0 else math.nan for t in reached]
    return {"goals_reached": float(sum(t == t for t in times)), "goals": float(len(times)), "time_to_goal": times}
