/* The evaluation of Vásárhelyi et al. 2018, written by hand for a GPU: one block flies one flock.

   The yardstick for the generated kernels of airflock: the same equations, the same random numbers and the same order
   parameters as vasarhelyi.c, laid out by hand. State lies in registers, what agents see of each other in shared memory
   (one load of 16 bytes per neighbour), clusters are bits, and the pairs of the collision check are left out while
   nobody can be near enough. PER_AGENT threads share the pairs of an agent and its random numbers.

   The rows of `all` are the numbers of `struct parameters` below, named as in vasarhelyi.h. At most 128 agents. Built with -DPER_AGENT=1, 2 or 4.
   C linkage: airflock's benchmark finds the kernel by its name. */
#ifndef PER_AGENT
#define PER_AGENT 1
#endif
#define ROOM 128
#define SLOTS 8
#define FULL 0xffffffffu
#define TINY 1e-12f
#define AWAY 1e9f
typedef unsigned int word;

enum { SENSOR = 1, OUTER = 2, START = 3, ATTEMPTS = 20000 };
enum { SCORES = 13 };

struct parameters {
    float v_flock, r0_rep, p_rep, r0_frict, c_frict, v_frict, p_frict, a_frict, r0_shill, v_shill, p_shill, a_shill;
    float tau, a_max, outer_noise, sensor_noise, damping, spring, range, half_side, separation, r_coll, r_cluster, dt;
    float period;
};

/* ---- Mathematics and random numbers ------------------------------------------------------------------------------ */

__device__ __forceinline__ float length(float x, float y) { return sqrtf(x * x + y * y + TINY); }

__device__ __forceinline__ float braking_curve(float s, float a, float p)
{
    s = fmaxf(s, 0.0f);
    float linear = s * p;
    return linear * p < a ? linear : sqrtf(fmaxf(2.0f * a * s - (a / p) * (a / p), 0.0f));
}

__device__ __forceinline__ uint4 philox(word c0, word c1, word c2, word k0, word k1)
{
    word c3 = 0;
#pragma unroll
    for (int round = 0; round < 10; round++) {
        word h0 = __umulhi(0xD2511F53u, c0), l0 = 0xD2511F53u * c0, h1 = __umulhi(0xCD9E8D57u, c2), l1 = 0xCD9E8D57u * c2;
        c0 = h1 ^ c1 ^ k0, c1 = l1, c2 = h0 ^ c3 ^ k1, c3 = l0;
        k0 += 0x9E3779B9u, k1 += 0xBB67AE85u;
    }
    return make_uint4(c0, c1, c2, c3);
}

__device__ __forceinline__ float uniform(word a) { return ((float)(int)(a >> 9) + 0.5f) * (1.0f / 8388608.0f); }

__device__ __forceinline__ float2 normal_pair(word a, word b)
{
    float radius = sqrtf(fmaxf(-2.0f * __logf(uniform(a)), 0.0f)), angle = (float)(int)(b << 2) * (0.78539816f / 2147483648.0f);
    float s = __sinf(angle), c = __cosf(angle);
    radius = b & 0x80000000u ? -radius : radius;
    return b & 0x40000000u ? make_float2(radius * s, radius * c) : make_float2(radius * c, radius * s);
}

/* ---- Sums over threads ------------------------------------------------------------------------------------------- */

__device__ __forceinline__ float over_agent(float v)
{
#pragma unroll
    for (int o = 1; o < PER_AGENT; o <<= 1) v += __shfl_xor_sync(FULL, v, o);
    return v;
}

/* Sums of COUNT numbers over the block, in every thread; of the last MINIMA of them the least instead. */
template <int COUNT, int MINIMA> __device__ __forceinline__ void over_block(float (&v)[COUNT], float (*shared)[16])
{
    const int warps = blockDim.x >> 5;
#pragma unroll
    for (int c = 0; c < COUNT; c++) {
#pragma unroll
        for (int o = 16; o; o >>= 1) {
            float other = __shfl_xor_sync(FULL, v[c], o);
            v[c] = c < COUNT - MINIMA ? v[c] + other : fminf(v[c], other);
        }
    }
    __syncthreads();
    if ((threadIdx.x & 31) == 0)
#pragma unroll
        for (int c = 0; c < COUNT; c++) shared[threadIdx.x >> 5][c] = v[c];
    __syncthreads();
#pragma unroll
    for (int c = 0; c < COUNT; c++) {
        v[c] = shared[0][c];
        for (int w = 1; w < warps; w++) v[c] = c < COUNT - MINIMA ? v[c] + shared[w][c] : fminf(v[c], shared[w][c]);
    }
}

__device__ __forceinline__ void wander(float &q, float &u, float g, const parameters &p)
{
    u += sqrtf(2.0f * p.damping * p.period * p.sensor_noise) * g - p.spring * p.period * q - p.damping * p.period * u;
    q += p.period * u;
}

__device__ __forceinline__ void shill(float d, float nx, float ny, float vx, float vy, const parameters &p, float &cx,
                                      float &cy)
{
    float sx = p.v_shill * nx - vx, sy = p.v_shill * ny - vy, s2 = sx * sx + sy * sy + TINY, per = rsqrtf(s2);
    float k = fmaxf(s2 * per - braking_curve(d - p.r0_shill, p.a_shill, p.p_shill), 0.0f) * per;
    cx += k * sx, cy += k * sy;
}

/* ---- One flight -------------------------------------------------------------------------------------------------- */

extern "C" __global__ void __launch_bounds__(PER_AGENT * ROOM)
    fly(const float *all, int n, int steps, int decide_every, int sample_every, int delay, word first_seed, float *scores)
{
    __shared__ float4 heard[ROOM], ring[SLOTS][ROOM];
    __shared__ float2 truth[ROOM];
    __shared__ float shared[32][16];
    __shared__ word grown[4];
    const int tid = threadIdx.x, i = tid / PER_AGENT, sub = tid % PER_AGENT, flock = blockIdx.x;
    const bool on = i < n, counts = on && sub == 0;
    const parameters p = *(const parameters *)(all + flock * (sizeof(parameters) / sizeof(float)));
    const word seed = first_seed + flock;
    for (int e = tid; e < ROOM; e += blockDim.x) truth[e] = make_float2(AWAY, AWAY), heard[e] = make_float4(AWAY, AWAY, 0, 0);
    __syncthreads();
    for (int e = 0; e < n; e++)
        for (int attempt = 0;; attempt++) { /* the same place in every thread; each looks at some of the others */
            uint4 w = philox(e, attempt, START, seed, 0);
            float x = (2.0f * uniform(w.x) - 1.0f) * p.half_side, y = (2.0f * uniform(w.y) - 1.0f) * p.half_side;
            int crowded = 0;
            for (int j = tid; j < e; j += blockDim.x) {
                float dx = x - truth[j].x, dy = y - truth[j].y;
                crowded |= dx * dx + dy * dy < p.separation * p.separation;
            }
            if (__syncthreads_or(crowded) && attempt < ATTEMPTS) continue;
            if (tid == 0) truth[e] = make_float2(x, y);
            __syncthreads();
            break;
        }
    float x = truth[i].x, y = truth[i].y, vx = 0, vy = 0, cx = 0, cy = 0;
    float qx = 0, qy = 0, ux = 0, uy = 0, sqx = 0, sqy = 0, sux = 0, suy = 0;
    float total[9] = {}, least = 1e30f, room = 1e30f, smallest = 0, correlation = 0, lap = 0, lap_abs = 0, polar = 0;
    float gap = 0, moved = 0, danger = 0;
    uint4 w = make_uint4(0, 0, 0, 0);
    float2 g0 = make_float2(0, 0), g1 = g0;
    for (int s = 0; s < SLOTS; s++)
        if (on) ring[s][i] = make_float4(x, y, vx, vy);
    const int slots = delay + 1;
    int to_decide = 0, to_sample = 0, samples = 0, k = 0, slot = 0;
    for (int step = 0; step <= steps; step++) {
        const bool look = __syncthreads_or(moved >= gap);
        const bool meet = to_decide == 0, take = to_sample == 0;
        if (meet || take || look) {
            if (counts) truth[i] = make_float2(x, y);
            if (meet) {
                uint4 r = philox(i, k, SENSOR, seed, 0);
                float2 own = normal_pair(r.x, r.y), sent = normal_pair(r.z, r.w);
                wander(qx, ux, own.x, p), wander(qy, uy, own.y, p);
                wander(sqx, sux, sent.x, p), wander(sqy, suy, sent.y, p);
                if (counts) {
                    ring[slot][i] = make_float4(x, y, vx, vy);
                    float4 past = ring[slot + 1 == slots ? 0 : slot + 1][i];
                    heard[i] = make_float4(past.x + sqx, past.y + sqy, past.z + sux, past.w + suy);
                }
                slot = slot + 1 == slots ? 0 : slot + 1;
                k++, to_decide = decide_every;
            }
            __syncthreads();
        }
        to_decide--;
        if (meet) {
            const float mx = x + qx, my = y + qy, mvx = vx + ux, mvy = vy + uy, range2 = p.range * p.range;
            float ax = 0, ay = 0;
#pragma unroll 4
            for (int j = sub; j < n; j += PER_AGENT) {
                float4 h = heard[j];
                float2 t = truth[j];
                float dx = mx - h.x, dy = my - h.y, r2 = dx * dx + dy * dy + TINY, per_r = rsqrtf(r2), r = r2 * per_r;
                float wx = h.z - mvx, wy = h.w - mvy, w2 = wx * wx + wy * wy + TINY, per_w = rsqrtf(w2);
                float push = p.p_rep * fmaxf(p.r0_rep - r, 0.0f) * per_r;
                float allowed = fmaxf(p.v_frict, braking_curve(r - p.r0_frict, p.a_frict, p.p_frict));
                float align = p.c_frict * fmaxf(w2 * per_w - allowed, 0.0f) * per_w;
                float ox = t.x - x, oy = t.y - y;
                bool hears = ox * ox + oy * oy <= range2 && j != i;
                ax += hears ? push * dx + align * wx : 0.0f;
                ay += hears ? push * dy + align * wy : 0.0f;
            }
            ax = over_agent(ax), ay = over_agent(ay);
            float kx = mx > 0 ? -1.0f : 1.0f, ky = my > 0 ? -1.0f : 1.0f;
            shill(p.half_side + kx * mx, kx, 0, mvx, mvy, p, ax, ay);
            shill(p.half_side + ky * my, 0, ky, mvx, mvy, p, ax, ay);
            float f = p.v_flock * rsqrtf(mvx * mvx + mvy * mvy + TINY);
            ax += f * mvx, ay += f * mvy;
            f = p.v_flock * rsqrtf(ax * ax + ay * ay + TINY);
            cx = f * ax, cy = f * ay;
        }
        if (look) {
            float near2 = 1e30f, touch = 0, lower = 0, v[3];
            for (int j = sub; j < n; j += PER_AGENT) {
                float dx = truth[j].x - x, dy = truth[j].y - y, r2 = dx * dx + dy * dy + TINY;
                bool touches = r2 <= p.r_coll * p.r_coll && j != i;
                near2 = j != i ? fminf(near2, r2) : near2;
                touch += touches, lower += touches && j < i;
            }
            touch = over_agent(touch), lower = over_agent(lower);
            v[0] = counts ? touch : 0, v[1] = counts && lower > 0 && danger == 0, v[2] = on ? near2 : 1e30f;
            danger = touch > 0;
            over_block<3, 1>(v, shared);
            total[0] += v[0], total[1] += v[1];
            gap = sqrtf(v[2]) - p.r_coll - 0.01f, moved = 0;
        }
        if (take) {
            to_sample = sample_every, samples++;
            word link[4] = {0, 0, 0, 0};
            float near2 = 1e30f;
#pragma unroll
            for (int part = 0; part < 4; part++) {
                if (part % PER_AGENT != sub || part * 32 >= n) continue;
#pragma unroll 8
                for (int e = 0; e < 32; e++) {
                    float2 t = truth[part * 32 + e];
                    float dx = t.x - x, dy = t.y - y, r2 = dx * dx + dy * dy + TINY;
                    link[part] |= (r2 < p.r_cluster * p.r_cluster ? 1u : 0u) << e;
                    near2 = part * 32 + e != i ? fminf(near2, r2) : near2;
                }
            }
#pragma unroll
            for (int o = 1; o < PER_AGENT; o <<= 1) near2 = fminf(near2, __shfl_xor_sync(FULL, near2, o));
            float v2 = vx * vx + vy * vy + TINY, per = rsqrtf(v2), near = sqrtf(near2);
            float hx = vx * per, hy = vy * per, ox = fabsf(x) - p.half_side, oy = fabsf(y) - p.half_side;
            float px = fmaxf(ox, 0.0f), py = fmaxf(oy, 0.0f), out = sqrtf(px * px + py * py);
            float v[13] = {x, y, vx, vy, hx, hy, v2 * per, near, near > p.range ? 1.0f : 0.0f, out, out > 0 ? 1.0f : 0.0f, near,
                           -out - fminf(fmaxf(ox, oy), 0.0f)};
#pragma unroll
            for (int c = 0; c < 11; c++) v[c] = counts ? v[c] : 0;
            v[11] = on ? near : 1e30f, v[12] = on ? v[12] : 1e30f;
            over_block<13, 2>(v, shared);
            const float m = 1.0f / n;
            float now = (v[3] * v[0] - v[2] * v[1]) * m * m / (p.v_flock * length(v[0] * m, v[1] * m));
            lap += now, lap_abs += fabsf(now), polar += length(v[4] * m, v[5] * m);
            total[2] += v[6] * m, total[3] += v[7] * m, total[4] += v[8], total[5] += v[9], total[6] += v[10];
            least = fminf(least, v[11]), room = fminf(room, v[12]);
            /* clusters, one after another: all agents look at once who is linked to the one that grows */
            bool earlier = false;
            float found = 0, fewest = n;
            for (int done = 0; done < n;) {
                int first, size = 1;
                float lead[1] = {on && !earlier ? (float)i : 1e30f};
                { float (&l)[1] = lead; over_block<1, 1>(l, shared); }
                first = (int)lead[0];
                bool mine = i == first;
                if (tid < 4) grown[tid] = tid == first >> 5 ? 1u << (first & 31) : 0;
                __syncthreads();
                for (bool growing = done + size < n; growing;) {
                    word touched = 0;
#pragma unroll
                    for (int part = 0; part < 4; part++) touched |= link[part] & grown[part];
                    int hit = on && !mine && !earlier && touched;
#pragma unroll
                    for (int o = 1; o < PER_AGENT; o <<= 1) hit |= __shfl_xor_sync(FULL, hit, o);
                    int fresh = __syncthreads_count(hit && sub == 0);
                    if (hit) mine = true;
                    if (hit && sub == 0) atomicOr(&grown[i >> 5], 1u << (i & 31));
                    size += fresh, growing = fresh && done + size < n;
                    __syncthreads();
                }
                float c[3] = {mine && counts ? hx : 0, mine && counts ? hy : 0, mine && counts ? hx * hx + hy * hy : 0};
                over_block<3, 0>(c, shared);
                found += (c[0] * c[0] + c[1] * c[1] - c[2]) / fmaxf(size - 1.0f, 1.0f);
                fewest = fminf(fewest, (float)size);
                earlier |= mine, done += size;
            }
            correlation += found * m, smallest += fewest;
        }
        to_sample--;
        if (step == steps) break;
        const int turn = (step >> 1) % PER_AGENT;
        if ((step & 1) == 0) {
            if (turn == 0) {
                w = philox(i, (step >> 1) + sub, OUTER, seed, 0);
                g0 = normal_pair(w.x, w.y), g1 = normal_pair(w.z, w.w);
            }
        }
        float gx = step & 1 ? g1.x : g0.x, gy = step & 1 ? g1.y : g0.y;
        if (PER_AGENT > 1) gx = __shfl_sync(FULL, gx, turn, PER_AGENT), gy = __shfl_sync(FULL, gy, turn, PER_AGENT);
        float ax = (cx - vx - ux) / p.tau, ay = (cy - vy - uy) / p.tau, a2 = ax * ax + ay * ay + TINY;
        float limit = fminf(1.0f, p.a_max * rsqrtf(a2)), kick = sqrtf(2.0f * p.outer_noise * p.dt);
        moved += on ? 2.0f * sqrtf(vx * vx + vy * vy) * p.dt : 0;
        x += vx * p.dt, y += vy * p.dt;
        vx += limit * ax * p.dt + kick * gx, vy += limit * ay * p.dt + kick * gy;
    }
    if (tid == 0) {
        const float m = 1.0f / samples, pairs = (float)n * (n - 1.0f) * (steps + 1.0f);
        const float score[SCORES] = {total[2] * m, correlation * m, smallest * m, total[3] * m, least, total[4] * m,
                                     total[0] / pairs, total[1], total[6] > 0 ? total[5] / total[6] : 0, room, lap * m,
                                     lap_abs * m, polar * m};
        for (int c = 0; c < SCORES; c++) scores[flock * SCORES + c] = score[c];
    }
}
