/* The rays to measure: of one kind, over tiles of a frame, in the order in which packets take them.
 *
 * Samples come from the renderer's sampler, tiles and batches are cut as kernels/tile/samples.c
 * does it. Secondary rays start at what the pinhole camera sees, off the surface by a small part of
 * the scene's extent, so that both sides of a comparison find the same things. */
#ifndef TRACER_BENCH_RAYS_H
#define TRACER_BENCH_RAYS_H

#include <stdbool.h>
#include <stdint.h>

#include "kernels.h"
#include "options.h"
#include "ray_set.h"
#include "scene.h"

enum ray_kind {
    RAY_PRIMARY, /* pinhole: one origin */
    RAY_LENS,
    RAY_POINT_SHADOW,
    RAY_AREA_SHADOW,
    RAY_MIRROR,
    RAY_REFRACTION,       /* into glass */
    RAY_GLOSSY,           /* Phong lobe of exponent 200 about the mirror direction */
    RAY_HEMISPHERE_SHORT, /* by the cosine, occlusion within a tenth of the extent */
    RAY_HEMISPHERE_LONG,  /* by the cosine, nearest hit */
    RAY_KIND_COUNT
};

enum ray_order {
    RAY_ORDER_AUTO,  /* as the renderer's AUTO assembly */
    RAY_ORDER_PIXEL, /* squares of 8x8 pixels, one sample after the other, never sorted */
    RAY_ORDER_COUNT
};

extern const char *const ray_kind_names[RAY_KIND_COUNT];
extern const char *const ray_order_names[RAY_ORDER_COUNT];

struct ray_list {
    enum ray_kind kind;
    enum ray_order order;
    bool any;           /* occlusion, not the nearest hit */
    bool common_origin; /* of each packet's rays */
    uint32_t bundle;    /* most packets that go through the tree together */
    struct ray_set rays;
    /* Batches follow each other, and so do the packets of a batch: first ray of each, and one more
     * at the end. A packet never holds rays of two batches. */
    uint32_t batch_count, packet_count, packet_capacity;
    uint32_t *batch_begin, *packet_begin;
    uint32_t *batch_packet; /* first packet of each batch, and one more at the end */
    uint32_t *packet_key;   /* of each packet's first ray: packets that go together share it */
};

/* Rays of one batch at most. */
#define RAY_BATCH 1024

/* Makes the rays of a kind; kernels trace the camera rays that others start from. The snapshot is
 * of the scene's world, with motion if moving is set. */
void ray_list_make(struct ray_list *list, enum ray_kind kind, enum ray_order order,
                   const struct bench_scene *scene, bool moving, const struct options *options,
                   const struct trc_snapshot *snapshot, const struct packet_kernels *kernels);
void ray_list_free(struct ray_list *list);

#endif
