/* What the tests of ray queries share: the instruction set under test, how many rays, judgement of
 * whole sets of rays. Needs cmocka. */
#ifndef TRACER_TESTS_QUERY_TEST_H
#define TRACER_TESTS_QUERY_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brute.h"
#include "bvh_check.h"
#include "model/snapshot.h"
#include "query_scene.h"
#include "ray_set.h"
#include "tracer/tracer.h"

#define QUERY_TEST_INLINE static inline __attribute__((unused))

/* The environment variable that sets the number of rays of each case. */
#define QUERY_TEST_RAYS "TRACER_TEST_RAYS"

/* Exit code of a test whose instruction set this CPU lacks. */
#define QUERY_TEST_SKIPPED 77

/* False if the environment wants an instruction set that is not in force. */
QUERY_TEST_INLINE bool query_test_isa(void) {
    const char *wanted = getenv("TRACER_ISA");
    return !wanted || !*wanted || strcmp(wanted, trc_isa_name(trc_isa())) == 0;
}

/* Kernels of few lanes, which take longer and are not the widest of a processor in use. */
QUERY_TEST_INLINE bool query_test_is_narrow(void) {
    return trc_isa() == TRC_ISA_SCALAR || trc_isa() == TRC_ISA_SSE42;
}

/* Rays of a case: from the environment, else usual (a quarter of it for narrow kernels). */
QUERY_TEST_INLINE uint32_t query_test_rays(uint32_t usual) {
    const char *text = getenv(QUERY_TEST_RAYS);
    const long count = text ? strtol(text, NULL, 10) : 0;
    if (count > 0)
        return (uint32_t)count;
    return query_test_is_narrow() ? (usual + 3) / 4 : usual;
}

#define assert_ok(call) query_test_ok((call), __FILE__, __LINE__)
QUERY_TEST_INLINE void query_test_ok(trc_status status, const char *file, int line) {
    if (status != TRC_OK)
        print_error("status %d: %s\n", (int)status, trc_last_message());
    _assert_int_equal((uint64_t)status, TRC_OK, file, line);
}

/* A committed scene whose trees hold their invariants. */
QUERY_TEST_INLINE struct query_scene query_test_scene(const struct query_world *world,
                                                      bool is_final) {
    struct query_scene scene;
    char message[256] = "";
    assert_ok(query_scene_create(world, is_final, 1, &scene));
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene.scene);
    if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
        fail_msg("%s", message);
    return scene;
}

#endif
