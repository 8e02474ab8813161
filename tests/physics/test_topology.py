"""Topologies against brute force and scipy: who is met, at ties and on edges, behind bodies and buildings, in boxes."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial import Delaunay, Voronoi, cKDTree

from airflock.core.agent import HeardNeighbour, met_neighbours
from airflock.core.contract import State
from airflock.parts import TOPOLOGIES
from airflock.parts.topologies.parameters import Parameters
from airflock.parts.topologies.ranking import HEARD_LIMIT, kth_least
from airflock.parts.topologies.strongest import loss

HERE = State(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
SEEDS = st.integers(0, 2**32 - 1)


def met(kind, offsets, place=None, fade=None, **numbers):
    """Numbers of those whom an agent meets, of others at these offsets (other, axis), m."""
    offsets = np.asarray(offsets, float)
    pad = (0.0,) * (3 - offsets.shape[1])
    drawn = np.zeros(len(offsets)) if fade is None else fade
    heard = [
        HeardNeighbour(j, State(*map(float, d), *pad, 0.0, 0.0, 0.0), 0.0, float(f))
        for j, (d, f) in enumerate(zip(offsets, drawn, strict=True))
    ]
    return {h.who for h in met_neighbours(TOPOLOGIES[kind], Parameters(kind=kind, **numbers), HERE, heard, place)}


# ------------------------------------------------------------------------------------------------------- k nearest


@given(SEEDS, st.integers(1, 40), st.integers(1, 45), st.sampled_from([2, 3]))
@settings(max_examples=150, deadline=None)
def test_the_nearest_are_those_of_a_tree(number, count, k, axes):
    offsets = np.random.default_rng(number).normal(size=(count, axes))
    expected = np.atleast_1d(cKDTree(offsets).query(np.zeros(axes), k=min(k, count))[1])
    assert met("nearest", offsets, k=k) == set(expected.tolist())


@given(st.lists(st.integers(0, 5), min_size=1, max_size=30), st.integers(1, 32))
@settings(max_examples=200, deadline=None)
def test_the_kth_least_is_that_of_a_sorted_list(values, k):
    given_, heap = [float(v) for v in values] + [1e30], [0.0] * (len(values) + 1)
    assert kth_least(len(given_), given_, heap, k) == (sorted(values)[k - 1] if k <= len(values) else HEARD_LIMIT)


def test_all_who_are_as_near_as_the_kth_are_met():
    square = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 1.0]]
    for k in (1, 2, 3, 4):
        assert met("nearest", square, k=k) == {0, 1, 2, 3}
    assert met("nearest", square, k=5) == {0, 1, 2, 3, 4}
    assert met("nearest", np.zeros((0, 2)), k=5) == set()


# --------------------------------------------------------------------------------------------------------- Voronoi


@given(SEEDS, st.integers(3, 40), st.sampled_from(["gauss", "square", "ring"]))
@settings(max_examples=200, deadline=None)
def test_cells_are_those_of_scipy(number, count, shape):
    """Also of agents at the rim, whose cells have no end: neighbours are joined by an edge of the triangulation."""
    rng = np.random.default_rng(number)
    others = rng.normal(size=(count, 2)) if shape == "gauss" else rng.uniform(-1.0, 1.0, (count, 2))
    if shape == "ring":
        others = others / np.linalg.norm(others, axis=1)[:, None] * rng.uniform(0.9, 1.1, (count, 1))
        others -= others[0] * 1.5  # the agent stands beside the ring, others hide each other
    offsets = others * 20.0
    first, neighbours = Delaunay(np.vstack([[0.0, 0.0], offsets])).vertex_neighbor_vertices
    expected = set((neighbours[first[0] : first[1]] - 1).tolist())
    differ = met("voronoi", offsets) ^ expected
    assert all(shared_edge(offsets, j) < 1e-3 for j in differ), (differ, expected)


def shared_edge(offsets, j):
    """Length of the edge that two cells share, m, by scipy; 0 where it is open and so both must agree that it is."""
    cells = Voronoi(np.vstack([[0.0, 0.0], offsets]))
    for pair, corners in zip(cells.ridge_points, cells.ridge_vertices, strict=True):
        if set(pair) == {0, j + 1}:
            ends = cells.vertices[corners]
            return math.inf if -1 in corners else float(np.linalg.norm(ends[0] - ends[1]))
    return 0.0


@given(SEEDS, st.integers(1, 12))
@settings(max_examples=100, deadline=None)
def test_a_neighbour_by_cells_has_a_point_that_is_nearest_to_both(number, count):
    """By the definition: no point of the bisector that is as near to nobody else, and no neighbour is left out."""
    offsets = np.random.default_rng(number).normal(size=(count, 2))
    assert met("voronoi", offsets) == {j for j in range(count) if free_stretch(offsets, j) > 1e-6}


def free_stretch(offsets, j):
    """Length of the part of the bisector to j on which nobody is nearer, m."""
    middle, along = 0.5 * offsets[j], np.array([-offsets[j][1], offsets[j][0]]) / np.linalg.norm(offsets[j])
    low, high = -math.inf, math.inf
    for k, d in enumerate(offsets):
        if k != j:  # (middle + s along) · d <= d · d / 2
            slope, room = along @ d, 0.5 * d @ d - middle @ d
            if slope == 0.0:
                high = high if room >= 0.0 else low
            elif slope > 0.0:
                high = min(high, room / slope)
            else:
                low = max(low, room / slope)
    return high - low


def test_cells_that_touch_at_a_corner_do_not_meet():
    ring = [[x, y] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) if (x, y) != (0.0, 0.0)]
    assert {tuple(ring[j]) for j in met("voronoi", ring)} == {(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)}
    angles = np.arange(6) * math.pi / 3.0
    hexagon = np.stack([np.cos(angles), np.sin(angles)], 1)
    assert met("voronoi", hexagon) == set(range(6))
    assert met("voronoi", np.vstack([hexagon, 2.0 * hexagon, 1.7321 * hexagon])) == set(range(6))


def test_in_a_row_the_next_ones_are_met_and_at_one_place_all():
    assert met("voronoi", [[1.0, 0.0], [2.0, 0.0], [-3.0, 0.0]]) == {0, 2}
    assert met("voronoi", [[2.0, 0.0], [1.0, 0.0]]) == {1}
    assert met("voronoi", [[5.0, 5.0]]) == {0}
    assert met("voronoi", np.zeros((0, 2))) == set()
    assert met("voronoi", [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]) == {0, 1}
    assert met("voronoi", [[1.0, 0.0], [1.0, 0.0], [2.0, 0.0]]) == {0, 1}


@given(SEEDS, st.integers(2, 30))
@settings(max_examples=60, deadline=None)
def test_who_meets_whom_by_cells_is_mutual(number, count):
    places = np.random.default_rng(number).uniform(-20.0, 20.0, (count, 2))
    pairs = set()
    for i in range(count):
        others = [j for j in range(count) if j != i]
        pairs |= {(i, others[j]) for j in met("voronoi", places[others] - places[i])}
    assert pairs == {(j, i) for i, j in pairs}


# ---------------------------------------------------------------------------------------------------------- visible


@given(SEEDS, st.integers(1, 25), st.sampled_from([2, 3]), st.floats(0.0, 0.6))
@settings(max_examples=150, deadline=None)
def test_who_is_seen_has_nobody_on_the_way(number, count, axes, radius):
    offsets = np.random.default_rng(number).normal(size=(count, axes))
    expected = set()
    distances = np.linalg.norm(offsets, axis=1)
    for j, d in enumerate(offsets):
        s = np.linspace(0.0, 1.0, 2001)[:, None, None]
        way = s * d  # (place, 1, axis)
        gaps = np.linalg.norm(way - offsets, axis=2).min(axis=0)
        nearer = distances < distances[j]  # nobody is nearer than itself, not even by rounding
        ahead = offsets @ d > 0.0
        doubtful = nearer & ahead & (np.abs(gaps - radius) < 2e-3)
        if doubtful.any():
            return
        if not (nearer & ahead & (gaps < radius)).any():
            expected.add(j)
    assert met("visible", offsets, radius=radius) == expected


def test_a_way_that_touches_a_body_is_free():
    assert met("visible", [[4.0, 0.0], [2.0, 0.5]], radius=0.5) == {0, 1}
    assert met("visible", [[4.0, 0.0], [2.0, 0.5]], radius=0.5001) == {1}
    assert met("visible", [[4.0, 0.0], [-2.0, 0.0]], radius=1.0) == {0, 1}  # nobody behind hides
    assert met("visible", [[4.0, 0.0], [0.0, 4.0]], radius=5.0) == {0, 1}  # nor one as far away


class Wall:
    """Something between an agent and all that is east of x = 3 m."""

    def is_blocked(self, x, y, z, to_x, to_y, to_z):
        return to_x > 3.0


def test_what_stands_in_the_world_hides():
    line = [[1.0, 0.0], [0.0, 5.0], [4.0, 4.0]]
    assert met("visible", line, Wall(), radius=0.0) == {0, 1}
    assert met("visible", line, radius=0.0) == {0, 1, 2}


# -------------------------------------------------------------------------------------------------------- strongest


def test_a_signal_loses_ten_decibels_times_the_exponent_with_a_tenfold_distance():
    t = SimpleNamespace(exponent=3.0, wall=20.0, fading=4.0)
    assert loss(100.0**2, 0.0, 0.0, t) - loss(10.0**2, 0.0, 0.0, t) == pytest.approx(30.0)
    assert loss(1.0, 1.0, 1.5, t) == pytest.approx(26.0)


@given(SEEDS, st.integers(1, 30), st.integers(1, 10), st.floats(0.0, 8.0))
@settings(max_examples=100, deadline=None)
def test_the_strongest_are_those_of_a_sorted_list(number, count, k, fading):
    rng = np.random.default_rng(number)
    offsets, fade = rng.uniform(-9.0, 9.0, (count, 3)), rng.normal(size=count)
    lost = 35.0 * np.log10(np.linalg.norm(offsets, axis=1)) + fading * fade + 15.0 * (offsets[:, 0] > 3.0)
    found = met("strongest", offsets, Wall(), fade, k=k, exponent=3.5, fading=fading, wall=15.0)
    assert found == set(np.argsort(lost)[:k].tolist())
    assert met("strongest", offsets, k=k) == met("nearest", offsets, k=k)  # in open air and without fading
