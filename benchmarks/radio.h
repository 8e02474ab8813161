/* Two lossy links: random words of packets, reception, and neighbours by the newest packet of each. */
#ifndef RADIO_H
#define RADIO_H

#include "motion.h"

enum { PACKET = 12 }; /* stream */

/* Packets that a link of this rate sends in decision k. */
static int packets(int64_t k, real rate, real period)
{
    real steps = (real)k;
    return (int)((real)floor((double)((steps + 1) * rate * period + (real)1e-6))
                 - (real)floor((double)(steps * rate * period + (real)1e-6)));
}

/* Random words of what all send the four receivers that share a call: word[w][j] for receiver 4 * four + w. */
PASS void draw_packets(flock *f, int four, int n, int64_t k, const schedule *s)
{
    lanes pair = {};
    for (int lane = 0; lane < BLOCK / 2; lane++) pair[lane] = (uint64_t)four * (uint64_t)n + 2 * (uint64_t)lane;
    for (int i = 0; i < ROOM; i += BLOCK, pair += BLOCK) {
        lanes even[4] = {pair, (lanes){} + (uint64_t)k, (lanes){} + PACKET}, odd[4] = {pair + 1, even[1], even[2]};
        philox_lanes(even, s->seed_low, s->seed_high);
        philox_lanes(odd, s->seed_low, s->seed_high);
        for (int w = 0; w < 4; w++) {
            lanes both = (even[w] & 0xFFFFFFFFu) | odd[w] << 32;
            memcpy(&f->word[w][i], &both, sizeof both);
        }
    }
}

/* Share of packets that arrive over a distance; the slow link reaches twice as far. */
INLINE real received(real s, real near, real far, real at_near, real at_far, real slope)
{
    real middle = at_near + slope * (s - near), beyond = at_far * far * far / most(s * s, far * far);
    return s <= near ? at_near : s < far ? middle : beyond;
}

/* Powers 0 to 3. */
INLINE real thrice(real x, int n) { return (n & 1 ? x : 1) * (n & 2 ? x * x : 1); }

/* Repulsion and alignment as in `neighbours`, by what agent i has last heard of each other one.

   packet: of each pair position, velocity and time stamp, [5][n][ROOM] */
PASS void neighbours_linked(flock *f, int n, const parameters *p, const schedule *s, int64_t k, real *packet)
{
    const real now = (real)(k * s->decide_every) * p->dt, sent = now - (real)(s->delay * s->decide_every) * p->dt;
    const real range2 = p->range * p->range, near = p->near, far = p->far, at_near = p->received_near;
    const real at_far = p->received_far, slope = (at_far - at_near) / most(far - near, (real)1e-6);
    const int fast = packets(k, p->fast_rate, p->period), slow = packets(k, p->slow_rate, p->period);
    const law l = law_of(p);
    for (whole i = 0; i < n; i++) {
        if (i % 4 == 0) draw_packets(f, i / 4, n, k, s);
        const uint32_t *restrict word = f->word[i % 4];
        const real *restrict hx = f->heard.x, *restrict hy = f->heard.y, *restrict hvx = f->heard.vx;
        const real *restrict hvy = f->heard.vy, *restrict tx = f->now.x, *restrict ty = f->now.y;
        real *restrict px = packet + (size_t)i * ROOM, *restrict py = px + (size_t)n * ROOM;
        real *restrict pvx = py + (size_t)n * ROOM, *restrict pvy = pvx + (size_t)n * ROOM;
        real *restrict stamp = pvy + (size_t)n * ROOM;
        const real mx = f->measured.x[i], my = f->measured.y[i], mvx = f->measured.vx[i], mvy = f->measured.vy[i];
        const real x = tx[i], y = ty[i];
        real sum_x = 0, sum_y = 0;
#pragma omp simd reduction(+ : sum_x, sum_y)
        for (whole j = 0; j < ROOM; j++) {
            real ox = tx[j] - x, oy = ty[j] - y, apart2 = ox * ox + oy * oy, d = root(apart2 + TINY);
            real miss = thrice(1 - received(d, near, far, at_near, at_far, slope), fast);
            miss *= thrice(1 - received(d / 2, near, far, at_near, at_far, slope), slow);
            int hears = apart2 <= range2, got = hears & (uniform(word[j]) >= miss);
            px[j] = got ? hx[j] : px[j], py[j] = got ? hy[j] : py[j];
            pvx[j] = got ? hvx[j] : pvx[j], pvy[j] = got ? hvy[j] : pvy[j];
            stamp[j] = got ? sent : stamp[j];
            real age = now - stamp[j], ax, ay;
            influence(mx - px[j] - pvx[j] * age, my - py[j] - pvy[j] * age, pvx[j] - mvx, pvy[j] - mvy, &l, &ax, &ay);
            hears &= (stamp[j] > (real)-1e8) & (j != i);
            sum_x += hears ? ax : 0;
            sum_y += hears ? ay : 0;
        }
        f->cx[i] = sum_x, f->cy[i] = sum_y;
    }
}

#endif
