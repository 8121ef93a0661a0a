/* Passes of what the camera sees, apart from light and from features for denoisers.
 *
 * Two kinds, as in Cycles: those of the first surface that is not mostly seen through (depth,
 * normal, indices ...), and those that add up over all surfaces on straight paths through
 * transparency, each by what it lets be seen of itself (colours, mist, mattes). */
#include "kernels/light/world.h"
#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"
#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/panorama.h"

/* Cycles' default of the view layer's Alpha Threshold. */
#define ALPHA_THRESHOLD 0.5f

#define BIT(NAME) (1ull << TRC_PASS_##NAME)
#define COLOR_PASSES (BIT(DIFFUSE_COLOR) | BIT(GLOSSY_COLOR) | BIT(TRANSMISSION_COLOR))
/* What is found elsewhere: kernels/tile/denoising.c and emission.c. */
#define FEATURE_PASSES                                                      \
    (BIT(DENOISING_ALBEDO) | BIT(DENOISING_NORMAL) | BIT(DENOISING_DEPTH) | \
     BIT(DENOISING_ROUGHNESS) | BIT(DENOISING_SPECULAR_ALBEDO) | BIT(DENOISING_EMISSION))

/* Whether something is asked for besides light and features for denoisers. */
static bool wants_data(const trc_render_desc *desc) {
    return desc->passes & trc_passes_data() & ~FEATURE_PASSES || desc->cryptomattes ||
           desc->aov_value_count || desc->aov_color_count;
}

static void store_vector(struct trc_tile *t, uint32_t pass, uint32_t slot, float x, float y,
                         float z) {
    float *const *p = t->samples.pass[pass];
    if (p[0])
        p[0][slot] = x;
    if (p[1])
        p[1][slot] = y;
    if (p[2])
        p[2][slot] = z;
}

void trc_pass_add_lanes(struct trc_tile *t, uint32_t pass, vvec3 value,
                        const uint32_t slots[TRC_WIDTH], vmask active) {
    float *const *columns = t->samples.pass[pass];
    uint32_t first;
    if (!columns[0] || !vm_any(active))
        return;
    if (trc_slots_follow(slots, active, &first)) {
        const vfloat values[3] = {value.x, value.y, value.z};
        for (int k = 0; k < 3 && columns[k]; k++)
            trc_column_add(columns[k], first, values[k], active);
        return;
    }
    float lanes[3][TRC_WIDTH];
    vf_store(lanes[0], value.x), vf_store(lanes[1], value.y), vf_store(lanes[2], value.z);
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const float v[3] = {lanes[0][i], lanes[1][i], lanes[2][i]};
        trc_pass_add(t, pass, slots[i], v);
    }
}

/* From the world to the camera, as it stands in the middle of the shutter. */
static const float *world_to_camera(const struct trc_tile *t) {
    return t->snapshot->camera.world_to_camera[1].m;
}

/* The same the other way round. */
static void camera_to_world(const struct trc_tile *t, float m[TRC_AFFINE_FLOATS]) {
    const struct trc_camera *c = &t->snapshot->camera;
    const float *before = c->camera_to_world[(c->key_count - 1) / 2].m;
    const float *after = c->camera_to_world[c->key_count / 2].m;
    for (int k = 0; k < TRC_AFFINE_FLOATS; k++)
        m[k] = before[k] + 0.5f * (after[k] - before[k]);
}

/* From the camera's origin to the points. */
static vvec3 from_camera(const struct trc_tile *t, vvec3 p) {
    float m[TRC_AFFINE_FLOATS];
    camera_to_world(t, m);
    return v3_sub(p, v3(vf_set(m[3]), vf_set(m[7]), vf_set(m[11])));
}

/* Along the camera's -Z, in its own space: of a sheared camera no distance in the world. Of
 * panoramas, which have no such axis, the distance. */
static vfloat depth_of(const struct trc_tile *t, vvec3 p) {
    const float *m = world_to_camera(t);
    if (trc_is_panorama(&t->snapshot->camera))
        return v3_length(from_camera(t, p));
    return vf_set(0.0f) - v3_dot(from_camera(t, p), v3(vf_set(m[8]), vf_set(m[9]), vf_set(m[10])));
}

/* ---- of the first surface ---- */

/* Until the first surface that is not mostly seen through, that one too. */
static vmask is_not_done(vuint path) {
    return vi_eq((vint)path & vi_set(TRC_PATH_DATA_DONE), vi_set(0));
}

/* Where a point of a triangle is in the world at a time. */
static void point_at(const struct trc_instance *instance, const struct trc_mesh *mesh,
                     const uint32_t index[3], float u, float v, float time, float p[3]) {
    float c[9], m[TRC_AFFINE_FLOATS], object[3];
    trc_corner_at(mesh->positions, index, mesh->vertex_count, mesh->key_count, time, c);
    trc_affine_at(instance, time, m);
    for (int k = 0; k < 3; k++)
        object[k] = (1.0f - u - v) * c[k] + u * c[3 + k] + v * c[6 + k];
    for (int k = 0; k < 3; k++)
        p[k] = m[4 * k] * object[0] + m[4 * k + 1] * object[1] + m[4 * k + 2] * object[2] +
               m[4 * k + 3];
}

/* Where a panorama shows what is at a place of the camera's own space. */
static void panorama_place(const struct trc_camera *c, const float at[3], float place[2]) {
    const struct trc_view_axis *axes = trc_view_axes(c);
    vfloat d[3], u, v;
    for (int k = 0; k < 3; k++)
        d[k] = vf_set(axes[k].sign * at[axes[k].column]);
    trc_panorama_place(c, v3(d[0], d[1], d[2]), &u, &v);
    place[0] = vf_get(u, 0);
    place[1] = vf_get(v, 0);
}

/* Where the camera sees what is that way from it at the start (moment 0), in the middle (1) or at
 * the end (2) of the shutter, in pixels from the lower left corner. */
static void raster_along(const struct trc_tile *t, const float way[3], int moment,
                         float raster[2]) {
    const struct trc_camera *c = &t->snapshot->camera;
    const float *m = c->world_to_camera[moment].m;
    uint32_t key;
    float f, window[4], at[3];
    trc_key_at(0.5f * (float)moment, c->key_count, &key, &f);
    const uint32_t next = key + (c->key_count > 1);
    for (int k = 0; k < 4; k++)
        window[k] = c->windows[key][k] + f * (c->windows[next][k] - c->windows[key][k]);
    for (int k = 0; k < 3; k++)
        at[k] = m[4 * k] * way[0] + m[4 * k + 1] * way[1] + m[4 * k + 2] * way[2];
    float place[2];
    if (trc_is_panorama(c)) {
        panorama_place(c, at, place);
    } else {
        const float scale = c->type == TRC_CAMERA_ORTHOGRAPHIC ? 1.0f : -1.0f / at[2];
        for (int k = 0; k < 2; k++)
            place[k] = at[k] * scale;
    }
    const float size[2] = {(float)t->desc->width, (float)t->desc->height};
    for (int k = 0; k < 2; k++)
        raster[k] = (place[k] - window[2 * k]) / (window[2 * k + 1] - window[2 * k]) * size[k];
}

/* From the camera to a point: far from the origin more exact than by the inverse's own way. */
static void way_to(const struct trc_tile *t, const float p[3], int moment, float way[3]) {
    const struct trc_camera *c = &t->snapshot->camera;
    uint32_t key;
    float f;
    trc_key_at(0.5f * (float)moment, c->key_count, &key, &f);
    const uint32_t next = key + (c->key_count > 1);
    for (int k = 0; k < 3; k++) {
        const float a = c->camera_to_world[key].m[4 * k + 3];
        way[k] = p[k] - (a + f * (c->camera_to_world[next].m[4 * k + 3] - a));
    }
}

/* Not counted where the camera does not see the way at all three times. */
static void store_motion(struct trc_tile *t, float ways[3][3], uint32_t slot) {
    float *const *out = t->samples.pass[TRC_PASS_VECTOR];
    float raster[3][2];
    for (int k = 0; k < 3; k++)
        raster_along(t, ways[k], k, raster[k]);
    const float motion[4] = {raster[0][0] - raster[1][0], raster[0][1] - raster[1][1],
                             raster[1][0] - raster[2][0], raster[1][1] - raster[2][1]};
    if (!isfinite(motion[0] + motion[1] + motion[2] + motion[3]))
        return;
    for (int k = 0; k < 4; k++)
        out[k][slot] = motion[k];
    out[4][slot] = 1.0f;
}

static void surface_motion(struct trc_tile *t, const struct trc_instance *instance,
                           const struct trc_mesh *mesh, uint32_t triangle, float u, float v,
                           uint32_t slot) {
    float ways[3][3], p[3];
    uint32_t corners[3];
    trc_mesh_corners(mesh, triangle, corners);
    for (int k = 0; k < 3; k++) {
        const float time = 0.5f * (float)k;
        point_at(instance, mesh, corners, u, v, time, p);
        way_to(t, p, k, ways[k]);
    }
    store_motion(t, ways, slot);
}

/* The default UVs of a triangle's corners. */
static void uv_corners(const struct trc_mesh *mesh, uint32_t triangle,
                       const float *corners_out[3]) {
    const float *values = mesh->attributes[mesh->default_uv].values;
    uint32_t index[3] = {3 * triangle, 3 * triangle + 1, 3 * triangle + 2};
    if (mesh->strands)
        trc_mesh_corners(mesh, triangle, index);
    for (int k = 0; k < 3; k++)
        corners_out[k] = values + 2 * (size_t)index[k];
}

static void first_surface(struct trc_tile *t, const struct trc_surface *s,
                          const struct trc_material *m, const struct trc_lobes *lobes,
                          const uint32_t *slots, vmask write) {
    float z[TRC_WIDTH], n[3][TRC_WIDTH], p[3][TRC_WIDTH], uv[2][TRC_WIDTH];
    vf_store(z, depth_of(t, s->p));
    const vvec3 normal =
        t->samples.pass[TRC_PASS_NORMAL][0] ? trc_lobes_normal(lobes, s) : v3_zero();
    vf_store(n[0], normal.x), vf_store(n[1], normal.y), vf_store(n[2], normal.z);
    vf_store(p[0], s->p.x), vf_store(p[1], s->p.y), vf_store(p[2], s->p.z);
    vf_store(uv[0], s->u), vf_store(uv[1], s->v);
    for (uint32_t bits = vm_bits(write); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const uint32_t slot = slots[i];
        const struct trc_instance *instance = &t->snapshot->instances[vi_get(s->instance, i)];
        const struct trc_mesh *mesh = t->snapshot->meshes[instance->mesh];
        store_vector(t, TRC_PASS_DEPTH, slot, z[i], 0.0f, 0.0f);
        store_vector(t, TRC_PASS_NORMAL, slot, n[0][i], n[1][i], n[2][i]);
        store_vector(t, TRC_PASS_POSITION, slot, p[0][i], p[1][i], p[2][i]);
        store_vector(t, TRC_PASS_OBJECT_INDEX, slot, (float)instance->pass_index, 0.0f, 0.0f);
        store_vector(t, TRC_PASS_MATERIAL_INDEX, slot, (float)m->pass_index, 0.0f, 0.0f);
        if (t->samples.pass[TRC_PASS_VECTOR][0])
            surface_motion(t, instance, mesh, (uint32_t)vi_get(s->triangle, i), uv[0][i], uv[1][i],
                           slot);
        if (mesh->default_uv >= 0 && t->samples.pass[TRC_PASS_UV][0]) {
            const float *c[3];
            const float u = uv[0][i], v = uv[1][i], w = 1.0f - u - v;
            uv_corners(mesh, (uint32_t)vi_get(s->triangle, i), c);
            store_vector(t, TRC_PASS_UV, slot, w * c[0][0] + u * c[1][0] + v * c[2][0],
                         w * c[0][1] + u * c[1][1] + v * c[2][1], 1.0f);
        }
    }
}

bool trc_shows_background_motion(const struct trc_tile *t) {
    return t->desc->pass_flags & TRC_PASSES_BACKGROUND_MOTION &&
           t->desc->passes & 1ull << TRC_PASS_VECTOR &&
           t->snapshot->camera.type != TRC_CAMERA_ORTHOGRAPHIC;
}

void trc_background_motion(struct trc_tile *t, vvec3 d, vuint path, const uint32_t slots[TRC_WIDTH],
                           vmask active) {
    const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
    float x[TRC_WIDTH], y[TRC_WIDTH], z[TRC_WIDTH];
    vf_store(x, d.x), vf_store(y, d.y), vf_store(z, d.z);
    active = vm_and(active, vm_and(vi_eq((vint)path & straight, straight), is_not_done(path)));
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        float ways[3][3];
        for (int k = 0; k < 3; k++)
            ways[k][0] = x[i], ways[k][1] = y[i], ways[k][2] = z[i];
        store_motion(t, ways, slots[i]);
    }
}

/* ---- of all surfaces of a straight path ---- */

static void add_colors(struct trc_tile *t, const struct trc_lobes *lobes, vvec3 weight,
                       const uint32_t *slots, vmask active) {
    static const uint32_t pass[3] = {TRC_PASS_DIFFUSE_COLOR, TRC_PASS_GLOSSY_COLOR,
                                     TRC_PASS_TRANSMISSION_COLOR};
    if (!(t->desc->passes & COLOR_PASSES))
        return;
    vvec3 albedo[3];
    trc_bsdf_albedo(lobes, t->desc->pass_flags, albedo);
    for (int k = 0; k < 3; k++)
        trc_pass_add_lanes(t, pass[k], v3_mul(weight, albedo[k]), slots, active);
}

/* Takes what is seen before the mist from the pass, which starts at 1. */
static void add_mist(struct trc_tile *t, const struct trc_surface *s, vvec3 seen,
                     const uint32_t *slots, vmask active) {
    if (!t->samples.pass[TRC_PASS_MIST][0])
        return;
    const trc_render_desc *d = t->desc;
    const vvec3 way = from_camera(t, s->p);
    float m[TRC_AFFINE_FLOATS];
    camera_to_world(t, m);
    const vvec3 axis = v3(vf_set(m[2]), vf_set(m[6]), vf_set(m[10]));
    const vfloat distance = t->snapshot->camera.type == TRC_CAMERA_ORTHOGRAPHIC
                                ? vf_abs(v3_dot(way, axis))
                                : vf_sqrt(v3_dot(way, way));
    const vfloat inv_depth = vf_set(d->mist_depth > 0.0f ? 1.0f / d->mist_depth : 0.0f);
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    const vfloat depth = vf_min(vf_max((distance - vf_set(d->mist_start)) * inv_depth, zero), one);
    const vfloat mist = d->mist_falloff == 1.0f ? depth : vf_pow(depth, vf_set(d->mist_falloff));
    const vfloat clear = (mist - one) * v3_average(seen);
    trc_pass_add_lanes(t, TRC_PASS_MIST, v3(clear, zero, zero), slots, active);
}

/* ---- mattes ---- */

/* Whether a sample counts towards the film. With adaptive sampling some are taken for their error
 * alone. */
static bool is_counted(const struct trc_tile *t, size_t pixel) {
    const struct trc_adaptive *a = t->job->adaptive;
    return !a || (a->pixels[pixel].reasons & TRC_PIXEL_COUNTS);
}

/* Of a sample, which fits the table's units. Surfaces that brighten what is behind them are rare.
 */
#define MAX_MATTE_WEIGHT 2.0f

/* What the surfaces cover goes to the pixel's table at once, as a sample may meet any number of
 * them. */
static void add_mattes(struct trc_tile *t, const struct trc_surface *s,
                       const struct trc_material *m, vvec3 seen, const uint32_t *slots,
                       vmask active) {
    const uint32_t places = t->job->film->matte_count;
    const float one = (float)t->job->film->matte_units;
    float weight[TRC_WIDTH];
    vf_store(weight, v3_average(seen));
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const struct trc_instance *instance = &t->snapshot->instances[vi_get(s->instance, i)];
        const float ids[TRC_CRYPTOMATTE_KINDS] = {
            [TRC_CRYPTOMATTE_OBJECT] = instance->cryptomatte_object,
            [TRC_CRYPTOMATTE_MATERIAL] = m->cryptomatte,
            [TRC_CRYPTOMATTE_ASSET] = instance->cryptomatte_asset,
        };
        if (!(weight[i] > 0.0f && weight[i] < INFINITY) ||
            !is_counted(t, trc_film_pixel(t, slots[i])))
            continue;
        const size_t first = trc_tile_pixel(t, slots[i]) * places;
        const uint32_t units = (uint32_t)(fminf(weight[i], MAX_MATTE_WEIGHT) * one + 0.5f);
        for (int k = 0; k < TRC_CRYPTOMATTE_KINDS; k++)
            if (t->mattes[k] && ids[k] != 0.0f)
                trc_matte_add(t->mattes[k] + first, places, ids[k], units);
    }
}

/* ---- AOVs ---- */

/* As Cycles, which takes nothing from what is behind something transparent. */
static void add_aovs(struct trc_tile *t, const struct trc_material *m,
                     const struct trc_registers *regs, const uint32_t *slots, vmask active) {
    for (uint32_t a = 0; a < m->aov_count; a++) {
        float *const *out = t->samples.pass[m->aovs[a].pass];
        const uint32_t channels = trc_pass_channels(m->aovs[a].pass) == 4 ? 4 : 1;
        float lanes[4][TRC_WIDTH];
        if (!out[0])
            continue;
        for (uint32_t k = 0; k < channels; k++) {
            const struct trc_operand *o = &m->operands[m->aovs[a].first_operand];
            vf_store(lanes[k], k < 3 ? trc_operand_value(o + k, regs) : vf_set(1.0f));
        }
        for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
            const int i = __builtin_ctz(bits);
            for (uint32_t k = 0; k < channels; k++)
                out[k][slots[i]] += lanes[k][i];
        }
    }
}

void trc_world_aovs(struct trc_tile *t, vvec3 d, vuint path, vuint depths,
                    const uint32_t slots[TRC_WIDTH], vmask active) {
    const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
    active = vm_and(active, vm_and(vi_eq((vint)path & straight, straight), is_not_done(path)));
    if (!vm_any(active))
        return;
    struct trc_registers regs;
    const struct trc_material *m = trc_world_run(t->snapshot, d, path, depths, active, &regs);
    add_aovs(t, m, &regs, slots, active);
}

/* Those that are seen straight. */
static vmask seen_straight(const struct trc_surface *s) {
    const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
    return vm_and(s->active, vi_eq((vint)s->path & straight, straight));
}

vuint trc_data_passes(struct trc_tile *t, const struct trc_surface *s, const struct trc_material *m,
                      const struct trc_registers *regs, const struct trc_lobes *lobes,
                      vvec3 found_weight, vfloat indirect_scale, vfloat length,
                      const uint32_t slots[TRC_WIDTH]) {
    struct trc_surface solid;
    if (m->aov_count)
        add_aovs(t, m, regs, slots, vm_and(seen_straight(s), is_not_done(s->path)));
    if (m->has & TRC_MATERIAL_HAS_HOLDOUT) {
        solid = *s;
        solid.active = vm_andnot(s->active, vm_and(seen_straight(s), trc_lobes_are_holdout(lobes)));
        s = &solid;
    }
    const vuint path = trc_denoising_passes(t, s, lobes, found_weight, length, slots);
    const vmask on = seen_straight(s);
    if (!wants_data(t->desc) || !vm_any(on))
        return path;
    const vvec3 weight = v3_scale(found_weight, indirect_scale);
    const vvec3 one = v3(vf_set(1.0f), vf_set(1.0f), vf_set(1.0f));
    const vvec3 alpha = v3_sub(one, trc_lobes_transparency(lobes));
    add_colors(t, lobes, weight, slots, on);
    add_mist(t, s, v3_mul(weight, alpha), slots, on);
    if (t->desc->cryptomattes)
        add_mattes(t, s, m, v3_mul(weight, alpha), slots, on);
    vmask first = vm_and(on, is_not_done(s->path));
    if (m->has & (TRC_MATERIAL_HAS_TRANSPARENCY | TRC_MATERIAL_HAS_PORTAL))
        first = vm_and(first, vf_ge(v3_average(alpha), vf_set(ALPHA_THRESHOLD)));
    if (!vm_any(first))
        return path;
    first_surface(t, s, m, lobes, slots, first);
    return (vuint)vi_select(first, (vint)path | vi_set(TRC_PATH_DATA_DONE), (vint)path);
}
