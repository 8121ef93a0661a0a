/* Dicing: refinement of a mesh that is about to be created, until no edge is longer than asked
 * for. */
#ifndef TRACER_SCENE_DICING_H
#define TRACER_SCENE_DICING_H

#include <stdbool.h>

#include "tracer/geometry.h"

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

/* The diced mesh of a checked descriptor with dicing. INVALID_ARGUMENT for a bad index, TOO_LARGE
 * or OUT_OF_MEMORY, which leave nothing to free. */
trc_status trc_dice(const trc_mesh_desc *desc, struct trc_diced_mesh *diced_out);

/* One without arrays is fine. */
void trc_diced_mesh_free(struct trc_diced_mesh *diced);

#endif
