/* Ambient occlusion, bevel and ray casts of programs.
 *
 * Bevel after A. King, C. Kulla, A. Conty and M. Fajardo, "BSSRDF Importance Sampling" (2013):
 * normals of the surface around, found by rays along three axes through a disk. Departures from
 * Cycles, whose formulas and chances these are: all that a ray meets up to a limit counts, where
 * Cycles picks four of them. */
#include "kernels/program/tracing.h"

#include <string.h>

#include "kernels/program/values.h"
#include "kernels/trace/spawn.h"
#include "model/program.h"

/* ---- rays ---- */

/* Rays of the lanes, of which some samples may share a packet. */
struct probe_rays {
    vvec3 o, d;
    vfloat reach;
    vmask active;
};

/* Largest components of directions that packets take, or distances. */
#define SMALLEST_DIRECTION 0x1p-60f
#define LARGEST_DIRECTION 0x1p60f

/* Leaves out those that are not numbers or that packets do not take. */
static vmask rays_valid(const struct probe_rays *r) {
    const vfloat o = v3_max(v3_abs(r->o)), d = v3_max(v3_abs(r->d));
    const vfloat sum = r->o.x + r->o.y + r->o.z + r->d.x + r->d.y + r->d.z;
    vmask m = vm_and(r->active, vf_gt(r->reach, vf_zero()));
    m = vm_and(m,
               vm_and(vf_gt(d, vf_set(SMALLEST_DIRECTION)), vf_lt(d, vf_set(LARGEST_DIRECTION))));
    return vm_and(m, vm_and(vf_lt(o, vf_set(TRC_MAX_COORDINATE)), vf_eq(sum, sum)));
}

static void rays_store(const struct trc_surface *s, int chunk, const struct probe_rays *r) {
    struct trc_packet *p = s->probe->packet;
    const vfloat o[3] = {r->o.x, r->o.y, r->o.z}, d[3] = {r->d.x, r->d.y, r->d.z};
    const int i = chunk * TRC_WIDTH;
    for (int k = 0; k < 3; k++) {
        vf_store(&p->o[k][i], o[k]);
        vf_store(&p->d[k][i], d[k]);
    }
    vf_store(&p->tmin[i], vf_zero());
    vf_store(&p->t[i], r->reach);
    vf_store(&p->time[i], s->time);
    p->active |= (uint64_t)vm_bits(rays_valid(r)) << i;
}

/* leaves: whether rays leave the surface, whose strands they then do not meet. */
static void packet_begin(const struct trc_surface *s, uint32_t visibility, bool leaves) {
    struct trc_packet *p = s->probe->packet;
    struct trc_left_strands *left = leaves ? s->probe->left : NULL;
    p->left = left;
    if (left) {
        vuint strand[2];
        trc_strand_words(s, strand);
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
            vu_store(left->instance + c * TRC_WIDTH, strand[0]);
            vu_store(left->strand + c * TRC_WIDTH, strand[1]);
        }
    }
    p->active = 0;
    p->visibility = visibility;
    p->common_origin = false;
    p->skip_transparent = false;
}

static void count_rays(const struct trc_probe *probe) {
    *probe->ray_count += (uint64_t)__builtin_popcountll(probe->packet->active);
}

/* The nearest hits of the packet's rays, which are then its active ones; is_local: of each lane's
 * own instance alone. */
static void trace_nearest(const struct trc_surface *s, bool is_local) {
    const struct trc_probe *probe = s->probe;
    uint32_t own[TRC_PACKET_SIZE];
    uint64_t met = 0;
    count_rays(probe);
    memset(probe->hits->instance, 0xff, sizeof probe->hits->instance);
    if (is_local) {
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++)
            vi_store((int32_t *)own + c * TRC_WIDTH, s->instance);
        trc_trace_one_instance(s->snapshot, probe->packet, probe->hits, own);
    } else {
        trc_trace_closest(s->snapshot, probe->packet, probe->hits, 1);
    }
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        const vint instance = vi_load((int32_t *)&probe->hits->instance[c * TRC_WIDTH]);
        met |= (uint64_t)(vm_bits(vi_eq(instance, vi_set(-1))) ^ TRC_LANE_BITS) << (c * TRC_WIDTH);
    }
    probe->packet->active &= met;
}

/* ---- ambient occlusion ---- */

/* The packet's rays that meet something. */
static uint64_t trace_occluded(const struct trc_surface *s, bool is_local) {
    if (is_local) {
        trace_nearest(s, true);
        return s->probe->packet->active;
    }
    uint64_t occluded;
    count_rays(s->probe);
    trc_trace_occluded(s->snapshot, s->probe->packet, 1, &occluded);
    return occluded;
}

static vfloat ambient_occlusion(const struct trc_surface *s, uint32_t mode, const vfloat *in) {
    const uint32_t count = mode & TRC_AMBIENT_SAMPLES_MASK;
    const bool is_local = mode & TRC_AMBIENT_ONLY_LOCAL;
    const vfloat own = in[TRC_OP_AT(AMBIENT_OCCLUSION, distance)];
    const vfloat distance =
        mode & TRC_AMBIENT_OF_WORLD ? vf_set(s->snapshot->world.ao_distance) : own;
    vvec3 n = v3_normalize(v3_read(in + TRC_OP_AT(AMBIENT_OCCLUSION, normal))), x, y;
    if (mode & TRC_AMBIENT_INSIDE)
        n = v3_neg(n);
    v3_frame(n, &x, &y);
    const vmask asks = vm_and(s->active, vf_gt(distance, vf_zero()));
    vfloat blocked = vf_zero();
    for (uint32_t sample = 0; sample < count && vm_any(asks);) {
        packet_begin(s, is_local ? TRC_VISIBLE_ALL : TRC_VISIBLE_SHADOW, true);
        for (int c = 0; c < TRC_PACKET_CHUNKS && sample < count; c++, sample++) {
            vfloat u[2];
            s->probe->numbers(s->probe, TRC_PROBE_AMBIENT, sample, count, u);
            const vvec3 d = v3_from_frame(trc_warp_cosine(u[0], u[1]), x, y, n);
            const vvec3 o = trc_spawn_origin(s, vf_ge(v3_dot(d, s->ng), vf_zero()));
            rays_store(s, c, &(struct probe_rays){o, d, distance, asks});
        }
        const uint64_t occluded = trace_occluded(s, is_local);
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++)
            blocked = blocked + vf_truth(vm_from_bits(trc_chunk_bits(occluded, c)));
    }
    return vf_one() - blocked * vf_set(1.0f / (float)(count ? count : 1));
}

/* ---- bevel ---- */

/* Density of a bounce below which surfaces seen through it keep their normals (Cycles). */
#define SHARP_BOUNCE 8.0f
/* Surfaces along one ray that count. */
#define MAX_BEVEL_HITS 8

/* The radius below which the share xi of a disk's samples lies, whose density falls with the cube
 * of the distance to its edge: 10 x^2 - 20 x^3 + 15 x^4 - 4 x^5 = xi, by Newton's method. */
static vfloat disk_radius(vfloat xi) {
    vfloat x = vf_set(0.25f);
    for (int step = 0; step < 10; step++) { /* 2 to 4 are enough but at the ends */
        const vfloat x2 = x * x, x3 = x2 * x, rest = vf_one() - x;
        const vfloat f = vf_set(10.0f) * x2 - vf_set(20.0f) * x3 + vf_set(15.0f) * x2 * x2 -
                         vf_set(4.0f) * x2 * x3 - xi;
        const vfloat slope = vf_set(20.0f) * (x * rest) * (rest * rest);
        const vmask ends = vm_or(vf_lt(vf_abs(f), vf_set(1e-6f)), vf_eq(slope, vf_zero()));
        if (vm_all(ends))
            break;
        x = vf_select(ends, x, vf_saturate(x - vf_divide(f, slope)));
    }
    return x;
}

/* A sample: where its disk lies, and where on it. */
struct bevel_sample {
    vvec3 axis[3];    /* the ray's, and the two across */
    vfloat chance[3]; /* of each to be the ray's */
    vfloat radius;    /* on the disk, of a whole of 1 */
};

static void bevel_draw(const struct trc_surface *s, const vfloat u[2], vfloat *turn,
                       struct bevel_sample *out) {
    vvec3 t, b;
    v3_frame(s->ng, &t, &b);
    const vmask across = vf_ge(u[0], vf_set(0.5f)), second = vf_ge(u[0], vf_set(0.75f));
    const vmask first = vm_andnot(across, second);
    const vfloat half = vf_set(0.5f), quarter = vf_set(0.25f);
    out->axis[0] = v3_select(second, b, v3_select(first, t, s->ng));
    out->axis[1] = v3_select(first, s->ng, t);
    out->axis[2] = v3_select(second, s->ng, b);
    out->chance[0] = vf_select(across, quarter, half);
    out->chance[1] = vf_select(first, half, quarter);
    out->chance[2] = vf_select(second, half, quarter);
    *turn = vf_select(across, (u[0] - vf_select(second, vf_set(0.75f), half)) * vf_set(4.0f),
                      u[0] * vf_set(2.0f));
    out->radius = disk_radius(u[1]);
}

/* What rays of a chunk met, as the surface from outside. */
static void hit_surface(const struct trc_surface *s, int chunk, vmask met,
                        struct trc_surface *hit) {
    const struct trc_probe *probe = s->probe;
    const int i = chunk * TRC_WIDTH;
    const vvec3 d = v3(vf_load(&probe->packet->d[0][i]), vf_load(&probe->packet->d[1][i]),
                       vf_load(&probe->packet->d[2][i]));
    *hit = (struct trc_surface){.snapshot = s->snapshot,
                                .active = met,
                                .instance = vi_load((int32_t *)&probe->hits->instance[i]),
                                .triangle = vi_load((int32_t *)&probe->hits->triangle[i]),
                                .u = vf_load(&probe->hits->u[i]),
                                .v = vf_load(&probe->hits->v[i]),
                                .time = s->time,
                                .wo = v3_neg(v3_normalize(d))};
    trc_surface_fetch(hit);
}

/* Adds the normals that a chunk's rays met, weighted. */
static void bevel_add(const struct trc_surface *s, int chunk, vmask met, vfloat radius,
                      const struct bevel_sample *sample, vvec3 *sum) {
    struct trc_surface hit;
    hit_surface(s, chunk, met, &hit);
    vfloat density[3], squares = vf_zero();
    for (int k = 0; k < 3; k++) {
        density[k] = sample->chance[k] * vf_abs(v3_dot(sample->axis[k], hit.ng));
        squares = squares + density[k] * density[k];
    }
    /* The power heuristic over the three axes, its own density cancelled; then the density of the
     * real distance in place of that on the disk. */
    const vfloat distance = vf_divide(v3_length(v3_sub(hit.p, s->p)), radius);
    const vfloat falloff =
        vf_divide(vf_max(vf_one() - distance, vf_zero()), vf_one() - sample->radius);
    const vfloat w = vf_divide(density[0], squares) * (falloff * falloff * falloff);
    const vmask counts = vm_and(met, vf_gt(w, vf_zero()));
    const vfloat side = vf_select(hit.backfacing, vf_set(-1.0f), vf_one());
    *sum = v3_add(*sum, v3_where(counts, v3_scale(hit.n, w * side)));
}

/* Traces the packet's rays on from one surface of their instance to the next. */
static void bevel_collect(const struct trc_surface *s, int chunks, vfloat radius,
                          const struct bevel_sample samples[TRC_PACKET_CHUNKS], vvec3 *sum) {
    struct trc_packet *p = s->probe->packet;
    float reach[TRC_PACKET_SIZE];
    memcpy(reach, p->t, sizeof reach);
    for (int passed = 0; passed < MAX_BEVEL_HITS && p->active; passed++) {
        trace_nearest(s, true);
        for (int c = 0; c < chunks; c++) {
            const vmask met = vm_from_bits(trc_chunk_bits(p->active, c));
            if (vm_any(met))
                bevel_add(s, c, met, radius, &samples[c], sum);
        }
        memcpy(p->tmin, p->t, sizeof reach);
        memcpy(p->t, reach, sizeof reach);
    }
}

static vvec3 bevel(const struct trc_surface *s, uint32_t mode, const vfloat *in) {
    const uint32_t count = mode;
    const vfloat radius = in[TRC_OP_AT(BEVEL, radius)];
    vmask asks = vm_and(s->active, vf_gt(radius, vf_zero()));
    if (s->probe->left) /* curves have no edges */
        asks = vm_and(asks, vi_lt(s->strand, vi_set(0)));
    asks = vm_and(asks, vf_ge(s->probe->min_pdf, vf_set(SHARP_BOUNCE)));
    vvec3 sum = v3_zero();
    for (uint32_t number = 0; number < count && vm_any(asks);) {
        struct bevel_sample samples[TRC_PACKET_CHUNKS];
        int c = 0;
        packet_begin(s, TRC_VISIBLE_ALL, false);
        for (; c < TRC_PACKET_CHUNKS && number < count; c++, number++) {
            struct bevel_sample *sample = &samples[c];
            vfloat u[2], turn, sine, cosine;
            s->probe->numbers(s->probe, TRC_PROBE_BEVEL, number, count, u);
            bevel_draw(s, u, &turn, sample);
            vf_sincos_turns(turn, &sine, &cosine);
            const vfloat r = sample->radius * radius;
            const vfloat height = vf_safe_sqrt(radius * radius - r * r);
            const vvec3 on_disk =
                v3_add(v3_scale(sample->axis[1], r * cosine), v3_scale(sample->axis[2], r * sine));
            const vvec3 o = v3_add(s->p, v3_mad(sample->axis[0], height, on_disk));
            rays_store(
                s, c,
                &(struct probe_rays){o, v3_neg(sample->axis[0]), vf_set(2.0f) * height, asks});
        }
        bevel_collect(s, c, radius, samples, &sum);
    }
    const vvec3 n = v3_normalize(sum);
    const vfloat side = vf_select(s->backfacing, vf_set(-1.0f), vf_one());
    const vmask found = vm_and(asks, vf_gt(v3_dot(n, n), vf_set(0.5f)));
    return v3_select(found, v3_scale(n, side), s->n);
}

/* ---- ray casts ---- */

bool trc_program_cast(const struct trc_surface *s, uint32_t mode, const vfloat *in,
                      struct trc_surface *hit) {
    if (!s->probe)
        return false;
    const vvec3 position = v3_read(in + TRC_OP_AT(RAYCAST, position));
    const vvec3 d = v3_read(in + TRC_OP_AT(RAYCAST, direction));
    /* From the point itself, as other rays that leave it. */
    const vmask here = vm_and(vf_eq(position.x, s->p.x),
                              vm_and(vf_eq(position.y, s->p.y), vf_eq(position.z, s->p.z)));
    const vvec3 away = trc_spawn_origin(s, vf_ge(v3_dot(d, s->ng), vf_zero()));
    const struct probe_rays rays = {v3_select(here, away, position), d,
                                    in[TRC_OP_AT(RAYCAST, distance)], s->active};
    packet_begin(s, TRC_VISIBLE_ALL, vm_all(vm_or(here, vm_not(s->active))));
    rays_store(s, 0, &rays);
    trace_nearest(s, mode & TRC_RAYCAST_ONLY_LOCAL);
    const vmask met = vm_from_bits(trc_chunk_bits(s->probe->packet->active, 0));
    if (!vm_any(met))
        return false;
    hit_surface(s, 0, met, hit);
    return true;
}

static void raycast(const struct trc_surface *s, uint32_t mode, const vfloat *in, vfloat *out) {
    const vfloat reach = in[TRC_OP_AT(RAYCAST, distance)];
    struct trc_surface hit;
    for (size_t i = 0; i < TRC_OP_OUT_AT(RAYCAST, end); i++)
        out[i] = vf_zero();
    out[TRC_OP_OUT_AT(RAYCAST, hit_distance)] = reach;
    if (!trc_program_cast(s, mode, in, &hit))
        return;
    const vvec3 position = v3_read(in + TRC_OP_AT(RAYCAST, position));
    const vvec3 d = v3_read(in + TRC_OP_AT(RAYCAST, direction));
    const vfloat t = vf_load(s->probe->packet->t);
    const vmask met = hit.active, self = vi_eq(hit.instance, s->instance);
    out[TRC_OP_OUT_AT(RAYCAST, is_hit)] = vf_truth(met);
    out[TRC_OP_OUT_AT(RAYCAST, self_hit)] = vf_truth(vm_and(met, self));
    out[TRC_OP_OUT_AT(RAYCAST, hit_distance)] = vf_select(met, t, reach);
    v3_write(out + TRC_OP_OUT_AT(RAYCAST, hit_position), v3_where(met, v3_mad(d, t, position)));
    v3_write(out + TRC_OP_OUT_AT(RAYCAST, hit_normal), v3_where(met, hit.n));
}

void trc_program_trace(const struct trc_surface *s, uint32_t op, uint32_t mode, const vfloat *in,
                       vfloat *out) {
    switch (op) {
    case TRC_OP_AMBIENT_OCCLUSION:
        out[0] = s->probe ? ambient_occlusion(s, mode, in) : vf_one();
        break;
    case TRC_OP_BEVEL:
        v3_write(out, s->probe ? bevel(s, mode, in) : s->n);
        break;
    default:
        raycast(s, mode, in, out);
        break;
    }
}
