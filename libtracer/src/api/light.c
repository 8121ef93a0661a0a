/* Public calls on lights and the world. */
#include <float.h>

#include "core/checks.h"
#include "core/core.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

#define PI_ABOVE 3.1415930f /* pi rounded up: callers round as they like */

/* Widest importance map. */
#define MAX_MAP_RESOLUTION 16384

/* Sizes may be negative by a mirroring host; the table takes their magnitude. */
static trc_status check_light(const trc_light_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_light_desc"));
    TRC_TRY(trc_check_enum(desc->type, TRC_LIGHT_AREA + 1, "type"));
    TRC_TRY(trc_check_finite(desc->transform, 12, "transform"));
    TRC_TRY(trc_check_finite(desc->color, 3, "color"));
    TRC_TRY(trc_check_finite(&desc->strength, 1, "strength"));
    TRC_TRY(trc_check_float(desc->radius, 0.0f, FLT_MAX, "radius"));
    TRC_TRY(trc_check_float(desc->angle, 0.0f, PI_ABOVE, "angle"));
    TRC_TRY(trc_check_finite(&desc->size_x, 1, "size_x"));
    TRC_TRY(trc_check_finite(&desc->size_y, 1, "size_y"));
    TRC_TRY(trc_check_enum(desc->area_shape, 2, "area_shape"));
    if (desc->type == TRC_LIGHT_AREA) {
        TRC_TRY(trc_check_float(desc->spread, FLT_MIN, PI_ABOVE, "spread"));
    }
    if (desc->type == TRC_LIGHT_SPOT) {
        TRC_TRY(trc_check_float(desc->spot_angle, FLT_MIN, PI_ABOVE, "spot_angle"));
        TRC_TRY(trc_check_float(desc->spot_blend, 0.0f, 1.0f, "spot_blend"));
    }
    TRC_TRY(trc_check_enum(desc->visibility, TRC_VISIBLE_ALL + 1, "visibility"));
    TRC_TRY(trc_check_enum(desc->cast_shadow, 2, "cast_shadow"));
    TRC_TRY(trc_check_enum(desc->use_mis, 2, "use_mis"));
    TRC_TRY(trc_check_count(desc->light_group, 0, TRC_MAX_LIGHT_GROUPS, "light_group"));
    TRC_TRY(trc_check_finite(&desc->random, 1, "random"));
    TRC_TRY(trc_check_finite(desc->object_color, 4, "object_color"));
    return trc_check_enum(desc->flags, 2 * TRC_LIGHT_CENTERED, "flags");
}

trc_status trc_light_create(trc_scene scene, const trc_light_desc *desc, trc_id *light_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_light(desc);
    if (status == TRC_OK)
        status = trc_check_out(light_out, sizeof *light_out, "light_out");
    if (status == TRC_OK)
        status = trc_scene_add_light(access.scene, desc, light_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_light_update(trc_scene scene, trc_id light, const trc_light_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_light(desc);
    if (status == TRC_OK)
        status = trc_scene_change_light(access.scene, light, desc);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_light_destroy(trc_scene scene, trc_id light) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = trc_scene_remove_light(access.scene, light);
    trc_scene_leave(&access);
    return status;
}

static trc_status check_world(const trc_world_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_world_desc"));
    TRC_TRY(trc_check_enum(desc->use_sampling, 2, "use_sampling"));
    TRC_TRY(trc_check_enum(desc->cast_shadow, 2, "cast_shadow"));
    TRC_TRY(trc_check_enum(desc->visibility, TRC_VISIBLE_ALL + 1, "visibility"));
    TRC_TRY(trc_check_count(desc->map_resolution, 0, MAX_MAP_RESOLUTION, "map_resolution"));
    TRC_TRY(trc_check_enum(desc->ao_method, TRC_AO_REPLACE + 1, "ao_method"));
    TRC_TRY(trc_check_count(desc->light_group, 0, TRC_MAX_LIGHT_GROUPS, "light_group"));
    TRC_TRY(trc_check_float(desc->sun_angle, 0.0f, 3.1415927f, "sun_angle"));
    if (desc->sun_angle > 0.0f) {
        const float *d = desc->sun_direction;
        const float square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        TRC_TRY(trc_check_float(square, FLT_MIN, FLT_MAX, "square of sun_direction"));
    }
    TRC_TRY(trc_check_float(desc->ao_factor, 0.0f, FLT_MAX, "ao_factor"));
    return trc_check_float(desc->ao_distance, desc->ao_factor > 0.0f ? FLT_MIN : 0.0f, FLT_MAX,
                           "ao_distance");
}

trc_status trc_scene_set_world(trc_scene scene, const trc_world_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_world(desc);
    if (status == TRC_OK)
        status = trc_scene_put_world(access.scene, desc);
    trc_scene_leave(&access);
    return status;
}
