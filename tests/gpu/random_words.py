"""Draws random words, uniform and normal numbers by the device's text in the CUDA simulator, and compares them."""

import json
import sys
import warnings
from pathlib import Path

import numpy as np
from numba import cuda

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import simulator  # noqa: E402

from airflock.core import random  # noqa: E402
from airflock.engine.text.generate import DriverSource  # noqa: E402
from inside import Shape, head, load_driver  # noqa: E402

LOOP = """
@cuda.jit()
def fill(counters, words, uniforms, normals):
    i = cuda.threadIdx.x
    a, b, c, d, e, f = counters[0, i], counters[1, i], counters[2, i], counters[3, i], counters[4, i], counters[5, i]
    w0, w1, w2, w3 = {philox}(a, b, c, d, e, f)
    words[0, i] = w0
    words[1, i] = w1
    words[2, i] = w2
    words[3, i] = w3
    uniforms[i] = uniform(w0)
    normals[0, i], normals[1, i] = normal_pair(w0, w1)
"""

if __name__ == "__main__":
    simulator.quick()
    warnings.simplefilter("ignore", RuntimeWarning)
    rng, n = np.random.default_rng(int(sys.argv[1])), 200
    counters = rng.integers(0, 2**32, (6, n))
    counters[:, :2] = [[0, 0xFFFFFFFF]] * 6
    source = DriverSource("@njit(**JIT)", {})
    loop = LOOP.format(philox=source.name(random.philox))
    text = [head("random numbers", 64, Shape(32, 1, 32, simulated=True)), *source.blocks, loop]
    driver = load_driver("\n\n".join(text), "random_cuda")
    words, uniforms, normals = np.zeros((4, n), np.uint32), np.zeros(n), np.zeros((2, n))
    driver.fill[1, n](counters, words, uniforms, normals)
    plain = [random.philox(*column) for column in counters.T.tolist()]
    pairs = [random.normal_pair(w[0], w[1]) for w in plain]
    found = {
        "counters": n,
        "wrong_words": int((np.array(plain) != words.T).sum()),
        "wrong_uniforms": int((uniforms != [random.uniform(w[0]) for w in plain]).sum()),
        "normals": float(np.abs(normals.T - np.array(pairs)).max()),
    }
    assert cuda is not None
    json.dump(found, sys.stdout)
