/* Ray queries: arrays of the caller through packets. */
#include "kernels/query.h"

#include "kernels/packet.h"
#include "scene/snapshot.h"

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

static void packet_load(const trc_rays *rays, uint64_t begin, uint32_t count, struct trc_packet *p,
                        int power[TRC_PACKET_SIZE]) {
    p->active = 0;
    p->common_origin = true;
    for (uint32_t i = 0; i < count; i++)
        if (ray_load(rays, begin + i, (int)i, p, &power[i]))
            p->active |= 1ull << i;
    const int first = p->active ? __builtin_ctzll(p->active) : 0;
    for (uint64_t m = p->active; m && p->common_origin; m &= m - 1) {
        const int i = __builtin_ctzll(m);
        for (int k = 0; k < 3; k++)
            p->common_origin = p->common_origin && p->o[k][i] == p->o[k][first];
    }
    p->visibility = rays->visibility;
    p->skip_transparent = false;
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
    TRC_KERNEL(trc_query_normal)(snapshot, h->instance[i], h->triangle[i], p->time[i], n);
    if (out->normal_x)
        out->normal_x[to] = n[0];
    if (out->normal_y)
        out->normal_y[to] = n[1];
    if (out->normal_z)
        out->normal_z[to] = n[2];
}

void TRC_KERNEL(trc_query_normal)(const struct trc_snapshot *snapshot, uint32_t instance,
                                  uint32_t triangle, float time, float normal[3]) {
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

void TRC_KERNEL(trc_query_closest_rays)(const struct trc_snapshot *snapshot, const trc_rays *rays,
                                        const trc_hits *hits, uint64_t begin, uint64_t end,
                                        uint32_t packet_size) {
    struct trc_packet p;
    struct trc_packet_hits h;
    int power[TRC_PACKET_SIZE];
    const uint32_t size = packet_size < TRC_PACKET_SIZE ? packet_size : TRC_PACKET_SIZE;
    for (uint64_t at = begin; at < end; at += size) {
        const uint32_t count = end - at < size ? (uint32_t)(end - at) : size;
        packet_load(rays, at, count, &p, power);
        memset(h.instance, 0xff, sizeof h.instance);
        TRC_KERNEL(trc_trace_closest)(snapshot, &p, &h);
        for (uint32_t i = 0; i < count; i++) {
            if ((p.active >> i & 1u) && h.instance[i] != TRC_NO_HIT)
                hit_store(snapshot, hits, at + i, &p, &h, i, power[i]);
            else
                hits->instance[at + i] = TRC_NO_HIT;
        }
    }
}

void TRC_KERNEL(trc_query_occluded_rays)(const struct trc_snapshot *snapshot, const trc_rays *rays,
                                         uint8_t *occluded, uint64_t begin, uint64_t end,
                                         uint32_t packet_size) {
    struct trc_packet p;
    int power[TRC_PACKET_SIZE];
    const uint32_t size = packet_size < TRC_PACKET_SIZE ? packet_size : TRC_PACKET_SIZE;
    for (uint64_t at = begin; at < end; at += size) {
        const uint32_t count = end - at < size ? (uint32_t)(end - at) : size;
        packet_load(rays, at, count, &p, power);
        const uint64_t blocked = TRC_KERNEL(trc_trace_occluded)(snapshot, &p);
        for (uint32_t i = 0; i < count; i++)
            occluded[at + i] = (uint8_t)(blocked >> i & 1u);
    }
}
