#include "bvh/former.h"

#include <stdlib.h>

#include "core/core.h"

static int by_mesh(const void *a, const void *b) {
    const uintptr_t x = (uintptr_t)(*(struct trc_blas *const *)a)->mesh;
    const uintptr_t y = (uintptr_t)(*(struct trc_blas *const *)b)->mesh;
    return x < y ? -1 : x > y;
}

trc_status trc_former_open(const struct trc_bvh *previous, struct trc_former *former) {
    *former = (struct trc_former){0};
    if (!previous || previous->blas_count == 0)
        return TRC_OK;
    former->trees = trc_alloc(previous->blas_count, sizeof *former->trees);
    if (!former->trees)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to find %u trees",
                        previous->blas_count);
    for (uint32_t i = 0; i < previous->blas_count; i++)
        if (previous->blas[i])
            former->trees[former->count++] = previous->blas[i];
    qsort(former->trees, former->count, sizeof *former->trees, by_mesh);
    return TRC_OK;
}

void trc_former_close(struct trc_former *former) { trc_free(former->trees); }

struct trc_blas *trc_former_find(const struct trc_former *former, const struct trc_mesh *mesh) {
    const struct trc_blas wanted = {.mesh = mesh}, *key = &wanted;
    if (former->count == 0)
        return NULL;
    struct trc_blas **found =
        bsearch(&key, former->trees, former->count, sizeof *former->trees, by_mesh);
    return found ? *found : NULL;
}
