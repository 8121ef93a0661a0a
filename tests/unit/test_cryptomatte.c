/* Cryptomatte: ids of names, tables of mattes, and mattes of a rendered scene. */
#include "model/cryptomatte.h"

#include "fixture.h"
#include "rng.h"

#include <stdio.h>

/* ---- ids ---- */

static uint32_t bits_of(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* From manifests that Cycles wrote; lengths of every remainder by four, and beyond ASCII. */
static void ids_are_the_hashes_of_names(void **state) {
    (void)state;
    static const struct {
        const char *name;
        uint32_t bits;
    } known[] = {
        {"Back", 0x5050d6fb},
        {"default_light", 0xfe269f93},
        {"Matt \xc3\xa9", 0x55914d2a},
        {"default_volume", 0xb331280e},
        {"default_surface", 0x78d05529},
        {"Clear", 0x62965740},
        {"default_background", 0xdba7ec85},
    };
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        assert_int_equal(bits_of(trc_cryptomatte_id(known[i].name)), known[i].bits);
    assert_true(trc_cryptomatte_id(NULL) == 0.0f);
}

/* Two in 256 hashes have an exponent that floats need for themselves. */
static void ids_are_normal_floats(void **state) {
    (void)state;
    uint32_t lowest = 0, highest = 0;
    for (int i = 0; i < 20000; i++) {
        char name[16];
        snprintf(name, sizeof name, "Cube.%03d", i);
        const float id = trc_cryptomatte_id(name);
        assert_true(isnormal(id));
        lowest += (bits_of(id) >> 23 & 255) == 1;
        highest += (bits_of(id) >> 23 & 255) == 254;
    }
    /* Twice the 78 of other exponents. */
    assert_in_range(lowest, 110, 210);
    assert_in_range(highest, 110, 210);
}

/* ---- tables ---- */

static void ranks_are_sorted(void **state) {
    (void)state;
    enum { IDS = 6, PLACES = 8, SAMPLES = 4000 };
    struct rng random = rng_seed(7);
    float expected[IDS] = {0};
    struct trc_matte mattes[PLACES] = {{0}};
    for (int i = 0; i < SAMPLES; i++) {
        const uint32_t id = rng_below(&random, 21); /* 0 six times as often as 5 */
        for (uint32_t k = 0, first = 0; k < IDS; first += IDS - k++)
            if (id >= first && id < first + IDS - k) {
                expected[k] += 0.5f;
                trc_matte_add(mattes, PLACES, (float)(k + 1), 2);
            }
    }
    for (uint32_t layer = 0; layer < PLACES / 2; layer++) {
        float out[4];
        trc_mattes_read(mattes, PLACES, layer, 4 * SAMPLES, out);
        for (uint32_t i = 0; i < 2; i++) {
            const uint32_t rank = 2 * layer + i;
            assert_true(out[2 * i] == (rank < IDS ? (float)(rank + 1) : 0.0f));
            assert_true(out[2 * i + 1] == (rank < IDS ? expected[rank] / SAMPLES : 0.0f));
        }
    }
}

static float id_of(uint32_t bits) {
    float id;
    memcpy(&id, &bits, sizeof id);
    return id;
}

/* Ids of equal weight stand by their bits, whichever came first: as floats some are negative and
 * the order would be another. */
static void ties_stand_by_bits(void **state) {
    (void)state;
    enum { IDS = 4, ORDERS = 24 };
    static const uint32_t ids[IDS] = {0x00800001u, 0x3f800000u, 0x80800000u, 0xc0000000u};
    for (uint32_t order = 0; order < ORDERS; order++) {
        struct trc_matte mattes[IDS + 1] = {{0}};
        uint32_t left[IDS] = {ids[0], ids[1], ids[2], ids[3]};
        trc_matte_add(mattes, IDS + 1, 5.0f, 3); /* the largest of all */
        for (uint32_t k = 0, digits = order; k < IDS; digits /= IDS - k, k++) {
            const uint32_t pick = k + digits % (IDS - k), bits = left[pick];
            left[pick] = left[k];
            trc_matte_add(mattes, IDS + 1, id_of(bits), 2);
        }
        float out[3][4];
        for (uint32_t layer = 0; layer < 3; layer++)
            trc_mattes_read(mattes, IDS + 1, layer, 12, out[layer]);
        assert_true(out[0][0] == 5.0f && out[0][1] == 0.25f);
        for (uint32_t k = 0; k < IDS; k++)
            assert_int_equal(bits_of(out[(k + 1) / 2][2 * ((k + 1) % 2)]), ids[k]);
    }
}

static void full_tables_keep_what_they_have(void **state) {
    (void)state;
    struct trc_matte mattes[2] = {{0}};
    trc_matte_add(mattes, 2, 3.0f, 1);
    trc_matte_add(mattes, 2, 4.0f, 1);
    trc_matte_add(mattes, 2, 5.0f, 9);
    trc_matte_add(mattes, 2, 4.0f, 1);
    float out[4];
    trc_mattes_read(mattes, 2, 0, 4, out);
    assert_true(out[0] == 4.0f && out[1] == 0.5f && out[2] == 3.0f && out[3] == 0.25f);
    trc_mattes_read(mattes, 2, 0, 1, out); /* never more than all */
    assert_true(out[1] == 1.0f && out[3] == 1.0f);
    trc_mattes_read(mattes, 2, 0, 0, out); /* nor anything without samples */
    assert_true(out[0] == 0.0f && out[1] == 0.0f);
}

/* ---- a render ---- */

enum { SIDE = 32, FLOATS = 4 * SIDE * SIDE, LAYERS = 2 };

/* Of the picture: squares one behind the other, the nearest half transparent. */
static const float near_part = 0.0625f, middle_part = 0.25f, far_part = 0.53f;

/* A square before the camera, which covers a part of the picture. */
static void add_square(trc_scene scene, trc_id mesh, float distance, float part, trc_id material,
                       float object, float asset) {
    const float half = 0.5f * distance * sqrtf(part);
    const float transform[12] = {half, 0, 0, 0, 0, half, 0, 0, 0, 0, 1, 5.0f - distance};
    trc_instance_desc desc = default_instance_desc(mesh);
    trc_id id = 0;
    desc.transforms = transform;
    desc.materials = &material;
    desc.material_count = 1;
    desc.cryptomatte_object = object;
    desc.cryptomatte_asset = asset;
    assert_int_equal(trc_instance_create(scene, &desc, &id), TRC_OK);
}

static trc_scene nested_squares(void) {
    trc_scene scene = 0;
    trc_id mesh = 0;
    const trc_scene_desc scene_desc = default_scene_desc();
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    trc_mesh_desc mesh_desc = default_mesh_desc();
    mesh_desc.indices = cube_indices + 6; /* the top face */
    mesh_desc.index_count = 6;
    mesh_desc.triangle_count = 2;
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    const trc_id glass = fixture_transparent(scene, 0.25f, 0.5f, 0.75f, "glass");
    const float both = trc_cryptomatte_id("both");
    add_square(scene, mesh, 4.0f, near_part, glass, trc_cryptomatte_id("near"), both);
    add_square(scene, mesh, 6.0f, middle_part, 0, trc_cryptomatte_id("middle"), both);
    add_square(scene, mesh, 10.0f, far_part, 0, trc_cryptomatte_id("far"), 0.0f);
    const trc_camera_desc camera = default_camera_desc();
    assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

static void draw(trc_scene scene, uint32_t threads,
                 float mattes[TRC_CRYPTOMATTE_KINDS][LAYERS][FLOATS]) {
    trc_render_desc desc = default_render_desc(SIDE, SIDE, 64);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 1.0f;
    desc.thread_count = threads;
    desc.cryptomattes = (1u << TRC_CRYPTOMATTE_KINDS) - 1;
    desc.cryptomatte_depth = 3; /* means 4 */
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    for (uint32_t kind = 0; kind < TRC_CRYPTOMATTE_KINDS; kind++)
        for (uint32_t layer = 0; layer < LAYERS; layer++)
            assert_int_equal(trc_render_read(render, TRC_PASS_CRYPTOMATTE(kind, layer),
                                             mattes[kind][layer], FLOATS),
                             TRC_OK);
    assert_int_equal(trc_render_read(render, TRC_PASS_CRYPTOMATTE(0, LAYERS), mattes[0][0], FLOATS),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

/* Mean coverage of the picture by an id. */
static double coverage(float mattes[LAYERS][FLOATS], const char *name) {
    const float id = trc_cryptomatte_id(name);
    double sum = 0.0;
    for (int layer = 0; layer < LAYERS; layer++)
        for (int i = 0; i < FLOATS; i += 2)
            if (mattes[layer][i] == id)
                sum += (double)mattes[layer][i + 1];
    return sum / (SIDE * SIDE);
}

static void mattes_cover_what_is_seen(void **state) {
    (void)state;
    static float mattes[TRC_CRYPTOMATTE_KINDS][LAYERS][FLOATS],
        other[TRC_CRYPTOMATTE_KINDS][LAYERS][FLOATS];
    const trc_scene scene = nested_squares();
    draw(scene, 1, mattes);
    draw(scene, 3, other);
    assert_memory_equal(mattes, other, sizeof mattes);
    const double near = 0.5 * (double)near_part, middle = (double)middle_part - near,
                 far = (double)(far_part - middle_part);
    const struct {
        const char *name;
        uint32_t kind;
        double part;
    } expected[] = {
        {"near", TRC_CRYPTOMATTE_OBJECT, near},
        {"middle", TRC_CRYPTOMATTE_OBJECT, middle},
        {"far", TRC_CRYPTOMATTE_OBJECT, far},
        {"both", TRC_CRYPTOMATTE_ASSET, near + middle},
        {"glass", TRC_CRYPTOMATTE_MATERIAL, near},
        {"default_surface", TRC_CRYPTOMATTE_MATERIAL, middle + far},
    };
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        const double found = coverage(mattes[expected[i].kind], expected[i].name);
        if (fabs(found - expected[i].part) > 5e-4)
            fail_msg("%s covers %f, not %f", expected[i].name, found, expected[i].part);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ids_are_the_hashes_of_names),
        cmocka_unit_test(ids_are_normal_floats),
        cmocka_unit_test(ranks_are_sorted),
        cmocka_unit_test(ties_stand_by_bits),
        cmocka_unit_test(full_tables_keep_what_they_have),
        cmocka_unit_test(mattes_cover_what_is_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
