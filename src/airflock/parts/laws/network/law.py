"""A small neural network as a law: a policy that was trained elsewhere flies, is certified and goes on board. Ours.

Each layer has up to 18 units, tanh but for the last one, whose three outputs are the desired
velocity in units of v_flock. A network sees 18 numbers, without units, in axes of its own: along
its horizontal heading, to its left, up.

| input | what it is |
|---|---|
| 0-1 | own heading: horizontal, up |
| 2 | own speed over v_flock |
| 3-5 | mean offset of the neighbours over r |
| 6-8 | sum of -(offset) r / (distance squared) over the neighbours: nearness |
| 9-11 | mean velocity of the neighbours minus own over v_flock |
| 12-14 | sum of normal (1 - distance / r) over the walls and obstacles nearer than r |
| 15-17 | direction to the goal, times its distance over r where that is below 1 |

`airflock.network_weights` makes the column `model.weights` of layers of any width up to 18. Without
weights an agent flies by one layer that keeps its heading, aligns, keeps its distance and turns
from walls.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from airflock.core import Parameters as Record, column, norm, quantity, shorten
from airflock.support import ParameterError

COMMAND = "velocity"
OURS = "our choice"
INPUTS, OUTPUTS, WIDTH = 18, 3, 18
ROW = 19  # numbers of a unit: a weight of each input, and its bias
BLOCK = 342  # numbers of a layer
MOST = 2048  # numbers of a network


def _row(weights: Sequence[float], bias: float) -> tuple[float, ...]:
    """Numbers of one unit, filled up with zeros."""
    return (*map(float, weights), *([0.0] * (WIDTH - len(weights))), float(bias))


def _axes(*gains: tuple[int, float]) -> tuple[float, ...]:
    """One layer that adds inputs, given by the first of their three and its gain, to the heading."""
    rows = [[float(out == 0 and k == 0 or out == 2 and k == 1) for k in range(INPUTS)] for out in range(OUTPUTS)]
    for first, gain in gains:
        for out in range(OUTPUTS):
            rows[out][first + out] += gain
    return tuple(number for row in rows for number in _row(row, 0.0))


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Scales of inputs and outputs, and the weights."""

    v_flock: float = quantity(4.0, "m/s", low=0.1, high=100.0, source=OURS, meaning="unit of speeds; preferred speed")
    v_max: float = quantity(6.0, "m/s", low=0.1, high=150.0, source=OURS, meaning="largest commanded speed")
    r: float = quantity(
        40.0, "m", low=0.1, high=1e4, source=OURS, meaning="unit of lengths; farther neighbours and walls are not seen"
    )
    weights: tuple[float, ...] = column(
        _axes((3, 0.2), (6, 0.1), (9, 0.3), (12, 1.0), (15, 0.5)), "1", most=MOST, source=OURS,
        meaning="weights of the layers, one after another: 19 numbers a unit, 18 units a layer, 3 in the last",
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.weights)
        if count % BLOCK != OUTPUTS * ROW:
            raise ParameterError(
                f"Parameters.weights has {count} numbers; give {OUTPUTS * ROW}, and {BLOCK} for each hidden layer "
                "(airflock.network_weights makes them of layers)"
            )


def network_weights(layers: Sequence[tuple[Any, Any]]) -> list[float]:
    """Make the column `model.weights` of the law `network` from the layers of a trained network.

    Parameters
    ----------
    layers : sequence of (weights, bias)
        In the order in which they act: weights of shape (units, inputs) and bias of shape (units,), as lists or arrays,
        such as torch's `Linear.weight` and `Linear.bias`. The first has 18 inputs, the last 3 units, any other up to
        18; all but the last are followed by tanh.

    Returns
    -------
    list of float
        Plain numbers, since an input or output is a multiple of the unit of its kind: `r`, `v_flock`. For
        `airflock.load(preset, {"model.weights": ...}, law="network")`, or for a JSON file that `model.weights` names.
        The order is ours.

    Raises
    ------
    ParameterError
        If a shape does not fit; names the layer, the shape and the expected one.

    Examples
    --------
    >>> import airflock
    >>> len(airflock.network_weights([([[0.0] * 18] * 8, [0.0] * 8), ([[0.0] * 8] * 3, [0.0] * 3)]))
    399
    """
    found: list[float] = []
    inputs = INPUTS
    for number, layer_ in enumerate(layers, 1):
        last = number == len(layers)
        try:
            weights, bias = layer_
            rows = [_row(row, each) for row, each in zip(weights, bias, strict=False)]
            units, biases, widths = len(weights), len(bias), sorted({len(row) for row in weights})
        except (TypeError, ValueError) as error:
            raise ParameterError(f"layer {number} of {len(layers)} is no pair of rows of numbers and biases") from error
        if widths != [inputs] or biases != units or (units != OUTPUTS if last else units > WIDTH):
            raise ParameterError(
                f"layer {number} of {len(layers)} has weights of shape {units} x {'/'.join(map(str, widths))} and "
                f"{biases} biases; expected {OUTPUTS if last else f'1 to {WIDTH}'} x {inputs}, and a bias a unit"
            )
        # Units that a narrow layer lacks are zeros: all hidden layers have one length.
        found += [each for row in rows for each in row] + [0.0] * (0 if last else (WIDTH - units) * ROW)
        inputs = units
    if len(found) > MOST or not layers:
        raise ParameterError(f"{len(layers)} layers take {len(found)} numbers; give 1 to {1 + MOST // BLOCK} layers")
    return found


class Sums(NamedTuple):
    """Sums over neighbours: offset (m), nearness (1/m), velocity difference (m/s), and their number."""

    ox: float
    oy: float
    oz: float
    sx: float
    sy: float
    sz: float
    ax: float
    ay: float
    az: float
    n: float


class Walls(NamedTuple):
    """Nearness of walls and obstacles along their normals."""

    x: float
    y: float
    z: float


def preferred_speed(p):
    """Unit of speeds, m/s."""
    return p.v_flock


def interaction_range(p):
    """Radius within which agents count as one group, m."""
    return p.r


def reach(p):
    """Distance beyond which neighbours are not seen, m."""
    return p.r


def wall_reach(p):
    """Distance beyond which a surface is not seen, m."""
    return p.r


def neighbour(dx, dy, dz, r2, dvx, dvy, dvz):
    """What one neighbour adds to the inputs."""
    k = -1.0 / r2
    return Sums(dx, dy, dz, k * dx, k * dy, k * dz, dvx, dvy, dvz, 1.0)


def boundary(distance, nx, ny, nz, p):
    """What one surface adds to the inputs."""
    k = max(1.0 - distance / p.r, 0.0)
    return Walls(k * nx, k * ny, k * nz)


def unit_sum(first, a, p):
    """Weighted sum of the inputs of one unit, whose numbers begin at this place of the column."""
    total = 0.0
    for k in range(19):
        total = total + p.weights[first + k] * a[k]
    return total


def layer(first, a, p):
    """Outputs of a hidden layer whose numbers begin at this place, and 1 for the biases of the next one."""
    return (
        math.tanh(unit_sum(first, a, p)),
        math.tanh(unit_sum(first + 19, a, p)),
        math.tanh(unit_sum(first + 38, a, p)),
        math.tanh(unit_sum(first + 57, a, p)),
        math.tanh(unit_sum(first + 76, a, p)),
        math.tanh(unit_sum(first + 95, a, p)),
        math.tanh(unit_sum(first + 114, a, p)),
        math.tanh(unit_sum(first + 133, a, p)),
        math.tanh(unit_sum(first + 152, a, p)),
        math.tanh(unit_sum(first + 171, a, p)),
        math.tanh(unit_sum(first + 190, a, p)),
        math.tanh(unit_sum(first + 209, a, p)),
        math.tanh(unit_sum(first + 228, a, p)),
        math.tanh(unit_sum(first + 247, a, p)),
        math.tanh(unit_sum(first + 266, a, p)),
        math.tanh(unit_sum(first + 285, a, p)),
        math.tanh(unit_sum(first + 304, a, p)),
        math.tanh(unit_sum(first + 323, a, p)),
        1.0,
    )


def decide(own, sums, walls, percept, p):
    """Desired velocity, m/s: the outputs of the network times v_flock, at most v_max."""
    flat = own.hx * own.hx + own.hy * own.hy
    k = 1.0 / norm(own.hx, own.hy, 0.0)
    still = flat < 1e-6
    c = 1.0 if still else k * own.hx  # at rest, or straight up, the axes are east, north and up
    s = 0.0 if still else k * own.hy
    level = own.hx * c + own.hy * s
    resting = flat + own.hz * own.hz < 0.5
    m = 1.0 / (max(sums.n, 1.0) * p.r)
    t = 1.0 / (max(sums.n, 1.0) * p.v_flock)
    far = norm(percept.goal_x, percept.goal_y, percept.goal_z)
    g = min(1.0 / p.r, 1.0 / far)
    a = (
        1.0 if resting else level,
        own.hz,
        norm(own.vx, own.vy, own.vz) / p.v_flock,
        m * (c * sums.ox + s * sums.oy),
        m * (c * sums.oy - s * sums.ox),
        m * sums.oz,
        p.r * (c * sums.sx + s * sums.sy),
        p.r * (c * sums.sy - s * sums.sx),
        p.r * sums.sz,
        t * (c * sums.ax + s * sums.ay),
        t * (c * sums.ay - s * sums.ax),
        t * sums.az,
        c * walls.x + s * walls.y,
        c * walls.y - s * walls.x,
        walls.z,
        g * (c * percept.goal_x + s * percept.goal_y),
        g * (c * percept.goal_y - s * percept.goal_x),
        g * percept.goal_z,
        1.0,
    )
    hidden = len(p.weights) // 342
    for number in range(hidden):
        a = layer(342 * number, a, p)
    first = 342 * hidden
    along = p.v_flock * unit_sum(first, a, p)
    left = p.v_flock * unit_sum(first + 19, a, p)
    up = p.v_flock * unit_sum(first + 38, a, p)
    return shorten(c * along - s * left, s * along + c * left, up, p.v_max)
