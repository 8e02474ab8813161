/* The evaluation of Vásárhelyi et al. 2018 in hand-written C: what goes in and what comes out. SI units throughout.

   Build-time switches:
     -DREAL=double     double precision (float by default)
     -DROOM=112        length of a row: at least the number of agents, a multiple of 16
     -DVECTOR_BYTES=32 width of the vectors that are written out (the widest of the machine by default)
     -DTRIAL_PHYSICS   the reduced physics of an earlier hand-written evaluation, to compare the two (see flock.h) */
#ifndef VASARHELYI_H
#define VASARHELYI_H

#include <stdint.h>

#ifndef REAL
#define REAL float
#endif
#ifndef ROOM
#define ROOM 112
#endif
typedef REAL real;

typedef struct {
    real v_flock, r0_rep, p_rep, r0_frict, c_frict, v_frict, p_frict, a_frict; /* model, Table S1 */
    real r0_shill, v_shill, p_shill, a_shill;
    real tau, a_max, outer_noise;                /* body: s, m/s², diffusion constant m²/s³ */
    real sensor_noise, damping, spring;          /* errors of the sensors: m²/s², 1/s, 1/s² */
    real range, half_side, separation;           /* radio range, half side of the arena, least distance at the start */
    real r_coll, r_cluster;                      /* nearer pairs collide; nearer pairs are linked */
    real near, far, received_near, received_far, fast_rate, slow_rate; /* two lossy links: m, shares, 1/s */
    real dt, period;                             /* motion step; time between two decisions */
} parameters;

typedef struct {
    int64_t agents, steps;
    int64_t decide_every, sample_every, collide_every; /* in steps */
    int64_t delay;                                     /* in decisions */
    int64_t links; /* 1: packets come over two lossy links, and the newest of each is carried on */
    int64_t skip; /* 1: leave the collision check out while nobody can be near enough; 0: all pairs every time */
    uint32_t seed_low, seed_high;
} schedule;

typedef struct {
    double phi_vel, phi_corr, n_min, r_min_mean, r_min, n_disc, phi_coll, n_coll, phi_wall, clearance, phi_lap, phi_lap_abs,
        polarisation;
} score;

/* Fly one world and score it; 0, or minus the number of the agent (from 1) that found no place.

   frames: NULL, or room for (samples, 4, agents) reals: x, y, vx, vy of every sample. */
int evaluate(const parameters *p, const schedule *s, real *frames, score *out);

/* Fly many worlds on all cores, world w with seed first + w. */
void evaluate_many(const parameters *p, const schedule *s, int64_t worlds, score *out);

/* Bytes of one vector that this file was compiled for, and of one real. */
int vector_bytes(void);
int real_bytes(void);

#endif
