/* Dicing: refinement of a mesh that is about to be created, until no edge is longer than asked
 * for. */
#ifndef TRACER_DICING_DICING_H
#define TRACER_DICING_DICING_H

#include "dicing/diced_mesh.h"

/* The diced mesh of a checked descriptor with dicing. INVALID_ARGUMENT for a bad index, TOO_LARGE
 * or OUT_OF_MEMORY, which leave nothing to free. */
trc_status trc_dice(const trc_mesh_desc *desc, struct trc_diced_mesh *diced_out);

#endif
