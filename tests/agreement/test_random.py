"""Random numbers: published vectors, the same plain and compiled, and streams that know nothing of each other."""

import math

import numpy as np
import pytest
from scipy import stats

from airflock.core import random
from airflock.engine.text.generate import DriverSource
from airflock.recordings.simulation import packet_uniforms
from inside import HEAD, load_driver, primitives

# Random123 (Salmon et al. 2011), kat_vectors, philox4x32 with 10 rounds: counter, key, answer
ONES = 0xFFFFFFFF
KNOWN = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((ONES,) * 4, (ONES,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]
LOOP = """
@njit(cache=True, **JIT | CALLED)
def fill(counters, keys, words, uniforms, normals):
    for i in range(counters.shape[1]):
        c0, c1, c2, c3 = counters[0, i], counters[1, i], counters[2, i], counters[3, i]
        w0, w1, w2, w3 = {philox}(c0, c1, c2, c3, keys[0, i], keys[1, i])
        words[0, i] = w0; words[1, i] = w1; words[2, i] = w2; words[3, i] = w3
        uniforms[i] = {uniform}(w0)
        normals[0, i], normals[1, i] = {pair}(w0, w1)
        normals[2, i], normals[3, i] = {pair}(w2, w3)
    return 0
"""


@pytest.fixture(scope="module", params=[32, 64])
def compiled(request):
    """Function of counters (4, n) and keys (2, n) → words (4, n), uniforms (n,), normals (4, n), compiled."""
    bits = request.param
    source = DriverSource("@njit(**JIT)", {})
    names = {"philox": source.name(random.philox), "uniform": source.name(random.uniform)}
    text = LOOP.format(**names, pair=source.name(random.normal_pair))
    head = HEAD.format(label="random numbers", bits=bits, primitives=primitives(bits))
    driver = load_driver("\n\n".join([head, *source.blocks, text]), "random")
    real = np.float32 if bits == 32 else np.float64

    def draw(counters, keys):
        n = counters.shape[1]
        words, uniforms, normals = np.zeros((4, n), np.uint32), np.zeros(n, real), np.zeros((4, n), real)
        driver.fill(np.asarray(counters, np.int64), np.asarray(keys, np.int64), words, uniforms, normals)
        return words, uniforms, normals

    draw.bits = bits
    return draw


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_philox_gives_the_published_answers(counter, key, answer):
    assert random.philox(*counter, *key) == answer


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_compiled_philox_gives_the_published_answers(compiled, counter, key, answer):
    words, _, _ = compiled(np.array([counter]).T, np.array([key]).T)
    assert tuple(words[:, 0].tolist()) == answer


def test_compiled_numbers_are_the_plain_ones(compiled, seed):
    rng = np.random.default_rng(seed)
    counters, keys = rng.integers(0, 2**32, (4, 2000)), rng.integers(0, 2**32, (2, 2000))
    words, uniforms, normals = compiled(counters, keys)
    plain = np.array([random.philox(*c, *k) for c, k in zip(counters.T.tolist(), keys.T.tolist(), strict=True)]).T
    np.testing.assert_array_equal(words, plain)
    np.testing.assert_array_equal(uniforms, [random.uniform(w) for w in plain[0].tolist()])  # exact in both precisions
    pairs = [(*random.normal_pair(a, b), *random.normal_pair(c, d)) for a, b, c, d in plain.T.tolist()]
    np.testing.assert_allclose(normals, np.array(pairs).T, rtol=0.0, atol=3e-6 if compiled.bits == 32 else 2e-13)


@pytest.mark.parametrize("b", [0, 1, 0x3FFFFFFF, 0x40000000, 0x7FFFFFFF, 0x80000000, 0xC0000000, ONES])
@pytest.mark.parametrize("a", [0, 511, 512, 0x7FFFFFFF, ONES])
def test_normal_pair_is_finite_at_the_ends(a, b):
    x, y = random.normal_pair(a, b)
    assert math.hypot(x, y) == pytest.approx(math.sqrt(-2.0 * math.log(random.uniform(a))))
    assert math.hypot(x, y) < 5.8


@pytest.mark.parametrize("word", [0, 1, 511, 512, 0x7FFFFFFF, 0x80000000, ONES - 512, ONES])
def test_uniform_numbers_lie_strictly_inside_in_single_precision(word):
    assert 0.0 < np.float32(random.uniform(word)) < 1.0
    assert np.float32(random.uniform(word)) == random.uniform(word)


def test_every_stream_has_a_number_of_its_own():
    names = ("SENSOR", "OUTER", "START", "GUST", "MODEL", "PACKET")
    numbers = {getattr(random, name) for name in names}
    assert len(numbers) == len(names)
    assert all(0 < number < 256 for number in numbers)  # draws are counted above


@pytest.mark.parametrize("agents", [1, 2, 3, 4, 5, 31, 32])
def test_every_pair_of_a_flock_has_a_random_word_of_its_own(agents):
    pairs = [(i, j) for i in range(agents) for j in range(agents)]
    assert len({(random.pair_number(i, j, agents), i & 3) for i, j in pairs}) == len(pairs)
    table = packet_uniforms(2**40 + 5, 3, 17, agents)
    assert table.shape == (agents, agents)
    for i, j in pairs:
        assert table[i, j] == random.pair_uniform(2**40 + 5, random.PACKET, 3, 17, i, j, agents)


def test_receivers_that_share_a_call_hear_independently(seed):
    """Of 20,000 decisions: uniform numbers of the four receivers have mean 1/2 and no correlation, to 4.5 SD."""
    table = np.array([packet_uniforms(seed, 0, decision, 4)[:, 0] for decision in range(20_000)])
    assert np.abs(table.mean(axis=0) - 0.5).max() < 4.5 * math.sqrt(1 / 12 / len(table))
    shared = np.corrcoef(table.T) - np.eye(4)
    assert np.abs(shared).max() < 4.5 / math.sqrt(len(table))


def test_draws_of_a_stream_meet_no_other_stream():
    assert random.random_words(1, random.SENSOR, 0, 5, 2, draw=1) == random.philox(2, 5, random.SENSOR + 256, 0, 1, 0)
    seen = {(s + 256 * d) for s in range(1, 8) for d in range(256)}
    assert len(seen) == 7 * 256


def test_seeds_may_use_64_bits():
    low, high = random.random_words(7, 1, 0, 0, 0), random.random_words(7 + (1 << 32), 1, 0, 0, 0)
    assert low != high
    assert random.random_words(7 + (1 << 64), 1, 0, 0, 0) == low


N = 100_000


@pytest.fixture
def draws(compiled, seed):
    """Normal numbers (4, N) of one stream over agents 0-99 and steps, as flights use them."""
    agents, steps = np.arange(N) % 100, np.arange(N) // 100

    def draw(stream, world=0, key=seed, shift=(0, 0)):
        counters = np.stack([agents + shift[0], steps + shift[1], np.full(N, stream), np.full(N, world)])
        return compiled(counters, np.stack([np.full(N, key), np.zeros(N, int)]))

    return draw


@pytest.mark.parametrize("stream", [random.SENSOR, random.OUTER, random.GUST])
def test_moments_of_a_stream(draws, stream):
    _, uniforms, normals = draws(stream)
    five = 5.0 / math.sqrt(4 * N)  # five standard errors
    assert abs(normals.mean()) < five
    assert abs(normals.astype(float).var() - 1.0) < five * math.sqrt(2.0)
    assert abs(stats.skew(normals.ravel())) < five * math.sqrt(6.0)
    assert abs(stats.kurtosis(normals.ravel())) < five * math.sqrt(24.0)
    assert stats.kstest(normals.ravel(), "norm").pvalue > 1e-4
    assert stats.kstest(uniforms, "uniform").pvalue > 1e-4


def test_streams_draws_worlds_seeds_agents_and_steps_are_independent(draws, seed):
    base = draws(random.SENSOR)[2].astype(float)
    others = {
        "another stream": draws(random.OUTER),
        "another draw": draws(random.SENSOR + 256),
        "another world": draws(random.SENSOR, world=1),
        "the next seed": draws(random.SENSOR, key=seed + 1),
        "the next agent": draws(random.SENSOR, shift=(1, 0)),
        "the next step": draws(random.SENSOR, shift=(0, 1)),
    }
    rows = np.concatenate([base, *[found[2].astype(float) for found in others.values()]])
    for power in (1, 2):  # values and their squares
        correlation = np.corrcoef(rows**power)
        worst = np.abs(correlation - np.eye(len(rows))).max()
        # 378 pairs: six standard errors are exceeded by chance once in a million runs
        assert worst < 6.0 / math.sqrt(N)


ORDER = """
@njit(cache=True, **JIT | CALLED)
def order(a, b, i, j, found, counts):
    found[0] = min(a, b); found[1] = max(a, b); found[2] = min(a, i); found[3] = max(i, b)
    found[4] = as_number(as_bits(a))
    counts[0] = min(i, j); counts[1] = max(i, 3); counts[2] = min(i - j, integer(2)); counts[3] = as_bits(a)
    return 0
"""


@pytest.mark.parametrize("bits", [32, 64])
def test_lesser_greater_and_bits_of_numbers_are_those_of_python(bits):
    head = HEAD.format(label="order", bits=bits, primitives=primitives(bits))
    driver = load_driver("\n\n".join([head, ORDER]) + "\n", "order")
    real, whole = (np.float32, np.int32) if bits == 32 else (np.float64, np.int64)
    for a, b, i, j in ((1.5, -2.5, 4, 7), (-2.5, 1.5, -4, -7), (0.0, 0.0, 3, 3), (1e30, -1e30, 2, -(2**31))):
        found, counts = np.zeros(5, real), np.zeros(4, np.int64)
        driver.order(real(a), real(b), i, j, found, counts)
        assert found.tolist() == [real(x) for x in (min(a, b), max(a, b), min(a, i), max(i, b), a)]
        assert counts.tolist() == [min(i, j), max(i, 3), min(i - j, 2), real(a).view(whole)]
