#include "bvh/cluster.h"

#include "core/box.h"

#define MOST_TRIANGLES 4
/* Largest area of a cluster's box over the sum of both. Two halves of a quad have .5; at 1, two
 * squares side by side, the SAH cost rises by 5 %. */
#define MOST_AREA 0.9f

static inline struct box ref_box(const struct trc_ref *r) {
    return (struct box){f4_load3(r->lower), f4_load3(r->upper)};
}

bool trc_cluster_join(struct trc_ref *former, const struct trc_ref *next) {
    const uint32_t count = trc_ref_count(former);
    if (former->part != next->part || trc_ref_first(former) + count != trc_ref_first(next) ||
        count == MOST_TRIANGLES)
        return false;
    const struct box a = ref_box(former), b = ref_box(next);
    struct box both = a;
    box_grow(&both, b);
    if (box_area(both) > MOST_AREA * (box_area(a) + box_area(b)))
        return false;
    f4_store3(former->lower, both.lower);
    f4_store3(former->upper, both.upper);
    former->primitive += TRC_REF_NEXT;
    return true;
}

/* Appends the triangles of a leaf's refs; its reference by slots. */
static uint32_t leaf_open(uint32_t leaf, const struct trc_ref *refs, uint32_t *slot_in_out,
                          struct trc_part_triangle *triangles_out) {
    const struct trc_ref *ref = refs + trc_leaf_first(leaf), *end = ref + trc_leaf_count(leaf);
    const uint32_t first = *slot_in_out;
    uint32_t slot = first;
    for (; ref < end; ref++)
        for (uint32_t i = 0; i < trc_ref_count(ref); i++)
            triangles_out[slot++] = (struct trc_part_triangle){ref->part, trc_ref_first(ref) + i};
    *slot_in_out = slot;
    return trc_leaf_ref(first, slot - first);
}

void trc_clusters_open(struct trc_topology *topology, const struct trc_ref *refs,
                       struct trc_part_triangle *triangles_out) {
    uint32_t slot = 0;
    if (trc_is_leaf(topology->root))
        topology->root = leaf_open(topology->root, refs, &slot, triangles_out);
    for (uint32_t node = 0; node < topology->node_count; node++)
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            uint32_t *child = &topology->children[node][i];
            if (trc_is_leaf(*child))
                *child = leaf_open(*child, refs, &slot, triangles_out);
        }
}
