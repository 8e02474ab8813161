/* Order parameters of one instant, added to sums over time; collisions. */
#ifndef MEASURE_H
#define MEASURE_H

#include "flock.h"

typedef struct {
    double samples, checks;
    double speed, correlation, smallest, spacing, least, disconnected, contacts, events, out, outside, lap, lap_abs;
    double polarisation, clearance;
} sums;

/* Mean speed, polarisation, lap and excursion: everything that needs no pairs. */
PASS void measure_agents(flock *f, int n, const parameters *p, sums *t)
{
    real speed = 0, sx = 0, sy = 0, svx = 0, svy = 0, shx = 0, shy = 0, out = 0, outside = 0, room = FAR;
    const real half = p->half_side;
    for (int i = 0; i < n; i++) {
        real x = f->now.x[i], y = f->now.y[i], vx = f->now.vx[i], vy = f->now.vy[i];
        real v2 = vx * vx + vy * vy + TINY, per_v = 1 / root(v2);
        f->heading_x[i] = vx * per_v, f->heading_y[i] = vy * per_v;
        speed += v2 * per_v;
        shx += vx * per_v, shy += vy * per_v;
        sx += x, sy += y, svx += vx, svy += vy;
        real ex = size(x) - half, ey = size(y) - half, ox = most(ex, 0), oy = most(ey, 0);
        out += TRIAL ? ox + oy : root(ox * ox + oy * oy);
        outside += TRIAL ? (real)(ox > 0) + (real)(oy > 0) : (real)((ox > 0) | (oy > 0));
        if (!TRIAL) room = least(room, -root(ox * ox + oy * oy) - least(most(ex, ey), 0));
    }
    t->speed += speed / n;
    t->out += out, t->outside += outside;
    if (TRIAL) return;
    t->clearance = room < t->clearance ? room : t->clearance;
    real lap = (svy * sx - svx * sy) / n / (p->v_flock * n * length(sx / n, sy / n));
    t->lap += lap, t->lap_abs += size(lap);
    t->polarisation += length(shx / n, shy / n);
}

/* A vector of agents side by side. */
typedef real stripe __attribute__((vector_size(VECTOR)));
typedef whole stripe_mask __attribute__((vector_size(VECTOR)));
enum { STRIPE = VECTOR / sizeof(real) };

/* The lesser of two vectors, lane by lane: gcc does not find the instruction by itself. */
INLINE stripe lower(stripe a, stripe b)
{
#if VECTOR == 64
    return sizeof(real) == 8 ? (stripe)_mm512_min_pd((__m512d)a, (__m512d)b) : (stripe)_mm512_min_ps((__m512)a, (__m512)b);
#elif VECTOR == 32
    return sizeof(real) == 8 ? (stripe)_mm256_min_pd((__m256d)a, (__m256d)b) : (stripe)_mm256_min_ps((__m256)a, (__m256)b);
#else
    stripe_mask less = a < b;
    return (stripe)((less & (stripe_mask)a) | (~less & (stripe_mask)b));
#endif
}

/* Of STRIPE agents from `first`, the least squared distances to the agents from..n-1 other than themselves, m². */
INLINE stripe nearest2(const flock *f, int first, int from, int n)
{
    const int next = first + STRIPE;
    const stripe far = (stripe){} + FAR;
    stripe x, y, near2 = far;
    stripe_mask lane;
    memcpy(&x, &f->now.x[first], sizeof x);
    memcpy(&y, &f->now.y[first], sizeof y);
    for (int l = 0; l < STRIPE; l++) lane[l] = first + l;
#pragma GCC unroll 3
    for (int part = 0; part < 3; part++) { /* those before, the stripe itself, those after */
        const int begins[] = {from, first, next}, ends[] = {first, next < n ? next : n, n};
#pragma GCC unroll 4
        for (int i = begins[part]; i < ends[part]; i++) {
            stripe dx = x - f->now.x[i], dy = y - f->now.y[i], r2 = dx * dx + dy * dy;
            if (part == 1) r2 += (stripe)((lane == i) & (stripe_mask)far);
            near2 = lower(r2, near2);
        }
    }
    return near2 + TINY;
}

INLINE real least_of(stripe a)
{
    real found = a[0];
    for (int l = 1; l < STRIPE; l++) found = least(found, a[l]);
    return found;
}

/* Distance of each agent to its nearest; returns the least squared distance of all pairs, m². */
PASS real measure_nearest(flock *f, int n, const parameters *p, sums *t)
{
    real spacing = 0, all2 = FAR;
    int alone = 0;
    for (int first = 0; first < n; first += STRIPE) {
        stripe near2 = nearest2(f, first, 0, n);
        memcpy(&f->nearest2[first], &near2, sizeof near2);
    }
    for (int i = 0; i < n; i++) {
        real near = root(f->nearest2[i]);
        spacing += near;
        alone += near > p->range;
        all2 = least(all2, f->nearest2[i]);
    }
    t->spacing += spacing / n;
    t->least = t->least < sqrt(all2) ? t->least : sqrt(all2);
    t->disconnected += alone;
    return all2;
}

/* Grow the cluster of agent `seed` until nobody is left to expand or everybody is reached; returns its members.

   member: 0 unseen, 1 in this cluster, 2 in an earlier one. */
INLINE int grow(flock *f, int n, int seed, int reached, real link2)
{
    int members = 1;
    f->member[seed] = 1;
    for (int e = seed; e >= 0 && reached + members < n;) {
        real x = f->now.x[e], y = f->now.y[e];
        whole fresh = 0;
        f->expanded[e] = 1;
        for (int j = 0; j < ROOM; j++) { /* who is AWAY is linked to nobody */
            real dx = f->now.x[j] - x, dy = f->now.y[j] - y;
            whole joins = (dx * dx + dy * dy + TINY < link2) & (f->member[j] == 0);
            f->member[j] |= joins;
            fresh += joins;
        }
        members += (int)fresh;
        for (e = n - 1; e >= 0 && (f->member[e] != 1 || f->expanded[e]); e--) {}
    }
    return members;
}

/* Velocity correlation within clusters (Eq. 13), self pairs left out, and the smallest cluster. */
PASS void measure_clusters(flock *f, int n, const parameters *p, sums *t)
{
    double correlation = 0;
    int reached = 0, smallest = n, singles = 0;
    memset(f->member, 0, sizeof f->member);
    memset(f->expanded, 0, sizeof f->expanded);
    for (int seed = 0; reached < n; seed++) {
        if (f->member[seed]) continue;
        int members = grow(f, n, seed, reached, p->r_cluster * p->r_cluster);
        real hx = 0, hy = 0, own = 0;
        for (int j = 0; j < n; j++) {
            real x = f->member[j] == 1 ? f->heading_x[j] : 0, y = f->member[j] == 1 ? f->heading_y[j] : 0;
            hx += x, hy += y, own += x * x + y * y;
            f->member[j] = f->member[j] ? 2 : 0;
        }
        if (members > 1) correlation += (hx * hx + hy * hy - own) / (members - 1);
        singles += members == 1;
        smallest = members < smallest ? members : smallest;
        reached += members;
    }
    t->correlation += correlation / n;
    t->smallest += smallest;
    if (TRIAL) t->disconnected += singles;
}

/* ---- Collisions -------------------------------------------------------------------------------------------------- */

/* Least squared distance of all pairs, m². */
PASS real closest2(const flock *f, int n)
{
    stripe all2 = (stripe){} + FAR;
    for (int first = 0; first < n; first += STRIPE) {
        stripe near2 = nearest2(f, first, first, n); /* those before have met this stripe already */
        all2 = lower(near2, all2);
    }
    return least_of(all2);
}

/* Contacts and new collisions, where somebody is in contact: an event is an agent that was in nobody's reach and comes
   within r_coll of one with a lower index. */
static void count_contacts(flock *f, int n, real r_coll, sums *t)
{
    for (int i = 0; i < n; i++) {
        int contacts = 0, lower = 0;
        for (int j = 0; j < n; j++) {
            real dx = f->now.x[j] - f->now.x[i], dy = f->now.y[j] - f->now.y[i];
            int touches = (dx * dx + dy * dy + TINY <= r_coll * r_coll) & (j != i);
            contacts += touches;
            lower += touches & (j < i);
        }
        t->events += lower > 0 && !f->danger[i];
        t->contacts += contacts;
        f->danger[i] = contacts > 0;
    }
}

#endif
