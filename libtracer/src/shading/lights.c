/* Light tables: lamps, emissive triangles and the world, and what chooses among them. */
#include "shading/lights.h"

#include <math.h>
#include <string.h>

#include "core/core.h"
#include "model/material.h"
#include "shading/lamps.h"
#include "shading/vectors.h"

#define PI 3.14159265358979f
/* Triangles between two looks at whether the commit is cancelled. */
#define POLL_INTERVAL 16384u
#define RECEIVERS (TRC_VISIBLE_DIFFUSE | TRC_VISIBLE_GLOSSY | TRC_VISIBLE_TRANSMISSION)

_Static_assert(sizeof(struct trc_light_triangle) == 4 * TRC_TRIANGLE_WORDS, "read by gathers");
_Static_assert(sizeof(struct trc_light_bound) == 4 * TRC_BOUND_WORDS, "read by gathers");

/* ---- emissive triangles ---- */

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
    trc_cross(e1, e2, b->axis);
    const float area = 0.5f * trc_normalize(b->axis, 0, 0, 1);
    b->radius = trc_length(half);
    b->intensity = light * area;
    b->two_sided = 1;
    b->cos_o = t->flags & TRC_TRIANGLE_MOVES ? -1.0f : 1.0f;
    b->child = -1;
    b->light = (int32_t)number;
}

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
 * are sampled; so are those whose shadows are linked, whose number tells their shadow rays apart.
 */
static bool is_light(const struct trc_instance *instance, const struct trc_material *m,
                     uint32_t scatters) {
    if (!m || !scatters || !(m->has & TRC_MATERIAL_HAS_EMISSION))
        return false;
    if (!(scatters & TRC_MATERIAL_IS_MATT) && !(m->flags & TRC_MATERIAL_SAMPLE_EMISSION) &&
        !instance->shadow_class)
        return false;
    return (m->has & TRC_MATERIAL_EMISSION_VARIES) || trc_brightness(m->emission) > 0.0f;
}

static bool has_lights(const struct trc_snapshot *s, const struct trc_instance *instance,
                       uint32_t scatters) {
    if (!(instance->visibility & RECEIVERS) || s->meshes[instance->mesh]->strands)
        return false;
    for (uint32_t i = 0; i < instance->material_count; i++)
        if (is_light(instance, s->materials[instance->materials[i]], scatters))
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
    trc_cross(e1, e2, n);
    return trc_length(n) > 0.0f || moves;
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
        if (!is_light(instance, m, options->scatters))
            continue;
        struct trc_light_triangle *t = &table->triangles[table->triangle_count];
        float lower[3], upper[3];
        if (!world_triangle(instance, mesh, i, t, lower, upper))
            continue;
        memcpy(t->emission, m->emission, sizeof t->emission);
        t->instance = (int32_t)instance_number;
        t->triangle = (int32_t)i;
        t->material = number;
        float light = trc_brightness(m->emission);
        if (m->has & TRC_MATERIAL_EMISSION_VARIES) {
            t->flags |= TRC_TRIANGLE_VARIES;
            light = fmaxf(light, 1e-3f);
            table->varies = true;
            if (m->has & TRC_MATERIAL_READS_LOBES) {
                const bool is_sampled = m->flags & TRC_MATERIAL_SAMPLE_EMISSION;
                t->flags |= TRC_TRIANGLE_ASKS_RAYS | (is_sampled ? 0 : TRC_TRIANGLE_BY_RAYS);
                table->triangles_ask_rays = true;
            }
        }
        table->moves |= (t->flags & TRC_TRIANGLE_MOVES) != 0;
        struct trc_light_bound *bound = &bounds[(*bound_count)++];
        bound_triangle(t, light, table->first_triangle + table->triangle_count, lower, upper,
                       bound);
        bound->excluded[0] = (uint32_t)instance->light_exclude;
        bound->excluded[1] = (uint32_t)(instance->light_exclude >> 32);
        table->triangle_count++;
    }
    const uint32_t count = table->triangle_count - before;
    table->instance_triangles[instance_number] = count;
    if (count == 0)
        return;
    instance->first_light = table->first_triangle + before;
    table->kinds |= 1u << TRC_KIND_TRIANGLE;
    table->shadows_linked |= instance->shadow_class != 0;
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
    return !w->is_constant || trc_brightness(w->radiance) > 0.0f;
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
            const uint32_t width = wanted < TRC_MAP_MAX_WIDTH ? wanted : TRC_MAP_MAX_WIDTH;
            const trc_status status = trc_world_map_create(s, width, options, &table->map);
            if (status != TRC_OK)
                return status;
        }
        memcpy(average, table->map->average, sizeof average);
    }
    table->distant[table->distant_count] = table->world_light;
    table->distant_irradiance[table->distant_count++] = PI * fmaxf(trc_brightness(average), 1e-6f);
    const bool asks =
        !s->world.is_constant && (s->materials[s->world.material]->has & TRC_MATERIAL_READS_LOBES);
    /* As in Cycles, the same light from everywhere is not sampled. */
    if (table->map && ((world && !world->use_sampling) || (asks && table->map->is_even))) {
        trc_world_map_release(table->map);
        table->map = NULL;
    }
    table->world_asks_rays = asks;
    table->world_is_shadowless = table->map && world && !world->cast_shadow;
    table->has_shadowless |= table->world_is_shadowless;
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

static void add_lamps(struct trc_light_table *table, const struct trc_snapshot *s,
                      const struct trc_light_options *options, struct trc_light_bound *bounds,
                      uint32_t *bound_count) {
    for (uint32_t i = 0; i < options->light_count; i++) {
        struct trc_lamp *lamp = &table->lamps[table->lamp_count];
        if (!trc_lamp_make(&options->lights[i], lamp) || !trc_lamp_take_nodes(table, s, options, i))
            continue;
        const uint32_t number = table->lamp_count++;
        table->kinds |= 1u << lamp->kind;
        table->limited |= lamp->bounce_limit != 0;
        table->has_shadowless |=
            (lamp->flags & (TRC_LAMP_CASTS_SHADOW | TRC_LAMP_DELTA | TRC_LAMP_MIS)) == TRC_LAMP_MIS;
        lamp->shadow_class = trc_shadow_class_of(s, options->lights[i].shadow_exclude);
        if (!options->scatters || !(lamp->visibility & RECEIVERS))
            continue;
        const uint32_t all = RECEIVERS | TRC_VISIBLE_UNBLOCKED;
        table->hides |= (lamp->visibility & all) != all;
        struct trc_light_bound *bound = &bounds[*bound_count];
        trc_lamp_bound(lamp, number, bound);
        const float mean = trc_lamp_mean(table, s, number, bound, options->reach);
        if (lamp->flags & TRC_LAMP_DISTANT) {
            table->distant[table->distant_count] = number;
            table->distant_irradiance[table->distant_count++] =
                trc_brightness(lamp->radiance) / lamp->inv_area * mean;
        } else {
            bound->intensity *= mean;
            (*bound_count)++;
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

/* Room for the programs of lamps, if some may have one. */
static trc_status allocate_programs(struct trc_light_table *table, const struct trc_snapshot *s,
                                    const struct trc_light_options *options) {
    uint32_t count = 0;
    for (uint32_t i = 0; options->light_materials && i < options->light_count; i++) {
        const uint32_t material = options->light_materials[i];
        count += material && (s->materials[material]->has & TRC_MATERIAL_EMISSION_VARIES);
    }
    if (!count)
        return TRC_OK;
    table->programs = trc_alloc(count, sizeof *table->programs);
    return table->programs ? TRC_OK
                           : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u lamps", count);
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
    table->linked = s->features & TRC_FEATURE_LINKS;
    status = allocate_programs(table, s, options);
    if (status != TRC_OK) {
        trc_free(bounds);
        return status;
    }
    add_lamps(table, s, options, bounds, &bound_count);
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
    trc_free(table->programs);
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
