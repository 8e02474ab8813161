"""Area and shape of a group: the ellipse, or in space the ellipsoid, whose uniform filling has the same second moments.

Our definitions. A uniform ellipse of half axes a, b has the variances a²/4, b²/4; a uniform
ellipsoid a²/5, b²/5, c²/5. Agents on one line have no area, agents on one plane no volume, and
rounding does not give them one: a determinant of moments below `FLAT` of the product of its
diagonal, which bounds it (Hadamard), counts as 0.
"""

import math
from typing import NamedTuple

FLAT = 1e-13  # some hundred times the rounding of a determinant of three rows

REPORTS = {
    "area": ("m²", "area of the ground plan"),
    "elongation": ("", "long over short axis"),
    "volume": ("m³", "volume; 0 in a plane"),
}
FORMULAS = {
    "area": (
        r"4\pi\sqrt{\det C_{xy}} \quad \textrm{(in space } 5\pi\sqrt{\det C_{xy}}\textrm{)}",
        "0 and more",
        "Ellipse with the second moments $C$ of the positions.",
    ),
    "elongation": (r"\sqrt{\lambda_1/\lambda_2}", "1 and more", "Eigenvalues of the second moments in the plane."),
    "volume": (r"\frac{4}{3}\pi\,5^{3/2}\sqrt{\det C}", "0 and more; 0 in a plane"),
}


class Agent(NamedTuple):
    """Products of the offsets from the centre, m²."""

    xx: float
    yy: float
    zz: float
    xy: float
    yz: float
    zx: float


class Sample(NamedTuple):
    """Area of the ground plan (m²), long over short axis of it, and volume (m³; 0 in a plane)."""

    area: float
    elongation: float
    volume: float


def agent(x, y, z, mean):
    """Second moments of one agent about the centre."""
    dx = x - mean.x
    dy = y - mean.y
    dz = z - mean.z
    return Agent(dx * dx, dy * dy, dz * dz, dx * dy, dy * dz, dz * dx)


def sample(agents, n, dimensions):
    """Area and elongation from the moments in the plane; volume from all."""
    a = agents.xx / n
    b = agents.yy / n
    c = agents.zz / n
    d = agents.xy / n
    e = agents.yz / n
    f = agents.zx / n
    flat = a * b - d * d
    flat = flat if flat > FLAT * a * b else 0.0
    half = 0.5 * (a + b)
    tilt = 0.5 * (a - b)
    long = half + math.sqrt(tilt * tilt + d * d)
    elongation = math.sqrt(long / max(flat / max(long, 1e-30), 1e-12 * half + 1e-30))
    full = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
    full = full if full > FLAT * a * b * c else 0.0
    scale = 20.0 / 3.0 * math.sqrt(5.0) * math.pi  # 4/3 pi 5^(3/2)
    area = math.pi * (4.0 if dimensions < 2.5 else 5.0) * math.sqrt(flat)
    return Sample(area, elongation, scale * math.sqrt(full) if dimensions > 2.5 else 0.0)
