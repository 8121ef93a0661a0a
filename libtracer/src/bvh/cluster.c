/* Clusters of triangles: see cluster.h. */
#include "bvh/cluster.h"

#include "model/ref.h"

#define MAX_TRIANGLES 4
/* Largest area of a cluster's box over the sum of both. Two halves of a quad have .5; at 1, two
 * squares side by side, the SAH cost rises by 5 %. */
#define MAX_AREA 0.9f

bool trc_cluster_join(struct trc_ref *former, const struct trc_ref *next) {
    const uint32_t count = trc_ref_count(former);
    if (former->part != next->part || trc_ref_first(former) + count != trc_ref_first(next) ||
        count == MAX_TRIANGLES)
        return false;
    const struct box a = trc_ref_box(former), b = trc_ref_box(next);
    struct box both = a;
    box_grow(&both, b);
    if (box_area(both) > MAX_AREA * (box_area(a) + box_area(b)))
        return false;
    f4_store3(former->lower, both.lower);
    f4_store3(former->upper, both.upper);
    former->primitive += TRC_REF_NEXT;
    return true;
}

void trc_clusters_open(const struct trc_ref *refs, uint32_t count,
                       struct trc_part_triangle *triangles_out) {
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < trc_ref_count(&refs[i]); k++)
            *triangles_out++ = (struct trc_part_triangle){refs[i].part & TRC_PART_INDEX_MASK,
                                                          trc_ref_first(&refs[i]) + k};
}
