/* An order for rays that have none in the caller's arrays: neighbours in it go the same way from
 * places close to each other, as packets are best of them. */
#ifndef TRACER_API_RAY_ORDER_H
#define TRACER_API_RAY_ORDER_H

#include <stdint.h>

#include "tracer/query.h"

/* Elements behind an order that may be read, though nothing follows from them. */
#define TRC_RAY_ORDER_ROOM 64

struct trc_ray_key {
    uint32_t key, ray;
};

/* Memory for orders of up to so many rays. */
struct trc_ray_order {
    uint32_t *order; /* of the rays that were sorted last; TRC_RAY_ORDER_ROOM more */
    struct trc_ray_key *keys, *sorted;
};

/* count: at least 1. OUT_OF_MEMORY; closed either way by trc_ray_order_close. */
trc_status trc_ray_order_open(uint32_t count, struct trc_ray_order *order);
void trc_ray_order_close(struct trc_ray_order *order);

/* Fills the order of count rays from number begin on, as numbers from 0 on: by dominant axis and
 * its side, then by cells of origins, then by cells of directions. Rays that hit nothing by the
 * rules of tracer/query.h come last. The same rays always have the same order. */
void trc_ray_order_sort(struct trc_ray_order *order, const trc_rays *rays, uint64_t begin,
                        uint32_t count);

#endif
