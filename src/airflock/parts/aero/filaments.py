"""Filaments: the downwash of discrete trailing and bound vortex filaments, and its slopes.

A wing is m horseshoes side by side: bound segments across, two trailing legs each, straight back to
infinity. Seen from another wing the downwash depends on the offset d = receiver - source alone, and
with equal segments the influence of segment e on control point k depends on k - e alone: one row of
2 m - 1 numbers stands for a block of m x m. Column k - e + shift(m) of a row holds it; the columns
before the first are zeros.
"""

import math

from airflock.parts.aero.wing import lanes

HOLE = 1e-20  # m², under a root or a quotient: on its own axis a filament induces nothing
SHARE = 1.0 / (4.0 * math.pi)


def leg(dx, y, dz, core2):
    """4 pi / circulation times the downwash of a trailing leg and of the bound line that ends in it, 1/m.

    dx, y, dz : control point minus the end of the leg, m; core2 : square of the viscous core, m²
    Dimock & Selig 2003, Eqs 5 and 6; the difference of two legs is a horseshoe.
    """
    across2 = y * y + dz * dz
    along2 = dx * dx + dz * dz
    u = 1.0 / math.sqrt(across2 + dx * dx + HOLE)
    return y * ((1.0 - dx * u) / (across2 + core2 + HOLE) - dx * u / (along2 + core2 + HOLE))


def leg_slopes(dx, y, dz, core2):
    """Derivatives of `leg` with respect to dx, y and dz, 1/m²."""
    g = 1.0 / (y * y + dz * dz + core2 + HOLE)
    q = 1.0 / (dx * dx + dz * dz + core2 + HOLE)
    u = 1.0 / math.sqrt(dx * dx + y * y + dz * dz + HOLE)
    u3 = u * u * u
    back = 1.0 - dx * u
    both = g + q
    sx = y * (dx * dx * u3 * both - u * both + 2.0 * dx * dx * q * q * u)
    sy = back * g * (1.0 - 2.0 * y * y * g) - dx * q * u + dx * y * y * u3 * both
    sz = y * dz * (2.0 * dx * u * q * q - 2.0 * back * g * g + dx * u3 * both)
    return sx, sy, sz


def influences(table, row, dx, dy, dz, m, h, core2):
    """Write one row: downwash (m/s) per unit circulation at control point k of segment e.

    table : (rows, m + lanes(m)); dx, dy, dz : centre of the receiving wing minus centre of the
            source, m; h : pitch, m
    """
    first = lanes(m) - m
    for k in range(2 * m):
        table[row][first + k] = leg(dx, dy + (float(k - m) + 0.5) * h, dz, core2)
    for k in range(2 * m - 1):
        table[row][first + k] = (table[row][first + k + 1] - table[row][first + k]) * SHARE


def add_wash(wash, i, table, row, circulation, j, m):
    """Add to row i of `wash` what the circulations in row j induce: one row of the table stands for the block."""
    # The influence of segment e on point k depends on k - e only, so one row of 2 m - 1 numbers
    # stands for the m x m block.
    last = lanes(m) - m
    for first in range((m + 3) // 4):
        e = 4 * first
        a = circulation[j][e]
        b = circulation[j][e + 1]
        c = circulation[j][e + 2]
        d = circulation[j][e + 3]
        for k in range(m):
            n = k - e + m + last
            wash[i][k] = wash[i][k] + (
                table[row][n - 1] * a + table[row][n - 2] * b + table[row][n - 3] * c + table[row][n - 4] * d
            )


def add_product(result, i, matrix, vector, j, m):
    """Add to row i of `result` the product of a symmetric matrix (lanes(m), m) with row j of `vector`."""
    # Four source segments at a time: LLVM then vectorises over control points without a remainder
    # (24 ns for a pair, else 92).
    for first in range((m + 3) // 4):
        e = 4 * first
        a = vector[j][e]
        b = vector[j][e + 1]
        c = vector[j][e + 2]
        d = vector[j][e + 3]
        for k in range(m):
            result[i][k] = result[i][k] + (
                matrix[e][k] * a + matrix[e + 1][k] * b + matrix[e + 2][k] * c + matrix[e + 3][k] * d
            )


def influence_slopes(slopes, row, dx, dy, dz, m, h, core2):
    """Write three rows, from `row` on: derivatives of `influences` with respect to dx, dy and dz."""
    first = lanes(m) - m
    for k in range(2 * m):
        sx, sy, sz = leg_slopes(dx, dy + (float(k - m) + 0.5) * h, dz, core2)
        slopes[row][first + k] = sx
        slopes[row + 1][first + k] = sy
        slopes[row + 2][first + k] = sz
    for j in range(3):
        for k in range(2 * m - 1):
            e = first + k
            slopes[row + j][e] = (slopes[row + j][e + 1] - slopes[row + j][e]) * SHARE
