/* Boxes of refs, as builders hold them. */
#ifndef TRACER_BVH_REF_H
#define TRACER_BVH_REF_H

#include "bvh/tree.h"
#include "core/box.h"

/* Four floats of a ref, of which lane 3 is one of its integers: never used as a number. */
static inline f4 trc_ref_corner(const struct trc_ref *r, size_t offset) {
    i4 v;
    memcpy(&v, (const char *)r + offset, sizeof v);
    return (f4)(v & (i4){-1, -1, -1, 0});
}

static inline struct box trc_ref_box(const struct trc_ref *r) {
    return (struct box){trc_ref_corner(r, offsetof(struct trc_ref, lower)),
                        trc_ref_corner(r, offsetof(struct trc_ref, upper))};
}

/* Twice the middle of its box. */
static inline f4 trc_ref_centroid(const struct trc_ref *r) {
    const struct box b = trc_ref_box(r);
    return b.lower + b.upper;
}

#endif
