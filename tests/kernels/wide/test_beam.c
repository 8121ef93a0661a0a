/* What a beam knows of the precision of triangles before any of its rays is tested: not less than
 * what each of them would say itself. */
#include <math.h>
#include <string.h>

#define TRC_WALK_PACKETS 2

#include "figures.h"
#include "kernels/trace/beam.h"
#include "wide_test.h"

enum { ROUNDS = 2000 };

/* Rays about z from near one point, or from one exactly, that begin at tmin. */
static void make_rays(struct rng *rng, bool is_common, struct trc_packet *packets) {
    memset(packets, 0, TRC_WALK_PACKETS * sizeof *packets);
    const float spread = exp2f(rng_range(rng, -8.0f, 0.0f)), side = rng_unit(rng) < 0.5f ? -1 : 1;
    const float start = rng_range(rng, 0.0f, 2.0f);
    for (int k = 0; k < TRC_WALK_PACKETS; k++) {
        struct trc_packet *p = &packets[k];
        p->common_origin = is_common;
        p->active = UINT64_MAX;
        for (int i = 0; i < TRC_PACKET_SIZE; i++) {
            for (int axis = 0; axis < 3; axis++)
                p->o[axis][i] = is_common ? 0.5f : rng_range(rng, 0.3f, 0.7f);
            p->d[0][i] = rng_range(rng, -spread, spread);
            p->d[1][i] = rng_range(rng, -spread, spread);
            p->d[2][i] = side;
            p->tmin[i] = start;
            p->t[i] = INFINITY;
        }
    }
}

/* A tree about the origins that ends soon on either side. */
static struct trc_tree make_tree(struct rng *rng) {
    struct trc_tree tree = {.extent = 5.0f};
    for (int axis = 0; axis < 3; axis++) {
        tree.lower[axis] = axis < 2 ? -4.0f : -4.0f * rng_unit(rng);
        tree.upper[axis] = axis < 2 ? 5.0f : 1.0f + 4.0f * rng_unit(rng);
    }
    return tree;
}

/* Triangles of the tree from end to end of it, narrow and wide. */
static void make_corners(struct rng *rng, const struct trc_tree *tree, f8 v[3][3]) {
    for (int i = 0; i < 8; i++) {
        const float width = exp2f(rng_range(rng, -6.0f, 2.0f));
        for (int corner = 0; corner < 3; corner++) {
            v[corner][0][i] = 0.5f + rng_range(rng, -width, width);
            v[corner][1][i] = 0.5f + rng_range(rng, -width, width);
            v[corner][2][i] = rng_range(rng, tree->lower[2], tree->upper[2]);
        }
    }
}

/* The largest of what a ray says over what the beam says, of triangle i. */
static double ray_share(const struct trc_packet *p, const struct trc_sheared *g, int ray,
                        f8 v[3][3], const struct trc_precision8 *most, int i) {
    float x = 0.0f, y = 0.0f, z = 0.0f, low = INFINITY, high = -INFINITY;
    for (int corner = 0; corner < 3; corner++) {
        const float dz = v[corner][2][i] - p->o[2][ray];
        x = fmaxf(x, fabsf(v[corner][0][i] - p->o[0][ray] - g->su[ray] * dz));
        y = fmaxf(y, fabsf(v[corner][1][i] - p->o[1][ray] - g->sv[ray] * dz));
        z = fmaxf(z, fabsf(dz));
        low = fminf(low, dz);
        high = fmaxf(high, dz);
    }
    const float weight = vf_get(trc_weight_error(vf_set(x), vf_set(y), vf_set(z), vf_set(1.0f)), 0);
    return fmax((double)(weight / most->weight_error[i]),
                fmax((double)(z / most->z[i]), (double)((high - low) / most->range[i])));
}

static void beams_do_not_promise_too_much(void **state) {
    (void)state;
    static struct trc_packet packets[TRC_WALK_PACKETS];
    static struct trc_group group;
    struct rng rng = rng_seed(7);
    struct trc_live all;
    double most_share = 0.0;
    uint64_t triangles = 0;
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        all.of[k] = UINT64_MAX;
    for (int round = 0; round < ROUNDS; round++) {
        struct trc_beam_corners corners;
        struct trc_precision8 most;
        f8 v[3][3];
        make_rays(&rng, round & 1, packets);
        const struct trc_tree tree = make_tree(&rng);
        make_corners(&rng, &tree, v);
        if (!trc_group_setup(&group, packets, &tree, &all, 2, packets->d[2][0] < 0.0f ? 1 : 0))
            continue;
        for (int c = 0; c < 3; c++)
            trc_beam_corners_set(&group.beam, c, v[c][0], v[c][1], v[c][2], &corners);
        const uint32_t met = trc_beam_triangles(&group, &corners, NULL, true, &most);
        for (uint32_t bits = met; bits; bits &= bits - 1) {
            const int i = __builtin_ctz(bits);
            triangles++;
            for (int k = 0; k < TRC_WALK_PACKETS; k++)
                for (int ray = 0; ray < TRC_PACKET_SIZE; ray++)
                    most_share =
                        fmax(most_share, ray_share(&packets[k], &group.of[k], ray, v, &most, i));
        }
    }
    print_figure("precision of triangles by beams", "rays use %.3f of it", most_share);
    assert_true(triangles > ROUNDS);
    assert_true(most_share <= 1.0);
    assert_true(most_share > 0.5);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {cmocka_unit_test(beams_do_not_promise_too_much)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
