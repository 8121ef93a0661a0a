/* What lies around the vertices of faces, and the rule that each follows: the smooth one, that of a
 * crease along two edges, or that of a corner, which stays. Sharpness by T. DeRose, M. Kass,
 * T. Truong, "Subdivision surfaces in character animation", 1998, with what OpenSubdiv makes of
 * vertices where it ends. A boundary is a crease that does not end. */
#ifndef TRACER_DICING_RINGS_H
#define TRACER_DICING_RINGS_H

#include "dicing/faces.h"

/* Of one vertex. Edges with two faces are inner ones; all others are boundaries. */
struct trc_ring {
    uint32_t face_count;
    uint32_t boundary_count;                 /* edges */
    uint32_t sharp_count, still_sharp_count; /* edges, at this level and at the next one */
    float ending;                            /* sharpness of those that are not any more, summed */
};

/* How much of a vertex follows the smooth rule, and how much that of a crease, along its edges that
 * are sharper than a minimum; the rest stays. */
struct trc_vertex_rule {
    float smooth, crease, sharpness_min;
};

struct trc_rings {
    uint32_t edge_count;
    uint32_t *edges;               /* of the corners, the edge to the next one */
    uint32_t *ends;                /* both of each edge */
    uint32_t *uses;                /* faces of each edge */
    float *sharpness;              /* of each edge; NULL: boundaries alone are sharp */
    struct trc_ring *rings;        /* of each vertex */
    struct trc_vertex_rule *rules; /* of each vertex */
};

/* OUT_OF_MEMORY; free the rings in either case. */
trc_status trc_rings_find(const struct trc_faces *faces, struct trc_rings *rings_out);
void trc_rings_free(struct trc_rings *rings);

/* What is left of a sharpness at the next level. */
float trc_sharpness_after(float sharpness);

/* 0 for a smooth edge, 1 for one that is a crease. */
float trc_edge_rule(const struct trc_rings *rings, size_t edge);

/* Whether an edge is one of the two of a vertex's crease. */
bool trc_is_along_crease(const struct trc_rings *rings, const struct trc_vertex_rule *rule,
                         size_t edge);

#endif
