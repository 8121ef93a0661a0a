/* Operations of a material under compilation: folded where inputs are constants, shared where
 * equal. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "model/kernels.h"
#include "shading/build.h"

/* Far above what fits into registers, far below what would overflow a count. */
#define MAX_OPS (1u << 20)

struct op_info {
    uint8_t inputs, outputs, is_pure;
};
static const struct op_info op_infos[TRC_OP_COUNT] = {
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) \
    {TRC_OP_AT(NAME, end), TRC_OP_OUT_AT(NAME, end), is_pure},
#include "model/operations.def"
};

#define TRC_OPERATION(NAME, is_pure, inputs, outputs)                  \
    _Static_assert(TRC_OP_AT(NAME, end) <= TRC_OP_MAX_INPUTS &&        \
                       TRC_OP_OUT_AT(NAME, end) <= TRC_OP_MAX_OUTPUTS, \
                   #NAME);
#include "model/operations.def"

uint32_t trc_op_inputs(uint32_t op) { return op_infos[op].inputs; }
uint32_t trc_op_outputs(uint32_t op) { return op_infos[op].outputs; }

trc_status trc_build_reserve(void **array, uint32_t *capacity, uint32_t needed, size_t size) {
    if (needed <= *capacity)
        return TRC_OK;
    uint32_t room = *capacity ? *capacity : 64;
    while (room < needed)
        room *= 2;
    void *block = trc_alloc(room, size);
    if (!block)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to compile a material");
    if (*capacity)
        memcpy(block, *array, *capacity * size);
    trc_free(*array);
    *array = block;
    *capacity = room;
    return TRC_OK;
}

static bool all_constant(const struct trc_operand *inputs, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (!trc_is_constant(inputs[i]))
            return false;
    }
    return true;
}

static void fold(const struct trc_build *b, uint32_t op, uint32_t mode, uint32_t resource,
                 const struct trc_operand *inputs, struct trc_operand *outputs) {
    float in[TRC_OP_MAX_INPUTS] = {0}, out[TRC_OP_MAX_OUTPUTS] = {0};
    for (uint32_t i = 0; i < op_infos[op].inputs; i++)
        in[i] = inputs[i].value;
    trc_kernels_get(TRC_ISA_SCALAR)
        ->program_fold(op, mode, trc_op_has_table(op) ? b->tables + resource : NULL, in, out);
    for (uint32_t i = 0; i < op_infos[op].outputs; i++)
        outputs[i] = trc_constant(out[i]);
}

/* Operations that give one of their inputs back whatever the others are. */
static const struct trc_operand *identity(uint32_t op, uint32_t mode,
                                          const struct trc_operand *in) {
    if (op == TRC_OP_MIX && trc_is_constant(in[TRC_OP_AT(MIX, factor)])) {
        const struct trc_operand *factor = in + TRC_OP_AT(MIX, factor);
        const bool through_hsv = mode == TRC_BLEND_SATURATION || mode == TRC_BLEND_VALUE;
        if (factor->value <= 0.0f && !through_hsv)
            return in + TRC_OP_AT(MIX, a);
        if (factor->value >= 1.0f && mode == TRC_BLEND_MIX)
            return in + TRC_OP_AT(MIX, b);
    }
    if (op != TRC_OP_MATH)
        return NULL;
    const struct trc_operand *a = in + TRC_OP_AT(MATH, a), *b = in + TRC_OP_AT(MATH, b);
    switch (mode) {
    case TRC_MATH_ADD:
        if (trc_is_value(*a, 0.0f))
            return b;
        return trc_is_value(*b, 0.0f) ? a : NULL;
    case TRC_MATH_SUBTRACT:
        return trc_is_value(*b, 0.0f) ? a : NULL;
    case TRC_MATH_MULTIPLY:
        if (trc_is_value(*a, 1.0f) || trc_is_value(*b, 0.0f))
            return b;
        return trc_is_value(*b, 1.0f) || trc_is_value(*a, 0.0f) ? a : NULL;
    case TRC_MATH_DIVIDE:
    case TRC_MATH_POWER:
        return trc_is_value(*b, 1.0f) ? a : NULL;
    default:
        return NULL;
    }
}

static uint32_t hash_op(uint32_t op, uint32_t mode, uint32_t resource,
                        const struct trc_operand *inputs) {
    uint32_t h = 2166136261u;
    const uint32_t head[3] = {op, mode, resource};
    for (uint32_t i = 0; i < 3; i++)
        h = (h ^ head[i]) * 16777619u;
    for (uint32_t i = 0; i < op_infos[op].inputs; i++) {
        uint32_t words[2];
        memcpy(words, &inputs[i], sizeof words);
        h = ((h ^ words[0]) * 16777619u ^ words[1]) * 16777619u;
        h ^= h >> 15;
    }
    return h % TRC_BUILD_BUCKETS;
}

/* Whether it depends on the shading normal besides its inputs. */
static bool reads_normal(uint32_t op) {
    switch (op) {
    case TRC_OP_NORMAL:
    case TRC_OP_OBJECT_NORMAL:
    case TRC_OP_REFLECTION:
    case TRC_OP_TANGENT:
    case TRC_OP_DEFAULT_TANGENT:
    case TRC_OP_TANGENT_VECTOR:
    case TRC_OP_NORMAL_MAP:
    case TRC_OP_IMAGE_BOX:
    case TRC_OP_BEVEL:
        return true;
    default:
        return false;
    }
}

bool trc_op_reads_position(uint32_t op) {
    return op == TRC_OP_POSITION || op == TRC_OP_OBJECT_POSITION || op == TRC_OP_CAMERA_POSITION ||
           op == TRC_OP_WINDOW;
}

/* Whether it gives something else since the point has changed. */
static bool is_changed(const struct trc_build *b, uint32_t op) {
    if (reads_normal(op))
        return true;
    return b->moves_point && (trc_op_reads_position(op) || op == TRC_OP_BESIDE);
}

static const struct trc_build_op *find_equal(const struct trc_build *b, uint32_t hash, uint32_t op,
                                             uint32_t mode, uint32_t resource,
                                             const struct trc_operand *inputs) {
    for (uint32_t i = b->buckets[hash]; i != UINT32_MAX; i = b->ops[i].next) {
        const struct trc_build_op *o = &b->ops[i];
        if (i < b->point_since && is_changed(b, op))
            break; /* chains go back in time */
        if (o->op == op && o->mode == mode && o->resource == resource &&
            (op_infos[op].inputs == 0 || memcmp(b->inputs + o->first_input, inputs,
                                                op_infos[op].inputs * sizeof *inputs) == 0)) {
            return o;
        }
    }
    return NULL;
}

static trc_status append(struct trc_build *b, uint32_t hash, uint32_t op, uint32_t mode,
                         uint32_t resource, const struct trc_operand *inputs) {
    const uint32_t count = op_infos[op].inputs;
    if (b->op_count == MAX_OPS) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "the material needs more than %u operations", MAX_OPS);
    }
    TRC_TRY(trc_build_reserve((void **)&b->ops, &b->op_capacity, b->op_count + 1, sizeof *b->ops));
    /* One more: inputs of an operation that has none are a place in the array, too. */
    TRC_TRY(trc_build_reserve((void **)&b->inputs, &b->input_capacity, b->input_count + count + 1,
                              sizeof *b->inputs));
    b->ops[b->op_count] = (struct trc_build_op){
        .op = (uint16_t)op,
        .mode = (uint16_t)mode,
        .resource = resource,
        .first_input = b->input_count,
        .first_value = b->value_count,
        .next = b->buckets[hash],
    };
    for (uint32_t i = 0; i < count; i++)
        b->inputs[b->input_count++] = inputs[i];
    b->buckets[hash] = b->op_count++;
    b->value_count += op_infos[op].outputs;
    return TRC_OK;
}

trc_status trc_build_op(struct trc_build *b, uint32_t op, uint32_t mode, uint32_t resource,
                        const struct trc_operand *inputs, struct trc_operand *outputs) {
    const struct op_info *info = &op_infos[op];
    if (info->is_pure && all_constant(inputs, info->inputs)) {
        fold(b, op, mode, resource, inputs, outputs);
        return TRC_OK;
    }
    const struct trc_operand *same = identity(op, mode, inputs);
    if (same) {
        memmove(outputs, same, info->outputs * sizeof *outputs);
        return TRC_OK;
    }
    const uint32_t hash = hash_op(op, mode, resource, inputs);
    const struct trc_build_op *o = find_equal(b, hash, op, mode, resource, inputs);
    if (!o) {
        TRC_TRY(append(b, hash, op, mode, resource, inputs));
        o = &b->ops[b->op_count - 1];
    }
    for (uint32_t i = 0; i < info->outputs; i++) {
        outputs[i] = (struct trc_operand){(int32_t)(o->first_value + i), 0.0f};
    }
    return TRC_OK;
}

/* Inputs that a mode of the Math node reads. */
static uint32_t math_arity(uint32_t mode) {
    switch (mode) {
    case TRC_MATH_MULTIPLY_ADD:
    case TRC_MATH_COMPARE:
    case TRC_MATH_SMOOTH_MIN:
    case TRC_MATH_SMOOTH_MAX:
    case TRC_MATH_WRAP:
        return 3;
    case TRC_MATH_ADD:
    case TRC_MATH_SUBTRACT:
    case TRC_MATH_MULTIPLY:
    case TRC_MATH_DIVIDE:
    case TRC_MATH_POWER:
    case TRC_MATH_LOGARITHM:
    case TRC_MATH_MINIMUM:
    case TRC_MATH_MAXIMUM:
    case TRC_MATH_LESS_THAN:
    case TRC_MATH_GREATER_THAN:
    case TRC_MATH_MODULO:
    case TRC_MATH_SNAP:
    case TRC_MATH_PINGPONG:
    case TRC_MATH_ARCTAN2:
        return 2;
    default:
        return 1;
    }
}

trc_status trc_build_math(struct trc_build *b, uint32_t mode, struct trc_operand x,
                          struct trc_operand y, struct trc_operand z, struct trc_operand *out) {
    const uint32_t arity = math_arity(mode);
    const struct trc_operand none = trc_constant(0.0f);
    const struct trc_operand in[TRC_OP_AT(MATH, end)] = {x, arity > 1 ? y : none,
                                                         arity > 2 ? z : none};
    return trc_build_op(b, TRC_OP_MATH, mode, TRC_NO_RESOURCE, in, out);
}
