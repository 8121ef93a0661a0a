/* Light tables: strengths to radiance, bounds for choosing, emissive triangles.
 *
 * Units, as measured on and read from Cycles 3.4: a point or spot of P watts has the intensity P /
 * (4 pi) and, with a radius r, is a disk that faces whoever looks, of radiance P / (4 pi^2 r^2); an
 * area light has the radiance P / (4 area); a sun of strength S and half angle h is a disk at
 * distance 1 of radius tan h and radiance S / (pi tan^2 h cos^3 theta). Of Cycles 4.3: a sun's cone
 * has the radiance S / (pi sin^2 h) all over. */
#include "shading/lights.h"

#include <math.h>
#include <string.h>

#include "core/core.h"
#include "model/material.h"

#define PI 3.14159265358979f
/* Triangles between two looks at whether the commit is cancelled. */
#define POLL_INTERVAL 16384u
#define RECEIVERS (TRC_VISIBLE_DIFFUSE | TRC_VISIBLE_GLOSSY | TRC_VISIBLE_TRANSMISSION)

_Static_assert(sizeof(struct trc_lamp) == 4 * TRC_LAMP_WORDS, "read by gathers");
_Static_assert(sizeof(struct trc_light_triangle) == 4 * TRC_TRIANGLE_WORDS, "read by gathers");
_Static_assert(sizeof(struct trc_light_bound) == 4 * TRC_BOUND_WORDS, "read by gathers");

/* ---- vectors ---- */

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static void cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}
static float length(const float a[3]) { return sqrtf(dot(a, a)); }
/* Length before; a zero vector becomes fallback. */
static float normalize(float a[3], float x, float y, float z) {
    const float size = length(a);
    if (size > 0.0f && size < INFINITY) {
        for (int i = 0; i < 3; i++)
            a[i] /= size;
        return size;
    }
    a[0] = x;
    a[1] = y;
    a[2] = z;
    return 0.0f;
}
static float brightness(const float c[3]) { return fabsf(trc_luminance(c)); }

/* ---- lamps ---- */

static void set_radiance(struct trc_lamp *lamp, const trc_light_desc *desc, float factor) {
    for (int i = 0; i < 3; i++)
        lamp->radiance[i] = desc->color[i] * desc->strength * factor;
}

static void make_point(struct trc_lamp *lamp, const trc_light_desc *desc) {
    const float r = fmaxf(desc->radius, 0.0f);
    lamp->half_u = lamp->half_v = r;
    lamp->inv_area = r > 0.0f ? 1.0f / (PI * r * r) : 1.0f;
    set_radiance(lamp, desc, 0.25f / PI * lamp->inv_area);
    if (r == 0.0f)
        lamp->flags |= TRC_LAMP_DELTA;
    if (desc->flags & TRC_LIGHT_SPHERE)
        lamp->flags |= TRC_LAMP_SPHERE;
    if (desc->type != TRC_LIGHT_SPOT)
        return;
    lamp->kind = TRC_KIND_SPOT;
    if (desc->flags & TRC_LIGHT_EVEN_CONE)
        lamp->flags |= TRC_LAMP_EVEN_CONE;
    lamp->cos_cone = cosf(0.5f * fminf(desc->spot_angle, PI));
    const float width = (1.0f - lamp->cos_cone) * fminf(fmaxf(desc->spot_blend, 0.0f), 1.0f);
    lamp->inv_smooth = width > 0.0f ? 1.0f / width : 0.0f;
}

static void make_sun(struct trc_lamp *lamp, const trc_light_desc *desc) {
    /* At pi the disk would be infinite; Cycles has no limit and gets nothing useful there. */
    const float half = 0.5f * fminf(fmaxf(desc->angle, 0.0f), 3.1f);
    const float r = tanf(half);
    lamp->kind = TRC_KIND_SUN;
    lamp->half_u = lamp->half_v = r;
    lamp->cos_cone = cosf(half);
    lamp->inv_area = r > 0.0f ? 1.0f / (PI * r * r) : 1.0f;
    set_radiance(lamp, desc, lamp->inv_area);
    if (r > 0.0f && (desc->flags & TRC_LIGHT_EVEN_CONE)) {
        lamp->flags |= TRC_LAMP_EVEN_CONE;
        set_radiance(lamp, desc, 1.0f / (PI * sinf(half) * sinf(half)));
    }
    for (int i = 0; i < 3; i++)
        lamp->position[i] = -lamp->normal[i];
    if (r == 0.0f)
        lamp->flags |= TRC_LAMP_DELTA;
}

/* False for one without area. */
static bool make_area(struct trc_lamp *lamp, const trc_light_desc *desc) {
    const float *m = desc->transform;
    float u[3] = {m[0], m[4], m[8]}, v[3] = {m[1], m[5], m[9]};
    const float size_u = normalize(u, 1, 0, 0) * desc->size_x;
    const float size_v = normalize(v, 0, 1, 0) * desc->size_y;
    const bool is_round = desc->area_shape == TRC_AREA_ELLIPSE;
    const float area = size_u * size_v * (is_round ? 0.25f * PI : 1.0f);
    if (!(area > 0.0f) || !(area < INFINITY))
        return false;
    memcpy(lamp->axis_u, u, sizeof u);
    memcpy(lamp->axis_v, v, sizeof v);
    lamp->kind = is_round ? TRC_KIND_ELLIPSE : TRC_KIND_RECTANGLE;
    lamp->half_u = 0.5f * size_u;
    lamp->half_v = 0.5f * size_v;
    lamp->inv_area = 1.0f / area;
    lamp->spread_scale = 1.0f;
    const float half = 0.5f * fmaxf(desc->spread, 0.0f);
    if (half < 0.5f * PI - 1e-4f) {
        /* A grid of slats: what passes at theta is 1 - tan(theta) / tan(half), scaled to keep the
         * power. */
        const float t = tanf(fmaxf(half, 1e-3f));
        lamp->tan_spread = 1.0f / t;
        lamp->spread_scale = 1.0f / (1.0f - fmaxf(half, 1e-3f) / t);
    }
    set_radiance(lamp, desc, 0.25f * lamp->inv_area);
    return true;
}

/* False for a lamp that gives no light to anything. */
static bool make_lamp(struct trc_lamp *lamp, const trc_light_desc *desc) {
    memset(lamp, 0, sizeof *lamp);
    const float *m = desc->transform;
    float normal[3] = {-m[2], -m[6], -m[10]};
    normalize(normal, 0, 0, -1);
    memcpy(lamp->normal, normal, sizeof normal);
    for (int i = 0; i < 3; i++)
        lamp->position[i] = m[4 * i + 3];
    lamp->kind = TRC_KIND_POINT;
    lamp->visibility = desc->visibility | TRC_VISIBLE_SHADOW;
    if (!(desc->flags & TRC_LIGHT_SYNTHETIC))
        lamp->visibility |= TRC_VISIBLE_UNBLOCKED;
    lamp->group = desc->light_group;
    lamp->flags =
        (desc->use_mis ? TRC_LAMP_MIS : 0) | (desc->cast_shadow ? TRC_LAMP_CASTS_SHADOW : 0);
    if (desc->type == TRC_LIGHT_SUN)
        make_sun(lamp, desc);
    else if (desc->type != TRC_LIGHT_AREA)
        make_point(lamp, desc);
    else if (!make_area(lamp, desc))
        return false;
    const float light = brightness(lamp->radiance);
    return light > 0.0f && light < INFINITY && (desc->visibility & TRC_VISIBLE_ALL) != 0;
}

/* ---- bounds ---- */

static void bound_lamp(const struct trc_lamp *lamp, uint32_t number, struct trc_light_bound *b) {
    memset(b, 0, sizeof *b);
    memcpy(b->center, lamp->position, sizeof b->center);
    memcpy(b->axis, lamp->normal, sizeof b->axis);
    b->child = -1;
    b->light = (int32_t)number;
    const bool is_area = lamp->kind == TRC_KIND_RECTANGLE || lamp->kind == TRC_KIND_ELLIPSE;
    const float light = brightness(lamp->radiance);
    if (is_area) {
        const float a = lamp->half_u, c = lamp->half_v;
        b->radius = lamp->kind == TRC_KIND_ELLIPSE ? fmaxf(a, c) : sqrtf(a * a + c * c);
        b->intensity = light / lamp->inv_area * lamp->spread_scale;
        b->cos_o = 1.0f;
        /* cot(h) = tan_spread. */
        b->cos_e = lamp->tan_spread / sqrtf(1.0f + lamp->tan_spread * lamp->tan_spread);
        return;
    }
    b->radius = lamp->half_u;
    b->intensity = light / lamp->inv_area;
    if (lamp->kind == TRC_KIND_SPOT) {
        b->cos_o = 1.0f;
        b->cos_e = fmaxf(lamp->cos_cone, 0.0f);
    } else {
        b->cos_o = -1.0f; /* all directions */
    }
}

static void bound_triangle(const struct trc_light_triangle *t, float light, uint32_t number,
                           const float lower[3], const float upper[3], struct trc_light_bound *b) {
    memset(b, 0, sizeof *b);
    float e1[3], e2[3], half[3];
    for (int i = 0; i < 3; i++) {
        e1[i] = t->v1[i] - t->v0[i];
        e2[i] = t->v2[i] - t->v0[i];
        half[i] = 0.5f * (upper[i] - lower[i]);
        b->center[i] = 0.5f * (upper[i] + lower[i]);
    }
    cross(e1, e2, b->axis);
    const float area = 0.5f * normalize(b->axis, 0, 0, 1);
    b->radius = length(half);
    b->intensity = light * area;
    b->two_sided = 1;
    b->cos_o = t->flags & TRC_TRIANGLE_MOVES ? -1.0f : 1.0f;
    b->child = -1;
    b->light = (int32_t)number;
}

/* ---- emissive triangles ---- */

static void transform_point(const struct trc_affine *a, const float p[3], float out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] =
            a->m[4 * i] * p[0] + a->m[4 * i + 1] * p[1] + a->m[4 * i + 2] * p[2] + a->m[4 * i + 3];
}

static const struct trc_material *material_of(const struct trc_snapshot *s,
                                              const struct trc_instance *instance,
                                              const struct trc_mesh *mesh, uint32_t triangle,
                                              uint32_t *number) {
    uint32_t slot = mesh->material_index ? mesh->material_index[triangle] : 0;
    if (slot >= instance->material_count)
        slot = instance->material_count - 1;
    *number = instance->materials[slot];
    return s->materials[*number];
}

/* Whether a material's triangles are lights. Cycles samples those only whose "multiple importance
 * sample" is on, and finds the others by rays. Matt lobes send none here: where there are some, all
 * are sampled. */
static bool is_light(const struct trc_material *m, uint32_t scatters) {
    if (!m || !scatters || !(m->has & TRC_MATERIAL_HAS_EMISSION))
        return false;
    if (!(scatters & TRC_MATERIAL_IS_MATT) && !(m->flags & TRC_MATERIAL_SAMPLE_EMISSION))
        return false;
    return (m->has & TRC_MATERIAL_EMISSION_VARIES) || brightness(m->emission) > 0.0f;
}

static bool has_lights(const struct trc_snapshot *s, const struct trc_instance *instance,
                       uint32_t scatters) {
    if (!(instance->visibility & RECEIVERS))
        return false;
    for (uint32_t i = 0; i < instance->material_count; i++)
        if (is_light(s->materials[instance->materials[i]], scatters))
            return true;
    return false;
}

/* World corners at the first keys, and the box over all keys: vertices and matrices are
 * interpolated linearly, so the box over all pairs of keys holds what lies between. False for a
 * triangle without area. */
static bool world_triangle(const struct trc_instance *instance, const struct trc_mesh *mesh,
                           uint32_t triangle, struct trc_light_triangle *t, float lower[3],
                           float upper[3]) {
    const uint32_t *index = mesh->indices + 3 * (size_t)triangle;
    float *const corners[3] = {t->v0, t->v1, t->v2};
    for (int i = 0; i < 3; i++) {
        lower[i] = INFINITY;
        upper[i] = -INFINITY;
    }
    for (uint32_t key = 0; key < mesh->key_count; key++) {
        const float *positions = mesh->positions + 3 * (size_t)mesh->vertex_count * key;
        for (uint32_t pose = 0; pose < instance->key_count; pose++)
            for (int k = 0; k < 3; k++) {
                float p[3];
                transform_point(&instance->object_to_world[pose], positions + 3 * (size_t)index[k],
                                p);
                if (key == 0 && pose == 0)
                    memcpy(corners[k], p, sizeof p);
                for (int i = 0; i < 3; i++) {
                    lower[i] = fminf(lower[i], p[i]);
                    upper[i] = fmaxf(upper[i], p[i]);
                }
            }
    }
    const bool moves = mesh->key_count > 1 || instance->key_count > 1;
    t->flags = moves ? TRC_TRIANGLE_MOVES : 0;
    float e1[3], e2[3], n[3];
    for (int i = 0; i < 3; i++) {
        e1[i] = t->v1[i] - t->v0[i];
        e2[i] = t->v2[i] - t->v0[i];
        if (!(upper[i] - lower[i] < 1e18f))
            return false;
    }
    cross(e1, e2, n);
    return length(n) > 0.0f || moves;
}

static void add_triangles(struct trc_light_table *table, const struct trc_snapshot *s,
                          uint32_t instance_number, const struct trc_light_options *options,
                          struct trc_light_bound *bounds, uint32_t *bound_count) {
    struct trc_instance *instance = &s->instances[instance_number];
    const struct trc_mesh *mesh = s->meshes[instance->mesh];
    const uint32_t before = table->triangle_count;
    for (uint32_t i = 0; i < mesh->triangle_count; i++) {
        if (i % POLL_INTERVAL == 0 && trc_lights_are_cancelled(options))
            return; /* set_bounds says so */
        uint32_t number;
        const struct trc_material *m = material_of(s, instance, mesh, i, &number);
        if (!is_light(m, options->scatters))
            continue;
        struct trc_light_triangle *t = &table->triangles[table->triangle_count];
        float lower[3], upper[3];
        if (!world_triangle(instance, mesh, i, t, lower, upper))
            continue;
        memcpy(t->emission, m->emission, sizeof t->emission);
        t->instance = (int32_t)instance_number;
        t->triangle = (int32_t)i;
        t->material = number;
        float light = brightness(m->emission);
        if (m->has & TRC_MATERIAL_EMISSION_VARIES) {
            t->flags |= TRC_TRIANGLE_VARIES;
            light = fmaxf(light, 1e-3f);
            table->varies = true;
        }
        table->moves |= (t->flags & TRC_TRIANGLE_MOVES) != 0;
        bound_triangle(t, light, table->first_triangle + table->triangle_count, lower, upper,
                       &bounds[(*bound_count)++]);
        table->triangle_count++;
    }
    const uint32_t count = table->triangle_count - before;
    table->instance_triangles[instance_number] = count;
    if (count == 0)
        return;
    instance->first_light = table->first_triangle + before;
    table->kinds |= 1u << TRC_KIND_TRIANGLE;
    const bool catchers = s->features & TRC_FEATURE_SHADOW_CATCHERS;
    const uint32_t all = RECEIVERS | (catchers ? TRC_VISIBLE_UNBLOCKED : 0u);
    table->hides |= (instance->visibility & all) != all;
}

/* Upper limit of the emissive triangles. */
static uint64_t count_triangles(const struct trc_snapshot *s, uint32_t scatters) {
    uint64_t count = 0;
    for (uint32_t i = 0; i < s->instance_count; i++)
        if (has_lights(s, &s->instances[i], scatters))
            count += s->meshes[s->instances[i].mesh]->triangle_count;
    return count;
}

/* ---- world ---- */

/* Which lobes samples of the world light: ambient occlusion that stands for its diffuse light
 * leaves them the others. */
static uint32_t world_sample_visibility(const struct trc_world *w) {
    const bool replaced = w->ao_factor > 0.0f && w->ao_method == TRC_AO_REPLACE;
    return replaced ? w->visibility & ~(uint32_t)TRC_VISIBLE_DIFFUSE : w->visibility;
}

static bool world_is_light(const struct trc_snapshot *s, uint32_t scatters) {
    const struct trc_world *w = &s->world;
    if (!scatters || (w->is_constant && !(scatters & TRC_MATERIAL_IS_MATT)))
        return false;
    if (w->material == UINT32_MAX || !(w->visibility & RECEIVERS))
        return false;
    return !w->is_constant || brightness(w->radiance) > 0.0f;
}

/* Width of the map when the caller leaves it open. */
#define MAP_WIDTH 1024u

static trc_status add_world(struct trc_light_table *table, const struct trc_snapshot *s,
                            const struct trc_light_options *options) {
    const struct trc_light_table *previous = options->previous;
    const trc_world_desc *world = options->world;
    if (table->world_light == UINT32_MAX)
        return TRC_OK;
    table->kinds |= 1u << TRC_KIND_WORLD;
    table->hides |= (table->world_visibility & RECEIVERS) != RECEIVERS;
    float average[3];
    memcpy(average, s->world.radiance, sizeof average);
    if (!s->world.is_constant) {
        if (previous && previous->map) {
            table->map = previous->map;
            atomic_fetch_add_explicit(&table->map->refs, 1, memory_order_relaxed);
        } else {
            const uint32_t wanted =
                world && world->map_resolution ? world->map_resolution : MAP_WIDTH;
            const uint32_t width = wanted < 16 ? 16 : wanted > 8192 ? 8192 : wanted;
            const trc_status status = trc_world_map_create(s, width, options, &table->map);
            if (status != TRC_OK)
                return status;
        }
        memcpy(average, table->map->average, sizeof average);
    }
    table->distant[table->distant_count] = table->world_light;
    table->distant_irradiance[table->distant_count++] = PI * fmaxf(brightness(average), 1e-6f);
    if (table->map && world && !world->use_sampling) {
        trc_world_map_release(table->map);
        table->map = NULL;
    }
    return TRC_OK;
}

/* ---- the table ---- */

/* Whether rays can meet a lamp. */
static bool is_seen(const struct trc_lamp *lamp) {
    return !(lamp->flags & TRC_LAMP_DELTA) &&
           ((lamp->flags & TRC_LAMP_MIS) || (lamp->visibility & TRC_VISIBLE_CAMERA));
}

static void list_seen(struct trc_light_table *table) {
    uint32_t count = 0;
    for (uint32_t group = 0; group <= TRC_MAX_LIGHT_GROUPS; group++) {
        table->group_seen[group] = count;
        for (uint32_t i = 0; i < table->lamp_count; i++)
            if (table->lamps[i].group == group && is_seen(&table->lamps[i]))
                table->seen[count++] = i;
    }
    table->group_seen[TRC_MAX_LIGHT_GROUPS + 1] = count;
}

static void add_lamps(struct trc_light_table *table, const struct trc_light_options *options,
                      struct trc_light_bound *bounds, uint32_t *bound_count) {
    for (uint32_t i = 0; i < options->light_count; i++) {
        struct trc_lamp *lamp = &table->lamps[table->lamp_count];
        if (!make_lamp(lamp, &options->lights[i]))
            continue;
        const uint32_t number = table->lamp_count++;
        table->kinds |= 1u << lamp->kind;
        if (!options->scatters || !(lamp->visibility & RECEIVERS))
            continue;
        const uint32_t all = RECEIVERS | TRC_VISIBLE_UNBLOCKED;
        table->hides |= (lamp->visibility & all) != all;
        if (lamp->kind == TRC_KIND_SUN) {
            table->distant[table->distant_count] = number;
            table->distant_irradiance[table->distant_count++] =
                brightness(lamp->radiance) / lamp->inv_area;
        } else {
            bound_lamp(lamp, number, &bounds[(*bound_count)++]);
        }
    }
}

/* Chooses between list and tree, and enters lights with their candidates. Takes over bounds. */
static trc_status set_bounds(struct trc_light_table *table, struct trc_light_bound *bounds,
                             uint32_t count, const struct trc_light_options *options) {
    const size_t lights = (size_t)table->first_triangle + table->triangle_count;
    trc_status status = TRC_OK;
    if (trc_lights_are_cancelled(options)) {
        trc_free(bounds);
        return trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled");
    }
    table->single = count + table->distant_count == 1;
    table->candidates = trc_alloc(lights ? lights : 1, sizeof *table->candidates);
    if (!table->candidates) {
        trc_free(bounds);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %zu lights", lights);
    }
    for (size_t i = 0; i < lights; i++)
        table->candidates[i] = UINT32_MAX;
    if (count <= TRC_LIGHT_LIST_MAX) {
        table->bounds = bounds;
        table->bound_count = table->cut_count = count;
        for (uint32_t i = 0; i < count; i++) {
            table->cut[i] = i;
            table->candidates[bounds[i].light] = i;
        }
    } else {
        const uint32_t distant = table->distant_count;
        status = trc_light_tree_build(table, bounds, count,
                                      distant < TRC_LIGHT_CUT_MAX ? TRC_LIGHT_CUT_MAX - distant : 1,
                                      options);
        trc_free(bounds);
    }
    for (uint32_t i = 0; i < table->distant_count; i++)
        table->candidates[table->distant[i]] = table->cut_count + i;
    return status;
}

static trc_status allocate(struct trc_light_table *table, uint32_t lamps, uint64_t triangles,
                           uint32_t instances, struct trc_light_bound **bounds_out) {
    if (triangles + lamps > INT32_MAX / TRC_LAMP_WORDS)
        return trc_fail(TRC_ERROR_TOO_LARGE, "%llu emissive triangles are too many lights",
                        (unsigned long long)triangles);
    table->lamps = trc_alloc_zeroed((size_t)lamps + 1, sizeof *table->lamps);
    table->triangles = trc_alloc((size_t)triangles + 1, sizeof *table->triangles);
    table->distant = trc_alloc((size_t)lamps + 1, sizeof *table->distant);
    table->distant_irradiance = trc_alloc((size_t)lamps + 1, sizeof(float));
    table->seen = trc_alloc((size_t)lamps + 1, sizeof *table->seen);
    table->instance_triangles = trc_alloc_zeroed((size_t)instances + 1, sizeof(uint32_t));
    *bounds_out = trc_alloc((size_t)triangles + lamps + 1, sizeof **bounds_out);
    if (table->lamps && table->triangles && table->distant && table->distant_irradiance &&
        table->seen && table->instance_triangles && *bounds_out)
        return TRC_OK;
    trc_free(*bounds_out);
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u lamps and %llu emissive triangles",
                    lamps, (unsigned long long)triangles);
}

static trc_status fill(struct trc_light_table *table, const struct trc_snapshot *s,
                       const struct trc_light_options *options) {
    const uint32_t scatters = options->scatters;
    struct trc_light_bound *bounds = NULL;
    trc_status status = allocate(table, options->light_count, count_triangles(s, scatters),
                                 s->instance_count, &bounds);
    if (status != TRC_OK)
        return status;
    uint32_t bound_count = 0;
    add_lamps(table, options, bounds, &bound_count);
    list_seen(table);
    table->world_visibility = world_sample_visibility(&s->world);
    table->world_light = world_is_light(s, scatters) ? table->lamp_count : UINT32_MAX;
    table->first_triangle = table->lamp_count + (table->world_light != UINT32_MAX);
    for (uint32_t i = 0; i < s->instance_count; i++) {
        s->instances[i].first_light = UINT32_MAX;
        if (has_lights(s, &s->instances[i], scatters))
            add_triangles(table, s, i, options, bounds, &bound_count);
    }
    status = add_world(table, s, options);
    if (status != TRC_OK) {
        trc_free(bounds);
        return status;
    }
    /* What the world gives differs from direction to direction, so its samples are worth a shadow
     * ray of their own; the world comes last. */
    const bool others = bound_count > 0 || table->distant_count > 1;
    table->world_apart = table->world_light != UINT32_MAX && others;
    if (table->world_apart)
        table->distant_count--;
    return set_bounds(table, bounds, bound_count, options);
}

trc_status trc_light_table_create(const struct trc_snapshot *snapshot,
                                  const struct trc_light_options *options,
                                  struct trc_light_table **out) {
    struct trc_light_table *table = trc_alloc_zeroed(1, sizeof *table);
    if (!table)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the light table");
    const trc_status status = fill(table, snapshot, options);
    if (status != TRC_OK) {
        trc_light_table_destroy(table);
        return status;
    }
    *out = table;
    return TRC_OK;
}

void trc_light_table_destroy(struct trc_light_table *table) {
    if (!table)
        return;
    trc_world_map_release(table->map);
    trc_free(table->lamps);
    trc_free(table->triangles);
    trc_free(table->bounds);
    trc_free(table->candidates);
    trc_free(table->trails);
    trc_free(table->distant);
    trc_free(table->distant_irradiance);
    trc_free(table->seen);
    trc_free(table->instance_triangles);
    trc_free(table);
}

uint64_t trc_light_table_triangle_count(const struct trc_light_table *table) {
    return table->triangle_count;
}
