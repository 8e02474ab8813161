/* Start, perceive, decide, move: the stages of a flight, each for all agents. */
#ifndef MOTION_H
#define MOTION_H

#include "normals.h"

/* ---- Start ------------------------------------------------------------------------------------------------------- */

enum { ATTEMPTS = 20000 };

static int place(flock *f, int i, const parameters *p, const schedule *s)
{
    for (uint32_t attempt = 0; attempt < ATTEMPTS; attempt++) {
        uint32_t w[4];
        philox((uint32_t)i, attempt, START, 0, s->seed_low, s->seed_high, w);
        real x = -p->half_side + 2 * p->half_side * uniform(w[0]), y = -p->half_side + 2 * p->half_side * uniform(w[1]);
        int free = 1;
        for (int j = 0; j < i; j++) {
            real dx = x - f->now.x[j], dy = y - f->now.y[j];
            free &= dx * dx + dy * dy >= p->separation * p->separation;
        }
        if (free) {
            f->now.x[i] = x, f->now.y[i] = y;
            return 1;
        }
    }
    return 0;
}

static void place_on_grid(flock *f, int n, const parameters *p, const schedule *s)
{
    int side = (int)ceil(sqrt(n));
    real cell = 2 * p->half_side / side, jitter = most(cell - 8, 0);
    for (int i = 0; i < n; i++) {
        uint32_t w[4];
        philox((uint32_t)i, 0, START, 0, s->seed_low, s->seed_high, w);
        f->now.x[i] = (i % side + (real)0.5) * cell - p->half_side + jitter * ((real)(w[0] >> 8) / 16777216 - (real)0.5);
        f->now.y[i] = (i / side + (real)0.5) * cell - p->half_side + jitter * ((real)(w[1] >> 8) / 16777216 - (real)0.5);
    }
}

static int begin(flock *f, int n, const parameters *p, const schedule *s)
{
    memset(f, 0, sizeof *f);
    for (int i = 0; i < ROOM; i++) f->now.x[i] = f->now.y[i] = AWAY;
    if (TRIAL) place_on_grid(f, n, p, s);
    for (int i = 0; i < n && !TRIAL; i++)
        if (!place(f, i, p, s)) return -(i + 1);
    return 0;
}

/* ---- Perceive ---------------------------------------------------------------------------------------------------- */

/* One step of an error along one axis: a damped oscillator q, u with a random push. */
INLINE void wander(real *restrict q, real *restrict u, const real *restrict g, const parameters *p)
{
    const real h = p->period, push = root(2 * p->damping * h * p->sensor_noise), spring = p->spring, damping = p->damping;
    for (int i = 0; i < ROOM; i++) {
        u[i] += push * g[i] - spring * h * q[i] - damping * h * u[i];
        q[i] += h * u[i];
    }
}

INLINE void add(state *restrict sum, const state *restrict a, const state *restrict b)
{
    for (int i = 0; i < ROOM; i++) {
        sum->x[i] = a->x[i] + b->x[i];
        sum->y[i] = a->y[i] + b->y[i];
        sum->vx[i] = a->vx[i] + b->vx[i];
        sum->vy[i] = a->vy[i] + b->vy[i];
    }
}

/* Both errors advance; own state is measured now, neighbours are heard as they were `delay` decisions ago.

   The ring holds the state of the last delay + 1 decisions: true states, because the error is that of the reception. */
PASS void perceive(flock *f, state *ring, int64_t k, const parameters *p, const schedule *s)
{
    const int64_t slots = s->delay + 1;
    normals(f, (uint32_t)k, SENSOR, s);
    wander(f->own_error.x, f->own_error.vx, f->g[0], p);
    wander(f->own_error.y, f->own_error.vy, f->g[1], p);
    add(&f->measured, &f->now, &f->own_error);
    for (int64_t slot = 0; slot < slots; slot++) /* before the start everybody was where it starts */
        if (slot == k % slots || k == 0) ring[slot] = TRIAL ? f->measured : f->now;
    if (TRIAL) {
        f->heard = ring[(k + 1) % slots];
        return;
    }
    wander(f->sent_error.x, f->sent_error.vx, f->g[2], p);
    wander(f->sent_error.y, f->sent_error.vy, f->g[3], p);
    add(&f->heard, &ring[(k + 1) % slots], &f->sent_error);
}

/* ---- Decide ------------------------------------------------------------------------------------------------------ */

typedef struct {
    real r0_rep, p_rep, r0_frict, c_frict, v_frict, p_frict, a_frict;
} law;

INLINE law law_of(const parameters *p)
{
    return (law){p->r0_rep, p->p_rep, p->r0_frict, p->c_frict, p->v_frict, p->p_frict, p->a_frict};
}

/* What one neighbour adds: at the offset (dx, dy) from it, with the velocity (ux, uy) relative to the own. */
INLINE void influence(real dx, real dy, real ux, real uy, const law *l, real *ax, real *ay)
{
    real r2 = dx * dx + dy * dy + TINY, u2 = ux * ux + uy * uy + TINY;
    real per_r = 1 / root(r2), per_u = 1 / root(u2), r = r2 * per_r, u = u2 * per_u;
    real push = l->p_rep * most(l->r0_rep - r, 0) * per_r;
    real allowed = most(l->v_frict, braking_curve(r - l->r0_frict, l->a_frict, l->p_frict));
    real align = l->c_frict * most(u - allowed, 0) * per_u;
    *ax = push * dx + align * ux;
    *ay = push * dy + align * uy;
}

/* Repulsion (Eqs 2-3) and alignment (Eqs 4-7) of all pairs within radio range, summed into the command. */
PASS void neighbours(flock *f, int n, const parameters *p)
{
    const state *heard = &f->heard;
    const real range2 = p->range * p->range;
    const law l = law_of(p);
    for (whole i = 0; i < n; i++) {
        const real mx = f->measured.x[i], my = f->measured.y[i], mvx = f->measured.vx[i], mvy = f->measured.vy[i];
        const real x = f->now.x[i], y = f->now.y[i];
        real sum_x = 0, sum_y = 0;
#pragma omp simd reduction(+ : sum_x, sum_y) /* gcc would take the outer loop, and leave its rest to scalar code */
        for (whole j = 0; j < ROOM; j++) {
            real dx = mx - heard->x[j], dy = my - heard->y[j], ax, ay;
            influence(dx, dy, heard->vx[j] - mvx, heard->vy[j] - mvy, &l, &ax, &ay);
            real ox = f->now.x[j] - x, oy = f->now.y[j] - y;
            int hears = ((TRIAL ? dx * dx + dy * dy + TINY : ox * ox + oy * oy) <= range2) & (j != i);
            sum_x += hears ? ax : 0;
            sum_y += hears ? ay : 0;
        }
        f->cx[i] = sum_x, f->cy[i] = sum_y;
    }
}

/* Alignment to the shill agent of a wall with inward normal (nx, ny) (Eqs 8-9), added to a command. */
INLINE void shill(real distance, real nx, real ny, real vx, real vy, const parameters *p, real *cx, real *cy)
{
    real sx = p->v_shill * nx - vx, sy = p->v_shill * ny - vy, s = length(sx, sy);
    real k = most(s - braking_curve(distance - p->r0_shill, p->a_shill, p->p_shill), 0) / s;
    *cx += k * sx;
    *cy += k * sy;
}

/* Walls and self-propulsion; the sum is rescaled to v_flock (Eqs 8-11). */
PASS void decide(flock *f, const parameters *given)
{
    const parameters p = *given; /* a copy: the compiler then knows that no store changes it */
    const real half = p.half_side;
    for (int i = 0; i < ROOM; i++) {
        real x = f->measured.x[i], y = f->measured.y[i], vx = f->measured.vx[i], vy = f->measured.vy[i];
        real k = p.v_flock / length(vx, vy), cx = f->cx[i] + k * vx, cy = f->cy[i] + k * vy;
        shill(TRIAL ? half - x : half - size(x), !TRIAL && x <= 0 ? 1 : -1, 0, vx, vy, &p, &cx, &cy);
        shill(TRIAL ? half - y : half - size(y), 0, !TRIAL && y <= 0 ? 1 : -1, vx, vy, &p, &cx, &cy);
        if (TRIAL) {
            shill(half + x, 1, 0, vx, vy, &p, &cx, &cy);
            shill(half + y, 0, 1, vx, vy, &p, &cx, &cy);
        }
        k = p.v_flock / length(cx, cy);
        f->cx[i] = k * cx, f->cy[i] = k * cy;
    }
}

/* ---- Move -------------------------------------------------------------------------------------------------------- */

/* Positions by the old velocity; velocities relax to the command, saturated, then the outer noise is added. */
PASS void move(flock *f, int64_t step, const parameters *given, const schedule *s)
{
    const parameters p = *given;
    const real dt = p.dt, per_tau = 1 / p.tau, kick = root(2 * p.outer_noise * dt);
    if (step % 2 == 0) normals(f, (uint32_t)(step / 2), OUTER, s); /* four numbers: two axes of two steps */
    const real *gx = f->g[2 * (step % 2)], *gy = f->g[2 * (step % 2) + 1];
    for (int i = 0; i < ROOM; i++) {
        real vx = f->now.vx[i], vy = f->now.vy[i];
        real ax = (f->cx[i] - vx - (TRIAL ? 0 : f->own_error.vx[i])) * per_tau;
        real ay = (f->cy[i] - vy - (TRIAL ? 0 : f->own_error.vy[i])) * per_tau;
        real k = least(1, p.a_max / length(ax, ay)) * dt;
        f->now.x[i] += vx * dt;
        f->now.y[i] += vy * dt;
        f->now.vx[i] = vx + k * ax + kick * gx[i];
        f->now.vy[i] = vy + k * ay + kick * gy[i];
    }
}

/* Largest squared speed of the flock, m²/s². */
PASS real fastest2(const flock *f, int n)
{
    real most2 = 0;
    for (int i = 0; i < n; i++) most2 = most(most2, f->now.vx[i] * f->now.vx[i] + f->now.vy[i] * f->now.vy[i]);
    return most2;
}

#endif
