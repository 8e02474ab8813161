"""The lifting line knows Glauert's wing, Munk's theorems, the infinite row, and its own derivatives."""

import math

import numpy as np
import pytest

from airflock.parts.aero import gradients, lifting_line, wing
from airflock.parts.aero.filaments import leg, leg_slopes
from formations import (
    FOOT,
    POUND,
    best_load,
    block,
    drags,
    influence_matrix,
    power,
    solved,
    vee,
    wing_of,
)

SPAN = 5.0 * FOOT
ELLIPTIC = 35.70743207918555  # ft lbf/s: W² V / (q pi b²)


def efficiency(segments, layout):
    return ELLIPTIC / power([(0.0, 0.0, 0.0)], wing_of(segments=segments, layout=layout))


def glauert(aspect, terms=60):
    """Span efficiency of a rectangular untwisted wing from Glauert's series (lift slope 2 pi)."""
    theta = np.pi * np.arange(1, terms + 1) / (2.0 * terms + 1.0)
    odd = np.arange(1, 2 * terms, 2)
    mu = 2.0 * math.pi / (4.0 * aspect)
    series = np.sin(np.outer(theta, odd)) * (odd * mu + np.sin(theta)[:, None])
    a = np.linalg.solve(series, mu * np.sin(theta))
    return 1.0 / float((odd * (a / a[0]) ** 2).sum())


def test_a_lone_wing_has_glauerts_efficiency():
    exact = glauert(5.0)
    assert exact == pytest.approx(0.9630407, abs=1e-5)
    assert efficiency(20, "inset") == pytest.approx(exact, rel=0.01)
    assert [efficiency(n, "inset") for n in (5, 10, 40)] == pytest.approx([0.976988, 0.971851, 0.964538], rel=1e-4)


def test_plain_filaments_underrate_drag_by_first_order():
    found = [efficiency(n, "plain") for n in (9, 10, 20, 40)]
    assert found == pytest.approx([1.0821339, 1.0698387, 1.0149471, 0.9882469], rel=1e-4)
    assert 2.0 * found[3] - found[2] == pytest.approx(glauert(5.0), rel=3e-3)  # Richardson


@pytest.mark.parametrize("m", [9, 10, 40])
def test_the_best_load_on_plain_filaments_is_exactly_one_segment_better_than_elliptic(m):
    _, drag = best_load([(0.0, 0.0, 0.0)], m, SPAN / m)
    assert 2.0 / (math.pi * SPAN**2) / drag == pytest.approx(1.0 + 1.0 / m, rel=1e-9)


def test_total_drag_does_not_know_stagger(seed):
    """Munk 1921: with circulations held, moving wings along the flow changes no total drag."""
    rng = np.random.default_rng(seed)
    m, h = 10, SPAN / 10
    across = rng.normal(0.0, 2.0, (5, 3)) * (0.0, 1.0, 0.4)
    load = rng.uniform(0.5, 1.5, 5 * m)
    totals = [load @ influence_matrix(across + s, m, h, 0.05) @ load for s in rng.normal(0, 9, (4, 5, 1)) * (1, 0, 0)]
    assert np.ptp(totals) / abs(totals[0]) < 1e-12


def test_mutual_influence_is_that_of_the_far_wake(seed):
    """A_ij plus A_ji transposed is the Trefftz plane's matrix, which no offset along the flow changes."""
    rng = np.random.default_rng(seed)
    m, h = 8, SPAN / 8
    for d in rng.normal(0.0, 3.0, (5, 3)):
        here = block(d, m, h, 0.1) + block(-d, m, h, 0.1).T
        k, e = np.indices((m, m))
        ends = [d[1] + (k - e + s) * h for s in (0.5, -0.5)]
        far = [2.0 * y / (y * y + d[2] ** 2 + 0.01) / (4.0 * math.pi) for y in ends]
        assert np.abs(here - (far[0] - far[1])).max() < 1e-12


def test_stagger_hardly_matters_with_equal_lift_and_abreast_is_best():
    w = wing_of(segments=10, layout="plain")
    found = [power(vee(5, sx * FOOT, SPAN), w) for sx in (0.0, 0.5, 1.0, 2.5, 10.0)]
    assert found == pytest.approx([8.93, 9.88, 10.46, 10.95, 11.13], abs=0.006)
    far = [power(vee(5, sx * FOOT, SPAN), w) for sx in (2.0, 5.0, 40.0)]
    assert np.ptp(far) / min(far) < 0.03


def test_wings_tip_to_tip_are_one_wing():
    """Five wings abreast, tips touching and lifts free, fly like one wing of five spans: drag 50/51 of elliptic."""
    m, h = 10, SPAN / 10
    a = influence_matrix([(0.0, i * SPAN, 0.0) for i in range(5)], m, h)
    form = 0.5 * (a + a.T)
    load = np.linalg.solve(form, np.ones(5 * m))
    load /= load.sum() * h
    assert h * load @ form @ load / (2.0 / (math.pi * (5.0 * SPAN) ** 2)) == pytest.approx(50.0 / 51.0, rel=1e-10)


def row_efficiency(n, ratio, m, image=0):
    """Span efficiency of wings abreast under the best load; with images, of an endless row."""
    h = SPAN / (m + 0.5)
    if not image:
        _, drag = best_load([(0.0, i * ratio * SPAN, 0.0) for i in range(n)], m, h)
        return n * 2.0 / (math.pi * SPAN**2) / drag
    a = block((0.0, 0.0, 0.0), m, h)
    k, e = np.indices((m, m))
    period = math.pi / (ratio * SPAN)  # the sum of 1 / (y + j p) over all images is pi / p cot(pi y / p)
    ends = [period / np.tan(period * (k - e + s) * h) for s in (0.5, -0.5)]
    a = 2.0 * (ends[0] - ends[1]) / (4.0 * math.pi) / 2.0
    load = np.linalg.solve(a, np.ones(m))
    load /= load.sum() * h
    return 2.0 / (math.pi * SPAN**2) / (h * load @ a @ load)


@pytest.mark.parametrize("ratio", [1.05, 1.25, 1.5, 2.0, 3.0])
def test_an_endless_row_follows_the_cascade_formula(ratio):
    exact = -8.0 / math.pi**2 * ratio**2 * math.log(math.cos(math.pi / (2.0 * ratio)))
    assert row_efficiency(1, ratio, 80, image=1) == pytest.approx(exact, rel=0.02)
    assert row_efficiency(1, ratio, 10, image=1) == pytest.approx(exact, rel=0.12 if ratio < 1.1 else 0.03)


def test_sixty_one_abreast_are_nearly_an_endless_row():
    exact = -8.0 / math.pi**2 * 1.25**2 * math.log(math.cos(math.pi / 2.5))
    found = row_efficiency(61, 1.25, 10)
    assert found == pytest.approx(1.4440148, rel=1e-4)
    assert found == pytest.approx(exact, rel=0.05)


def test_v_of_five():
    assert power(vee(5, 5.0 * FOOT, 1.25 * SPAN), wing_of()) == pytest.approx(29.3, rel=0.01)
    plain = [power(vee(5, 5.0 * FOOT, SPAN), wing_of(segments=m, layout="plain")) for m in (5, 9, 10, 20)]
    assert plain == pytest.approx([9.27275, 10.80155, 11.09756, 13.04492], rel=1e-4)
    inset = power(vee(5, 5.0 * FOOT, SPAN), wing_of(segments=10))
    assert inset == pytest.approx(19.810, rel=1e-3)


def test_a_core_of_a_twentieth_span_keeps_half_the_saving():
    w = wing_of(core=0.05)
    found = {s: power(vee(5, 7.5 * FOOT, s * SPAN), w) for s in (0.8, 0.9, 1.0)}
    assert min(found, key=found.get) == 0.9
    assert found[0.9] == pytest.approx(18.6, rel=0.01)


def test_swept_wings_are_the_dense_solution(seed):
    """Also where wings overlap so much that sweeps do not settle and the dense system answers."""
    rng = np.random.default_rng(seed)
    w = wing_of(segments=10, core=0.02)
    m, h, k = 10, wing.pitch(w), wing.stiffness(w)
    for spread in (2.0, 1.0, 0.12):
        x = rng.normal(0.0, spread, (4, 3)) * (1.0, 1.0, 0.2)
        work = solved(x, w)
        a = influence_matrix(x, m, h, w.core * w.span)
        wings = np.kron(np.eye(4), np.ones((1, m)))
        system = np.block([[np.eye(4 * m) / k + a / w.speed, -wings.T], [wings, np.zeros((4, 4))]])
        exact = np.linalg.solve(system, np.concatenate([np.zeros(4 * m), np.full(4, wing.circulation_sum(w))]))
        load = exact[: 4 * m]
        assert np.abs(np.ravel([row[:m] for row in work.circulation]) - load).max() < 1e-10 * wing.circulation_sum(w)
        drag = w.density * h * (load * (a @ load)).reshape(4, m).sum(1)
        found = [lifting_line.induced_drag(i, work, work.circulation, w) for i in range(4)]
        assert found == pytest.approx(drag, rel=1e-9, abs=1e-9)


def test_slopes_of_a_leg_are_its_differences(seed):
    rng = np.random.default_rng(seed)
    for d in rng.normal(0.0, 1.0, (20, 3)):
        for c in range(3):
            e = np.eye(3)[c] * 1e-6
            step = (leg(*(d + e), 0.01) - leg(*(d - e), 0.01)) / 2e-6
            assert leg_slopes(*d, 0.01)[c] == pytest.approx(step, rel=1e-6, abs=1e-8)


def numeric(x, i, w, respond=True, held=None):
    found = []
    for c in range(3):
        value = []
        for sign in (1.0, -1.0, 2.0, -2.0):  # five points: error of fourth order
            moved = x.copy()
            moved[i, c] += sign * 2e-4
            if respond:
                value.append(drags(moved, w)[i])
                continue
            work = solved(moved, w)
            for j, row in enumerate(held):
                work.circulation[j][:] = row
            lifting_line.wash_on(i, len(x), wing.segments_of(w), work.tables, work.circulation, work.wash)
            lifting_line.carry(i, wing.segments_of(w), work, work.circulation)
            value.append(lifting_line.induced_drag(i, work, work.circulation, w))
        found.append((8.0 * (value[0] - value[1]) - (value[2] - value[3])) / (12.0 * 2e-4))
    return np.array(found)


@pytest.mark.parametrize("respond", [True, False])
def test_analytic_gradient_is_the_central_difference(respond, seed):
    rng = np.random.default_rng(seed)
    w = wing_of(segments=10, core=0.05)
    x = vee(4, 5.0 * FOOT, 0.95 * SPAN) + rng.normal(0.0, 0.1, (4, 3))
    work = solved(x, w, "analytic")
    held = [list(row) for row in work.circulation]
    gradients.slopes_of(4, work, w)
    for i in range(4):
        found = np.array(gradients.analytic(i, 4, work, w, 0.0 if respond else 1.0))
        exact = numeric(x, i, w, respond, held)
        assert np.abs(found - exact).max() < 1e-6 * np.abs(exact).max()


def test_gradient_where_sweeps_do_not_settle(seed):
    """One factorisation then serves the transposed system too."""
    rng = np.random.default_rng(seed)
    w = wing_of(segments=5, core=0.05)
    x = rng.normal(0.0, 0.05, (4, 3)) + np.arange(4)[:, None] * (0.02, 0.03, 0.0)
    work = solved(x, w, "analytic")
    assert work.pivots[0] != [0.0] * 20  # the dense system was needed
    gradients.slopes_of(4, work, w)
    found = np.array(gradients.analytic(1, 4, work, w, 0.0))
    exact = numeric(x, 1, w)
    assert np.abs(found - exact).max() < 1e-5 * np.abs(exact).max()


def test_over_cells_is_a_difference_over_one_pitch():
    w = wing_of(segments=5, layout="plain")
    h = wing.pitch(w)
    x = vee(3, 5.0 * FOOT, 6.0 * FOOT)
    work = solved(x, w, "cells")
    found = gradients.over_cells(2, 3, work, w, 0.0)
    for c in range(2):
        e = np.zeros((3, 3))
        e[2, c] = h
        assert found[c] == pytest.approx((drags(x + e, w)[2] - drags(x - e, w)[2]) / (2.0 * h), rel=1e-9)
    assert found[2] == 0.0
    again = gradients.over_cells(2, 3, work, w, 0.0)
    assert again == pytest.approx(found, rel=1e-10)  # the tables were put back


def test_units():
    w = wing_of()
    assert wing.lift_coefficient(w) == pytest.approx(1.8696, rel=1e-3)
    assert w.weight / POUND == pytest.approx(10.0)
