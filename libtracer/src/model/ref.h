/* Refs: the primitives of a builder and their boxes. */
#ifndef TRACER_MODEL_REF_H
#define TRACER_MODEL_REF_H

#include <stddef.h>
#include <stdint.h>

#include "core/box.h"

/* One primitive for the builder: its box (of a moving one: the mean over the keys). */
struct trc_ref {
    float lower[3];
    uint32_t part; /* index of the part, see below, and TRC_PART_CLIPPED; TLAS: unused */
    float upper[3];
    /* First triangle of the part's mesh, and in bits 28-31 how many follow it (bvh/cluster.h);
     * TLAS: item. */
    uint32_t primitive;
};
#define TRC_REF_NEXT 0x10000000u
static inline uint32_t trc_ref_first(const struct trc_ref *r) {
    return r->primitive & (TRC_REF_NEXT - 1);
}
static inline uint32_t trc_ref_count(const struct trc_ref *r) {
    return r->primitive / TRC_REF_NEXT + 1;
}

/* In the place of a part: what stands there has a smaller box than its triangles (bvh/clip.h). */
#define TRC_PART_CLIPPED 0x80000000u
#define TRC_PART_INDEX_MASK 0x7fffffffu

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
