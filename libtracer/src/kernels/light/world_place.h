/* Directions towards the world: by its importance map, its sun, or without. */
#ifndef TRACER_KERNELS_LIGHT_WORLD_PLACE_H
#define TRACER_KERNELS_LIGHT_WORLD_PLACE_H

#include "kernels/light/place.h"
#include "model/lights.h"

/* Words before the range of normals that holds n, or before what serves both sides. */
TRC_INLINE vint trc_map_facing_at(vvec3 n, vmask has_n) {
    const vfloat sum = vf_abs(n.x) + vf_abs(n.y) + vf_abs(n.z);
    const vfloat scale = vf_rcp(vf_select(has_n, sum, vf_one()));
    const vfloat x = n.x * scale, y = n.y * scale;
    const vmask folds = vf_lt(n.z, vf_zero());
    const vfloat folded_x = vf_copysign(vf_one() - vf_abs(y), x),
                 folded_y = vf_copysign(vf_one() - vf_abs(x), y);
    const vfloat half = vf_set(0.5f * TRC_MAP_NORMALS), last = vf_set(TRC_MAP_NORMALS - 1);
    const vfloat right = vf_select(folds, folded_x, x) * half + half;
    const vfloat up = vf_select(folds, folded_y, y) * half + half;
    const vint column = vf_to_int(vf_min(right, last)), row = vf_to_int(vf_min(up, last));
    const vint facing =
        vi_select(has_n, row * vi_set(TRC_MAP_NORMALS) + column, vi_set(TRC_MAP_FACINGS - 1));
    return facing * vi_set(TRC_MAP_FACING_WORDS);
}

/* Density per solid angle. theta by v, azimuth by u. */
TRC_INLINE vfloat trc_map_density(const struct trc_world_map *map, vvec3 n, vmask has_n, vvec3 wi,
                                  vmask m) {
    vfloat u = vf_atan2(wi.y, wi.x) * vf_set(0.5f * TRC_INV_PI);
    u = vf_select(vf_lt(u, vf_zero()), u + vf_one(), u);
    const vfloat v = vf_acos(wi.z) * vf_set(TRC_INV_PI);
    const vfloat width = vf_set((float)map->width), height = vf_set((float)map->height);
    const vint x = vf_to_int(vf_min(u * width, width - vf_one()));
    const vint y = vf_to_int(vf_min(v * height, height - vf_one()));
    const vfloat density = vf_gather(map->density, y * vi_set((int32_t)map->width) + x, m);
    const vfloat columns = vf_set(TRC_MAP_COLUMNS), rows = vf_set(TRC_MAP_ROWS);
    const vint column = vf_to_int(vf_min(u * columns, columns - vf_one()));
    const vint row = vf_to_int(vf_min(v * rows, rows - vf_one()));
    const vint block = column * vi_set(TRC_MAP_ROWS) + row;
    const vfloat factor = vf_gather(map->facings->factor, trc_map_facing_at(n, has_n) + block, m);
    const vfloat sine = vf_safe_sqrt((vf_one() - wi.z) * (vf_one() + wi.z));
    return vf_divide(density * factor, sine * vf_set(2.0f * TRC_PI * TRC_PI));
}

/* Interval of rising sums that holds u, and where in it: count intervals from base (per lane an
 * offset). */
TRC_INLINE vint trc_sum_search(const float *sums, vint base, uint32_t count, vfloat u, vmask m,
                               vfloat *within) {
    vint low = vi_set(0), size = vi_set((int32_t)count);
    /* Halves of odd sizes differ by one from lane to lane; a size of 1 stays where it is. */
    for (uint32_t left = count; left > 1; left = (left + 1) / 2) {
        const vint half = size >> 1;
        const vmask up = vf_le(vf_gather(sums, base + low + half, m), u);
        low = vi_select(up, low + half, low);
        size = vi_select(up, size - half, half);
    }
    const vfloat start = vf_gather(sums, base + low, m),
                 end = vf_gather(sums, base + low + vi_set(1), m);
    *within = vf_saturate(vf_divide(u - start, end - start));
    return low;
}
static inline vvec3 trc_map_sample(const struct trc_world_map *map, vvec3 n, vmask has_n, vfloat u1,
                                   vfloat u2, vmask m, vfloat *pdf) {
    const struct trc_map_facing *facings = map->facings;
    const uint32_t across = map->width / TRC_MAP_COLUMNS, down = map->height / TRC_MAP_ROWS;
    const vint facing = trc_map_facing_at(n, has_n);
    const vint column = trc_sum_search(facings->across, facing, TRC_MAP_COLUMNS, u1, m, &u1);
    const vint rows = facing + column * vi_set(TRC_MAP_ROWS + 1);
    const vint row = trc_sum_search(facings->down[0], rows, TRC_MAP_ROWS, u2, m, &u2);
    const vint block = column * vi_set(TRC_MAP_ROWS) + row;
    const vint inner =
        trc_sum_search(map->down, block * vi_set((int32_t)down + 1), down, u2, m, &u2);
    const vint y = row * vi_set((int32_t)down) + inner;
    const vint cells = (y * vi_set(TRC_MAP_COLUMNS) + column) * vi_set((int32_t)across + 1);
    const vint x =
        column * vi_set((int32_t)across) + trc_sum_search(map->along, cells, across, u1, m, &u1);
    const vfloat u = (vi_to_float(x) + u1) / vf_set((float)map->width);
    const vfloat v = (vi_to_float(y) + u2) / vf_set((float)map->height);
    vfloat sine, cosine, s, c;
    vf_sincos_turns(v * vf_set(0.5f), &sine, &cosine);
    vf_sincos_turns(u, &s, &c);
    const vfloat density = vf_gather(map->density, y * vi_set((int32_t)map->width) + x, m) *
                           vf_gather(facings->factor, facing + block, m);
    *pdf = vf_divide(density, sine * vf_set(2.0f * TRC_PI * TRC_PI));
    return v3(sine * c, sine * s, cosine);
}

/* Chance of sampling the sun of the world: none where all of it is below the surface. */
TRC_INLINE vfloat trc_world_sun_chance(const struct trc_world_sun *sun, vvec3 n, vmask has_n) {
    const vfloat cosine = v3_dot(n, v3_set(sun->direction));
    const vmask below = vm_and(has_n, vf_lt(cosine, vf_set(-sun->sine)));
    return vf_select(below, vf_zero(), vf_set(sun->share));
}
/* Of its places, taken evenly on a disk that touches the sphere at its middle. */
TRC_INLINE vfloat trc_world_sun_density(const struct trc_world_sun *sun, vvec3 wi) {
    const vvec3 middle = v3_set(sun->direction), off = v3_sub(wi, middle);
    const vfloat c = v3_dot(wi, middle);
    const vfloat inv_area = vf_set(1.0f / (TRC_PI * sun->tangent * sun->tangent));
    return vf_where(vf_lt(v3_dot(off, off), vf_set(sun->square_chord)),
                    inv_area * vf_rcp(c * c * c));
}
TRC_INLINE vvec3 trc_world_sun_sample(const struct trc_world_sun *sun, vfloat u1, vfloat u2) {
    const vvec3 middle = v3_set(sun->direction);
    vvec3 a, b;
    v3_frame(middle, &a, &b);
    vfloat x, y;
    trc_warp_disk(u1, u2, &x, &y);
    const vvec3 off = v3_add(v3_scale(a, x), v3_scale(b, y));
    return v3_normalize(v3_mad(off, vf_set(sun->tangent), middle));
}

/* Without a map: by cosine above n, or on both sides of it. */
TRC_INLINE vfloat trc_world_density(const struct trc_light_table *t, vvec3 n, vmask has_n, vvec3 wi,
                                    vmask m) {
    if (t->map) {
        const vfloat density = trc_map_density(t->map, n, has_n, wi, m);
        if (!(t->map->sun.share > 0.0f))
            return density;
        const vfloat chance = trc_world_sun_chance(&t->map->sun, n, has_n);
        const vfloat sun_density = trc_world_sun_density(&t->map->sun, wi);
        return density + chance * (sun_density - density);
    }
    const vfloat cosine = v3_dot(n, wi);
    return vf_select(has_n, vf_max(cosine, vf_zero()) * vf_set(TRC_INV_PI),
                     vf_abs(cosine) * vf_set(0.5f * TRC_INV_PI / TRC_BOTH_SIDES));
}
TRC_INLINE struct trc_place trc_world_sample(const struct trc_light_table *t, vvec3 n, vmask has_n,
                                             vfloat u1, vfloat u2, vmask m) {
    struct trc_place s;
    s.distance = vf_set(TRC_FAR);
    s.radiance = v3_zero();
    if (t->map && t->map->sun.share > 0.0f) {
        const vfloat chance = trc_world_sun_chance(&t->map->sun, n, has_n);
        const vmask is_sun = vf_lt(u1, chance);
        const vfloat rest = vf_divide(u1 - chance, vf_one() - chance);
        u1 = vf_min(vf_select(is_sun, vf_divide(u1, chance), rest), vf_set(TRC_BELOW_ONE));
        const vvec3 to_sun = trc_world_sun_sample(&t->map->sun, u1, u2);
        s.wi = v3_select(is_sun, to_sun, trc_map_sample(t->map, n, has_n, u1, u2, m, &s.pdf));
        s.pdf = trc_world_density(t, n, has_n, s.wi, m);
        return s;
    }
    if (t->map) {
        s.wi = trc_map_sample(t->map, n, has_n, u1, u2, m, &s.pdf);
        return s;
    }
    vvec3 side = n, a, b;
    const vmask both = vm_not(has_n);
    if (vm_any(both)) {
        /* The first half of the numbers goes to the upper side. */
        const vmask is_lower = vm_and(both, vf_le(vf_set(0.5f), u1));
        const vfloat length = vf_set(1.0f / TRC_BOTH_SIDES);
        const vfloat scale = vf_select(is_lower, vf_zero() - length, length);
        side = v3_select(both, v3_scale(n, scale), n);
        u1 = vf_select(both, u1 + u1 - vf_where(is_lower, vf_one()), u1);
    }
    v3_frame(side, &a, &b);
    s.wi = v3_from_frame(trc_warp_cosine(u1, u2), a, b, side);
    s.pdf = trc_world_density(t, n, has_n, s.wi, m);
    return s;
}

#endif
