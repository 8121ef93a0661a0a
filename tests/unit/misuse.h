/* What the tests of bad input share: checks of a refused call, and a scene that must still work
 * after them. */
#ifndef TRACER_TESTS_UNIT_MISUSE_H
#define TRACER_TESTS_UNIT_MISUSE_H

#include "fixture.h"

#include "core/core.h"

/* The call fails with that status and says why. */
#define REFUSED(expected, call)                     \
    do {                                            \
        (void)trc_fail(TRC_OK, "%s", "");           \
        assert_int_equal((call), (expected));       \
        assert_true(trc_last_message()[0] != '\0'); \
    } while (0)

#define ARGUMENT TRC_ERROR_INVALID_ARGUMENT
#define HANDLE TRC_ERROR_INVALID_HANDLE
#define SIZE TRC_ERROR_STRUCT_SIZE
#define LARGE TRC_ERROR_TOO_LARGE

#define UNTOUCHED UINT64_C(0x1234567812345678)

/* A pointer that is not aligned to 4 bytes. */
static float odd_storage[64];
#define MISALIGNED(type) ((type *)(void *)((char *)odd_storage + 2))

static trc_scene scene; /* of the test that runs */

FIXTURE_INLINE int set_up(void **state) {
    (void)state;
    scene = fixture_scene();
    return 0;
}

/* Whatever was refused, the scene commits and renders. */
FIXTURE_INLINE int tear_down(void **state) {
    (void)state;
    trc_render render = 0;
    const trc_render_desc desc = default_render_desc(40, 8, 1);
    float pixels[40 * 8 * 4];
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, 40 * 8 * 4), TRC_OK);
    for (int i = 0; i < 40 * 8 * 4; i++)
        assert_true(isfinite(pixels[i]));
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    return trc_scene_destroy(scene);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

#endif
