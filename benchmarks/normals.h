/* Random numbers: a number is a function of seed, stream, step and agent (Philox), normal by Box and Muller. */
#ifndef NORMALS_H
#define NORMALS_H

#include "flock.h"

enum { SENSOR = 1, OUTER = TRIAL ? 0 : 2, START = TRIAL ? 2 : 3 }; /* streams */

/* Philox 4x32-10 (Salmon et al. 2011). */
INLINE void philox(uint32_t c0, uint32_t c1, uint32_t c2, uint32_t c3, uint32_t k0, uint32_t k1, uint32_t out[4])
{
#pragma GCC unroll 10
    for (int round = 0; round < 10; round++) {
        uint64_t a = (uint64_t)0xD2511F53u * c0, b = (uint64_t)0xCD9E8D57u * c2;
        c0 = (uint32_t)(b >> 32) ^ c1 ^ k0;
        c1 = (uint32_t)b;
        c2 = (uint32_t)(a >> 32) ^ c3 ^ k1;
        c3 = (uint32_t)a;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    out[0] = c0, out[1] = c1, out[2] = c2, out[3] = c3;
}

/* A word as a real in (0, 1), from its upper 23 bits: exact in both precisions. */
INLINE real uniform(uint32_t word)
{
    return TRIAL ? ((real)(int32_t)(word >> 8) + (real)0.5) * (real)(1.0 / 16777216.0)
                 : ((real)(int32_t)(word >> 9) + (real)0.5) * (real)(1.0 / 8388608.0);
}

/* log u = e log 2 + log m with m near 1: Cephes' polynomial in single, the series of atanh in double precision. */
INLINE float log_single(float u)
{
    int32_t bits;
    memcpy(&bits, &u, 4);
    int32_t e = (bits - 0x3F3504F3) >> 23;
    bits -= (int32_t)((uint32_t)e << 23);
    float m;
    memcpy(&m, &bits, 4);
    float f = m - 1.0f, z = f * f, p = 7.0376836292e-2f;
    p = p * f - 1.1514610310e-1f;
    p = p * f + 1.1676998740e-1f;
    p = p * f - 1.2420140846e-1f;
    p = p * f + 1.4249322787e-1f;
    p = p * f - 1.6668057665e-1f;
    p = p * f + 2.0000714765e-1f;
    p = p * f - 2.4999993993e-1f;
    p = p * f + 3.3333331174e-1f;
    return f * z * p - 0.5f * z + f + (float)e * 0.69314718f;
}

INLINE double log_double(double u)
{
    int64_t bits;
    memcpy(&bits, &u, 8);
    int64_t shifted = bits - 0x3FE6A09E667F3BCDLL;
    int32_t e = (int32_t)(shifted >> 32) >> 20; /* a shift of 64-bit integers would not vectorise everywhere */
    bits -= (int64_t)((uint64_t)(int64_t)e << 52);
    double m;
    memcpy(&m, &bits, 8);
    double s = (m - 1.0) / (m + 1.0), z = s * s, p = 1.0 / 23.0;
    p = p * z + 1.0 / 21.0;
    p = p * z + 1.0 / 19.0;
    p = p * z + 1.0 / 17.0;
    p = p * z + 1.0 / 15.0;
    p = p * z + 1.0 / 13.0;
    p = p * z + 1.0 / 11.0;
    p = p * z + 1.0 / 9.0;
    p = p * z + 1.0 / 7.0;
    p = p * z + 1.0 / 5.0;
    p = p * z + 1.0 / 3.0;
    p = p * z + 1.0;
    return (double)e * 0.6931471805599453 + 2.0 * s * p;
}

/* Sine and cosine on (-pi/4, pi/4): Cephes' minimax polynomials. */
INLINE void turn_single(float g, float *sine, float *cosine)
{
    float y = g * g, s = -1.9515295891e-4f, c = 2.443315711809948e-5f;
    s = s * y + 8.3321608736e-3f;
    s = s * y - 1.6666654611e-1f;
    c = c * y - 1.388731625493765e-3f;
    c = c * y + 4.166664568298827e-2f;
    *sine = g + g * y * s;
    *cosine = c * y * y - 0.5f * y + 1.0f;
}

INLINE void turn_double(double g, double *sine, double *cosine)
{
    double y = g * g, s = -7.647163731819816e-13, c = 4.779477332387385e-14;
    s = s * y + 1.605904383682161e-10;
    s = s * y - 2.505210838544172e-08;
    s = s * y + 2.755731922398589e-06;
    s = s * y - 1.984126984126984e-04;
    s = s * y + 8.333333333333333e-03;
    s = s * y - 1.666666666666667e-01;
    c = c * y - 1.147074559772972e-11;
    c = c * y + 2.087675698786810e-09;
    c = c * y - 2.755731922398589e-07;
    c = c * y + 2.480158730158730e-05;
    c = c * y - 1.388888888888889e-03;
    c = c * y + 4.166666666666666e-02;
    c = c * y - 0.5;
    *sine = g + g * y * s;
    *cosine = c * y + 1.0;
}

/* Two independent normal numbers (Box and Muller); the upper two bits of b choose the quarter turn. */
INLINE void normal_pair(uint32_t a, uint32_t b, real *first, real *second)
{
    real turned = (real)(int32_t)(b << 2) * (real)(0.7853981633974483 / 2147483648.0), s, c, radius;
    if (sizeof(real) == 8) {
        double sine, cosine;
        radius = root(-2 * (real)log_double(uniform(a)));
        turn_double(turned, &sine, &cosine);
        s = (real)sine, c = (real)cosine;
    } else {
        float sine, cosine;
        radius = root(-2 * (real)log_single((float)uniform(a)));
        turn_single((float)turned, &sine, &cosine);
        s = sine, c = cosine;
    }
    radius = b & 0x80000000u ? -radius : radius;
    int swap = (b & 0x40000000u) != 0;
    *first = radius * (swap ? s : c);
    *second = radius * (swap ? c : s);
}

/* The same for a block of agents at once. Lanes of 64 bits hold one word each, in their lower half: a 32-bit multiplication
   then gives both halves of the product where they are wanted, and nothing has to be shuffled. What is left in the upper
   halves does not matter. Even agents are in one vector, odd agents in another, so that both together are one of 32-bit
   words. */
typedef uint64_t lanes __attribute__((vector_size(VECTOR)));
enum { BLOCK = 2 * VECTOR / 8 }; /* agents */

INLINE lanes multiply(lanes a, lanes b)
{
#if VECTOR == 64
    return (lanes)_mm512_mul_epu32((__m512i)a, (__m512i)b);
#elif VECTOR == 32
    return (lanes)_mm256_mul_epu32((__m256i)a, (__m256i)b);
#else
    return (a & 0xFFFFFFFFu) * b;
#endif
}

INLINE void philox_lanes(lanes c[4], uint32_t k0, uint32_t k1)
{
    const lanes m0 = (lanes){} + 0xD2511F53u, m1 = (lanes){} + 0xCD9E8D57u;
#pragma GCC unroll 10
    for (int round = 0; round < 10; round++) {
        lanes a = multiply(c[0], m0), b = multiply(c[2], m1);
        c[0] = b >> 32 ^ c[1] ^ (uint64_t)k0;
        c[1] = b;
        c[2] = a >> 32 ^ c[3] ^ (uint64_t)k1;
        c[3] = a;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
}

/* Four normal numbers per agent. */
PASS void normals(flock *f, uint32_t step, uint32_t stream, const schedule *s)
{
    lanes agent = {};
    for (int lane = 0; lane < BLOCK / 2; lane++) agent[lane] = 2 * (uint64_t)lane;
    for (int i = 0; i < ROOM; i += BLOCK, agent += BLOCK) {
        lanes even[4] = {agent, (lanes){} + step, (lanes){} + stream}, odd[4] = {agent + 1, even[1], even[2]};
        philox_lanes(even, s->seed_low, s->seed_high);
        philox_lanes(odd, s->seed_low, s->seed_high);
        for (int w = 0; w < 4; w++) {
            lanes both = (even[w] & 0xFFFFFFFFu) | odd[w] << 32;
            memcpy(&f->word[w][i], &both, sizeof both);
        }
    }
    for (int i = 0; i < ROOM; i++) normal_pair(f->word[0][i], f->word[1][i], &f->g[0][i], &f->g[1][i]);
    for (int i = 0; i < ROOM; i++) normal_pair(f->word[2][i], f->word[3][i], &f->g[2][i], &f->g[3][i]);
}

#endif
