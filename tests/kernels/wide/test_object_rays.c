/* Origins of rays in the object space of instances, against long arithmetic: what their images are
 * off by, seen from the world, is within the bound of object_rays.h whatever the matrix. */
#include <math.h>
#include <string.h>

#include "figures.h"
#include "kernels/trace/object_rays.h"
#include "scene/affine.h"
#include "wide_test.h"

#define KEYS 3
#define MATRICES 4000
/* Products of half-ulps are left out of the bound. */
#define HIGHER_ORDERS 1.001L

/* Columns of up to that scale at random angles, that far from the origin. False where two are so
 * near to one that what the first guess is off by, squared, is no longer small. */
static bool random_matrix(struct rng *rng, float scale, float distance, struct trc_affine *m) {
    float column[3][3], away[3];
    for (int k = 0; k < 3; k++) {
        rng_direction(rng, column[k]);
        const float size = scale * rng_range(rng, 0.01f, 1.0f);
        for (int i = 0; i < 3; i++)
            m->m[4 * i + k] = size * column[k][i];
    }
    rng_direction(rng, away);
    for (int i = 0; i < 3; i++)
        m->m[4 * i + 3] = distance * away[i];
    float volume = 0.0f;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        volume += column[0][i] * (column[1][j] * column[2][k] - column[1][k] * column[2][j]);
    }
    return fabsf(volume) > 0.05f;
}

/* Rays from about the object. */
static void make_rays(struct rng *rng, const struct trc_affine *m, struct trc_packet *p) {
    memset(p, 0, sizeof *p);
    for (int k = 0; k < TRC_PACKET_SIZE; k++) {
        float at[3];
        rng_direction(rng, at);
        p->time[k] = rng_unit(rng);
        for (int i = 0; i < 3; i++) {
            p->o[i][k] = m->m[4 * i] * at[0] + m->m[4 * i + 1] * at[1] + m->m[4 * i + 2] * at[2] +
                         m->m[4 * i + 3];
            p->d[i][k] = at[i];
        }
    }
}

/* The largest error of ray k's origin over its bound. The matrix is interpolated as the library
 * does. */
static long double share_of_bound(const struct trc_instance *instance, const struct trc_packet *p,
                                  const struct trc_packet *image, int k) {
    float m[12];
    long double most = 0.0L;
    trc_affine_at(instance, p->time[k], m);
    for (int i = 0; i < 3; i++) {
        long double at = (long double)m[4 * i + 3], reach = 0.0L;
        for (int j = 0; j < 3; j++) {
            const long double term = (long double)m[4 * i + j] * (long double)image->o[j][k];
            at += term;
            reach += fabsl(term);
        }
        most = fmaxl(most, fabsl(at - (long double)p->o[i][k]) / (5.0L * 0x1p-24L * reach));
    }
    return most;
}

static void origins_are_within_their_bound(void **state) {
    (void)state;
    static const float scales[] = {1e-3f, 1.0f, 1e3f}, distances[] = {0.0f, 1.0f, 1e4f, 1e6f};
    struct rng rng = rng_seed(5);
    long double most = 0.0L;
    uint32_t count = 0;
    while (count < MATRICES) {
        struct trc_affine to_world[KEYS], to_object;
        struct trc_packet rays, image;
        const float scale = scales[count % 3], distance = distances[count / 3 % 4];
        if (!random_matrix(&rng, scale, distance, &to_world[0]))
            continue;
        /* In motion the matrix' keys differ by a tenth. */
        for (int key = 1; key < KEYS; key++)
            for (int i = 0; i < 12; i++)
                to_world[key].m[i] = to_world[0].m[i] * rng_range(&rng, 0.9f, 1.1f);
        assert_true(trc_affine_invert(&to_world[0], &to_object));
        const struct trc_instance instance = {.key_count = count / 12 % 2 ? KEYS : 1,
                                              .object_to_world = to_world,
                                              .world_to_object = &to_object};
        make_rays(&rng, &to_world[0], &rays);
        trc_packet_to_object(&instance, &rays, UINT64_MAX, &image);
        for (int k = 0; k < TRC_PACKET_SIZE; k++)
            most = fmaxl(most, share_of_bound(&instance, &rays, &image, k));
        count++;
    }
    print_figure("origins in object space", "off by %.2Lf of their bound", most);
    assert_true(most < HIGHER_ORDERS);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {cmocka_unit_test(origins_are_within_their_bound)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
