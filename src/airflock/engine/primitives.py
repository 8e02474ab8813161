"""Random primitives for a CPU, as driver text: the arithmetic of `core.random` in machine words.

The integers are identical to the plain form. The normal numbers use polynomials for logarithm, sine
and cosine instead of the C library, whose scalar calls would stop vectorisation; they agree with
the plain form to rounding.
"""

from airflock.engine import vectors
from airflock.engine.stages.words import CONSTANTS


def _written(number: float) -> str:
    """A number as driver text: 0.5, 1e30."""
    short, power = repr(float(number)), f"{number:.0e}".replace("e+0", "e").replace("e+", "e")
    return min(short, power, key=len)


DECLARED = "\n".join(f"{constant.spelled} = real({_written(constant)})" for constant in CONSTANTS)

MACHINE = """
u32 = np.uint32
u64 = np.uint64
"""
# Words of 32 bits as such, for processors that multiply them as fast as they add them: those of a
# GPU.
NARROW = (
    MACHINE
    + """
@njit(**INLINE)
def word(a):
    return u32(a)

@njit(**INLINE)
def multiply_high(a, b):
    return u32((u64(u32(a)) * u64(u32(b))) >> u64(32))

@njit(**INLINE)
def multiply_low(a, b):
    return u32(u64(u32(a)) * u64(u32(b)))

@njit(**INLINE)
def add32(a, b):
    return u32(u32(a) + u32(b))

@njit(**INLINE)
def xor32(a, b):
    return u32(u32(a) ^ u32(b))

@njit(**INLINE)
def uniform(word):
    return (real(np.int32(word >> u32(9))) + real(0.5)) * real(1.0 / 8388608.0)
"""
)
# Words of 32 bits in lanes of 64: one product has both halves. In lanes of 32, LLVM multiplies
# three times for them.
WIDE = (
    MACHINE
    + """
@njit(**INLINE)
def word(a):
    return u64(u32(a))

@njit(**INLINE)
def multiply_high(a, b):
    return (word(a) * word(b)) >> u64(32)

@njit(**INLINE)
def multiply_low(a, b):
    return word(word(a) * word(b))

@njit(**INLINE)
def add32(a, b):
    return word(a + b)

@njit(**INLINE)
def xor32(a, b):
    return a ^ b

@njit(**INLINE)
def uniform(word):
    return (real(np.int32(u32(word) >> u32(9))) + real(0.5)) * real(1.0 / 8388608.0)
"""
)

# log: x = 2^e m with m near 1; log m by a polynomial (Cephes' logf coefficients), or by the series
# of atanh.
LOG32 = """
@njit(**INLINE)
def log_uniform(u):
    bits = as_bits(np.float32(u))
    e = np.int32(np.int32(bits - np.int32(0x3F3504F3)) >> np.int32(23))  # Numba would go on in 64 bits
    m = as_number(np.int32(bits - np.int32(e << np.int32(23))))
    f = m - real(1.0)
    z = f * f
    p = real(7.0376836292e-2)
    p = p * f - real(1.1514610310e-1)
    p = p * f + real(1.1676998740e-1)
    p = p * f - real(1.2420140846e-1)
    p = p * f + real(1.4249322787e-1)
    p = p * f - real(1.6668057665e-1)
    p = p * f + real(2.0000714765e-1)
    p = p * f - real(2.4999993993e-1)
    p = p * f + real(3.3333331174e-1)
    return f * z * p - real(0.5) * z + f + real(e) * real(0.69314718)
"""
LOG64 = """
@njit(**INLINE)
def log_uniform(u):
    bits = as_bits(np.float64(u))
    e = (bits - 0x3FE6A09E667F3BCD) >> 52
    m = as_number(np.int64(bits - (e << 52)))
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    p = 1.0 / 23.0
    p = p * z + 1.0 / 21.0
    p = p * z + 1.0 / 19.0
    p = p * z + 1.0 / 17.0
    p = p * z + 1.0 / 15.0
    p = p * z + 1.0 / 13.0
    p = p * z + 1.0 / 11.0
    p = p * z + 1.0 / 9.0
    p = p * z + 1.0 / 7.0
    p = p * z + 1.0 / 5.0
    p = p * z + 1.0 / 3.0
    p = p * z + 1.0
    return real(np.int32(e)) * 0.6931471805599453 + 2.0 * s * p
"""
# sine and cosine on (-pi/4, pi/4): Cephes' minimax polynomials in each precision.
TURN32 = """
@njit(**INLINE)
def sine_cosine(g):
    y = g * g
    s = real(-1.9515295891e-4)
    s = s * y + real(8.3321608736e-3)
    s = s * y - real(1.6666654611e-1)
    s = g + g * y * s
    c = real(2.443315711809948e-5)
    c = c * y - real(1.388731625493765e-3)
    c = c * y + real(4.166664568298827e-2)
    c = c * y * y - real(0.5) * y + real(1.0)
    return s, c
"""
TURN64 = """
@njit(**INLINE)
def sine_cosine(g):
    y = g * g
    s = -7.647163731819816e-13
    s = s * y + 1.605904383682161e-10
    s = s * y - 2.505210838544172e-08
    s = s * y + 2.755731922398589e-06
    s = s * y - 1.984126984126984e-04
    s = s * y + 8.333333333333333e-03
    s = s * y - 1.666666666666667e-01
    s = g + g * y * s
    c = 4.779477332387385e-14
    c = c * y - 1.147074559772972e-11
    c = c * y + 2.087675698786810e-09
    c = c * y - 2.755731922398589e-07
    c = c * y + 2.480158730158730e-05
    c = c * y - 1.388888888888889e-03
    c = c * y + 4.166666666666666e-02
    c = c * y - 0.5
    c = c * y + 1.0
    return s, c
"""
NORMAL = """
@njit(**INLINE)
def normal_pair(a, b):
    b = u32(b)
    radius = math.sqrt(real(-2.0) * log_uniform(uniform(a)))
    s, c = sine_cosine(real(np.int32(b << u32(2))) * real(0.7853981633974483 / 2147483648.0))
    radius = -radius if (b & u32(0x80000000)) != u32(0) else radius
    swap = (b & u32(0x40000000)) != u32(0)
    return radius * (s if swap else c), radius * (c if swap else s)
"""


def random_primitives(bits: int) -> str:
    """Text of all primitives for float32 or float64, after those of `vectors`."""
    return vectors.EXTREME_TEXT + WIDE + (LOG32 + TURN32 if bits == 32 else LOG64 + TURN64) + NORMAL
