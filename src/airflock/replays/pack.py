"""Packing of positions: whole numbers of 16 bits, as differences in time, deflated. `unpack` is what the page does."""

import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

STEPS = 65535  # of 16 bits


class Packed(NamedTuple):
    """Positions as bytes.

    low     : smallest coordinate of each axis, m
    quantum : of each axis, m; positions are kept to half of it
    shape   : frames, axes, agents
    data    : zlib stream of the low bytes of all differences and then of the high ones; in both, each axis after the
              other, each agent after the other, frame by frame
    """

    low: list[float]
    quantum: list[float]
    shape: tuple[int, int, int]
    data: bytes


def pack(position: NDArray[Any]) -> Packed:
    """Pack positions (time, axis, agent), m, all finite."""
    given = np.asarray(position, float)
    low, high = given.min(axis=(0, 2)), given.max(axis=(0, 2))
    quantum = np.maximum((high - low) / STEPS, 1e-12)
    whole = np.round((given - low[:, None]) / quantum[:, None]).astype(np.uint16)
    steps = whole.copy()
    steps[1:] -= whole[:-1]  # modulo 2^16, which adding up undoes
    series = np.ascontiguousarray(steps.transpose(1, 2, 0)).ravel()
    data = (series & 0xFF).astype(np.uint8).tobytes() + (series >> 8).astype(np.uint8).tobytes()
    frames, axes, agents = given.shape
    return Packed(low.tolist(), quantum.tolist(), (frames, axes, agents), zlib.compress(data, 9))


def unpack(packed: Packed) -> NDArray[np.float64]:
    """Positions (time, axis, agent), m, within half a quantum of those packed."""
    frames, axes, agents = packed.shape
    halves = np.frombuffer(zlib.decompress(packed.data), np.uint8).reshape(2, -1).astype(np.uint16)
    series = (halves[0] | halves[1] << 8).reshape(axes, agents, frames)
    whole = np.add.accumulate(series, axis=2, dtype=np.uint16)
    scaled = whole * np.array(packed.quantum)[:, None, None] + np.array(packed.low)[:, None, None]
    return np.asarray(scaled.transpose(2, 0, 1))
