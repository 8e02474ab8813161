"""Measures of SwarmLab (Soria, Schiano and Floreano 2020), beside the fitness of Vásárhelyi et al. 2018.

SwarmLab's five are order, safety, union, connectivity and speed (phi_vel). They make no fitness of
their own.
"""

from airflock.parts.metric_sets import vasarhelyi
from airflock.parts.metrics.swarmlab import errors as errors

METRICS = [*vasarhelyi.METRICS, "swarmlab"]
REPORTS, FORMULAS, NEEDS, fitness = vasarhelyi.REPORTS, vasarhelyi.FORMULAS, vasarhelyi.NEEDS, vasarhelyi.fitness
