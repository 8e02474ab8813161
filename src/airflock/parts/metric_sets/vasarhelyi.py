"""The six partial fitnesses and their product (Vásárhelyi et al. 2018, Eqs 17-22).

F_cluster is printed with three arguments in F3; F1 takes three and fits the definition: F1(N_min, N/5, N/5).
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
