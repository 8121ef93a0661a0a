/* Ray queries: arrays of the caller through packets. */
#include "kernels/trace/query.h"

#include "kernels/trace/packet.h"
#include "model/snapshot.h"

/* Rays are scaled by a power of two so that the largest component of the direction is in [1, 2):
 * exact, and distances scale back exactly. Rays that documented rules exclude stay inactive. */

static bool ray_load(const trc_rays *rays, uint64_t from, int lane, struct trc_packet *p,
                     int *power) {
    const float o[3] = {rays->origin_x[from], rays->origin_y[from], rays->origin_z[from]};
    const float d[3] = {rays->direction_x[from], rays->direction_y[from], rays->direction_z[from]};
    const float tmin = rays->tmin ? rays->tmin[from] : 0.0f;
    const float tmax = rays->tmax ? rays->tmax[from] : INFINITY;
    const float time = rays->time ? rays->time[from] : 0.0f;
    float largest = 0.0f;
    for (int k = 0; k < 3; k++) {
        if (!isfinite(o[k]) || !isfinite(d[k]))
            return false;
        largest = fmaxf(largest, fabsf(d[k]));
    }
    if (largest == 0.0f || !(tmin <= tmax) || isnan(time))
        return false;
    int exponent;
    (void)frexpf(largest, &exponent);
    *power = exponent - 1;
    for (int k = 0; k < 3; k++) {
        p->o[k][lane] = o[k];
        p->d[k][lane] = ldexpf(d[k], 1 - exponent);
    }
    p->tmin[lane] = ldexpf(tmin, *power);
    p->t[lane] = ldexpf(tmax, *power);
    p->time[lane] = f_min(f_max(time, 0.0f), 1.0f);
    return true;
}

/* Rays on their way through packets, by 64. */
struct load {
    uint32_t count, packet_count;
    struct trc_packet packets[TRC_BUNDLE];
    struct trc_packet_hits hits[TRC_BUNDLE];
    int power[TRC_BUNDLE * TRC_PACKET_SIZE];
};

/* Whether all active rays start where the first of them does. */
static bool has_common_origin(const struct load *l) {
    const struct trc_packet *first = NULL;
    int lane = 0;
    for (uint32_t k = 0; k < l->packet_count; k++) {
        const struct trc_packet *p = &l->packets[k];
        for (uint64_t m = p->active; m; m &= m - 1) {
            const int i = __builtin_ctzll(m);
            if (!first) {
                first = p;
                lane = i;
            }
            for (int axis = 0; axis < 3; axis++)
                if (p->o[axis][i] != first->o[axis][lane])
                    return false;
        }
    }
    return true;
}

static void rays_load(const trc_rays *rays, uint64_t begin, uint32_t count, struct load *l) {
    l->count = count;
    l->packet_count = (count + TRC_PACKET_SIZE - 1) / TRC_PACKET_SIZE;
    for (uint32_t k = 0; k < l->packet_count; k++) {
        l->packets[k].active = 0;
        l->packets[k].visibility = rays->visibility;
        l->packets[k].skip_transparent = false;
    }
    for (uint32_t i = 0; i < count; i++) {
        struct trc_packet *p = &l->packets[i / TRC_PACKET_SIZE];
        const int lane = (int)(i % TRC_PACKET_SIZE);
        if (ray_load(rays, begin + i, lane, p, &l->power[i]))
            p->active |= 1ull << lane;
    }
    const bool common = has_common_origin(l);
    for (uint32_t k = 0; k < l->packet_count; k++)
        l->packets[k].common_origin = common;
}

static void hit_store(const struct trc_snapshot *snapshot, const trc_hits *out, uint64_t to,
                      const struct trc_packet *p, const struct trc_packet_hits *h, uint32_t i,
                      int power) {
    out->instance[to] = h->instance[i];
    if (out->triangle)
        out->triangle[to] = h->triangle[i];
    if (out->distance)
        out->distance[to] = ldexpf(p->t[i], -power);
    if (out->u)
        out->u[to] = h->u[i];
    if (out->v)
        out->v[to] = h->v[i];
    if (!out->normal_x && !out->normal_y && !out->normal_z)
        return;
    float n[3];
    trc_query_normal(snapshot, h->instance[i], h->triangle[i], p->time[i], n);
    if (out->normal_x)
        out->normal_x[to] = n[0];
    if (out->normal_y)
        out->normal_y[to] = n[1];
    if (out->normal_z)
        out->normal_z[to] = n[2];
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

void trc_query_closest_rays(const struct trc_snapshot *snapshot, const trc_rays *rays,
                            const trc_hits *hits, uint64_t begin, uint64_t end,
                            uint32_t packet_size) {
    struct load l;
    for (uint64_t at = begin; at < end; at += packet_size) {
        rays_load(rays, at, end - at < packet_size ? (uint32_t)(end - at) : packet_size, &l);
        for (uint32_t k = 0; k < l.packet_count; k++)
            memset(l.hits[k].instance, 0xff, sizeof l.hits[k].instance);
        trc_trace_closest(snapshot, l.packets, l.hits, l.packet_count);
        for (uint32_t i = 0; i < l.count; i++) {
            const uint32_t k = i / TRC_PACKET_SIZE, lane = i % TRC_PACKET_SIZE;
            if ((l.packets[k].active >> lane & 1u) && l.hits[k].instance[lane] != TRC_NO_HIT)
                hit_store(snapshot, hits, at + i, &l.packets[k], &l.hits[k], lane, l.power[i]);
            else
                hits->instance[at + i] = TRC_NO_HIT;
        }
    }
}

void trc_query_occluded_rays(const struct trc_snapshot *snapshot, const trc_rays *rays,
                             uint8_t *occluded, uint64_t begin, uint64_t end,
                             uint32_t packet_size) {
    struct load l;
    uint64_t blocked[TRC_BUNDLE];
    for (uint64_t at = begin; at < end; at += packet_size) {
        rays_load(rays, at, end - at < packet_size ? (uint32_t)(end - at) : packet_size, &l);
        trc_trace_occluded(snapshot, l.packets, l.packet_count, blocked);
        for (uint32_t i = 0; i < l.count; i++)
            occluded[at + i] = (uint8_t)(blocked[i / TRC_PACKET_SIZE] >> i % TRC_PACKET_SIZE & 1u);
    }
}
