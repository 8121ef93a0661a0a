/* The trees of a former snapshot, found by their mesh in logarithmic time. */
#ifndef TRACER_BVH_FORMER_H
#define TRACER_BVH_FORMER_H

#include "model/tree.h"
#include "tracer/base.h"

struct trc_former {
    struct trc_blas **trees; /* in the order of their meshes' places in memory; not owned */
    uint32_t count;
};

/* previous: NULL for none; it must outlive former. */
trc_status trc_former_open(const struct trc_bvh *previous, struct trc_former *former);
void trc_former_close(struct trc_former *former);

/* NULL if the mesh had none. */
struct trc_blas *trc_former_find(const struct trc_former *former, const struct trc_mesh *mesh);

#endif
