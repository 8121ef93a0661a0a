/* What dicing leaves: a descriptor of the refined mesh with the arrays that it points to. */
#ifndef TRACER_DICING_DICED_MESH_H
#define TRACER_DICING_DICED_MESH_H

#include <stdbool.h>

#include "dicing/refined_mesh.h"

/* A descriptor and the arrays of its own that it points to; names of attributes are the caller's.
 */
struct trc_diced_mesh {
    trc_mesh_desc desc; /* without dicing */
    bool is_coarse;     /* it would have had too many triangles */
    uint32_t *indices;
    float *positions, *normals, *generated;
    uint8_t *smooth;
    uint16_t *material_index;
    trc_corner_attribute attributes[TRC_MAX_ATTRIBUTES];
    float *values[TRC_MAX_ATTRIBUTES];
};

/* Describes what is done of a mesh, whose arrays that are laid out alike it takes over.
 * OUT_OF_MEMORY. */
trc_status trc_diced_mesh_describe(struct trc_refined_mesh *mesh, const trc_mesh_desc *desc,
                                   struct trc_diced_mesh *out);

/* One without arrays is fine. */
void trc_diced_mesh_free(struct trc_diced_mesh *diced);

#endif
