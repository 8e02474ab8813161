"""Packing: positions as whole numbers of 16 bits, rows of bytes beside them, as differences in time, deflated.

`unpack_positions` is what the page does.
"""

import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

MAX_QUANTA = 65535  # of 16 bits


class PackedPositions(NamedTuple):
    """Positions as bytes.

    low     : smallest coordinate of each axis, m
    quantum : of each axis, m; positions are kept to half of it
    shape   : frames, axes, agents
    data    : zlib stream of the low bytes of all differences and then of the high ones; in both, each axis after the
              other, each agent after the other, frame by frame; then the differences of each row of bytes
    """

    low: list[float]
    step: list[float]
    shape: tuple[int, int, int]
    data: bytes


def pack_positions(position: NDArray[Any], rows: Sequence[NDArray[np.uint8]] = ()) -> PackedPositions:
    """Pack positions (time, axis, agent), m, all finite, and rows of bytes (time, agent) beside them."""
    given = np.asarray(position, float)
    low, high = given.min(axis=(0, 2)), given.max(axis=(0, 2))
    quantum = np.maximum((high - low) / MAX_QUANTA, 1e-12)
    whole = np.round((given - low[:, None]) / quantum[:, None]).astype(np.uint16)
    steps = whole.copy()
    steps[1:] -= whole[:-1]  # modulo 2^16, which adding up undoes
    series = np.ascontiguousarray(steps.transpose(1, 2, 0)).ravel()
    data = (series & 0xFF).astype(np.uint8).tobytes() + (series >> 8).astype(np.uint8).tobytes()
    data += b"".join(np.diff(row, axis=0, prepend=row[:1] * 0).T.tobytes() for row in rows)  # modulo 2^8
    frames, axes, agents = given.shape
    return PackedPositions(low.tolist(), quantum.tolist(), (frames, axes, agents), zlib.compress(data, 9))


def unpack_positions(packed: PackedPositions) -> tuple[NDArray[np.float64], list[NDArray[np.uint8]]]:
    """Positions (time, axis, agent), m, within half a quantum of those packed, and the rows of bytes."""
    frames, axes, agents = packed.shape
    data = np.frombuffer(zlib.decompress(packed.data), np.uint8)
    halves = data[: 2 * frames * axes * agents].reshape(2, -1).astype(np.uint16)
    series = (halves[0] | halves[1] << 8).reshape(axes, agents, frames)
    whole = np.add.accumulate(series, axis=2, dtype=np.uint16)
    scaled = whole * np.array(packed.step)[:, None, None] + np.array(packed.low)[:, None, None]
    rest = data[2 * frames * axes * agents :].reshape(-1, agents, frames)
    rows = [np.add.accumulate(row, axis=1, dtype=np.uint8).T for row in rest]
    return np.asarray(scaled.transpose(2, 0, 1)), rows
