"""Visible neighbours: no other body, and no shape of the world, lies on the straight path to their centre.

Bodies are balls of one radius at the places where they are believed to be. One hides another if its
centre is nearer and the way to the other's centre passes through it; a way that only touches is
free. Our definition.
"""

from airflock.parts.topologies.ranking import HEARD_LIMIT

NEAR = True  # whoever is farther away hides nobody


def meet(n, dx, dy, dz, r2, hidden, met, t):
    """Fill `met`: 1.0 for each of the first n who can be seen.

    dx, dy, dz : offsets, m; r2 : their squares, m²; hidden : 1.0 behind what stands in the world;
                 t.radius : m
    """
    size = t.radius * t.radius
    for j in range(n):
        met[j] = 0.0
        if r2[j] < HEARD_LIMIT and hidden[j] < 0.5:
            free = 1.0
            for k in range(n):
                if r2[k] < r2[j] and free > 0.5:
                    along = dx[k] * dx[j] + dy[k] * dy[j] + dz[k] * dz[j]
                    if along > 0.0 and r2[k] * r2[j] - along * along < size * r2[j]:
                        free = 0.0
            met[j] = free
