"""Inside: whether a position lies within surfaces that close around it, by how often straight lines leave them.

A line from within a closed surface leaves it once more than it enters it, whichever way it goes. So
the number of crossings outwards less those inwards (the winding number) is 0 outside and within a
cavity, and not 0 inside, also where closed bodies overlap or are turned inside out. Two lines of
three decide, because one through an edge that two triangles share may count it twice: random places
in a region that is shut would find each place where a line errs.
"""

from airflock.core import FAR
from airflock.world.casts import entry, inverse, ray_to_shape
from airflock.world.shapes import CLOSED, SEGMENT


def outwards(ux, uy, uz, shapes, k):
    """1.0 if a line in the direction u leaves through row k, a triangle or a segment, -1.0 if it enters."""
    ex = shapes[k][9] - shapes[k][7]
    ey = shapes[k][10] - shapes[k][8]
    if shapes[k][6] == SEGMENT:
        return 1.0 if ux * ey > uy * ex else -1.0
    ex = shapes[k][10] - shapes[k][7]
    ey = shapes[k][11] - shapes[k][8]
    ez = shapes[k][12] - shapes[k][9]
    fx = shapes[k][13] - shapes[k][7]
    fy = shapes[k][14] - shapes[k][8]
    fz = shapes[k][15] - shapes[k][9]
    out = ux * (ey * fz - ez * fy) + uy * (ez * fx - ex * fz) + uz * (ex * fy - ey * fx)
    return 1.0 if out > 0.0 else -1.0


def winding(x, y, z, ux, uy, uz, shapes, nodes, links):
    """Crossings outwards less those inwards of the line from a position along u, through closed surfaces."""
    # Odd wherever the parity of crossings is odd, so faces that look inwards cost nothing; parts
    # with a free edge are left out.
    count = 0.0
    ix = inverse(ux)
    iy = inverse(uy)
    iz = inverse(uz)
    i = 0
    while i < len(nodes):
        if entry(x, y, z, ix, iy, iz, nodes, i, 0.0) < FAR:
            for k in range(links[i][1], links[i][2]):
                if (shapes[k][CLOSED] > 0.5) & (ray_to_shape(x, y, z, ux, uy, uz, shapes, k, 0.0) < FAR):
                    count += outwards(ux, uy, uz, shapes, k)
            i += 1
        else:
            i = links[i][0]
    return count


def inside(x, y, z, shapes, nodes, links):
    """1.0 if a position lies within closed surfaces made of triangles or, in a plane, of segments; else 0.0."""
    # Three directions without a rational relation to axes or to each other: edges of buildings are
    # parallel to axes, and one line through a shared edge may count it twice.
    first = winding(x, y, z, 0.3103, 0.1702, 0.9353, shapes, nodes, links)
    second = winding(x, y, z, -0.6403, 0.5401, -0.5462, shapes, nodes, links)
    if (first == 0.0) == (second == 0.0):
        return 0.0 if first == 0.0 else 1.0
    return 0.0 if winding(x, y, z, 0.5507, -0.8206, -0.1536, shapes, nodes, links) == 0.0 else 1.0
