/* From the public node list to a material that kernels run: model/material.h.
 *
 * In order: every node is checked (shading/validate.c); value nodes become operations on floats,
 * which are folded where their inputs are constants, by running the operation itself on the scalar
 * kernels, and shared where they are equal (shading/lower.c, shading/fold.c); mix and add shaders
 * become weights of the leaves below them (shading/leaves.c); operations that no leaf needs are
 * dropped and the rest get registers (shading/emit.c). */
#ifndef TRACER_SHADING_COMPILE_H
#define TRACER_SHADING_COMPILE_H

#include <stdbool.h>

#include "model/material.h"
#include "model/names.h"

struct trc_compile_context {
    struct trc_names *names; /* attribute names are interned here */
    /* Position of a living image in the snapshot's images, UINT32_MAX for another id: such nodes
     * render magenta, as do positions that are NULL or beyond the end when rendering. NULL: none.
     */
    uint32_t (*image_index)(const void *images, trc_id image);
    /* Whether it has smaller levels, so that lookups are worth a footprint. NULL: none has. */
    bool (*image_has_levels)(const void *images, trc_id image);
    const void *images; /* first argument of both */
};

/* One holder: the caller. INVALID_ARGUMENT names the node and the input; TOO_LARGE (counts of the
 * descriptor, TRC_MAX_LEAVES, TRC_MAX_REGISTERS), OUT_OF_MEMORY. The floating-point state must be
 * the default. */
trc_status trc_material_compile(const trc_material_desc *desc,
                                const struct trc_compile_context *context,
                                struct trc_material **material_out);

/* NULL is fine for both. The last release frees. */
struct trc_material *trc_material_retain(struct trc_material *material);
void trc_material_release(struct trc_material *material);

#endif
