/* Small pictures with their counts of samples, and means of many, for tests of sampling by noise.
 */
#ifndef TRACER_TESTS_COUNTED_PICTURE_H
#define TRACER_TESTS_COUNTED_PICTURE_H

#include "fixture.h"

#include <math.h>
#include <stdlib.h>

enum { WIDTH = 70, HEIGHT = 50, FRAME = WIDTH * HEIGHT };

struct picture {
    float combined[4 * FRAME], counts[FRAME];
    trc_render_progress progress;
};

/* For groups of tests of one scene, fixture_scene()'s: state is its handle. */
static inline int fixture_setup(void **state) {
    static trc_scene scene;
    scene = fixture_scene();
    *state = &scene;
    return 0;
}
static inline int fixture_teardown(void **state) {
    return trc_scene_destroy(*(const trc_scene *)*state) == TRC_OK ? 0 : 1;
}

/* A render of WIDTH x HEIGHT with the pass of counts, to be freed. */
static inline struct picture *picture_draw(trc_scene scene, const trc_render_desc *desc) {
    struct picture *p = malloc(sizeof *p);
    trc_render render = 0;
    assert_non_null(p);
    assert_int_equal(trc_render_start(scene, desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    p->progress = (trc_render_progress){.struct_size = sizeof p->progress};
    assert_int_equal(trc_render_poll(render, &p->progress), TRC_OK);
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, p->combined, 4 * FRAME), TRC_OK);
    assert_int_equal(trc_render_read(render, TRC_PASS_SAMPLE_COUNT, p->counts, FRAME), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    return p;
}

/* Means of a quantity and of how many samples they took. */
struct moments {
    double sum, sum2, samples;
    uint64_t count;
};

static inline void moments_add(struct moments *m, double mean, double samples) {
    m->sum += mean;
    m->sum2 += mean * mean;
    m->samples += samples;
    m->count++;
}

static inline double moments_mean(const struct moments *m) { return m->sum / (double)m->count; }

/* Square of the mean's standard error. */
static inline double moments_variance(const struct moments *m) {
    const double mean = moments_mean(m);
    return (m->sum2 / (double)m->count - mean * mean) / (double)m->count;
}

/* Adds the mean green of a picture and of its counts. */
static inline void moments_add_picture(struct moments *m, const struct picture *p) {
    double mean = 0.0, samples = 0.0;
    for (uint32_t i = 0; i < FRAME; i++) {
        mean += (double)p->combined[4 * i + 1] / FRAME;
        samples += (double)p->counts[i] / FRAME;
    }
    moments_add(m, mean, samples);
}

/* Fails if two means are more than four standard errors apart. */
static inline void moments_require_same(const struct moments *a, const struct moments *b) {
    const double error = sqrt(moments_variance(a) + moments_variance(b));
    const double apart = moments_mean(a) - moments_mean(b);
    print_message("means %.6f, %.6f of %.1f, %.1f samples: %.2f standard errors (%.2e) apart\n",
                  moments_mean(a), moments_mean(b), a->samples / (double)a->count,
                  b->samples / (double)b->count, apart / error, error / moments_mean(b));
    assert_true(fabs(apart) < 4.0 * error);
}

#endif
