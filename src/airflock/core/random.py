"""Counter-based random numbers: a number is a function of (seed, stream, world, step, agent).

Philox 4x32-10 (Salmon et al. 2011). The counter holds agent, step, stream with draw, and world; the
key holds the seed. So no number depends on the order of evaluation, on threads or on who else
draws, and a new noise source never shifts another. The functions named in `PRIMITIVES` are written
here for plain Python integers and floats; a device binds its own form of the same arithmetic
(`airflock.engine.primitives`).
"""

import math

# Every stream of the project; each may draw 256 times per step. Numbers are never reused: 4, 5 and
# 9 are taken. Streams 4 and 5 were the loss and the link of each packet; one draw replaced both. A
# number is never used again, so that no old and new flight share noise by accident.
SENSOR = 1  # Langevin noise of own and of sent measurements
OUTER = 2  # white outer noise on the acceleration
START = 3  # where the agents start
GUST = 6  # wind gusts, common to the flock
MODEL = 7  # noise that a model requests through percept.normal and percept.uniform
SCENE = 8  # the scene of a flight, where each flight has its own
FAULT = 10  # onset and agents of faults: step is the occurrence, agent the entry or the one that may be hit
SPREAD = 11  # tolerances of manufacture: step is the number's place in its record
PACKET = 12  # arrival of packets: agent is the number of the pair, `pair_number`
FADE = 16  # strength of the signal between one pair, the same both ways
AIR = 17  # numbers of the rules of a radio: agent is the number of the pair, receiver * agents + sender

# A device binds these, and compiles of each function in COMPILED the form that calls them.
PRIMITIVES = ("word", "multiply_high", "multiply_low", "add32", "xor32", "uniform", "normal_pair")

MASK = 0xFFFFFFFF
QUARTER_PI = 0.25 * math.pi


def word(a):
    """An integer as a 32-bit word."""
    return a & MASK


def multiply_high(a, b):
    """Upper 32 bits of the product of two 32-bit words."""
    return (a * b) >> 32


def multiply_low(a, b):
    """Lower 32 bits of the product of two 32-bit words."""
    return (a * b) & MASK


def add32(a, b):
    """Sum of two 32-bit words, modulo 2^32."""
    return (a + b) & MASK


def xor32(a, b):
    """Bitwise exclusive or of two 32-bit words."""
    return a ^ b


def philox(c0, c1, c2, c3, k0, k1):
    """Four random words of 32 bits from a counter of four words and a key of two."""
    c0, c1, c2, c3, k0, k1 = c0 & MASK, c1 & MASK, c2 & MASK, c3 & MASK, k0 & MASK, k1 & MASK
    # Ten rounds, as in the paper. The rounds are written twice: with operators they take 0.6 of the
    # time in plain Python, by primitives a device binds its own words.
    for _ in range(10):
        a, b = 0xD2511F53 * c0, 0xCD9E8D57 * c2
        c0, c1, c2, c3 = (b >> 32) ^ c1 ^ k0, b & MASK, (a >> 32) ^ c3 ^ k1, a & MASK
        k0, k1 = (k0 + 0x9E3779B9) & MASK, (k1 + 0xBB67AE85) & MASK
    return c0, c1, c2, c3


def philox_of_words(c0, c1, c2, c3, k0, k1):
    """Compute `philox` by the primitives of a device, whose words have other operators; drivers hold this form."""
    c0, c1, c2, c3, k0, k1 = word(c0), word(c1), word(c2), word(c3), word(k0), word(k1)
    for _ in range(10):
        h0 = multiply_high(0xD2511F53, c0)
        l0 = multiply_low(0xD2511F53, c0)
        h1 = multiply_high(0xCD9E8D57, c2)
        l1 = multiply_low(0xCD9E8D57, c2)
        c0 = xor32(xor32(h1, c1), k0)
        c1 = l1
        c2 = xor32(xor32(h0, c3), k1)
        c3 = l0
        k0 = add32(k0, 0x9E3779B9)
        k1 = add32(k1, 0xBB67AE85)
    return c0, c1, c2, c3


COMPILED = {philox: philox_of_words}


def draw(c0, c1, c2, c3, k0, k1):
    """Compute philox, compiled once and called, where no loop over agents has to vectorise around it."""
    return philox(c0, c1, c2, c3, k0, k1)


def random_words(seed, stream, world, step, agent, draw=0):
    """Four random words of 32 bits for one consumer; seed may use 64 bits, the others 32, draw 8."""
    return philox(agent, step, stream + 256 * draw, world, seed, seed >> 32)


def pair_number(receiver, sender, agents):
    """Number of a pair among so many agents. Four receivers share one: the word of each is receiver & 3 of the four."""
    # Four receivers share the four words of one call. The number does not depend on who draws or in
    # which order.
    return (receiver >> 2) * agents + sender


def pair_uniform(seed, stream, world, step, receiver, sender, agents):
    """Uniform number of one receiver and one sender, strictly between 0 and 1, in one step."""
    return uniform(random_words(seed, stream, world, step, pair_number(receiver, sender, agents))[receiver & 3])


def uniform(word):
    """A word as a float strictly between 0 and 1, from its upper 23 bits: exactly the same in every precision."""
    return ((word >> 9) + 0.5) / 8388608.0


def normal_pair(a, b):
    """Two independent normal numbers N(0, 1) from two words (Box and Muller); at most 5.8 standard deviations."""
    radius = math.sqrt(-2.0 * math.log(uniform(a)))
    # The angle lies within a quarter turn, where a polynomial for sine and cosine is short; two
    # further bits choose the quarter, so that no bit of the word is used twice.
    angle = (((b << 2) & MASK) ^ 0x80000000) - 0x80000000  # the lower 30 bits as a signed word
    s = math.sin(angle * (QUARTER_PI / 2147483648.0))
    c = math.cos(angle * (QUARTER_PI / 2147483648.0))
    if b & 0x80000000:  # the upper two bits choose the quarter turn
        radius = -radius
    if b & 0x40000000:
        return radius * s, radius * c
    return radius * c, radius * s
