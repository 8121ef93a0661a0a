/* Assembly: packets of the rays of a step, and their hits.
 *
 * Which rays share a packet decides how well they stay together (Boulos et al. 2007, section 3.3).
 */
#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"

uint32_t trc_hit_material(const struct trc_snapshot *snapshot, uint32_t instance,
                          uint32_t triangle) {
    const struct trc_instance *in = &snapshot->instances[instance];
    const struct trc_mesh *mesh = snapshot->meshes[in->mesh];
    const uint32_t slot = mesh->material_index ? mesh->material_index[triangle] : 0;
    return in->materials[slot < in->material_count ? slot : in->material_count - 1];
}

/* Rays of one packet share their visibility; else the assembly decides (Boulos et al. 2007,
 * section 3.3). Keys are what rays of a packet share; runs break packets where the key changes. */
#define RAY_KIND (TRC_VISIBLE_ALL | TRC_VISIBLE_UNBLOCKED)
#define RAY_KIND_BITS 6
/* Of the material that rays left, what its groups differ by: keys stay below TRC_BINS. */
#define GROUP_MASK 63u
static bool all_see_the_same(const struct trc_tile *t) {
    return !(t->snapshot->features & (TRC_FEATURE_VISIBILITY | TRC_FEATURE_SHADOW_CATCHERS));
}
static uint32_t assembly_key(const struct trc_tile *t, uint32_t ray) {
    const struct trc_ray_store *r = &t->work;
    const uint32_t kind = r->w[TRC_RAY_PATH][ray] & RAY_KIND;
    switch (t->desc->assembly) {
    case TRC_ASSEMBLY_BLIND:
        return all_see_the_same(t) ? 0 : kind;
    case TRC_ASSEMBLY_GROUPS:
        return kind | (r->w[TRC_RAY_PARENT][ray] & GROUP_MASK) << RAY_KIND_BITS;
    case TRC_ASSEMBLY_OCTANTS:
        return kind | (uint32_t)(r->f[TRC_RAY_DX][ray] < 0.0f) << RAY_KIND_BITS |
               (uint32_t)(r->f[TRC_RAY_DY][ray] < 0.0f) << (RAY_KIND_BITS + 1) |
               (uint32_t)(r->f[TRC_RAY_DZ][ray] < 0.0f) << (RAY_KIND_BITS + 2);
    default:
        return kind;
    }
}

/* The default: rays other than the camera's also share a cell of directions. */
static void keys_by_direction(struct trc_tile *t) {
    const struct trc_ray_store *r = &t->work;
    for (uint32_t i = 0; i < r->count; i += TRC_WIDTH) {
        const vuint kind = vu_load(r->w[TRC_RAY_PATH] + i) & vu_set(RAY_KIND);
        const vvec3 d = v3(vf_load(r->f[TRC_RAY_DX] + i), vf_load(r->f[TRC_RAY_DY] + i),
                           vf_load(r->f[TRC_RAY_DZ] + i));
        const vuint cell = kind * vu_set(TRC_DIRECTION_CELLS) + trc_direction_cell(d);
        const vmask camera =
            vi_eq((vint)(kind & vu_set(TRC_VISIBLE_CAMERA)), vi_set(TRC_VISIBLE_CAMERA));
        const vuint straight = (kind & vu_set(TRC_VISIBLE_UNBLOCKED)) * vu_set(TRC_DIRECTION_CELLS);
        vi_store((int32_t *)t->keys + i, vi_select(camera, (vint)straight, (vint)cell));
    }
}

/* left: NULL where there are no curves. */
static void packet_load(struct trc_tile *t, const uint32_t *order, uint32_t count,
                        struct trc_packet *p, struct trc_packet_hits *h,
                        struct trc_left_strands *left) {
    const struct trc_ray_store *r = &t->work;
    float *const to[] = {p->o[0], p->o[1], p->o[2], p->d[0], p->d[1],
                         p->d[2], p->tmin, p->t,    p->time};
    static const int from[] = {TRC_RAY_OX, TRC_RAY_OY,   TRC_RAY_OZ,   TRC_RAY_DX,  TRC_RAY_DY,
                               TRC_RAY_DZ, TRC_RAY_TMIN, TRC_RAY_TMAX, TRC_RAY_TIME};
    const int columns = t->object_motion ? 9 : 8;
    if (order[count - 1] - order[0] == count - 1) { /* sorted stably, so they follow each other */
        for (int k = 0; k < columns; k++)
            memcpy(to[k], r->f[from[k]] + order[0], count * sizeof(float));
    } else {
        uint32_t at_padded[TRC_PACKET_SIZE] = {0};
        memcpy(at_padded, order, count * sizeof *order);
        for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
            const vmask m = vm_first((int32_t)(count - i));
            const vint at = vi_load((const int32_t *)at_padded + i);
            for (int k = 0; k < columns; k++)
                vf_store(to[k] + i, vf_gather(r->f[from[k]], at, m));
        }
    }
    const uint32_t path = r->w[TRC_RAY_PATH][order[0]];
    p->active = count < TRC_PACKET_SIZE ? (1ull << count) - 1 : ~0ull;
    p->visibility = t->desc->assembly == TRC_ASSEMBLY_BLIND && all_see_the_same(t)
                        ? TRC_VISIBLE_ALL
                        : trc_ray_visibility(path);
    if (path & TRC_VISIBLE_UNBLOCKED)
        p->visibility <<= TRC_UNBLOCKED_SHIFT;
    p->common_origin = (path & TRC_VISIBLE_CAMERA) && t->camera_common;
    p->skip_transparent = false;
    p->left = left;
    for (uint32_t i = 0; left && i < count; i++) {
        left->instance[i] = r->w[TRC_RAY_STRAND_INSTANCE][order[i]];
        left->strand[i] = r->w[TRC_RAY_STRAND][order[i]];
    }
    memset(h->instance, 0xff, count * sizeof *h->instance);
}

static void hits_store(struct trc_tile *t, const uint32_t *order, uint32_t count,
                       const struct trc_packet *p, const struct trc_packet_hits *h) {
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t ray = order[i];
        t->hits.t[ray] = p->t[i];
        t->hits.instance[ray] = h->instance[i];
        if (h->instance[i] == TRC_NO_HIT)
            continue;
        t->hits.triangle[ray] = h->triangle[i];
        t->hits.u[ray] = h->u[i];
        t->hits.v[ray] = h->v[i];
        t->hits.material[ray] = trc_hit_material(t->snapshot, h->instance[i], h->triangle[i]);
    }
}

static void count_rays(struct trc_tile *t) {
    struct trc_tile_counts *counts = &t->job->counts;
    for (uint32_t i = 0; i < t->work.count; i++) {
        const uint32_t path = t->work.w[TRC_RAY_PATH][i];
        if (path & TRC_VISIBLE_CAMERA)
            counts->rays_camera++;
        else if (path & TRC_PATH_REFLECTED)
            counts->rays_reflection++;
        else
            counts->rays_refraction++;
    }
}

/* Packets of t->order, each from begin to end. */
struct bundle {
    uint32_t count;
    uint32_t begin[TRC_BUNDLE], end[TRC_BUNDLE];
};

/* Whether rays of this one's kind mostly meet the same nodes as their neighbours: not once they
 * have been scattered. */
static bool stays_together(const struct trc_tile *t, uint32_t ray) {
    return (t->work.w[TRC_RAY_PATH][ray] & TRC_VISIBLE_CAMERA) ||
           t->work.f[TRC_RAY_PDF][ray] < 0.0f;
}

/* Whether the packet that begins there goes with those of the bundle. */
static bool bundle_takes(const struct trc_tile *t, const struct bundle *b, uint32_t begin) {
    const uint32_t first = t->order[b->begin[0]], ray = t->order[begin];
    return b->count < t->bundle && t->keys[first] == t->keys[ray] && stays_together(t, first) &&
           stays_together(t, ray);
}

/* Traces a packet on its own if some of its rays look back. */
static bool looked_back(struct trc_tile *t, const uint32_t *order, uint32_t count,
                        struct trc_packet *p, struct trc_packet_hits *h) {
    uint32_t left[TRC_PACKET_SIZE];
    bool looks = false;
    for (uint32_t i = 0; i < count; i++)
        looks |= p->tmin[i] < 0.0f;
    if (!looks)
        return false;
    for (uint32_t i = 0; i < TRC_PACKET_SIZE; i++)
        left[i] = i < count ? t->work.w[TRC_RAY_LEFT][order[i]] : TRC_NO_HIT;
    trc_trace_looking_back(t->snapshot, p, h, left);
    p->active = 0;
    return true;
}

static void bundle_trace(struct trc_tile *t, struct bundle *b) {
    uint32_t together = 0;
    for (uint32_t k = 0; k < b->count; k++) {
        const uint32_t *order = t->order + b->begin[k], count = b->end[k] - b->begin[k];
        packet_load(t, order, count, &t->packets[k], &t->packet_hits[k],
                    t->left ? &t->left[k] : NULL);
        together += !(t->looks_back && t->generation > 0 &&
                      looked_back(t, order, count, &t->packets[k], &t->packet_hits[k]));
    }
    if (together)
        trc_trace_closest(t->snapshot, t->packets, t->packet_hits, b->count);
    for (uint32_t k = 0; k < b->count; k++)
        hits_store(t, t->order + b->begin[k], b->end[k] - b->begin[k], &t->packets[k],
                   &t->packet_hits[k]);
    b->count = 0;
}

void trc_assembly_trace(struct trc_tile *t) {
    const uint32_t count = t->work.count;
    const bool runs = t->desc->assembly == TRC_ASSEMBLY_RUNS;
    const uint32_t size = t->desc->assembly == TRC_ASSEMBLY_NONE ? 1 : t->packet_size;
    if (t->desc->assembly == TRC_ASSEMBLY_AUTO)
        keys_by_direction(t);
    else
        for (uint32_t i = 0; i < count; i++)
            t->keys[i] = assembly_key(t, i);
    struct bundle bundle = {0};
    trc_tile_sort(t, t->keys, count, t->order);
    for (uint32_t begin = 0; begin < count;) {
        const uint32_t key = t->keys[t->order[begin]];
        uint32_t end = begin + 1;
        while (end < count && end - begin < size && t->keys[t->order[end]] == key &&
               (!runs || t->work.w[TRC_RAY_PARENT][t->order[end]] ==
                             t->work.w[TRC_RAY_PARENT][t->order[begin]]))
            end++;
        if (bundle.count && !bundle_takes(t, &bundle, begin))
            bundle_trace(t, &bundle);
        bundle.begin[bundle.count] = begin;
        bundle.end[bundle.count++] = end;
        begin = end;
    }
    if (bundle.count)
        bundle_trace(t, &bundle);
    count_rays(t);
}
