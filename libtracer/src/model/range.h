/* Ranges of refs: what a builder splits. */
#ifndef TRACER_MODEL_RANGE_H
#define TRACER_MODEL_RANGE_H

#include "model/ref.h"

/* Refs that become a child, and as much memory beside them: splits move refs to and fro. */
struct trc_range {
    struct trc_ref *refs, *spare; /* count */
    uint32_t count;
    uint32_t first_slot;          /* triangles of all refs before */
    uint32_t triangles;           /* of its refs */
    struct box bounds, centroids; /* centroids: of lower + upper */
};

/* Boxes within a range count as longer by this part of its longest edge: packets meet a box if one
 * as much wider as they are is met by their middle, and boxes smaller than a packet spare nothing.
 * So of flat ranges, which have the same area however they are cut, squares come out, not strips
 * (docs/measurements.md). */
#define TRC_RANGE_MARGIN 0.1f
static inline float trc_range_margin(const struct trc_range *r) {
    const f4 size = box_size(r->bounds);
    const float yz = size[1] > size[2] ? size[1] : size[2];
    return TRC_RANGE_MARGIN * (size[0] > yz ? size[0] : yz);
}

/* What its refs say: triangles and both boxes. */
static inline void trc_range_measure(struct trc_range *r) {
    r->triangles = 0;
    r->bounds = r->centroids = box_empty();
    for (uint32_t i = 0; i < r->count; i++) {
        r->triangles += trc_ref_count(&r->refs[i]);
        box_grow(&r->bounds, trc_ref_box(&r->refs[i]));
        box_add(&r->centroids, trc_ref_centroid(&r->refs[i]));
    }
}

/* Both parts of a range, the left one of so many refs and triangles, which stand in refs; not
 * measured. */
static inline void trc_range_part(const struct trc_range *r, struct trc_ref *refs,
                                  struct trc_ref *spare, uint32_t left_count,
                                  uint32_t left_triangles, struct trc_range *left,
                                  struct trc_range *right) {
    *left = (struct trc_range){.refs = refs,
                               .spare = spare,
                               .count = left_count,
                               .first_slot = r->first_slot,
                               .triangles = left_triangles};
    *right = (struct trc_range){.refs = refs + left_count,
                                .spare = spare + left_count,
                                .count = r->count - left_count,
                                .first_slot = r->first_slot + left_triangles,
                                .triangles = r->triangles - left_triangles};
}

#endif
