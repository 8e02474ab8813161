"""The six partial fitnesses and their product (Vásárhelyi et al. 2018, Eqs 17-22).

F_cluster is printed with three arguments in F3; F1 takes three and fits the definition: F1(N_min,
N/5, N/5).
"""

from collections.abc import Mapping

from airflock.core import bell, peak, rising
from airflock.parts.metrics.parameters import Parameters

METRICS = ["speed", "correlation", "nearest", "collisions", "excursion", "rotation", "polarisation"]
REPORTS = {
    "f_speed": ("", "partial fitness: speed"),
    "f_coll": ("", "partial fitness: collisions"),
    "f_disc": ("", "partial fitness: connection"),
    "f_cluster": ("", "partial fitness: clusters"),
    "f_wall": ("", "partial fitness: walls"),
    "f_corr": ("", "partial fitness: correlation"),
    "fitness": ("", "product of the partial fitnesses"),
}
FORMULAS = {
    "f_speed": (
        r"F_1(\phi^{vel}, v_{flock}, v_{tol})",
        "0 to 1",
        "0 below $v_{flock} - v_{tol}$, 1 from $v_{flock}$ upwards.",
    ),
    "f_coll": (
        r"F_3(\phi^{coll}, a_{tol}) = \left(\frac{a_{tol}}{\phi^{coll} + a_{tol}}\right)^2",
        "0 to 1",
    ),
    "f_disc": ("F_3(N_{disc}, N/5)", "0 to 1"),
    "f_cluster": ("F_1(N_{min}, N/5, N/5)", "0 to 1"),
    "f_wall": (r"e^{-(\phi^{wall}/r_{tol})^2}", "0 to 1"),
    "f_corr": (r"\max(\phi^{corr}, 0)", "0 to 1"),
    "fitness": (
        "F = F^{speed} F^{coll} F^{disc} F^{cluster} F^{wall} F^{corr}",
        "0 to 1",
        "A product: one partial fitness of 0 makes it 0, so look at the parts first.",
    ),
}
NEEDS = {
    "f_speed": ("v_flock",),
    "f_coll": ("r_coll",),
    "f_disc": ("r_comm",),
    "f_cluster": ("r_cluster",),
    "f_wall": ("r_tol",),
    "f_corr": ("r_cluster",),
    "fitness": ("r_cluster", "r_coll", "r_comm", "v_flock"),
}


def fitness(values: Mapping[str, float], agents: int, q: Parameters) -> dict[str, float]:
    """Partial fitnesses f_* and their product from the order parameters of one flight.

    values : mapping with phi_vel (m/s), phi_corr, phi_coll, phi_wall (m), n_disc, n_min
    agents : number of agents; q : metric parameters with v_flock, v_tol (m/s), a_tol, r_tol (m)
    Returns a dict of numbers between 0 and 1.
    """
    parts = {
        "f_speed": rising(values["phi_vel"], q.v_flock, q.v_tol),
        "f_coll": peak(values["phi_coll"], q.a_tol),
        "f_disc": peak(values["n_disc"], agents / 5.0),
        "f_cluster": rising(values["n_min"], agents / 5.0, agents / 5.0),
        "f_wall": bell(values["phi_wall"], q.r_tol),
        "f_corr": max(values["phi_corr"], 0.0),
    }
    product = 1.0
    for part in parts.values():
        product *= part
    return {**parts, "fitness": product}
