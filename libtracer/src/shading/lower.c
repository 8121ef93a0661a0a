/* Value nodes to operations. */
#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

/* A node on its way: its inputs in order, three operands for a colour or vector, and its outputs.
 */
struct lowering {
    struct trc_build *b;
    const trc_node *node;
    struct trc_operand in[3 * TRC_MAX_NODE_INPUTS];
    struct trc_operand *out;
};

/* An operation without resource. */
static trc_status op(struct trc_build *b, uint32_t code, uint32_t mode,
                     const struct trc_operand *in, struct trc_operand *out) {
    return trc_build_op(b, code, mode, TRC_NO_RESOURCE, in, out);
}

static void copy3(struct trc_operand *out, const struct trc_operand *in) {
    memcpy(out, in, 3 * sizeof *out);
}

/* ---- the point ---- */

/* Whether it has another value at another place of the surface, whatever its node says; normals,
 * tangents, the ray and the object count as the same. */
static bool varies_in_place(uint32_t code) {
    switch (code) {
    case TRC_OP_POSITION:
    case TRC_OP_PARAMETRIC:
    case TRC_OP_GENERATED:
    case TRC_OP_OBJECT_POSITION:
    case TRC_OP_CAMERA_POSITION:
    case TRC_OP_WINDOW:
    case TRC_OP_UV:
    case TRC_OP_COLOR_ATTRIBUTE:
        return true;
    default:
        return false;
    }
}

/* An operation at the point beside that is being lowered. */
static trc_status build_beside(struct trc_build *b, uint32_t code, uint32_t resource,
                               struct trc_operand *outputs) {
    struct trc_operand out[TRC_OP_OUT_AT(BESIDE, end)];
    const uint32_t direction = b->place == TRC_PLACE_Y ? TRC_BESIDE_Y : 0;
    const struct trc_operand *width =
        trc_op_reads_position(code) ? &b->position_width : &b->filter_width;
    TRC_TRY(trc_build_op(b, TRC_OP_BESIDE, code | direction, resource, width, out));
    memcpy(outputs, out, trc_op_outputs(code) * sizeof *out);
    return TRC_OK;
}

static bool is_beside(const struct trc_build *b) { return b->place > TRC_PLACE_MIDDLE; }

trc_status trc_build_point(struct trc_build *b, uint32_t code, uint32_t resource,
                           struct trc_operand *outputs) {
    return is_beside(b) && varies_in_place(code)
               ? build_beside(b, code, resource, outputs)
               : trc_build_op(b, code, 0, resource, NULL, outputs);
}

/* ---- inputs ---- */

static uint32_t output_offset(const trc_node *node, uint32_t output) {
    uint32_t offset = 0;
    for (uint32_t i = 0; i < output; i++)
        offset += trc_socket_floats(trc_node_output_kind(node, i));
    return offset;
}

/* What an unlinked input of that kind stands for in a value node. */
static trc_status default_input(struct trc_build *b, enum trc_socket_kind kind,
                                struct trc_operand *out) {
    switch (kind) {
    case TRC_SOCKET_NORMAL:
        return op(b, TRC_OP_NORMAL, 0, NULL, out);
    case TRC_SOCKET_GENERATED:
        return trc_build_point(b, TRC_OP_GENERATED, TRC_NO_RESOURCE, out);
    case TRC_SOCKET_POSITION:
        return trc_build_point(b, TRC_OP_POSITION, TRC_NO_RESOURCE, out);
    case TRC_SOCKET_UV:
        out[TRC_OP_OUT_AT(UV, end)] = trc_constant(0.0f);
        return trc_build_point(b, TRC_OP_UV, TRC_NO_RESOURCE, out);
    default:
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "an input has no default");
    }
}

static trc_status linked_input(struct trc_build *b, const trc_node_input *input,
                               enum trc_socket_kind kind, struct trc_operand *out) {
    const trc_node *from = &b->desc->nodes[input->node];
    const enum trc_socket_kind given = trc_node_output_kind(from, input->output);
    const struct trc_operand *value =
        b->outputs + b->first_output[input->node] + output_offset(from, input->output);
    if (given == TRC_SOCKET_FLOAT) {
        for (uint32_t i = 0; i < trc_socket_floats(kind); i++)
            out[i] = *value;
        return TRC_OK;
    }
    if (kind == TRC_SOCKET_FLOAT)
        return op(b, given == TRC_SOCKET_COLOR ? TRC_OP_LUMINANCE : TRC_OP_AVERAGE, 0, value, out);
    copy3(out, value);
    return TRC_OK;
}

trc_status trc_build_input(struct trc_build *b, const trc_node *node, uint32_t index,
                           struct trc_operand *out) {
    const trc_node_input *input = &b->desc->inputs[node->first_input + index];
    const enum trc_socket_kind kind = trc_node_info_of(node->type)->inputs[index].kind;
    const uint32_t floats = trc_socket_floats(kind);
    if (input->node >= 0)
        return linked_input(b, input, kind, out);
    if (input->node == TRC_INPUT_DEFAULT) {
        const bool at_setup = kind == TRC_SOCKET_NORMAL || kind == TRC_SOCKET_TANGENT;
        if (!trc_node_is_shader(node->type) || !at_setup)
            return default_input(b, kind, out);
        for (uint32_t i = 0; i < floats; i++)
            out[i] = (struct trc_operand){TRC_REG_DEFAULT, 0.0f};
        return TRC_OK;
    }
    for (uint32_t i = 0; i < floats; i++)
        out[i] = trc_constant(input->value[i]);
    return TRC_OK;
}

/* ---- resources ---- */

static trc_status name_of(const struct lowering *l, uint32_t *resource) {
    *resource = TRC_NO_RESOURCE;
    if (!l->node->name || !l->node->name[0])
        return TRC_OK;
    return trc_names_add(l->b->context->names, l->node->name, resource);
}

static uint32_t image_of(const struct lowering *l) {
    const struct trc_compile_context *context = l->b->context;
    if (!l->node->image || !context->image_index)
        return TRC_NO_RESOURCE;
    return context->image_index(context->images, l->node->image);
}

/* First float of a table, which is added unless an equal one is there. */
static trc_status table_of(const struct lowering *l, uint32_t *resource) {
    struct trc_build *b = l->b;
    const uint32_t count = (uint32_t)l->node->table_count;
    for (uint32_t i = 0; i < b->table_count; i += count) {
        *resource = i;
        if (memcmp(b->tables + i, l->node->table, count * sizeof(float)) == 0)
            return TRC_OK;
    }
    TRC_TRY(trc_build_reserve((void **)&b->tables, &b->table_capacity, b->table_count + count,
                              sizeof(float)));
    memcpy(b->tables + b->table_count, l->node->table, count * sizeof(float));
    *resource = b->table_count;
    b->table_count += count;
    return TRC_OK;
}

/* ---- nodes ---- */

/* One operation for each output, from the first; float pairs get 0 as the third of their vector. */
static trc_status lower_outputs(const struct lowering *l, const uint16_t *codes, uint32_t count) {
    struct trc_operand *out = l->out;
    for (uint32_t i = 0; i < count; i++) {
        TRC_TRY(trc_build_point(l->b, codes[i], TRC_NO_RESOURCE, out));
        if (trc_op_outputs(codes[i]) == 2)
            out[2] = trc_constant(0.0f);
        const uint32_t floats = trc_op_outputs(codes[i]);
        out += floats == 2 ? 3 : floats;
    }
    return TRC_OK;
}

static trc_status lower_texture_coordinate(const struct lowering *l) {
    static const uint16_t codes[] = {TRC_OP_GENERATED,       TRC_OP_OBJECT_NORMAL,   TRC_OP_UV,
                                     TRC_OP_OBJECT_POSITION, TRC_OP_CAMERA_POSITION, TRC_OP_WINDOW,
                                     TRC_OP_REFLECTION};
    TRC_TRY(lower_outputs(l, codes, sizeof codes / sizeof *codes));
    if (!is_beside(l->b) || !(l->node->mode & TRC_COORDINATE_CURVED))
        return TRC_OK;
    return build_beside(l->b, TRC_OP_OBJECT_NORMAL, TRC_NO_RESOURCE,
                        l->out + TRC_OUT_AT(TEXTURE_COORDINATE, normal));
}

static trc_status lower_geometry(const struct lowering *l) {
    static const uint16_t codes[] = {TRC_OP_POSITION,    TRC_OP_NORMAL,   TRC_OP_DEFAULT_TANGENT,
                                     TRC_OP_TRUE_NORMAL, TRC_OP_INCOMING, TRC_OP_PARAMETRIC,
                                     TRC_OP_BACKFACING};
    TRC_TRY(lower_outputs(l, codes, sizeof codes / sizeof *codes));
    /* Pointiness of a flat surface; islands are not told apart, so each object is one. */
    l->out[TRC_OUT_AT(GEOMETRY, pointiness)] = trc_constant(0.5f);
    return op(l->b, TRC_OP_OBJECT_RANDOM, 0, NULL,
              l->out + TRC_OUT_AT(GEOMETRY, random_per_island));
}

static trc_status lower_object_info(const struct lowering *l) {
    static const uint16_t codes[] = {TRC_OP_OBJECT_LOCATION, TRC_OP_OBJECT_COLOR,
                                     TRC_OP_OBJECT_INDEX};
    TRC_TRY(lower_outputs(l, codes, sizeof codes / sizeof *codes));
    l->out[TRC_OUT_AT(OBJECT_INFO, material_index)] = trc_constant((float)l->b->desc->pass_index);
    return op(l->b, TRC_OP_OBJECT_RANDOM, 0, NULL, l->out + TRC_OUT_AT(OBJECT_INFO, random));
}

static bool has_levels(const struct lowering *l) {
    const struct trc_compile_context *context = l->b->context;
    return context->image_has_levels && context->image_has_levels(context->images, l->node->image);
}

/* The operation whose first outputs two operands are; NULL unless it is of that kind. */
static const struct trc_build_op *source_of(const struct trc_build *b, uint32_t code,
                                            const struct trc_operand *pair) {
    for (uint32_t i = 0; i < b->op_count; i++) {
        const struct trc_build_op *o = &b->ops[i];
        if (o->op == code && pair[0].reg == (int32_t)o->first_value &&
            pair[1].reg == (int32_t)o->first_value + 1)
            return o;
    }
    return NULL;
}

/* What a mapping scales its U and V by at least; 0 unless it is constant and turns them about the
 * third axis alone. in: of TRC_OP_MAPPING. */
static float min_scale(uint32_t mode, const struct trc_operand *in) {
    /* Of the matrix: what mixes Z with X and Y. */
    static const uint32_t zeros[4] = {TRC_OP_AT(MAPPING, row0) + 2, TRC_OP_AT(MAPPING, row1) + 2,
                                      TRC_OP_AT(MAPPING, row2), TRC_OP_AT(MAPPING, row2) + 1};
    const uint32_t scale = TRC_OP_AT(MAPPING, scale);
    /* The others divide by the scale. */
    const bool is_product = mode == TRC_MAPPING_POINT || mode == TRC_MAPPING_VECTOR;
    for (uint32_t i = scale; i < TRC_OP_AT(MAPPING, end); i++)
        if (!trc_is_constant(in[i]) || !is_product)
            return 0.0f;
    for (int i = 0; i < 4; i++)
        if (in[zeros[i]].value != 0.0f)
            return 0.0f;
    return fminf(fabsf(in[scale].value), fabsf(in[scale + 1].value));
}

/* The minimum that a UV map's coordinates, mapped or not, change by per metre of the surface; 0,
 * for which lookups read no smaller levels, where they come from elsewhere. */
static trc_status density_of(const struct lowering *l, const struct trc_operand *uv,
                             struct trc_operand *out) {
    const struct trc_build_op *mapping = source_of(l->b, TRC_OP_MAPPING, uv);
    const struct trc_operand *in = mapping ? l->b->inputs + mapping->first_input : uv;
    const struct trc_build_op *map = source_of(l->b, TRC_OP_UV, in);
    const float scale = mapping ? min_scale(mapping->mode, in) : 1.0f;
    *out = trc_constant(0.0f);
    if (!map || scale == 0.0f)
        return TRC_OK;
    TRC_TRY(trc_build_op(l->b, TRC_OP_UV_DENSITY, 0, map->resource, NULL, out));
    return trc_build_math(l->b, TRC_MATH_MULTIPLY, *out, trc_constant(scale), trc_constant(0.0f),
                          out);
}

static trc_status lower_image(const struct lowering *l) {
    const uint32_t projection = l->node->mode & TRC_IMAGE_PROJECTION_MASK;
    const uint32_t mode = l->node->mode & ~(uint32_t)TRC_IMAGE_PROJECTION_MASK;
    const uint32_t image = image_of(l), vector = TRC_AT(IMAGE, vector);
    struct trc_operand uv[TRC_OP_AT(IMAGE, end)] = {l->in[vector], l->in[vector + 1],
                                                    trc_constant(0.0f)};
    if (projection == TRC_IMAGE_BOX)
        return trc_build_op(l->b, TRC_OP_IMAGE_BOX, mode, image, l->in, l->out);
    if (projection != TRC_IMAGE_FLAT) {
        const uint32_t wrap =
            projection == TRC_IMAGE_SPHERE ? TRC_PROJECT_SPHERE : TRC_PROJECT_TUBE;
        TRC_TRY(op(l->b, TRC_OP_PROJECT, wrap, l->in + vector, uv));
    } else if ((mode & TRC_IMAGE_INTERPOLATION_MASK) != TRC_IMAGE_CLOSEST && has_levels(l) &&
               l->b->place == TRC_PLACE_SHADED) { /* slopes would be those of the level */
        TRC_TRY(density_of(l, uv, uv + TRC_OP_AT(IMAGE, density)));
    }
    return trc_build_op(l->b, TRC_OP_IMAGE, mode, image, uv, l->out);
}

static trc_status lower_environment(const struct lowering *l) {
    const bool is_ball = l->node->mode & TRC_ENVIRONMENT_MIRROR_BALL;
    const uint32_t mode = (l->node->mode & TRC_IMAGE_INTERPOLATION_MASK) | TRC_IMAGE_REPEAT;
    struct trc_operand uv[TRC_OP_AT(IMAGE, end)], rgba[TRC_OP_OUT_AT(IMAGE, end)];
    uv[TRC_OP_AT(IMAGE, density)] = trc_constant(0.0f);
    TRC_TRY(op(l->b, TRC_OP_PROJECT,
               is_ball ? TRC_PROJECT_MIRROR_BALL : TRC_PROJECT_EQUIRECTANGULAR, l->in, uv));
    TRC_TRY(trc_build_op(l->b, TRC_OP_IMAGE, mode, image_of(l), uv, rgba));
    memcpy(l->out, rgba, 3 * sizeof *rgba);
    return TRC_OK;
}

static trc_status lower_named(const struct lowering *l, uint32_t code, uint32_t mode) {
    uint32_t name;
    TRC_TRY(name_of(l, &name));
    return trc_build_op(l->b, code, mode, name, l->in, l->out);
}

/* An attribute at the point. */
static trc_status lower_attribute(const struct lowering *l, uint32_t code) {
    uint32_t name;
    TRC_TRY(name_of(l, &name));
    if (code == TRC_OP_UV)
        l->out[TRC_OP_OUT_AT(UV, end)] = trc_constant(0.0f);
    return trc_build_point(l->b, code, name, l->out);
}

static trc_status lower_mapping(const struct lowering *l) {
    struct trc_operand in[TRC_OP_AT(MAPPING, end)];
    const uint32_t mode = l->node->mode;
    const bool is_moved = mode == TRC_MAPPING_POINT || mode == TRC_MAPPING_TEXTURE;
    copy3(in + TRC_OP_AT(MAPPING, vector), l->in + TRC_AT(MAPPING, vector));
    for (uint32_t i = 0; i < 3; i++)
        in[TRC_OP_AT(MAPPING, location) + i] =
            is_moved ? l->in[TRC_AT(MAPPING, location) + i] : trc_constant(0.0f);
    copy3(in + TRC_OP_AT(MAPPING, scale), l->in + TRC_AT(MAPPING, scale));
    TRC_TRY(op(l->b, TRC_OP_ROTATION, 0, l->in + TRC_AT(MAPPING, rotation),
               in + TRC_OP_AT(MAPPING, row0)));
    return op(l->b, TRC_OP_MAPPING, mode, in, l->out);
}

static trc_status lower_mix(const struct lowering *l) {
    TRC_TRY(op(l->b, TRC_OP_MIX, l->node->mode & ~(uint32_t)TRC_MODE_CLAMP, l->in, l->out));
    return l->node->mode & TRC_MODE_CLAMP ? op(l->b, TRC_OP_SATURATE, 0, l->out, l->out) : TRC_OK;
}

static trc_status lower_math(const struct lowering *l) {
    TRC_TRY(trc_build_math(l->b, l->node->mode & ~(uint32_t)TRC_MODE_CLAMP, l->in[TRC_AT(MATH, a)],
                           l->in[TRC_AT(MATH, b)], l->in[TRC_AT(MATH, c)], l->out));
    if (!(l->node->mode & TRC_MODE_CLAMP))
        return TRC_OK;
    const struct trc_operand in[TRC_OP_AT(CLAMP, end)] = {*l->out, trc_constant(0.0f),
                                                          trc_constant(1.0f)};
    return op(l->b, TRC_OP_CLAMP, TRC_CLAMP_MINMAX, in, l->out);
}

static trc_status lower_map_range(const struct lowering *l) {
    TRC_TRY(op(l->b, TRC_OP_MAP_RANGE, 0, l->in, l->out));
    if (!(l->node->mode & TRC_MODE_CLAMP))
        return TRC_OK;
    const struct trc_operand in[TRC_OP_AT(CLAMP, end)] = {*l->out, l->in[TRC_AT(MAP_RANGE, to_min)],
                                                          l->in[TRC_AT(MAP_RANGE, to_max)]};
    return op(l->b, TRC_OP_CLAMP, TRC_CLAMP_RANGE, in, l->out);
}

static trc_status lower_vector_math(const struct lowering *l) {
    const uint32_t mode = l->node->mode;
    const struct trc_operand zero = trc_constant(0.0f);
    struct trc_operand in[TRC_OP_AT(VECTOR_MATH, end)];
    for (uint32_t i = 0; i < TRC_OP_AT(VECTOR_MATH, end); i++)
        in[i] = zero;
    copy3(in + TRC_OP_AT(VECTOR_MATH, a), l->in + TRC_AT(VECTOR_MATH, a));
    const bool is_unary = mode == TRC_VECTOR_LENGTH || mode == TRC_VECTOR_SCALE ||
                          mode == TRC_VECTOR_NORMALIZE || mode == TRC_VECTOR_ABSOLUTE ||
                          mode == TRC_VECTOR_ROUND || mode == TRC_VECTOR_SIGN ||
                          (mode >= TRC_VECTOR_FLOOR && mode <= TRC_VECTOR_TANGENT);
    if (!is_unary)
        copy3(in + TRC_OP_AT(VECTOR_MATH, b), l->in + TRC_AT(VECTOR_MATH, b));
    if (mode == TRC_VECTOR_MULTIPLY_ADD || mode == TRC_VECTOR_WRAP ||
        mode == TRC_VECTOR_FACEFORWARD)
        copy3(in + TRC_OP_AT(VECTOR_MATH, c), l->in + TRC_AT(VECTOR_MATH, c));
    if (mode == TRC_VECTOR_SCALE || mode == TRC_VECTOR_REFRACT)
        in[TRC_OP_AT(VECTOR_MATH, scale)] = l->in[TRC_AT(VECTOR_MATH, scale)];
    for (uint32_t i = 0; i < TRC_OUT_AT(VECTOR_MATH, end); i++)
        l->out[i] = zero;
    /* Inputs a and b stand alike in both operations. */
    if (mode == TRC_VECTOR_DOT || mode == TRC_VECTOR_DISTANCE || mode == TRC_VECTOR_LENGTH) {
        return op(l->b, TRC_OP_VECTOR_MEASURE, mode, in, l->out + TRC_OUT_AT(VECTOR_MATH, value));
    }
    return op(l->b, TRC_OP_VECTOR_MATH, mode, in, l->out + TRC_OUT_AT(VECTOR_MATH, vector));
}

/* Red, green, blue and X, Y, Z are what the operands are already. */
static trc_status lower_components(const struct lowering *l, uint32_t code) {
    const uint32_t mode = l->node->mode;
    if (mode != TRC_SEPARATE_RGB && mode != TRC_SEPARATE_XYZ)
        return op(l->b, code, mode, l->in, l->out);
    copy3(l->out, l->in);
    return TRC_OK;
}

/* Each channel by its curve, mixed with what came in by the factor. */
static trc_status lower_curves(const struct lowering *l, uint32_t table) {
    const bool is_color = l->node->type == TRC_NODE_CURVES;
    const uint32_t mode = l->node->mode == TRC_CURVES_EXTRAPOLATED ? TRC_CURVE_EXTRAPOLATE : 0u;
    const uint32_t channels = is_color ? 3 : 1;
    const struct trc_operand none = trc_constant(0.0f);
    const struct trc_operand factor =
        l->in[is_color ? TRC_AT(CURVES, factor) : TRC_AT(FLOAT_CURVE, factor)];
    const struct trc_operand low = l->in[is_color ? TRC_AT(CURVES, low) : TRC_AT(FLOAT_CURVE, low)];
    const struct trc_operand high =
        l->in[is_color ? TRC_AT(CURVES, high) : TRC_AT(FLOAT_CURVE, high)];
    for (uint32_t i = 0; i < channels; i++) {
        const struct trc_operand value =
            l->in[(is_color ? TRC_AT(CURVES, color) : TRC_AT(FLOAT_CURVE, value)) + i];
        const struct trc_operand in[TRC_OP_AT(CURVE, end)] = {value, low, high};
        struct trc_operand change;
        TRC_TRY(trc_build_op(l->b, TRC_OP_CURVE, mode | i, table, in, l->out + i));
        if (trc_is_value(factor, 1.0f))
            continue;
        TRC_TRY(trc_build_math(l->b, TRC_MATH_SUBTRACT, l->out[i], value, none, &change));
        TRC_TRY(trc_build_math(l->b, TRC_MATH_MULTIPLY_ADD, change, factor, value, l->out + i));
    }
    return TRC_OK;
}

/* A VECTOR_MATH of two vectors. */
static trc_status combine(struct trc_build *b, uint32_t mode, const struct trc_operand *x,
                          const struct trc_operand *y, struct trc_operand *out) {
    struct trc_operand in[TRC_OP_AT(VECTOR_MATH, end)];
    for (uint32_t i = 0; i < TRC_OP_AT(VECTOR_MATH, end); i++)
        in[i] = trc_constant(0.0f);
    copy3(in + TRC_OP_AT(VECTOR_MATH, a), x);
    if (y)
        copy3(in + TRC_OP_AT(VECTOR_MATH, b), y);
    return op(b, TRC_OP_VECTOR_MATH, mode, in, out);
}

/* Whether a place is on a wire. */
static trc_status build_wire(const struct lowering *l, const struct trc_operand place[3],
                             struct trc_operand *out) {
    struct trc_operand in[TRC_OP_AT(WIREFRAME, end)];
    in[TRC_OP_AT(WIREFRAME, size)] = l->in[TRC_AT(WIREFRAME, size)];
    copy3(in + TRC_OP_AT(WIREFRAME, position), place);
    return op(l->b, TRC_OP_WIREFRAME, l->node->mode & TRC_WIREFRAME_PIXELS, in, out);
}

/* Beside the point what is there, or, STEEP, what is at the point and its change since a step
 * before it, over the length of the step. */
static trc_status lower_wireframe(const struct lowering *l) {
    struct trc_build *b = l->b;
    const struct trc_operand none = trc_constant(0.0f);
    struct trc_operand here[3], place[3], behind[3], on_wire, was_on_wire, change, length;
    struct trc_operand step[TRC_OP_AT(VECTOR_MEASURE, end)] = {none, none, none, none, none, none};
    TRC_TRY(trc_build_point(b, TRC_OP_POSITION, TRC_NO_RESOURCE, place));
    if (!is_beside(b) || !(l->node->mode & TRC_WIREFRAME_STEEP))
        return build_wire(l, place, l->out);
    TRC_TRY(op(b, TRC_OP_POSITION, 0, NULL, here));
    TRC_TRY(build_wire(l, here, &on_wire));
    TRC_TRY(combine(b, TRC_VECTOR_SUBTRACT, place, here, step));
    TRC_TRY(combine(b, TRC_VECTOR_SUBTRACT, here, step, behind));
    TRC_TRY(build_wire(l, behind, &was_on_wire));
    TRC_TRY(op(b, TRC_OP_VECTOR_MEASURE, TRC_VECTOR_LENGTH, step, &length));
    TRC_TRY(trc_build_math(b, TRC_MATH_SUBTRACT, on_wire, was_on_wire, none, &change));
    TRC_TRY(trc_build_math(b, TRC_MATH_DIVIDE, change, length, none, &change));
    return trc_build_math(b, TRC_MATH_ADD, on_wire, change, none, l->out);
}

/* By way of world space. */
static trc_status lower_vector_transform(const struct lowering *l) {
    const uint32_t from = l->node->mode & TRC_SPACE_MASK;
    const uint32_t to = l->node->mode >> TRC_SPACE_TO_SHIFT & TRC_SPACE_MASK;
    const uint32_t type = l->node->mode >> TRC_TRANSFORMED_SHIFT;
    const uint32_t kind = type == TRC_TRANSFORMED_POINT    ? (uint32_t)TRC_TRANSFORM_POINT
                          : type == TRC_TRANSFORMED_NORMAL ? (uint32_t)TRC_TRANSFORM_NORMAL
                                                           : 0u;
    copy3(l->out, l->in);
    if (from != to && from != TRC_SPACE_WORLD) {
        const uint32_t transform = from == TRC_SPACE_OBJECT ? TRC_TRANSFORM_OBJECT_TO_WORLD
                                                            : TRC_TRANSFORM_CAMERA_TO_WORLD;
        TRC_TRY(op(l->b, TRC_OP_TRANSFORM, transform | kind, l->out, l->out));
    }
    if (from != to && to != TRC_SPACE_WORLD) {
        const uint32_t transform =
            to == TRC_SPACE_OBJECT ? TRC_TRANSFORM_WORLD_TO_OBJECT : TRC_TRANSFORM_WORLD_TO_CAMERA;
        TRC_TRY(op(l->b, TRC_OP_TRANSFORM, transform | kind, l->out, l->out));
    }
    return type == TRC_TRANSFORMED_UNIT_VECTOR || (type == TRC_TRANSFORMED_NORMAL && from != to)
               ? combine(l->b, TRC_VECTOR_NORMALIZE, l->out, NULL, l->out)
               : TRC_OK;
}

/* By the mapping that turns a vector, about the center. */
static trc_status lower_vector_rotate(const struct lowering *l) {
    struct trc_operand in[TRC_OP_AT(MAPPING, end)], axis[TRC_OP_AT(AXIS_ROTATION, end)];
    const struct trc_operand *center = l->in + TRC_AT(VECTOR_ROTATE, center);
    struct trc_operand *rows = in + TRC_OP_AT(MAPPING, row0);
    const uint32_t kind = l->node->mode & ~(uint32_t)TRC_ROTATE_INVERSE;
    for (uint32_t i = 0; i < 3; i++) {
        in[TRC_OP_AT(MAPPING, location) + i] = trc_constant(0.0f);
        in[TRC_OP_AT(MAPPING, scale) + i] = trc_constant(1.0f);
    }
    TRC_TRY(combine(l->b, TRC_VECTOR_SUBTRACT, l->in + TRC_AT(VECTOR_ROTATE, vector), center,
                    in + TRC_OP_AT(MAPPING, vector)));
    if (kind == TRC_ROTATE_EULER) {
        TRC_TRY(op(l->b, TRC_OP_ROTATION, 0, l->in + TRC_AT(VECTOR_ROTATE, rotation), rows));
    } else {
        for (uint32_t i = 0; i < 3; i++)
            axis[TRC_OP_AT(AXIS_ROTATION, axis) + i] =
                kind == TRC_ROTATE_AXIS_ANGLE
                    ? l->in[TRC_AT(VECTOR_ROTATE, axis) + i]
                    : trc_constant(TRC_ROTATE_X + i == kind ? 1.0f : 0.0f);
        axis[TRC_OP_AT(AXIS_ROTATION, angle)] = l->in[TRC_AT(VECTOR_ROTATE, angle)];
        TRC_TRY(op(l->b, TRC_OP_AXIS_ROTATION, 0, axis, rows));
    }
    /* A texture mapping turns back. */
    const bool is_inverse = l->node->mode & TRC_ROTATE_INVERSE;
    TRC_TRY(op(l->b, TRC_OP_MAPPING, is_inverse ? TRC_MAPPING_TEXTURE : TRC_MAPPING_VECTOR, in,
               l->out));
    return combine(l->b, TRC_VECTOR_ADD, l->out, center, l->out);
}

/* Less the midlevel, times the scale, to the world. */
static trc_status lower_vector_displacement(const struct lowering *l) {
    const struct trc_operand none = trc_constant(0.0f), *in = l->in;
    uint32_t name;
    for (uint32_t i = 0; i < 3; i++) {
        TRC_TRY(trc_build_math(l->b, TRC_MATH_SUBTRACT, in[TRC_AT(VECTOR_DISPLACEMENT, vector) + i],
                               in[TRC_AT(VECTOR_DISPLACEMENT, midlevel)], none, l->out + i));
        TRC_TRY(trc_build_math(l->b, TRC_MATH_MULTIPLY, l->out[i],
                               in[TRC_AT(VECTOR_DISPLACEMENT, scale)], none, l->out + i));
    }
    if (l->node->mode == TRC_NORMAL_MAP_WORLD)
        return TRC_OK;
    if (l->node->mode == TRC_NORMAL_MAP_OBJECT)
        return op(l->b, TRC_OP_TRANSFORM, TRC_TRANSFORM_OBJECT_TO_WORLD, l->out, l->out);
    TRC_TRY(name_of(l, &name));
    return trc_build_op(l->b, TRC_OP_TANGENT_VECTOR, 0, name, l->out, l->out);
}

static trc_status lower_camera_data(const struct lowering *l) {
    struct trc_operand in[TRC_OP_AT(VECTOR_MEASURE, end)];
    struct trc_operand *seen = in + TRC_OP_AT(VECTOR_MEASURE, a);
    TRC_TRY(op(l->b, TRC_OP_CAMERA_POSITION, TRC_CAMERA_DATA_POSITION, NULL, seen));
    for (uint32_t i = 0; i < 3; i++)
        in[TRC_OP_AT(VECTOR_MEASURE, b) + i] = trc_constant(0.0f);
    l->out[TRC_OUT_AT(CAMERA_DATA, view_z_depth)] = seen[2];
    TRC_TRY(op(l->b, TRC_OP_VECTOR_MEASURE, TRC_VECTOR_LENGTH, in,
               l->out + TRC_OUT_AT(CAMERA_DATA, view_distance)));
    return combine(l->b, TRC_VECTOR_NORMALIZE, seen, NULL,
                   l->out + TRC_OUT_AT(CAMERA_DATA, view_vector));
}

static trc_status lower_ambient_occlusion(const struct lowering *l) {
    struct trc_operand in[TRC_OP_AT(AMBIENT_OCCLUSION, end)];
    struct trc_operand *const open = l->out + TRC_OUT_AT(AMBIENT_OCCLUSION, open);
    in[TRC_OP_AT(AMBIENT_OCCLUSION, distance)] = l->in[TRC_AT(AMBIENT_OCCLUSION, distance)];
    copy3(in + TRC_OP_AT(AMBIENT_OCCLUSION, normal), l->in + TRC_AT(AMBIENT_OCCLUSION, normal));
    TRC_TRY(op(l->b, TRC_OP_AMBIENT_OCCLUSION, l->node->mode, in, open));
    for (uint32_t i = 0; i < 3; i++)
        TRC_TRY(trc_build_math(l->b, TRC_MATH_MULTIPLY, l->in[TRC_AT(AMBIENT_OCCLUSION, color) + i],
                               *open, trc_constant(0.0f), l->out + i));
    return TRC_OK;
}

/* A normal of its own is turned as the point's. */
static trc_status lower_bevel(const struct lowering *l) {
    struct trc_operand normal[3];
    TRC_TRY(op(l->b, TRC_OP_BEVEL, l->node->mode, l->in + TRC_AT(BEVEL, radius), l->out));
    if (l->b->desc->inputs[l->node->first_input + TRC_INPUT_OF(BEVEL, normal)].node < 0)
        return TRC_OK;
    TRC_TRY(op(l->b, TRC_OP_NORMAL, 0, NULL, normal));
    TRC_TRY(combine(l->b, TRC_VECTOR_SUBTRACT, l->out, normal, l->out));
    TRC_TRY(combine(l->b, TRC_VECTOR_ADD, l->in + TRC_AT(BEVEL, normal), l->out, l->out));
    return combine(l->b, TRC_VECTOR_NORMALIZE, l->out, NULL, l->out);
}

/* Long because it is the list of node types. */
static trc_status lower_node(const struct lowering *l) {
    struct trc_build *b = l->b;
    const uint32_t mode = l->node->mode;
    uint32_t resource = TRC_NO_RESOURCE;
    switch (l->node->type) {
    case TRC_NODE_IMAGE:
        return lower_image(l);
    case TRC_NODE_ENVIRONMENT:
        return lower_environment(l);
    case TRC_NODE_UV_MAP:
        return lower_attribute(l, TRC_OP_UV);
    case TRC_NODE_COLOR_ATTRIBUTE:
        return mode & TRC_ATTRIBUTE_LEVEL ? lower_named(l, TRC_OP_COLOR_ATTRIBUTE, 0)
                                          : lower_attribute(l, TRC_OP_COLOR_ATTRIBUTE);
    case TRC_NODE_BUMP:
        return trc_build_bump(b, l->node, l->in, l->out);
    case TRC_NODE_DISPLACEMENT:
        return trc_build_displacement(b, l->node, l->in, l->out);
    case TRC_NODE_VECTOR_DISPLACEMENT:
        return lower_vector_displacement(l);
    case TRC_NODE_NORMAL_MAP:
        return lower_named(l, TRC_OP_NORMAL_MAP, mode);
    case TRC_NODE_TANGENT:
        return lower_named(l, TRC_OP_TANGENT, mode);
    case TRC_NODE_TEXTURE_COORDINATE:
        return lower_texture_coordinate(l);
    case TRC_NODE_GEOMETRY:
        return lower_geometry(l);
    case TRC_NODE_OBJECT_INFO:
        return lower_object_info(l);
    case TRC_NODE_INSTANCE_VALUES:
        return op(b, TRC_OP_INSTANCE_VALUES, mode, NULL, l->out);
    case TRC_NODE_LIGHT_PATH:
        for (uint32_t i = 0; i < TRC_OUTPUT_OF(LIGHT_PATH, end); i++) {
            TRC_TRY(op(b, TRC_OP_LIGHT_PATH, i, NULL, l->out + i));
        }
        return TRC_OK;
    case TRC_NODE_MAPPING:
        return lower_mapping(l);
    case TRC_NODE_MIX_COLOR:
        return lower_mix(l);
    case TRC_NODE_MATH:
        return lower_math(l);
    case TRC_NODE_VECTOR_MATH:
        return lower_vector_math(l);
    case TRC_NODE_MAP_RANGE:
        return lower_map_range(l);
    case TRC_NODE_CLAMP:
        return op(b, TRC_OP_CLAMP, mode, l->in, l->out);
    case TRC_NODE_FRESNEL:
        return op(b, TRC_OP_FRESNEL, 0, l->in, l->out);
    case TRC_NODE_LAYER_WEIGHT:
        TRC_TRY(op(b, TRC_OP_LAYER_FRESNEL, 0, l->in, l->out + TRC_OUT_AT(LAYER_WEIGHT, fresnel)));
        return op(b, TRC_OP_LAYER_FACING, 0, l->in, l->out + TRC_OUT_AT(LAYER_WEIGHT, facing));
    case TRC_NODE_INVERT:
        return op(b, TRC_OP_INVERT, 0, l->in, l->out);
    case TRC_NODE_GAMMA:
        return op(b, TRC_OP_GAMMA, 0, l->in, l->out);
    case TRC_NODE_HUE_SATURATION:
        return op(b, TRC_OP_HUE_SATURATION, 0, l->in, l->out);
    case TRC_NODE_BRIGHT_CONTRAST:
        return op(b, TRC_OP_BRIGHT_CONTRAST, 0, l->in, l->out);
    case TRC_NODE_COLOR_RAMP:
        TRC_TRY(table_of(l, &resource));
        return trc_build_op(b, TRC_OP_RAMP, mode, resource, l->in, l->out);
    case TRC_NODE_CURVES:
    case TRC_NODE_FLOAT_CURVE:
        TRC_TRY(table_of(l, &resource));
        return lower_curves(l, resource);
    case TRC_NODE_BLACKBODY:
        return op(b, TRC_OP_BLACKBODY, mode, l->in, l->out);
    case TRC_NODE_WAVELENGTH:
        return op(b, TRC_OP_WAVELENGTH, mode, l->in, l->out);
    case TRC_NODE_VECTOR_TRANSFORM:
        return lower_vector_transform(l);
    case TRC_NODE_VECTOR_ROTATE:
        return lower_vector_rotate(l);
    case TRC_NODE_CAMERA_DATA:
        return lower_camera_data(l);
    case TRC_NODE_POINT_INFO:
        return op(b, TRC_OP_POINT_INFO, 0, NULL, l->out);
    case TRC_NODE_AMBIENT_OCCLUSION:
        return lower_ambient_occlusion(l);
    case TRC_NODE_BEVEL:
        return lower_bevel(l);
    case TRC_NODE_RAYCAST:
        return op(b, TRC_OP_RAYCAST, mode, l->in, l->out);
    case TRC_NODE_RAYCAST_ATTRIBUTE:
        return lower_named(l, TRC_OP_RAYCAST_ATTRIBUTE, mode);
    case TRC_NODE_WIREFRAME:
        return lower_wireframe(l);
    case TRC_NODE_SEPARATE:
        return lower_components(l, TRC_OP_SEPARATE);
    case TRC_NODE_COMBINE:
        return lower_components(l, TRC_OP_COMBINE);
    case TRC_NODE_CHECKER:
        return op(b, TRC_OP_CHECKER, 0, l->in, l->out);
    case TRC_NODE_RGB_TO_BW:
        return op(b, TRC_OP_LUMINANCE, 0, l->in, l->out);
    default:
        return trc_build_texture(b, l->node, l->in, l->out);
    }
}

trc_status trc_build_nodes(struct trc_build *b, const uint8_t *wanted, uint32_t end) {
    for (uint32_t i = 0; i < end; i++) {
        struct lowering l = {
            .b = b, .node = &b->desc->nodes[i], .out = b->outputs + b->first_output[i]};
        if ((wanted && !wanted[i]) || trc_node_is_shader(l.node->type) ||
            trc_node_is_output(l.node->type))
            continue;
        uint32_t floats = 0;
        for (uint32_t k = 0; k < l.node->input_count; k++) {
            TRC_TRY(trc_build_input(b, l.node, k, l.in + floats));
            floats += trc_socket_floats(trc_node_info_of(l.node->type)->inputs[k].kind);
        }
        TRC_TRY(lower_node(&l));
    }
    return TRC_OK;
}

trc_status trc_build_prepare(struct trc_build *b) {
    b->first_output = trc_alloc(b->desc->node_count, sizeof *b->first_output);
    if (!b->first_output)
        goto no_memory;
    for (uint32_t i = 0; i < b->desc->node_count; i++) {
        const trc_node *node = &b->desc->nodes[i];
        b->first_output[i] = b->output_count;
        b->output_count += output_offset(node, trc_node_info_of(node->type)->output_count);
    }
    b->outputs = trc_alloc(b->output_count, sizeof *b->outputs);
    if (b->outputs)
        return TRC_OK;
no_memory:
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to compile a material");
}

trc_status trc_build_values(struct trc_build *b) {
    TRC_TRY(trc_build_prepare(b));
    TRC_TRY(trc_build_relief(b));
    return trc_build_nodes(b, NULL, b->desc->node_count);
}
