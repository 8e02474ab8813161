"""The rule contract: what a model, a body, an order parameter and a set of them consist of.

A rule is a plain function of floats. Its argument names are the declaration: a driver computes and supplies only what
is asked for, in any order. `core.vocabulary` lists the names.
"""

from airflock.core.contract.bodies import Body, body
from airflock.core.contract.metric_sets import MetricSet
from airflock.core.contract.metrics import Metric, metric
from airflock.core.contract.models import Model, model
from airflock.core.contract.namespaces import namespace_names

__all__ = ["Body", "Metric", "MetricSet", "Model", "body", "metric", "model", "namespace_names"]
