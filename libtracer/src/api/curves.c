/* Public calls on curves. */
#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

static bool is_ball(const trc_curves_desc *desc) {
    return desc->shape == TRC_CURVE_BALL || desc->shape == TRC_CURVE_HOLLOW_BALL;
}

static trc_status check_attribute(const trc_curve_attribute *attribute,
                                  const trc_curves_desc *desc) {
    const char *name = "trc_curve_attribute";
    TRC_TRY(trc_check_struct(attribute, sizeof *attribute, name));
    TRC_TRY(trc_check_enum(attribute->reserved, 1, "reserved"));
    if (attribute->width != 2 && attribute->width != 4)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s: width is %" PRIu32 ", it can be 2 or 4",
                        name, attribute->width);
    if (!attribute->name)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s: name is NULL", name);
    TRC_TRY(trc_check_enum(attribute->per_strand, 2, "per_strand"));
    const bool of_strands = attribute->per_strand && desc->lengths;
    const uint64_t count = of_strands ? desc->strand_count : desc->point_count;
    return trc_check_array(attribute->values, attribute->value_count, attribute->width * count,
                           sizeof(float), sizeof(float), "attribute values");
}

static trc_status check_curves(const trc_curves_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_curves_desc"));
    TRC_TRY(trc_check_count(desc->key_count, 1, TRC_MAX_KEYS, "key_count"));
    TRC_TRY(trc_check_enum(desc->shape, TRC_CURVE_HOLLOW_BALL + 1, "shape"));
    TRC_TRY(trc_check_count(desc->piece_count, 1, TRC_MAX_CURVE_PIECES, "piece_count"));
    TRC_TRY(trc_check_float(desc->tolerance, 0.0f, 1e6f, "tolerance"));
    /* Singles first: later products of them cannot wrap. */
    TRC_TRY(trc_check_count(desc->point_count, 0, INT32_MAX / 4, "point_count"));
    TRC_TRY(trc_check_count(desc->strand_count, 0, INT32_MAX / 4, "strand_count"));
    TRC_TRY(trc_check_array(desc->points, desc->point_value_count,
                            4 * desc->point_count * desc->key_count, sizeof(float), sizeof(float),
                            "points"));
    if (is_ball(desc) && (desc->lengths || desc->strand_count))
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "trc_curves_desc: balls have no lengths");
    if (!is_ball(desc) && !desc->lengths && desc->point_count)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "trc_curves_desc: lengths is NULL");
    if (desc->lengths || desc->strand_count)
        TRC_TRY(trc_check_array(desc->lengths, desc->strand_count, desc->strand_count,
                                sizeof(uint32_t), sizeof(uint32_t), "lengths"));
    if (desc->generated || desc->generated_count)
        TRC_TRY(trc_check_array(desc->generated, desc->generated_count,
                                3 * (desc->lengths ? desc->strand_count : desc->point_count),
                                sizeof(float), sizeof(float), "generated"));
    TRC_TRY(trc_check_count(desc->attribute_count, 0, TRC_MAX_ATTRIBUTES, "attribute_count"));
    if (desc->attribute_count && !desc->attributes)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "attributes is NULL");
    for (uint32_t i = 0; i < desc->attribute_count; i++)
        TRC_TRY(check_attribute(&desc->attributes[i], desc));
    return TRC_OK;
}

trc_status trc_curves_create(trc_scene scene, const trc_curves_desc *desc, trc_id *mesh_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_curves(desc);
    if (status == TRC_OK)
        status = trc_check_out(mesh_out, sizeof *mesh_out, "mesh_out");
    if (status == TRC_OK)
        status = trc_scene_add_curves(access.scene, desc, mesh_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_curves_update(trc_scene scene, trc_id mesh, uint32_t key_count, const float *points,
                             uint64_t point_value_count) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = trc_check_count(key_count, 1, TRC_MAX_KEYS, "key_count");
    if (status == TRC_OK)
        status = trc_scene_pose_curves(access.scene, mesh, key_count, points, point_value_count);
    trc_scene_leave(&access);
    return status;
}
