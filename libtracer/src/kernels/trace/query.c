/* Ray queries: arrays of the caller through packets. */
#include "kernels/trace/query.h"

#include "kernels/trace/curve_surface.h"
#include "kernels/trace/direction.h"
#include "kernels/trace/packet.h"
#include "model/snapshot.h"

/* Rays are scaled by a power of two so that the largest component of the direction is in [1, 2):
 * exact, and distances scale back exactly. Rays that documented rules exclude stay inactive. */

/* Which of the caller's rays: count from number begin on, or, where order is not NULL, begin plus
 * what stands there. */
struct rays_part {
    uint64_t begin;
    uint32_t count;
    const uint32_t *order;
};

/* Rays on their way through packets. */
struct load {
    uint32_t count, packet_count;
    struct trc_packet packets[TRC_BUNDLE];
    struct trc_packet_hits hits[TRC_BUNDLE];
    int32_t power[TRC_BUNDLE * TRC_PACKET_SIZE]; /* of two: what the direction was divided by */
};

/* ---- rays ---- */

/* Bits of a float's exponent, and the exponent of 1. */
#define EXPONENT_SHIFT 23
#define EXPONENT_OF_ONE 127
/* Within these powers of two, neither they nor what is divided by them leave the range. */
#define MAX_PLAIN_POWER 120

static vfloat power_of_two(vint power) {
    return vi_as_float((power + vi_set(EXPONENT_OF_ONE)) << EXPONENT_SHIFT);
}

/* TRC_WIDTH elements of the caller's, those of the part from number i on; 0 beyond its end. */
TRC_INLINE vfloat elements_load(const float *column, const struct rays_part *part, uint32_t i) {
    const uint32_t left = part->count - i;
    if (part->order)
        return vf_gather(column + part->begin, vi_load((const int32_t *)part->order + i),
                         vm_first((int32_t)left));
    if (left >= TRC_WIDTH)
        return vf_load(column + part->begin + i);
    float lanes[TRC_WIDTH] = {0.0f};
    memcpy(lanes, column + part->begin + i, left * sizeof(float));
    return vf_load(lanes);
}

TRC_INLINE vmask is_finite(vfloat a) { return vf_lt(vf_abs(a), vf_set(INFINITY)); }

/* Scales one ray whose direction is as good as zero or as infinite. */
static __attribute__((noinline)) void ray_scale(struct trc_packet *p, int lane, int32_t *power) {
    float largest = 0.0f;
    for (int k = 0; k < 3; k++)
        largest = fmaxf(largest, fabsf(p->d[k][lane]));
    int exponent;
    (void)frexpf(largest, &exponent);
    *power = exponent - 1;
    for (int k = 0; k < 3; k++)
        p->d[k][lane] = ldexpf(p->d[k][lane], 1 - exponent);
    p->tmin[lane] = ldexpf(p->tmin[lane], *power);
    p->t[lane] = ldexpf(p->t[lane], *power);
}

/* TRC_WIDTH rays of the part from number at on into lanes from i of a packet; the lanes that are
 * active. */
TRC_INLINE uint32_t lanes_load(const trc_rays *rays, const struct rays_part *part, uint32_t at,
                               struct trc_packet *p, int i, int32_t *power) {
    const uint32_t left = part->count - at;
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    const vfloat o[3] = {elements_load(rays->origin_x, part, at),
                         elements_load(rays->origin_y, part, at),
                         elements_load(rays->origin_z, part, at)};
    const vfloat d[3] = {elements_load(rays->direction_x, part, at),
                         elements_load(rays->direction_y, part, at),
                         elements_load(rays->direction_z, part, at)};
    const vfloat tmin = rays->tmin ? elements_load(rays->tmin, part, at) : zero;
    const vfloat tmax = rays->tmax ? elements_load(rays->tmax, part, at) : vf_set(INFINITY);
    const vfloat time = rays->time ? elements_load(rays->time, part, at) : zero;
    const vfloat largest = vf_max(vf_abs(d[0]), vf_max(vf_abs(d[1]), vf_abs(d[2])));
    vmask good = vm_and(vf_gt(largest, zero), vm_and(vf_le(tmin, tmax), vf_eq(time, time)));
    for (int k = 0; k < 3; k++)
        good = vm_and(good, vm_and(is_finite(o[k]), is_finite(d[k])));
    const vint exponent = (vf_as_int(largest) >> EXPONENT_SHIFT) - vi_set(EXPONENT_OF_ONE);
    const vmask plain =
        vm_and(vi_lt(vi_set(-MAX_PLAIN_POWER), exponent), vi_lt(exponent, vi_set(MAX_PLAIN_POWER)));
    const vint scale = vi_select(plain, exponent, vi_set(0));
    const vfloat along = power_of_two(scale), inverse = power_of_two(vi_set(0) - scale);
    for (int k = 0; k < 3; k++) {
        vf_store(&p->o[k][i], o[k]);
        vf_store(&p->d[k][i], d[k] * inverse);
    }
    vf_store(&p->tmin[i], tmin * along);
    vf_store(&p->t[i], tmax * along);
    vf_store(&p->time[i], vf_min(vf_max(time, zero), one));
    vi_store(power, scale);
    if (left < TRC_WIDTH)
        good = vm_and(good, vm_first((int32_t)left));
    for (uint32_t extreme = vm_bits(vm_andnot(good, plain)); extreme; extreme &= extreme - 1) {
        const int lane = __builtin_ctz(extreme);
        ray_scale(p, i + lane, power + lane);
    }
    return vm_bits(good);
}

/* Whether all active rays start where the first of them does. */
static bool has_common_origin(const struct load *l) {
    const struct trc_packet *first = NULL;
    vfloat o[3];
    for (uint32_t k = 0; k < l->packet_count; k++) {
        const struct trc_packet *p = &l->packets[k];
        if (!p->active)
            continue;
        for (int axis = 0; axis < 3 && !first; axis++)
            o[axis] = vf_set(p->o[axis][__builtin_ctzll(p->active)]);
        first = p;
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
            const int i = c * TRC_WIDTH;
            vmask same = vm_all_set();
            for (int axis = 0; axis < 3; axis++)
                same = vm_and(same, vf_eq(vf_load(&p->o[axis][i]), o[axis]));
            if (trc_chunk_bits(p->active, c) & ~vm_bits(same))
                return false;
        }
    }
    return true;
}

static void rays_load(const trc_rays *rays, const struct rays_part *part, struct load *l) {
    const uint32_t count = part->count;
    l->count = count;
    l->packet_count = (count + TRC_PACKET_SIZE - 1) / TRC_PACKET_SIZE;
    for (uint32_t k = 0; k < l->packet_count; k++) {
        struct trc_packet *p = &l->packets[k];
        p->active = 0;
        p->visibility = rays->visibility;
        p->skip_transparent = false;
        p->left = NULL;
        for (uint32_t i = 0; i < TRC_PACKET_SIZE && k * TRC_PACKET_SIZE + i < count;
             i += TRC_WIDTH) {
            const uint32_t at = k * TRC_PACKET_SIZE + i;
            p->active |= (uint64_t)lanes_load(rays, part, at, p, (int)i, &l->power[at]) << i;
        }
    }
    const bool common = has_common_origin(l);
    for (uint32_t k = 0; k < l->packet_count; k++)
        l->packets[k].common_origin = common;
}

/* ---- hits ---- */

/* Distances in the caller's lengths. */
TRC_INLINE vfloat scale_back(vfloat t, const int32_t *power) {
    const vint p = vi_load(power);
    const vmask plain =
        vm_and(vi_lt(vi_set(-MAX_PLAIN_POWER), p), vi_lt(p, vi_set(MAX_PLAIN_POWER)));
    if (__builtin_expect(vm_all(plain), 1))
        return t * power_of_two(vi_set(0) - p);
    float lanes[TRC_WIDTH];
    vf_store(lanes, t);
    for (int i = 0; i < TRC_WIDTH; i++)
        lanes[i] = ldexpf(lanes[i], -power[i]);
    return vf_load(lanes);
}

/* Stores lanes of hit as the caller's elements of the part from number at on; others are not
 * touched. column: of floats or words, or NULL. */
TRC_INLINE void elements_store(void *column, const struct rays_part *part, uint32_t at, vmask hit,
                               vint value) {
    if (!column)
        return;
    int32_t *const to = (int32_t *)column + part->begin;
    if (!part->order && part->count - at >= TRC_WIDTH) {
        vi_store(to + at, vi_select(hit, value, vi_load(to + at)));
        return;
    }
    int32_t lanes[TRC_WIDTH];
    vi_store(lanes, value);
    for (uint32_t bits = vm_bits(hit); bits; bits &= bits - 1) {
        const uint32_t i = (uint32_t)__builtin_ctz(bits);
        to[part->order ? part->order[at + i] : at + i] = lanes[i];
    }
}

/* The normal of a hit of a curve, towards where the ray came from, unit. */
static void curve_normal(const struct trc_snapshot *snapshot, const struct trc_packet *p,
                         const struct trc_packet_hits *h, uint32_t lane, float normal[3]) {
    const vvec3 d = v3(vf_set(p->d[0][lane]), vf_set(p->d[1][lane]), vf_set(p->d[2][lane]));
    struct trc_surface s = {.snapshot = snapshot,
                            .active = vm_from_bits(1),
                            .instance = vi_set((int32_t)h->instance[lane]),
                            .triangle = vi_set((int32_t)h->triangle[lane]),
                            .u = vf_set(h->u[lane]),
                            .v = vf_set(h->v[lane]),
                            .time = vf_set(p->time[lane]),
                            .strand = vi_set(-1),
                            .wo = v3_neg(v3_normalize(d))};
    trc_curve_fetch(&s, s.active);
    normal[0] = vf_get(s.n.x, 0);
    normal[1] = vf_get(s.n.y, 0);
    normal[2] = vf_get(s.n.z, 0);
}

static void normals_store(const struct trc_snapshot *snapshot, const trc_hits *out,
                          const struct rays_part *part, uint32_t at, const struct trc_packet *p,
                          const struct trc_packet_hits *h, uint32_t hit) {
    float *const columns[3] = {out->normal_x, out->normal_y, out->normal_z};
    for (; hit; hit &= hit - 1) {
        const uint32_t number = at + (uint32_t)__builtin_ctz(hit), lane = number % TRC_PACKET_SIZE;
        float n[3];
        if (snapshot->meshes[snapshot->instances[h->instance[lane]].mesh]->strands)
            curve_normal(snapshot, p, h, lane, n);
        else
            trc_query_normal(snapshot, h->instance[lane], h->triangle[lane], p->time[lane], n);
        for (int k = 0; k < 3; k++)
            if (columns[k])
                columns[k][part->begin + (part->order ? part->order[number] : number)] = n[k];
    }
}

/* What rays of the part met, from number at on, into the caller's arrays. */
TRC_INLINE void lanes_store(const struct trc_snapshot *snapshot, const trc_hits *out,
                            const struct rays_part *part, uint32_t at, const struct load *l) {
    const struct trc_packet *p = &l->packets[at / TRC_PACKET_SIZE];
    const struct trc_packet_hits *h = &l->hits[at / TRC_PACKET_SIZE];
    const int i = (int)(at % TRC_PACKET_SIZE);
    const uint32_t left = part->count - at;
    const vint instance = vi_load((const int32_t *)&h->instance[i]), none = vi_set(-1);
    const vmask within = left < TRC_WIDTH ? vm_first((int32_t)left) : vm_all_set();
    const vmask active = vm_and(within, vm_from_bits((uint32_t)(p->active >> i) & TRC_LANE_BITS));
    const vmask hit = vm_andnot(active, vi_eq(instance, none));
    elements_store(out->instance, part, at, within, vi_select(hit, instance, none));
    if (!vm_any(hit))
        return;
    elements_store(out->triangle, part, at, hit, vi_load((const int32_t *)&h->triangle[i]));
    if (out->distance)
        elements_store(out->distance, part, at, hit,
                       vf_as_int(scale_back(vf_load(&p->t[i]), &l->power[at])));
    elements_store(out->u, part, at, hit, vf_as_int(vf_load(&h->u[i])));
    elements_store(out->v, part, at, hit, vf_as_int(vf_load(&h->v[i])));
    if (out->normal_x || out->normal_y || out->normal_z)
        normals_store(snapshot, out, part, at, p, h, vm_bits(hit));
}

void trc_query_normal(const struct trc_snapshot *snapshot, uint32_t instance, uint32_t triangle,
                      float time, float normal[3]) {
    const struct trc_instance *in = &snapshot->instances[instance];
    const struct trc_mesh *mesh = snapshot->meshes[in->mesh];
    uint32_t key, mesh_key;
    float f, mesh_f;
    trc_key_at(time, in->key_count, &key, &f);
    trc_key_at(time, mesh->key_count, &mesh_key, &mesh_f);
    double world[3][3];
    for (int v = 0; v < 3; v++) {
        const uint32_t index = mesh->indices[3 * (size_t)triangle + (uint32_t)v];
        const float *a = mesh->positions + 3 * ((size_t)mesh_key * mesh->vertex_count + index);
        const float *b = mesh->key_count > 1 ? a + 3 * (size_t)mesh->vertex_count : a;
        const float *ma = in->object_to_world[key].m;
        const float *mb = in->key_count > 1 ? in->object_to_world[key + 1].m : ma;
        for (int r = 0; r < 3; r++) {
            world[v][r] = (1.0 - f) * ma[4 * r + 3] + (double)f * mb[4 * r + 3];
            for (int k = 0; k < 3; k++)
                world[v][r] += ((1.0 - f) * ma[4 * r + k] + (double)f * mb[4 * r + k]) *
                               ((1.0 - mesh_f) * a[k] + (double)mesh_f * b[k]);
        }
    }
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        normal[k] = (float)((world[1][i] - world[0][i]) * (world[2][j] - world[0][j]) -
                            (world[1][j] - world[0][j]) * (world[2][i] - world[0][i]));
    }
}

/* ---- order ---- */

/* Rays that are ordered together. */
#define ORDERED_RAYS 1024
/* Directions in a packet, in the mean, from which on rays are ordered. */
#define MIXED_DIRECTIONS 3

/* Sorts the part's rays stably by direction into order, unless most packets are of one direction as
 * they are: then its order stays NULL. */
static void rays_order(const trc_rays *rays, struct rays_part *part, uint32_t *order) {
    uint32_t direction[ORDERED_RAYS + TRC_WIDTH], first[TRC_DIRECTIONS + 1] = {0}, groups = 0;
    for (uint32_t i = 0; i < part->count; i += TRC_WIDTH)
        vu_store(direction + i, trc_direction_cell(v3(elements_load(rays->direction_x, part, i),
                                                      elements_load(rays->direction_y, part, i),
                                                      elements_load(rays->direction_z, part, i))));
    for (uint32_t i = 0; i < part->count; i += TRC_PACKET_SIZE) {
        const uint32_t end = part->count - i < TRC_PACKET_SIZE ? part->count : i + TRC_PACKET_SIZE;
        uint32_t seen = 0;
        for (uint32_t k = i; k < end; k++)
            seen |= 1u << direction[k];
        groups += (uint32_t)__builtin_popcount(seen);
    }
    if (groups * TRC_PACKET_SIZE < MIXED_DIRECTIONS * part->count)
        return;
    for (uint32_t i = 0; i < part->count; i++)
        first[direction[i] + 1]++;
    for (uint32_t k = 0; k < TRC_DIRECTIONS; k++)
        first[k + 1] += first[k];
    for (uint32_t i = 0; i < part->count; i++)
        order[first[direction[i]]++] = i;
    part->order = order;
}

/* ---- queries ---- */

static void hits_clear(struct load *l) {
    for (uint32_t k = 0; k < l->packet_count; k++)
        memset(l->hits[k].instance, 0xff, sizeof l->hits[k].instance);
}

/* How rays are taken: so many at a time, of which so many go together; ordered: by direction, where
 * they mix. */
struct manner {
    uint32_t part_size, load_size;
    bool ordered;
};

/* As packets of that size, or as is best (0): bundles, which coherent rays gain most from, of rays
 * that are ordered where each packet would go many ways. Packets of fewer than stream_size go as
 * that many single rays: as a stream from the root on, ordered alike. */
static struct manner manner_of(uint32_t packet_size, uint32_t stream_size) {
    if (packet_size == 0)
        return (struct manner){ORDERED_RAYS, TRC_BUNDLE * TRC_PACKET_SIZE, true};
    if (packet_size < stream_size)
        return (struct manner){ORDERED_RAYS, stream_size, true};
    return (struct manner){packet_size, packet_size, false};
}

/* The rays of a query on their way, a load after the other. */
struct rays_walk {
    const trc_rays *rays;
    struct manner manner;
    const uint32_t *given; /* the order of all, or NULL */
    uint64_t next, end;    /* rays that no part has yet */
    struct rays_part all;  /* the part under way, and how many of it are done */
    uint32_t done;
    uint32_t order[ORDERED_RAYS + TRC_WIDTH];
};

static void rays_walk_begin(struct rays_walk *w, const trc_rays *rays, uint64_t begin, uint64_t end,
                            struct manner manner, const uint32_t *given) {
    w->rays = rays;
    w->manner = manner;
    w->given = given;
    if (given)
        w->manner.part_size = (uint32_t)(end - begin);
    w->next = begin;
    w->end = end;
    w->all.count = w->done = 0;
}

static uint32_t at_most(uint64_t count, uint32_t size) {
    return count < size ? (uint32_t)count : size;
}

/* Loads the next rays; false: there are none. part_out: which they are. */
static bool rays_walk_load(struct rays_walk *w, struct load *l, struct rays_part *part_out) {
    if (w->done == w->all.count) {
        if (w->next == w->end)
            return false;
        w->all =
            (struct rays_part){w->next, at_most(w->end - w->next, w->manner.part_size), w->given};
        w->next += w->all.count;
        w->done = 0;
        if (w->manner.ordered && !w->given)
            rays_order(w->rays, &w->all, w->order);
    }
    const uint32_t *order = w->all.order;
    *part_out = (struct rays_part){w->all.begin + (order ? 0 : w->done),
                                   at_most(w->all.count - w->done, w->manner.load_size),
                                   order ? order + w->done : NULL};
    w->done += part_out->count;
    rays_load(w->rays, part_out, l);
    return true;
}

void trc_query_closest_rays(const struct trc_snapshot *snapshot, const trc_rays *rays,
                            const trc_hits *hits, uint64_t begin, uint64_t end,
                            uint32_t packet_size, const uint32_t *order) {
    struct rays_walk walk;
    struct rays_part part;
    struct load l;
    rays_walk_begin(&walk, rays, begin, end, manner_of(packet_size, TRC_STREAM_CLOSEST), order);
    while (rays_walk_load(&walk, &l, &part)) {
        hits_clear(&l);
        trc_trace_closest(snapshot, l.packets, l.hits, l.packet_count);
        for (uint32_t k = 0; k < l.count; k += TRC_WIDTH)
            lanes_store(snapshot, hits, &part, k, &l);
    }
}

/* A byte of 0 or 1 for each of eight bits, the lowest first in memory. */
static uint64_t bytes_of_bits(uint32_t bits) {
    const uint64_t ones = 0x0101010101010101u, own_bit = 0x8040201008040201u;
    return ((((bits & 0xffu) * ones) & own_bit) + 0x7f * ones) >> 7 & ones;
}

/* Whether rays of the part are blocked, a mask for each packet, into the caller's bytes. */
static void occluded_store(uint8_t *occluded, const struct rays_part *part,
                           const uint64_t *blocked) {
    uint8_t *const to = occluded + part->begin;
    uint32_t k = 0;
    for (; !part->order && k + sizeof(uint64_t) <= part->count; k += sizeof(uint64_t)) {
        const uint64_t bytes =
            bytes_of_bits((uint32_t)(blocked[k / TRC_PACKET_SIZE] >> k % TRC_PACKET_SIZE));
        memcpy(to + k, &bytes, sizeof bytes);
    }
    for (; k < part->count; k++)
        to[part->order ? part->order[k] : k] =
            (uint8_t)(blocked[k / TRC_PACKET_SIZE] >> k % TRC_PACKET_SIZE & 1u);
}

void trc_query_occluded_rays(const struct trc_snapshot *snapshot, const trc_rays *rays,
                             uint8_t *occluded, uint64_t begin, uint64_t end, uint32_t packet_size,
                             const uint32_t *order) {
    struct rays_walk walk;
    struct rays_part part;
    struct load l;
    uint64_t blocked[TRC_BUNDLE];
    rays_walk_begin(&walk, rays, begin, end, manner_of(packet_size, TRC_STREAM_ANY), order);
    while (rays_walk_load(&walk, &l, &part)) {
        trc_trace_occluded(snapshot, l.packets, l.packet_count, blocked);
        occluded_store(occluded, &part, blocked);
    }
}
