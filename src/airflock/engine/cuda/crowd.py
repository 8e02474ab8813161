"""Crowd: one big flock on a GPU, step by step; its order parameters are measured by the CPU's driver at each sample."""

import math
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import initial_values
from airflock.engine.cpu import DriverResult
from airflock.engine.cuda.cells import COMMON_ARGUMENTS, NEIGHBOUR_COLUMNS, large_flock_text, private_columns
from airflock.engine.cuda.launch import configure_kernel
from airflock.engine.cuda.memory import MAX_MEMORY_SHARE, memory_message
from airflock.engine.measuring import score_tables
from airflock.engine.passes.build import sampled_columns
from airflock.engine.passes.flock import flock_rules
from airflock.engine.plan import Plan
from airflock.engine.store import load_driver
from airflock.engine.tables import WorldTables, world_tables
from airflock.engine.totals import combine_sums
from airflock.scenarios import FORMATIONS, Scenario, step_counts
from airflock.support import DeviceError, cuda_runtime, free_gpu_memory, is_simulated, require_gpu

CELLS = 4  # at most so many cells per agent, as on the CPU
PAIRED = 20_000  # agents from which order parameters that look at all pairs are refused


@cache
def large_flock_driver(plan: Plan, simulated: bool) -> ModuleType:
    """Driver of one big flock."""
    return load_driver(large_flock_text(plan, simulated), f"{plan.model.name}_crowd")


def cell_plan_error(plan: Plan, agents: int) -> str | None:
    """Why a plan cannot be flown by cells on a GPU; None if it can."""
    if not plan.grid:
        return "cells need at least 1000 agents, a model of finite reach and perception without noise or delay"
    if plan.columns:
        return "one big flock with groups flies on cpu"
    if plan.faults or plan.absence:
        return "one big flock with faults, or whose agents leave, flies on cpu"
    if plan.topology is not None:
        return f"one big flock with topology.kind = {plan.topology.name} flies on cpu"
    if flock_rules(plan):
        return f"{plan.model.name} or its order parameters solve for the whole flock"
    if plan.start in FORMATIONS and not plan.given_start:
        return f"one big flock starts at random or given places, not in start.kind = {plan.start}"
    if plan.dryden:
        return "one big flock in Dryden turbulence flies on cpu"
    if plan.body.Memory is not None:
        return f"a body that remembers ({plan.body.name}) flies on cpu in one big flock"
    if plan.goals or plan.own or plan.scene or plan.stop:
        return "one big flock with goals, in a scene, or up to its first collision flies on cpu"
    if any(metric.clock == "collision" for metric in plan.metrics):
        return "one big flock is not watched for collisions on a GPU; choose metrics.kind = order, or device = cpu"
    if agents > PAIRED and any(metric.pair or metric.cluster for metric in plan.metrics):
        return f"order parameters of pairs take too long for {agents} agents; choose metrics.kind = order"
    return None


def cell_grid(scenario: Scenario, plan: Plan, tables: WorldTables) -> tuple[list[float], list[float], list[int]]:
    """Lower corner and size of the cells (m), and their number, per axis. Who is outside is in the nearest cell."""
    row = dict(zip([f"{k}.{f}" for k, fields in plan.records.items() for f in fields], tables.row, strict=True))
    assert scenario.model.reach is not None
    near = min(float(scenario.model.reach(scenario.parameters)), float(scenario.radio.range), 1e8)
    half = [float(row[f"w.half_{a}"]) if a in plan.axes else 0.0 for a in "xyz"]
    if not plan.periodic:  # an arena without walls has no size: where the agents start is as good a box as any
        half = [h if 0.0 < h < 1e7 else float(row[f"w.extent_{a}"]) for h, a in zip(half, "xyz", strict=True)]
    width = [2.0 * h for h in half]
    volume = math.prod(max(w / near, 1.0) for w in width)
    side = near * max(1.0, (volume / (CELLS * scenario.agents)) ** (1.0 / plan.dimensions))
    count = [max(1, int(w / side)) for w in width]
    size = [w / c if w > 0.0 else 1.0 for w, c in zip(width, count, strict=True)]
    return [-h for h in half], size, count


def memory_error(scenario: Scenario, plan: Plan) -> str | None:
    """Why a flock does not fit into the GPU's free memory: what it needs and how many agents fit; None if it does."""
    each = (
        2 * (NEIGHBOUR_COLUMNS + private_columns(plan)) * plan.bits // 8 + 12
    )  # two copies of the tables; cell, rank, number
    each += 8 * CELLS  # at most so many cells, each with a count and a first agent
    room = int(MAX_MEMORY_SHARE * free_gpu_memory())
    n = scenario.agents
    return None if n * each <= room else memory_message(n, n * each, room, room // each)


class LargeFlock:
    """One big flock in the GPU's memory.

    Its tables are in the order of the cells of the last decision: near (agent, 8) holds x y z number vx vy vz nothing,
    rest (agent, columns) command and memory of the model.
    """

    def __init__(self, scenario: Scenario, plan: Plan, seed: int = 0, start: Any = None):
        require_gpu(is_simulated())
        self.plan = plan.built(grid=True)
        self.scenario, self.agents, self.step = scenario, scenario.agents, 0
        fault = cell_plan_error(self.plan, self.agents)
        if fault is not None:
            raise DeviceError(f"device = cuda: {fault}")
        if scenario.separation() > 0.0 and start is None:
            raise DeviceError("device = cuda: one big flock starts at random places; set start.separation = 0")
        self.tables: WorldTables = world_tables(scenario, self.plan, seed)
        self.times = step_counts(scenario)
        self.driver = large_flock_driver(self.plan, is_simulated())
        self._allocate()
        self._begin(start)

    def _allocate(self) -> None:
        """All tables."""
        cuda, real, n = cuda_runtime(), self.tables.row.dtype, self.agents
        low, size, count = cell_grid(self.scenario, self.plan, self.tables)
        cells = int(np.prod(count))
        fault = None if is_simulated() else memory_error(self.scenario, self.plan)
        if fault is not None:
            raise DeviceError(f"device = cuda: {fault}")
        t = self.tables
        shapes = t.shapes if len(t.shapes) else np.zeros((1, 16), real)
        whole = [t.faces, t.edges, t.spans, shapes, t.nodes.reshape(-1, 6), t.links.reshape(-1, 3)]
        arrays = [t.row, t.whole, *(a if len(a) else np.zeros((1, a.shape[1]), a.dtype) for a in whole[:3]), *whole[3:]]
        given = [*arrays, np.array([*low, *size], real), np.array(count, np.int32)]
        self.common = [cuda.to_device(np.ascontiguousarray(array)) for array in given]
        assert len(self.common) == len(COMMON_ARGUMENTS)
        self.near, self.sorted = (cuda.to_device(np.zeros((n, NEIGHBOUR_COLUMNS), real)) for _ in range(2))
        self.rest, self.rest_sorted = (cuda.to_device(np.zeros((n, self.driver.REST), real)) for _ in range(2))
        self.cell, self.rank, self.listed = (cuda.to_device(np.zeros(n, np.int32)) for _ in range(3))
        self.counts = cuda.to_device(np.zeros(cells, np.int32))
        self.starts = cuda.to_device(np.zeros(cells + 1, np.uint32))
        self.blocks = -(-cells // self.driver.SCAN)
        self.sums = cuda.to_device(np.zeros(self.blocks, np.int32))

    def _begin(self, start: Any) -> None:
        """Agents at random places, or at given ones: (component, agent)."""
        dims = self.plan.dimensions
        if start is None:
            configure_kernel(self.driver.begin, *self._grid(self.agents))(self.near, self.rest, *self.common)
            return
        near = np.zeros((self.agents, NEIGHBOUR_COLUMNS), self.tables.row.dtype)
        near[:, :dims], near[:, 4 : 4 + dims] = np.asarray(start)[:dims].T, np.asarray(start)[dims:].T
        near[:, 3] = np.arange(self.agents)
        rest = np.zeros((self.agents, self.driver.REST), near.dtype)
        for c, value in enumerate(initial_values(self.plan.model.Memory)):
            rest[:, 3 + c] = value
        self.near, self.rest = cuda_runtime().to_device(near), cuda_runtime().to_device(rest)

    def _grid(self, work: int) -> tuple[int, int]:
        """Blocks and threads for this many threads."""
        return -(-work // self.driver.THREADS), int(self.driver.THREADS)

    def advance(self, steps: int = 1) -> None:
        """Fly this many motion steps; returns while the GPU may still be at work."""
        each, scan = self._grid(self.agents), (self.blocks, int(self.driver.SCAN))
        most = self._grid(max(self.agents, len(self.counts)))
        count, within, before, list_, copy, move = (
            configure_kernel(getattr(self.driver, name), *grid)
            for name, grid in (("count_agents", each), ("sum_within", scan), ("sum_before", scan),
                               ("list_agents", most), ("copy_agents", each), ("advance", each))
        )  # fmt: skip
        for _ in range(steps):
            meet = self.step % self.times["decide_every"] == 0
            if meet:
                count(self.near, self.common[-2], self.common[-1], self.counts, self.cell, self.rank)
                within(self.counts, self.starts, self.sums)
                before(self.counts, self.starts, self.sums)
                list_(self.near, self.cell, self.rank, self.starts, self.counts, self.listed)
                copy(self.near, self.rest, self.cell, self.starts, self.listed, self.sorted, self.rest_sorted)
            state = (self.near, self.rest, self.sorted, self.rest_sorted, self.starts)
            move(*state, np.int32(meet), np.int32(self.step), *self.common)
            self.step += 1

    def state(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """(component, agent) position and velocity; and the commands, agents in the order of their numbers."""
        near, rest, dims = self.near.copy_to_host(), self.rest.copy_to_host(), self.plan.dimensions
        order = np.argsort(near[:, 3])
        parts = [near[order, :dims].T, near[order, 4 : 4 + dims].T]
        return np.concatenate(parts), rest[order, :dims].T

    def neighbours(self, sample: int = 200) -> float:
        """Mean number of others within the reach of an agent, over some of them."""
        assert self.scenario.model.reach is not None
        reach, dims = float(self.scenario.model.reach(self.scenario.parameters)), self.plan.dimensions
        places, _ = self.state()
        x, half = places[:dims].T.astype(float), np.array(self.common[-2].copy_to_host()[:dims], float)
        found = []
        for i in range(0, self.agents, max(1, self.agents // sample)):
            d = x - x[i]
            d -= 2.0 * np.abs(half) * np.round(d / (2.0 * np.abs(half))) if self.plan.periodic else 0.0
            found.append(float((np.einsum("ij,ij->i", d, d) < reach * reach).sum() - 1))
        return float(np.mean(found))


def fly_large_flock(scenario: Scenario, plan: Plan, seed: int, start: Any = None) -> DriverResult:
    """Fly one big flock and measure it at each sample."""
    flock = LargeFlock(scenario, plan, seed, start)
    every, steps = flock.times["sample_every"], flock.times["steps"]
    once = plan.built(grid=True, keep_frames=False)
    table = flock.tables.changed(sample_every=1)
    frames, series = [], []
    places = flock.state()[0]
    for step in range(0, steps + 1, every):
        flock.advance(step - flock.step)
        places = flock.state()[0]
        series.append(score_tables(once, table, places[None])[1][0])
        if plan.record:  # the command of this instant is decided by the step that follows
            flock.advance()
            frames.append(np.concatenate([places, flock.state()[1]]))
    if flock.step < steps:
        flock.advance(steps - flock.step)
        places = flock.state()[0]
    status = min(0, int(flock.near.copy_to_host()[:, 3].min()))
    kept = np.stack(frames) if plan.record else None
    return DriverResult(combine_sums(plan, _sums(plan, np.array(series))), kept, places, status)


def _sums(plan: Plan, series: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over time as a driver keeps them, from the values of every sample."""
    found = []
    for c, (_, how, _) in enumerate(sampled_columns(plan.metrics)):
        found.append({"min": np.min, "max": np.max}.get(how, np.sum)(series[:, c]))
    return np.array([*found, float(len(series)), 0.0])
