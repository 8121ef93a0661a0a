/* Public calls on materials and images. */
#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/image.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

/* Most entries of a node's table: a ramp has 256 RGBA values. */
#define MAX_TABLE 65536

/* Arrays and their counts; what nodes mean is checked as they are compiled. */
static trc_status check_material(const trc_material_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_material_desc"));
    TRC_TRY(trc_check_enum(desc->reserved, 1, "reserved"));
    TRC_TRY(trc_check_count(desc->node_count, 0, TRC_MAX_NODES, "node_count"));
    TRC_TRY(
        trc_check_count(desc->input_count, 0, TRC_MAX_NODES * TRC_MAX_NODE_INPUTS, "input_count"));
    if (desc->node_count)
        TRC_TRY(trc_check_out(desc->nodes, _Alignof(trc_node), "nodes"));
    if (desc->input_count) {
        TRC_TRY(trc_check_out(desc->inputs, _Alignof(trc_node_input), "inputs"));
    }
    if (desc->film_colors)
        TRC_TRY(trc_check_out(desc->film_colors, _Alignof(float), "film_colors"));
    if (desc->surface < -1 || (desc->surface >= 0 && (uint32_t)desc->surface >= desc->node_count)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "surface is %" PRId32 " of %" PRIu32 " nodes",
                        desc->surface, desc->node_count);
    }
    for (uint32_t i = 0; i < desc->node_count; i++) {
        const trc_node *node = &desc->nodes[i];
        if ((uint64_t)node->first_input + node->input_count > desc->input_count) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "node %" PRIu32 ": its inputs are beyond the last", i);
        }
        TRC_TRY(trc_check_count(node->table_count, 0, MAX_TABLE, "table_count"));
        if (node->table_count)
            TRC_TRY(trc_check_out(node->table, sizeof(float), "table"));
    }
    return TRC_OK;
}

trc_status trc_material_create(trc_scene scene, const trc_material_desc *desc,
                               trc_id *material_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_material(desc);
    if (status == TRC_OK)
        status = trc_check_out(material_out, sizeof *material_out, "material_out");
    if (status == TRC_OK)
        status = trc_scene_add_material(access.scene, desc, material_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_material_update(trc_scene scene, trc_id material, const trc_material_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_material(desc);
    if (status == TRC_OK)
        status = trc_scene_change_material(access.scene, material, desc);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_material_destroy(trc_scene scene, trc_id material) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = trc_scene_remove_material(access.scene, material);
    trc_scene_leave(&access);
    return status;
}

/* Limits of an image, from the public header. */
#define MAX_IMAGE_SIDE 65536
#define MAX_IMAGE_PIXELS (1u << 30)

static trc_status check_pixels(const trc_image_desc *desc) {
    TRC_TRY(trc_check_count(desc->width, 1, MAX_IMAGE_SIDE, "width"));
    TRC_TRY(trc_check_count(desc->height, 1, MAX_IMAGE_SIDE, "height"));
    const uint64_t pixels = (uint64_t)desc->width * desc->height;
    TRC_TRY(trc_check_count(pixels, 1, MAX_IMAGE_PIXELS, "width * height"));
    const size_t channel_bytes = desc->is_float ? sizeof(float) : 1;
    return trc_check_array(desc->pixels, desc->pixel_bytes, pixels * 4 * channel_bytes, 1,
                           channel_bytes, "pixels");
}

static trc_status check_image(const trc_image_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_image_desc"));
    TRC_TRY(trc_check_enum(desc->alpha_mode, 4, "alpha_mode"));
    TRC_TRY(trc_check_enum(desc->is_srgb, 2, "is_srgb"));
    TRC_TRY(trc_check_enum(desc->is_mip_mapped, 2, "is_mip_mapped"));
    TRC_TRY(trc_check_enum(desc->is_alpha_literal, 2, "is_alpha_literal"));
    if (desc->path && desc->pixels)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "an image has either pixels or a path");
    if (desc->path || trc_image_desc_is_empty(desc))
        return TRC_OK;
    TRC_TRY(trc_check_enum(desc->is_float, 2, "is_float"));
    return check_pixels(desc);
}

trc_status trc_image_expect(trc_scene scene, const trc_image_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_image(desc);
    if (status == TRC_OK && !desc->path)
        status = trc_fail(TRC_ERROR_INVALID_ARGUMENT, "an image that is read ahead needs a path");
    if (status == TRC_OK)
        trc_scene_expect_image(access.scene, desc);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_image_create(trc_scene scene, const trc_image_desc *desc, trc_id *image_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_image(desc);
    if (status == TRC_OK)
        status = trc_check_out(image_out, sizeof *image_out, "image_out");
    if (status == TRC_OK)
        status = trc_scene_add_image(access.scene, desc, image_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_image_update(trc_scene scene, trc_id image, const trc_image_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_image(desc);
    if (status == TRC_OK)
        status = trc_scene_change_image(access.scene, image, desc);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_image_destroy(trc_scene scene, trc_id image) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = trc_scene_remove_image(access.scene, image);
    trc_scene_leave(&access);
    return status;
}
