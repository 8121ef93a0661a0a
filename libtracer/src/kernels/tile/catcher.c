/* Shadow catchers: objects that stand for those of the footage behind the picture.
 *
 * Where the camera sees one, its ray is split. One half goes on as ever and finds the catcher's
 * light as it is; the other, unblocked half meets shadow catchers alone, and lights of the footage.
 * Both have the same random numbers, so that they differ by what is in the way alone. Their sums
 * over a pixel's samples make the ratio by which the footage darkens (film/film.h). Catchers take
 * light from each other in both halves, hence not at all; what they reflect of the other objects
 * counts as change, too. Behaviour as in Cycles from 3.0 on. */
#include "kernels/tile/tile.h"

/* The first catcher of a path straight from the camera. */
static bool is_caught(const struct trc_tile *t, uint32_t ray) {
    const uint32_t straight = TRC_PATH_TRANSPARENT_BACKGROUND, hit = t->hits.instance[ray];
    const uint32_t path = t->work.w[TRC_RAY_PATH][ray];
    return (path & (straight | TRC_PATH_CAUGHT)) == straight && hit != TRC_NO_HIT &&
           t->snapshot->instances[hit].visibility & TRC_VISIBLE_UNBLOCKED;
}

/* Appends a ray with its hit once more. */
static uint32_t duplicate(struct trc_tile *t, uint32_t ray) {
    struct trc_hit_store *h = &t->hits;
    const uint32_t other = trc_rays_duplicate(&t->work, ray);
    float *const floats[] = {h->t, h->u, h->v};
    uint32_t *const words[] = {h->instance, h->triangle, h->material};
    for (int k = 0; k < 3; k++) {
        floats[k][other] = floats[k][ray];
        words[k][other] = words[k][ray];
    }
    return other;
}

void trc_catcher_split(struct trc_tile *t) {
    struct trc_ray_store *r = &t->work;
    const uint32_t count = r->count;
    trc_rays_reserve(r, r->capacity - count);
    for (uint32_t ray = 0; ray < count; ray++) {
        if (!is_caught(t, ray))
            continue;
        /* The picture has a hole here, as large as what the catcher covers of the footage, less
         * what may be seen through itself. */
        const uint32_t slot = r->w[TRC_RAY_SLOT][ray];
        const uint32_t blocked = slot + TRC_ROW_BLOCKED * TRC_CATCHER_BATCH;
        const float seen = (r->f[TRC_RAY_WEIGHT_R][ray] + r->f[TRC_RAY_WEIGHT_G][ray] +
                            r->f[TRC_RAY_WEIGHT_B][ray]) /
                           3.0f;
        t->samples.transparency[slot] += seen;
        t->samples.transparency[blocked] -= seen;
        r->w[TRC_RAY_PATH][ray] |= TRC_PATH_CAUGHT;
        const uint32_t other = duplicate(t, ray);
        r->w[TRC_RAY_SLOT][ray] = blocked;
        r->w[TRC_RAY_SLOT][other] = slot + TRC_ROW_UNBLOCKED * TRC_CATCHER_BATCH;
        r->w[TRC_RAY_PATH][other] |= TRC_VISIBLE_UNBLOCKED;
    }
}
