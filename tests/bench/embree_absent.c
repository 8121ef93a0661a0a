/* In place of embree.c where there is no Embree. */
#include "embree.h"

struct embree_device *embree_open(uint32_t isa, uint32_t threads) {
    (void)isa;
    (void)threads;
    return NULL;
}

void embree_close(struct embree_device *device) { (void)device; }

struct embree_scene *embree_scene_create(struct embree_device *device, const struct mesh *mesh,
                                         enum embree_use use) {
    (void)device;
    (void)mesh;
    (void)use;
    return NULL;
}

struct embree_scene *embree_curves_create(struct embree_device *device, enum embree_curve curve,
                                          const float *points, uint32_t strand_count,
                                          uint32_t point_count, uint32_t pieces) {
    (void)device;
    (void)curve;
    (void)points;
    (void)strand_count;
    (void)point_count;
    (void)pieces;
    return NULL;
}

void embree_scene_destroy(struct embree_scene *scene) { (void)scene; }

double embree_build_seconds(const struct embree_scene *scene) {
    (void)scene;
    return 0.0;
}

uint64_t embree_build_bytes(const struct embree_scene *scene) {
    (void)scene;
    return 0;
}

double embree_pose(struct embree_scene *scene, const float *positions) {
    (void)scene;
    (void)positions;
    return 0.0;
}

uint32_t embree_contestants(const struct embree_scene *scene, struct contestant out[EMBREE_MODES]) {
    (void)scene;
    (void)out;
    return 0;
}
