"""What of a record a rule reads: told by its text, and everything where its text does not tell."""

import inspect
import math

import pytest

from airflock.core.law import fields_read
from airflock.core.vocabulary import Mean
from airflock.parts import METRICS

RECORDS = {"pair", "shared", "memory", "wing", "q", "agents", "clusters", "members"}
RULES = [
    pytest.param(rule, id=f"{name}-{kind}")
    for name, one in METRICS.items()
    for kind in ("agent", "member", "cluster", "sample")
    if (rule := getattr(one, kind)) is not None and "mean" in inspect.signature(rule).parameters
]


class Noted:
    """A record that notes which of its fields are read; each is a half."""

    def __init__(self):
        self.noted = set()

    def __getattr__(self, name):
        self.noted.add(name)
        return 0.5


def drift(vx, vy, m):
    return math.hypot(vx - m.vx, vy - m.vy)


def direct(x, mean):
    return x - mean.x


def handed_on(vx, vy, hx, mean):
    return drift(vx, vy, mean) + hx * mean.hx


def renamed(mean):
    m = mean
    return m.x


def by_keyword(vx, vy, mean):
    return drift(vx, vy, m=mean)


def taken_apart(mean):
    return math.hypot(*mean)


def in_a_row(vx, mean):
    return drift(*(vx, vx), mean)


def test_fields_are_followed_into_the_functions_that_are_handed_the_record():
    assert fields_read(direct, "mean") == {"x"}
    assert fields_read(handed_on, "mean") == {"vx", "vy", "hx"}


@pytest.mark.parametrize("rule", [renamed, by_keyword, taken_apart, in_a_row])
def test_where_the_text_does_not_tell_nothing_is_said(rule):
    assert fields_read(rule, "mean") is None


@pytest.mark.parametrize("rule", RULES)
def test_whatever_a_shipped_rule_reads_of_a_mean_was_told(rule):
    mean = Noted()
    given = {name: Noted() if name in RECORDS else 0.5 for name in inspect.signature(rule).parameters}
    rule(**given | {"mean": mean})
    assert mean.noted
    assert mean.noted <= fields_read(rule, "mean") <= set(Mean._fields)
