/* The entry point of tangents. */
#include "scene/tangents.h"
#include "core/checks.h"
#include "core/core.h"
#include "tracer/tracer.h"

/* Corners have numbers of 32 bits. */
#define MOST_TRIANGLES ((UINT64_C(1) << 30) - 1)

static trc_status check(const trc_tangents_desc *desc, uint32_t form) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_tangents_desc"));
    TRC_TRY(trc_check_enum(desc->has_seams, 2, "has_seams"));
    TRC_TRY(trc_check_enum(form, TRC_TANGENTS_COORDINATES + 1, "form"));
    const uint64_t triangles = desc->triangle_count;
    TRC_TRY(trc_check_count(triangles, 0, MOST_TRIANGLES, "triangle_count"));
    const struct {
        const float *values;
        uint64_t width; /* floats of a triangle */
        const char *name;
    } arrays[] = {
        {desc->positions, 9, "positions"}, {desc->normals, 9, "normals"}, {desc->uvs, 6, "uvs"}};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        const uint64_t count = triangles * arrays[i].width;
        TRC_TRY(trc_check_array(arrays[i].values, count, count, sizeof(float), sizeof(float),
                                arrays[i].name));
    }
    return TRC_OK;
}

trc_status trc_tangents_find(const trc_tangents_desc *desc, uint32_t form, float *tangents_out,
                             uint64_t float_count) {
    TRC_TRY(check(desc, form));
    const uint64_t width = form == TRC_TANGENTS_VECTORS ? 9 : 12;
    TRC_TRY(trc_check_array(tangents_out, float_count, desc->triangle_count * width, sizeof(float),
                            sizeof(float), "tangents_out"));
    return trc_tangents_fill(desc, form, tangents_out);
}
