/* The evaluation of Vásárhelyi et al. 2018, written by hand: one flock flies, its order parameters are summed up.

   The yardstick for the generated drivers of airflock: the same equations, the same random numbers, the same order of
   events, so that both can be compared number by number, and every loop laid out so that a C compiler vectorises it.
   The stages of a step are in motion.h and radio.h, the order parameters in measure.h; this file is their order. */
#include "measure.h"
#include "radio.h"

static void conclude(const sums *t, int n, score *out)
{
    *out = (score){
        .phi_vel = t->speed / t->samples,
        .phi_corr = t->correlation / t->samples,
        .n_min = t->smallest / t->samples,
        .r_min_mean = t->spacing / t->samples,
        .r_min = t->least,
        .n_disc = t->disconnected / t->samples,
        .phi_coll = t->contacts / (t->checks * n * (n - 1.0)),
        .n_coll = t->events,
        .phi_wall = t->outside > 0 ? t->out / t->outside : 0,
        .clearance = t->clearance,
        .phi_lap = t->lap / t->samples,
        .phi_lap_abs = t->lap_abs / t->samples,
        .polarisation = t->polarisation / t->samples,
    };
}

/* One sample of the flight: x, y, vx, vy of all agents. */
static void keep(const flock *f, int n, real *frame)
{
    const real *rows[] = {f->now.x, f->now.y, f->now.vx, f->now.vy};
    for (int row = 0; row < 4; row++) memcpy(frame + row * n, rows[row], (size_t)n * sizeof(real));
}

int evaluate(const parameters *p, const schedule *s, real *frames, score *out)
{
    const int n = (int)s->agents;
    flock flying, *f = &flying;
    state ring[s->delay + 1];
    sums t = {.least = (double)FAR, .clearance = (double)FAR};
    real packet[s->links ? 5 * n * ROOM : 1] __attribute__((aligned(64)));
    for (int i = 0; i < (s->links ? 5 * n * ROOM : 0); i++) packet[i] = i < 4 * n * ROOM ? 0 : (real)-1e9;
    real gap = 0, travelled = 0; /* no pair can have met before it has travelled this gap */
    int status = begin(f, n, p, s);
    for (int64_t step = 0; status == 0 && step <= s->steps - TRIAL; step++) {
        real near2 = -1; /* not known */
        if (step % s->decide_every == 0) {
            perceive(f, ring, step / s->decide_every, p, s);
            if (s->links) neighbours_linked(f, n, p, s, step / s->decide_every, packet);
            else neighbours(f, n, p);
            decide(f, p);
        }
        if (step % s->sample_every == 0) {
            t.samples += 1;
            measure_agents(f, n, p, &t);
            if (!TRIAL) near2 = measure_nearest(f, n, p, &t);
            measure_clusters(f, n, p, &t);
            if (frames) keep(f, n, frames + step / s->sample_every * 4 * n);
        }
        if (step % s->collide_every == 0) {
            t.checks += 1;
            if (near2 < 0) near2 = s->skip && travelled < gap ? FAR : closest2(f, n);
            if (near2 <= p->r_coll * p->r_coll) count_contacts(f, n, p->r_coll, &t);
            else memset(f->danger, 0, sizeof f->danger);
            if (near2 < FAR) gap = root(near2) - p->r_coll - (real)0.01, travelled = 0; /* 1 cm for rounding */
        }
        if (step < s->steps) {
            if (s->skip) travelled += 2 * root(fastest2(f, n)) * p->dt;
            move(f, step, p, s);
        }
    }
    if (status == 0) conclude(&t, n, out);
    return status;
}

void evaluate_many(const parameters *p, const schedule *s, int64_t worlds, score *out)
{
#pragma omp parallel for schedule(dynamic, 1)
    for (int64_t world = 0; world < worlds; world++) {
        schedule own = *s;
        own.seed_low += (uint32_t)world;
        evaluate(p, &own, NULL, &out[world]);
    }
}

int vector_bytes(void) { return VECTOR; }
int real_bytes(void) { return (int)sizeof(real); }
