/* A small scene that uses every kind of object, for the unit tests. */
#ifndef TRACER_TESTS_UNIT_FIXTURE_H
#define TRACER_TESTS_UNIT_FIXTURE_H

/* What cmocka.h needs, in its order. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "default_descs.h"

#define FIXTURE_INLINE static inline __attribute__((unused))

/* A committed scene: a cube with the default material, a light, a camera. */
FIXTURE_INLINE trc_scene fixture_scene(void) {
    trc_scene scene = 0;
    trc_id mesh = 0, instance = 0, light = 0;
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    const trc_camera_desc camera_desc = default_camera_desc();
    const trc_light_desc light_desc = default_light_desc();
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    const trc_instance_desc instance_desc = default_instance_desc(mesh);
    assert_int_equal(trc_instance_create(scene, &instance_desc, &instance), TRC_OK);
    assert_int_equal(trc_light_create(scene, &light_desc, &light), TRC_OK);
    assert_int_equal(trc_scene_set_camera(scene, &camera_desc), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

#endif
