"""Checks of a topology: its choice of neighbours does not depend on order, direction or unit."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.check.truths import (
    UNIT_SCALES,
    Report,
    TruthTable,
    parameters_with_values,
    require_part,
    rescaled,
    run_truths,
)
from airflock.core import FAR, TINY, Topology, call_rule, law
from airflock.parts.topologies import Parameters as Usual
from airflock.scenarios import TOPOLOGY_KIND, check_seed

TRIES = 40  # random flocks that each truth is tried on
UNHEARD = 0.2  # share of the others that an agent does not hear


class Neighbours(NamedTuple):
    """The others of one agent: offsets (other, axis) m, whether each is heard and hidden, fading of each signal."""

    offsets: NDArray[np.float64]
    heard: NDArray[np.bool_]
    hidden: NDArray[np.float64]
    fade: NDArray[np.float64]

    def subset(self, order: Any) -> "Neighbours":
        """Some of them, or all in another order."""
        return Neighbours(*(column[order] for column in self))


def check_topology(topology: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a topology and return a report with one line a truth.

    Everybody is met or not, and nobody who is not heard; the order of the others does not matter;
    turned about the vertical it is the same; in other units it is the same; where it says that it
    is NEAR, nobody farther matters. A topology that rightly breaks one of them says which and why:
    VIOLATES = {"turned": "whoever is east is met"}.

    Parameters
    ----------
    topology : Topology, module, class, mapping or str
        A topology: a Topology, a namespace such as globals(), a name of ours, or a file that ends in .py.
    parameters : mapping, optional
        Values that differ from the defaults, by name.
    seed : int
        Of the random flocks; it stands in every mismatch.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the topology does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a value is none of its numbers.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_topology("nearest", {"k": 3}).broken
    ()
    """
    found = _gathered(topology)
    t = parameters_with_values(found.Parameters or Usual, parameters, "topology")
    flocks = list(_flocks(found, seed))
    truths: TruthTable = {
        "rule": ("the rule can be compiled", lambda: "".join(law.rule_errors(found.meet)[:1])),
        "heard": ("each agent is met or not, and none that is not heard", lambda: _heard(found, t, flocks, seed)),
        "order": ("the order of the others does not matter", lambda: _order(found, t, flocks, seed)),
        "turned": ("turned about the vertical it is the same", lambda: _turned(found, t, flocks, seed)),
        "near": ("where it says NEAR, nobody farther matters", lambda: _near(found, t, flocks, seed)),
        "units": ("in another unit of length it is the same", lambda: _units(found, t, flocks, seed)),
    }
    return run_truths(f"topology {found.name}", truths, found.violates)


def _gathered(source: Any) -> Topology:
    found, errors = TOPOLOGY_KIND.from_caller(source)
    if found is None and not errors:
        errors = [f"topology {source!r}: agents meet all whom they hear; there is no rule to check"]
    return require_part((found, errors))


def _flocks(found: Topology, seed: int) -> Iterator[Neighbours]:
    """The others of an agent, at random places and on a lattice, some of them not heard."""
    rng = np.random.default_rng(check_seed(seed))
    for number in range(TRIES):
        count = int(rng.integers(1, 25))
        offsets = 20.0 * rng.normal(size=(count, 3))
        if number % 4 == 3:
            offsets = np.round(offsets / 10.0) * 10.0 + 1e-3 * rng.normal(size=(count, 3))
        if found.flat or number % 2:
            offsets[:, 2] = 0.0
        hidden = (rng.random(count) < 0.3).astype(float)
        yield Neighbours(offsets, rng.random(count) >= UNHEARD, hidden, rng.normal(size=count))


def _met(found: Topology, t: Any, others: Neighbours) -> NDArray[np.float64]:
    """The row that the rule fills; 2.0 where it fills nothing."""
    count, columns = len(others.offsets), others.offsets.T.tolist()
    squares = (others.offsets**2).sum(axis=1) + TINY
    met = [2.0] * count
    given = {
        "n": count, "dx": columns[0], "dy": columns[1], "dz": columns[2], "met": met, "t": t,
        "r2": np.where(others.heard, squares, FAR).tolist(), "hidden": others.hidden.tolist(),
        "fade": others.fade.tolist(), "heap": [FAR] * count, "weak": [FAR] * count,
    }  # fmt: skip
    call_rule(found.meet, "meet", given, found.name)
    return np.array(met)


def _heard(found: Topology, t: Any, flocks: list[Neighbours], seed: int) -> str:
    for number, others in enumerate(flocks):
        met = _met(found, t, others)
        if not np.isin(met, (0.0, 1.0)).all():
            return f"flock {number} of seed {seed}: met holds {met[~np.isin(met, (0.0, 1.0))][0]:g}"
        if (met[~others.heard] > 0.5).any():
            return f"flock {number} of seed {seed}: an agent is met that is not heard"
    return ""


def _order(found: Topology, t: Any, flocks: list[Neighbours], seed: int) -> str:
    rng = np.random.default_rng(seed)
    for number, others in enumerate(flocks):
        order = rng.permutation(len(others.offsets))
        off = np.flatnonzero(_met(found, t, others.subset(order)) != _met(found, t, others)[order])
        if len(off):
            return f"flock {number} of seed {seed}: in another order other agents are met"
    return ""


def _turned(found: Topology, t: Any, flocks: list[Neighbours], seed: int) -> str:
    for number, others in enumerate(flocks):
        angle = 0.7 + number
        c, s = math.cos(angle), math.sin(angle)
        turned = others.offsets @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        if (_met(found, t, others._replace(offsets=turned)) != _met(found, t, others)).any():
            return f"flock {number} of seed {seed}: turned by {angle:.2g} rad others are met"
    return ""


def _near(found: Topology, t: Any, flocks: list[Neighbours], seed: int) -> str:
    for number, others in enumerate(flocks if found.near else []):
        far = np.linalg.norm(others.offsets, axis=1)
        inside = far <= np.median(far)
        if (_met(found, t, others.subset(inside)) != _met(found, t, others)[inside]).any():
            return f"flock {number} of seed {seed}: without those beyond {np.median(far):.3g} m others are met"
    return ""


def _units(found: Topology, t: Any, flocks: list[Neighbours], seed: int) -> str:
    for units in UNIT_SCALES:
        other = rescaled(t, units)
        for number, others in enumerate(flocks):
            scaled = others._replace(offsets=others.offsets * units.metre)
            if (_met(found, other, scaled) != _met(found, t, others)).any():
                told = f"flock {number} of seed {seed}: in other units others are met"
                return f"{told}: a unit is declared wrongly, or the rule contains a number that has a unit"
    return ""
