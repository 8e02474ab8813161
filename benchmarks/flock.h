/* What one flight keeps in memory, and the scalar mathematics of its rules.

   Every loop over agents runs over whole rows of ROOM reals. The rows behind the last agent hold agents that are AWAY:
   out of everybody's range, and left out of every sum. */
#ifndef FLOCK_H
#define FLOCK_H

#include "vasarhelyi.h"

#include <math.h>
#include <string.h>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#if defined(VECTOR_BYTES)
#define VECTOR VECTOR_BYTES
#elif defined(__AVX512F__)
#define VECTOR 64
#elif defined(__AVX2__)
#define VECTOR 32
#else
#define VECTOR 16
#endif
_Static_assert(ROOM % (VECTOR / 4) == 0, "ROOM is a whole number of vectors of 32-bit words");

/* TRIAL_PHYSICS: neighbours are chosen by where they are heard instead of where they are; one error process serves own
   and sent measurements, and neighbours are heard with the error of then; the controller knows its true velocity; four
   walls act instead of the nearer of each axis; agents start on a jittered grid; no nearest distances, no lap, no
   polarisation, no collision events; phi_wall is a sum over axes. */
#ifdef TRIAL_PHYSICS
enum { TRIAL = 1 };
#else
enum { TRIAL = 0 };
#endif

#define INLINE static inline __attribute__((always_inline))
#define PASS static __attribute__((noinline)) /* one stage, one function: a profile then reads like the model */

static const real TINY = (real)1e-12; /* guards the length of a zero vector */
static const real AWAY = (real)1e9;
static const real FAR = (real)1e30;

typedef __typeof__(_Generic((real)0, double: (int64_t)0, default: (int32_t)0)) whole; /* integers as wide as a real */

typedef struct {
    real x[ROOM], y[ROOM], vx[ROOM], vy[ROOM];
} __attribute__((aligned(64))) state;

typedef struct {
    state now;                                                       /* true state */
    state own_error, sent_error; /* of own measurements, and of what others hear */
    state measured, heard;       /* own state as an agent measures it, and as others hear it */
    real cx[ROOM], cy[ROOM];     /* command */
    real g[4][ROOM];             /* normal numbers, from these words: */
    uint32_t word[4][ROOM];
    real heading_x[ROOM], heading_y[ROOM], nearest2[ROOM];
    whole danger[ROOM], member[ROOM], expanded[ROOM];
} flock;

/* ---- Scalar mathematics ------------------------------------------------------------------------------------------ */

INLINE real least(real a, real b) { return a < b ? a : b; }
INLINE real most(real a, real b) { return a > b ? a : b; }
INLINE real root(real a) { return sizeof(real) == 8 ? (real)sqrt(a) : (real)sqrtf((float)a); }
INLINE real size(real a) { return sizeof(real) == 8 ? (real)fabs(a) : (real)fabsf((float)a); }
INLINE real length(real x, real y) { return root(x * x + y * y + TINY); }

/* Speed from which one can still stop within s (Eq. 4). */
INLINE real braking_curve(real s, real a, real p)
{
    s = most(s, 0);
    real linear = s * p, curve = root(most(2 * a * s - (a / p) * (a / p), 0));
    return linear * p < a ? linear : curve;
}

#endif
