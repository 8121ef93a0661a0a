/* Pictures of the level view (fixture.h): pixels in parallel rays straight down from 1 m above x
 * from 0 to 4 m, columns of 0.25 m. Needs cmocka. */
#ifndef TRACER_TESTS_LEVEL_TEST_H
#define TRACER_TESTS_LEVEL_TEST_H

#include "node_list.h"
#include "picture_test.h"

enum { LEVEL_WIDTH = 16, LEVEL_HEIGHT = 4, LEVEL_PIXELS = LEVEL_WIDTH * LEVEL_HEIGHT };

/* Each pixel shows the point in its middle. */
PICTURE_TEST_INLINE trc_render_desc level_desc(uint32_t samples) {
    trc_render_desc desc = default_render_desc(LEVEL_WIDTH, LEVEL_HEIGHT, samples);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 0.01f;
    return desc;
}

/* The material of a node list; flags: TRC_MATERIAL_* besides the list's. */
PICTURE_TEST_INLINE trc_id level_material(trc_scene scene, const struct node_list *list,
                                          uint32_t surface, uint32_t flags) {
    trc_material_desc desc = node_list_material(list, surface);
    trc_id id = 0;
    desc.flags |= flags;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

/* What is measured with noise: a mean and its standard error. */
struct mean {
    double value, error;
};

/* Of so many values with that sum and sum of squares, both over the count. */
PICTURE_TEST_INLINE struct mean mean_from(double sum, double sum2, int count) {
    return (struct mean){sum, sqrt(fmax(sum2 - sum * sum, 0.0) / (count - 1))};
}

#endif
