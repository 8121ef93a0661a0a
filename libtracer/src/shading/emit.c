/* From operations on values to a program on registers. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

/* Last use of a value: the number of an operation, or one of these. */
#define NEVER_USED UINT32_MAX
#define USED_BY_LEAF (UINT32_MAX - 1)

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to compile a material");
}

/* ---- what is needed ---- */

static void mark_operands(struct trc_build *b, const struct trc_operand *operands, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (operands[i].reg >= 0)
            b->value_is_live[operands[i].reg] = 1;
    }
}

trc_status trc_build_mark(struct trc_build *b) {
    b->value_is_live = trc_alloc_zeroed(b->value_count, 1);
    if (!b->value_is_live)
        return no_memory();
    mark_operands(b, b->leaf_operands, b->leaf_operand_count);
    for (uint32_t i = 0; i < b->leaf_count; i++)
        mark_operands(b, &b->leaves[i].weight, 1);
    for (uint32_t i = b->op_count; i-- > 0;) {
        struct trc_build_op *o = &b->ops[i];
        const uint8_t *live = b->value_is_live + o->first_value;
        o->is_live = memchr(live, 1, trc_op_outputs(o->op)) != NULL || o->op == TRC_OP_SET_NORMAL ||
                     o->op == TRC_OP_SET_POSITION;
        if (!o->is_live)
            continue;
        mark_operands(b, b->inputs + o->first_input, trc_op_inputs(o->op));
        if ((o->op == TRC_OP_IMAGE && live[TRC_OP_OUT_AT(IMAGE, alpha)]) ||
            (o->op == TRC_OP_IMAGE_BOX && live[TRC_OP_OUT_AT(IMAGE_BOX, alpha)])) {
            o->mode |= TRC_IMAGE_MODE_ALPHA;
        }
        if ((o->op == TRC_OP_NOISE && !memchr(live + TRC_OP_OUT_AT(NOISE, color), 1, 3)) ||
            (o->op == TRC_OP_VORONOI && !memchr(live + TRC_OP_OUT_AT(VORONOI, color), 1, 3)))
            o->mode |= TRC_MODE_NO_COLOR;
    }
    return TRC_OK;
}

/* ---- registers ---- */

struct registers {
    const struct trc_build *b;
    uint32_t *last_use; /* of each value */
    uint16_t *reg;      /* of each value */
    uint8_t taken[TRC_MAX_REGISTERS];
    uint32_t count; /* highest one in use so far + 1 */
};

static void find_last_uses(struct registers *r) {
    const struct trc_build *b = r->b;
    for (uint32_t i = 0; i < b->value_count; i++)
        r->last_use[i] = NEVER_USED;
    for (uint32_t i = 0; i < b->op_count; i++) {
        if (!b->ops[i].is_live)
            continue;
        const struct trc_operand *in = b->inputs + b->ops[i].first_input;
        for (uint32_t k = 0; k < trc_op_inputs(b->ops[i].op); k++) {
            if (in[k].reg >= 0)
                r->last_use[in[k].reg] = i;
        }
    }
    for (uint32_t i = 0; i < b->leaf_operand_count; i++) {
        if (b->leaf_operands[i].reg >= 0)
            r->last_use[b->leaf_operands[i].reg] = USED_BY_LEAF;
    }
    for (uint32_t i = 0; i < b->leaf_count; i++) {
        if (b->leaves[i].weight.reg >= 0)
            r->last_use[b->leaves[i].weight.reg] = USED_BY_LEAF;
    }
}

/* The first run of count free registers; UINT32_MAX: none. */
static uint32_t take(struct registers *r, uint32_t count) {
    uint32_t run = 0;
    for (uint32_t i = 0; i < TRC_MAX_REGISTERS; i++) {
        run = r->taken[i] ? 0 : run + 1;
        if (run < count)
            continue;
        const uint32_t first = i + 1 - count;
        memset(r->taken + first, 1, count);
        if (i + 1 > r->count)
            r->count = i + 1;
        return first;
    }
    return UINT32_MAX;
}

/* Registers of one operation's outputs. Those of inputs that it is the last to read are free for
 * them: kernels copy inputs before they write. */
static trc_status place_op(struct registers *r, uint32_t index) {
    const struct trc_build *b = r->b;
    const struct trc_build_op *o = &b->ops[index];
    const struct trc_operand *in = b->inputs + o->first_input;
    const uint32_t count = trc_op_outputs(o->op);
    for (uint32_t k = 0; k < trc_op_inputs(o->op); k++) {
        if (in[k].reg >= 0 && r->last_use[in[k].reg] == index)
            r->taken[r->reg[in[k].reg]] = 0;
    }
    const uint32_t first = take(r, count);
    if (first == UINT32_MAX) {
        return trc_fail(TRC_ERROR_TOO_LARGE,
                        "the material's nodes need more than %d values at the same time",
                        TRC_MAX_REGISTERS);
    }
    for (uint32_t k = 0; k < count; k++) {
        r->reg[o->first_value + k] = (uint16_t)(first + k);
        if (r->last_use[o->first_value + k] == NEVER_USED)
            r->taken[first + k] = 0;
    }
    return TRC_OK;
}

/* ---- output ---- */

static struct trc_operand placed(const struct registers *r, struct trc_operand o) {
    if (o.reg >= 0)
        o.reg = r->reg[o.reg];
    return o;
}

/* Copies the table at first, unless it is there already, and says where it went. */
static uint32_t copy_table(const struct trc_build *b, uint32_t first, struct trc_material *m) {
    const uint32_t floats = 4 * TRC_TABLE_ENTRIES;
    for (uint32_t i = 0; i < m->table_count; i += floats) {
        if (memcmp(m->tables + i, b->tables + first, floats * sizeof(float)) == 0)
            return i;
    }
    memcpy(m->tables + m->table_count, b->tables + first, floats * sizeof(float));
    m->table_count += floats;
    return m->table_count - floats;
}

static void write_op(const struct registers *r, const struct trc_build_op *o,
                     struct trc_material *m) {
    const struct trc_operand *in = r->b->inputs + o->first_input;
    const uint32_t count = trc_op_inputs(o->op);
    m->instructions[m->instruction_count++] = (struct trc_instruction){
        .op = o->op,
        .mode = o->mode,
        .out = r->reg[o->first_value],
        .input_count = (uint16_t)count,
        .first_input = m->operand_count,
        .resource = trc_op_has_table(o->op) ? copy_table(r->b, o->resource, m) : o->resource,
    };
    for (uint32_t k = 0; k < count; k++)
        m->operands[m->operand_count++] = placed(r, in[k]);
}

static void write_leaves(const struct registers *r, struct trc_material *m) {
    const struct trc_build *b = r->b;
    for (uint32_t i = 0; i < b->leaf_count; i++) {
        struct trc_leaf *leaf = &m->leaves[i];
        *leaf = b->leaves[i];
        leaf->weight = placed(r, leaf->weight);
        leaf->first_operand = m->operand_count;
        const struct trc_operand *in = b->leaf_operands + b->leaves[i].first_operand;
        for (uint32_t k = 0; k < leaf->operand_count; k++) {
            m->operands[m->operand_count++] = placed(r, in[k]);
        }
    }
    m->leaf_count = b->leaf_count;
}

/* After the leaves, whose operands end where those of the AOVs begin. */
static void write_aovs(const struct registers *r, struct trc_material *m) {
    const struct trc_build *b = r->b;
    for (uint32_t i = 0; i < b->aov_count; i++) {
        const uint32_t first = b->aovs[i].first_operand;
        const uint32_t end =
            i + 1 < b->aov_count ? b->aovs[i + 1].first_operand : b->leaf_operand_count;
        m->aovs[i] = b->aovs[i];
        m->aovs[i].first_operand = m->operand_count;
        for (uint32_t k = first; k < end; k++)
            m->operands[m->operand_count++] = placed(r, b->leaf_operands[k]);
    }
    m->aov_count = b->aov_count;
}

/* Room for all that is live. */
static trc_status make_room(const struct trc_build *b, struct trc_material *m) {
    uint32_t ops = 0, operands = b->leaf_operand_count, tables = 0;
    for (uint32_t i = 0; i < b->op_count; i++) {
        if (!b->ops[i].is_live)
            continue;
        ops++;
        operands += trc_op_inputs(b->ops[i].op);
        if (trc_op_has_table(b->ops[i].op))
            tables = b->table_count;
    }
    m->operands = operands ? trc_alloc(operands, sizeof *m->operands) : NULL;
    m->instructions = ops ? trc_alloc(ops, sizeof *m->instructions) : NULL;
    m->tables = tables ? trc_alloc(tables, sizeof *m->tables) : NULL;
    m->aovs = b->aov_count ? trc_alloc(b->aov_count, sizeof *m->aovs) : NULL;
    if ((operands && !m->operands) || (ops && !m->instructions) || (tables && !m->tables) ||
        (b->aov_count && !m->aovs)) {
        return no_memory();
    }
    return TRC_OK;
}

static trc_status emit(struct registers *r, struct trc_material *m) {
    const struct trc_build *b = r->b;
    TRC_TRY(make_room(b, m));
    find_last_uses(r);
    for (uint32_t i = 0; i < b->op_count; i++) {
        if (!b->ops[i].is_live)
            continue;
        TRC_TRY(place_op(r, i));
        write_op(r, &b->ops[i], m);
    }
    write_leaves(r, m);
    write_aovs(r, m);
    m->register_count = r->count;
    return TRC_OK;
}

trc_status trc_build_emit(const struct trc_build *b, struct trc_material *m) {
    struct registers r = {.b = b};
    r.last_use = trc_alloc(b->value_count, sizeof *r.last_use);
    r.reg = trc_alloc(b->value_count, sizeof *r.reg);
    const trc_status status = r.last_use && r.reg ? emit(&r, m) : no_memory();
    trc_free(r.last_use);
    trc_free(r.reg);
    return status;
}
