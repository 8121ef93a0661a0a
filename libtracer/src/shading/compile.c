/* The compiler's driver and the life of materials. */
#include "shading/compile.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

static void build_free(struct trc_build *b) {
    trc_free(b->ops);
    trc_free(b->inputs);
    trc_free(b->tables);
    trc_free(b->outputs);
    trc_free(b->first_output);
    trc_free(b->height_outputs);
    trc_free(b->height_nodes);
    trc_free(b->value_is_live);
    trc_free(b);
}

static void material_free(struct trc_material *m) {
    trc_material_release(m->displacement);
    trc_material_release(m->shadow);
    trc_free(m->aovs);
    trc_free(m->operands);
    trc_free(m->instructions);
    trc_free(m->tables);
    trc_free(m);
}

static trc_status compile(struct trc_build *b, struct trc_material *m) {
    TRC_TRY(trc_build_values(b));
    TRC_TRY(trc_build_leaves(b));
    TRC_TRY(trc_build_aovs(b));
    TRC_TRY(trc_build_mark(b));
    trc_build_traits(b, m);
    return trc_build_emit(b, m);
}

/* The program that moves vertices. */
static trc_status compile_offset(struct trc_build *b, struct trc_material *m) {
    TRC_TRY(trc_build_offset(b));
    TRC_TRY(trc_build_mark(b));
    return trc_build_emit(b, m);
}

/* What shadow rays need of it. */
static trc_status compile_shadow(struct trc_build *b, struct trc_material *m) {
    TRC_TRY(trc_build_values(b));
    TRC_TRY(trc_build_leaves(b));
    TRC_TRY(trc_build_shadow(b));
    TRC_TRY(trc_build_mark(b));
    trc_build_traits(b, m);
    return trc_build_emit(b, m);
}

/* Whether shadow rays need less than all of a material. */
static bool has_shadow(const struct trc_material *m) {
    bool has_more = false;
    for (uint32_t i = 0; i < m->leaf_count; i++) {
        if (!trc_leaf_has_shadow(&m->leaves[i]))
            return false;
        has_more |= m->leaves[i].type != TRC_NODE_TRANSPARENT;
    }
    return has_more && trc_material_is_clear(m);
}

static trc_status build(const trc_material_desc *desc, const struct trc_compile_context *context,
                        trc_status (*how)(struct trc_build *b, struct trc_material *m),
                        struct trc_material **material_out) {
    struct trc_build *b = trc_alloc_zeroed(1, sizeof *b);
    struct trc_material *m = trc_alloc_zeroed(1, sizeof *m);
    trc_status status = TRC_ERROR_OUT_OF_MEMORY;
    if (b && m) {
        b->desc = desc;
        b->context = context;
        memset(b->buckets, 0xff, sizeof b->buckets);
        atomic_init(&m->refs, 1);
        m->flags = desc->flags;
        m->pass_index = desc->pass_index;
        m->cryptomatte = desc->cryptomatte;
        m->has_film_colors = desc->film_colors != NULL;
        if (desc->film_colors)
            memcpy(m->film_colors, desc->film_colors, sizeof m->film_colors);
        status = how(b, m);
    } else {
        trc_fail(status, "no memory to compile a material");
    }
    if (b)
        build_free(b);
    if (status != TRC_OK) {
        if (m)
            material_free(m);
        return status;
    }
    *material_out = m;
    return TRC_OK;
}

trc_status trc_material_compile(const trc_material_desc *desc,
                                const struct trc_compile_context *context,
                                struct trc_material **material_out) {
    struct trc_material *m;
    TRC_TRY(trc_material_validate(desc));
    TRC_TRY(build(desc, context, compile, &m));
    trc_status status = TRC_OK;
    const uint32_t method = trc_displacement_method_of(trc_displacement_of(desc));
    if (method != TRC_DISPLACEMENT_BUMP)
        status = build(desc, context, compile_offset, &m->displacement);
    m->keeps_normals = method == TRC_DISPLACEMENT_BOTH;
    if (status == TRC_OK && has_shadow(m))
        status = build(desc, context, compile_shadow, &m->shadow);
    if (status != TRC_OK) {
        material_free(m);
        return status;
    }
    *material_out = m;
    return TRC_OK;
}

struct trc_material *trc_material_retain(struct trc_material *material) {
    if (material)
        atomic_fetch_add_explicit(&material->refs, 1, memory_order_relaxed);
    return material;
}

void trc_material_release(struct trc_material *material) {
    if (!material)
        return;
    if (atomic_fetch_sub_explicit(&material->refs, 1, memory_order_acq_rel) == 1) {
        material_free(material);
    }
}
