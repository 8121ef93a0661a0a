/* Orders of rays that have none. */
#include <math.h>
#include <stdlib.h>

#include "api/ray_order.h"
#include "query_test.h"

#define COUNT 5000
#define FIRST 7 /* of the rays that are sorted */
#define INVALID_EVERY 50
#define SIDES 6

static struct ray_set random_rays(void) {
    struct ray_set rays;
    struct rng rng = rng_seed(1);
    ray_set_init(&rays);
    for (uint32_t i = 0; i < FIRST + COUNT; i++) {
        float o[3], d[3];
        for (int k = 0; k < 3; k++) {
            o[k] = rng_range(&rng, -20.0f, 20.0f);
            d[k] = rng_range(&rng, -1.0f, 1.0f);
        }
        if (i % INVALID_EVERY == 0)
            o[i % 3] = NAN;
        ray_set_add_simple(&rays, o, d);
    }
    return rays;
}

/* Twice the dominant axis, one more where the ray goes down it. */
static uint32_t side_of(const float d[3]) {
    int axis = 0;
    for (int k = 1; k < 3; k++)
        axis = fabsf(d[k]) > fabsf(d[axis]) ? k : axis;
    return 2 * (uint32_t)axis + (d[axis] < 0.0f);
}

/* Each ray is there once, those of one side together, those that hit nothing last. */
static void sides_are_together(void **state) {
    (void)state;
    struct ray_set rays = random_rays();
    const trc_rays view = ray_set_view(&rays, 0, rays.count);
    struct trc_ray_order order;
    uint8_t seen[COUNT] = {0};
    uint32_t side = 0, changes = 0;
    bool may_hit = true;
    assert_ok(trc_ray_order_open(COUNT, &order));
    trc_ray_order_sort(&order, &view, FIRST, COUNT);
    for (uint32_t i = 0; i < COUNT; i++) {
        float o[3], d[3];
        assert_in_range(order.order[i], 0, COUNT - 1);
        assert_int_equal(seen[order.order[i]]++, 0);
        ray_set_get(&rays, FIRST + order.order[i], o, d);
        const bool is_valid = !isnan(o[0] + o[1] + o[2]);
        assert_true(may_hit || !is_valid);
        may_hit = is_valid;
        changes += is_valid && i > 0 && side_of(d) != side;
        side = is_valid ? side_of(d) : side;
    }
    assert_false(may_hit);
    assert_int_equal(changes, SIDES - 1);
    trc_ray_order_close(&order);
    ray_set_free(&rays);
}

/* The mean step from an origin to the next of the order, over that of the rays as they are. */
static void neighbours_start_close(void **state) {
    (void)state;
    struct ray_set rays = random_rays();
    const trc_rays view = ray_set_view(&rays, 0, rays.count);
    struct trc_ray_order order;
    double sorted = 0.0, before = 0.0;
    assert_ok(trc_ray_order_open(COUNT, &order));
    trc_ray_order_sort(&order, &view, FIRST, COUNT);
    for (uint32_t i = 1; i < COUNT; i++) {
        double way[2] = {0.0, 0.0};
        for (int k = 0; k < 3; k++) {
            const float *o = rays.origin[k] + FIRST;
            way[0] += pow((double)o[order.order[i]] - (double)o[order.order[i - 1]], 2.0);
            way[1] += pow((double)o[i] - (double)o[i - 1], 2.0);
        }
        if (!isnan(way[0] + way[1])) {
            sorted += sqrt(way[0]);
            before += sqrt(way[1]);
        }
    }
    print_message("steps between origins: %.3f of what they were\n", sorted / before);
    assert_true(sorted < 0.5 * before); /* a cell of 1/8 of an edge or its neighbour: about .2 */
    trc_ray_order_close(&order);
    ray_set_free(&rays);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sides_are_together),
        cmocka_unit_test(neighbours_start_close),
    };
    return cmocka_run_group_tests_name("ray_order", tests, NULL, NULL);
}
