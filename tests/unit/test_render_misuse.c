/* Bad input at renders and queries, and the caller's floating-point state, which every call keeps.
 */
#include "misuse.h"

#include <stdbool.h>

#include "core/fpstate.h"

/* ---- renders ---- */

#define REFUSE_RENDER(status, change)                             \
    do {                                                          \
        trc_render_desc desc = default_render_desc(64, 48, 4);    \
        trc_render render = UNTOUCHED;                            \
        change;                                                   \
        REFUSED(status, trc_render_start(scene, &desc, &render)); \
        assert_true(render == UNTOUCHED);                         \
    } while (0)

static void render_frames(void **state) {
    (void)state;
    const uint64_t peak = trc_memory_peak_bytes();
    REFUSE_RENDER(ARGUMENT, desc.width = 0);
    REFUSE_RENDER(ARGUMENT, desc.height = 0);
    REFUSE_RENDER(LARGE, desc.width = 65537);
    REFUSE_RENDER(LARGE, desc.height = UINT32_MAX);
    REFUSE_RENDER(ARGUMENT, desc.crop_width = 8);
    REFUSE_RENDER(ARGUMENT, desc.crop_height = 8);
    REFUSE_RENDER(ARGUMENT, desc.crop_x = 60; desc.crop_width = 5; desc.crop_height = 5);
    REFUSE_RENDER(ARGUMENT, desc.crop_y = UINT32_MAX; desc.crop_width = 5; desc.crop_height = 5);
    REFUSE_RENDER(ARGUMENT, desc.passes = UINT64_C(1) << TRC_PASS_COUNT);
    REFUSE_RENDER(ARGUMENT, desc.cryptomattes = 1u << TRC_CRYPTOMATTE_KINDS);
    REFUSE_RENDER(ARGUMENT, desc.cryptomattes = 1; desc.cryptomatte_depth = 0);
    REFUSE_RENDER(LARGE, desc.aov_value_count = TRC_MAX_AOVS + 1);
    REFUSE_RENDER(LARGE, desc.light_group_count = TRC_MAX_LIGHT_GROUPS + 1);
    REFUSE_RENDER(LARGE, desc.aov_color_count = TRC_MAX_AOVS + 1);
    REFUSE_RENDER(LARGE, desc.cryptomattes = 1; desc.cryptomatte_depth = 17);
    REFUSE_RENDER(ARGUMENT, desc.passes = 1u << TRC_PASS_MIST; desc.mist_start = -1.0f);
    REFUSE_RENDER(ARGUMENT, desc.passes = 1u << TRC_PASS_MIST; desc.mist_depth = NAN);
    REFUSE_RENDER(ARGUMENT, desc.passes = 1u << TRC_PASS_MIST; desc.mist_falloff = 0.0f);
    /* 1.7 terabytes: refused, and not a page of it was touched. */
    REFUSE_RENDER(LARGE, desc.width = 65536; desc.height = 65536;
                  desc.passes = (1u << TRC_PASS_COUNT) - 1);
    assert_true(trc_memory_peak_bytes() - peak < 1u << 20);
}

static void render_settings(void **state) {
    (void)state;
    REFUSE_RENDER(ARGUMENT, desc.integrator = 3);
    REFUSE_RENDER(ARGUMENT, desc.sample_count = 0);
    REFUSE_RENDER(LARGE, desc.sample_count = (1u << 20) + 1);
    REFUSE_RENDER(LARGE, desc.light_samples = 65);
    REFUSE_RENDER(ARGUMENT, desc.attenuation_cutoff = NAN);
    REFUSE_RENDER(ARGUMENT, desc.attenuation_cutoff = -1.0f);
    REFUSE_RENDER(ARGUMENT, desc.filter_glossy = INFINITY);
    REFUSE_RENDER(ARGUMENT, desc.clamp_direct = -1.0f);
    REFUSE_RENDER(ARGUMENT, desc.clamp_indirect = NAN);
    REFUSE_RENDER(ARGUMENT, desc.assembly = TRC_ASSEMBLY_NONE + 1);
    REFUSE_RENDER(ARGUMENT, desc.packet_size = 1);
    REFUSE_RENDER(ARGUMENT, desc.packet_size = 512);
    REFUSE_RENDER(ARGUMENT, desc.sampler = 5);
    REFUSE_RENDER(ARGUMENT, desc.filter = 3);
    REFUSE_RENDER(ARGUMENT, desc.filter_width = 0.0f);
    REFUSE_RENDER(ARGUMENT, desc.filter_width = NAN);
    REFUSE_RENDER(ARGUMENT, desc.film_transparent = 2);
    REFUSE_RENDER(ARGUMENT, desc.film_exposure = -1.0f);
    REFUSE_RENDER(ARGUMENT, desc.film_exposure = NAN);
    REFUSE_RENDER(LARGE, desc.thread_count = 1025);
    REFUSE_RENDER(ARGUMENT, desc.progressive = 2);
    REFUSE_RENDER(ARGUMENT, desc.noise_threshold = NAN);
    REFUSE_RENDER(LARGE, desc.min_samples = (1u << 20) + 1);
    REFUSE_RENDER(ARGUMENT, desc.extra_samples = NAN);
    REFUSE_RENDER(ARGUMENT, desc.extra_samples = -0.1f);
    REFUSE_RENDER(ARGUMENT, desc.extra_samples = 1.5f);
}

static void render_reads(void **state) {
    (void)state;
    trc_render_desc desc = default_render_desc(64, 48, 1);
    desc.crop_x = 3;
    desc.crop_y = 40;
    desc.crop_width = 10;
    desc.crop_height = 8;
    float pixels[10 * 8 * 4 + 1];
    for (size_t i = 0; i < sizeof pixels / sizeof *pixels; i++)
        pixels[i] = -5.0f;
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    REFUSED(ARGUMENT, trc_render_wait(render, NAN));
    assert_int_equal(trc_render_wait(render, INFINITY), TRC_OK);
    REFUSED(ARGUMENT, trc_render_read(render, TRC_PASS_COMBINED, NULL, 320));
    REFUSED(ARGUMENT, trc_render_read(render, TRC_PASS_COMBINED, pixels, 319));
    REFUSED(ARGUMENT, trc_render_read(render, TRC_PASS_COMBINED, pixels, 64 * 48 * 4));
    REFUSED(LARGE, trc_render_read(render, TRC_PASS_COMBINED, pixels, UINT64_MAX));
    REFUSED(ARGUMENT, trc_render_read(render, TRC_PASS_COMBINED, MISALIGNED(float), 320));
    REFUSED(ARGUMENT, trc_render_read(render, TRC_PASS_DEPTH, pixels, 80));
    REFUSED(ARGUMENT, trc_render_read(render, TRC_PASS_COUNT, pixels, 80));
    REFUSED(ARGUMENT, trc_render_read(render, UINT32_MAX, pixels, 80));
    assert_true(pixels[0] == -5.0f && pixels[319] == -5.0f);
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, 320), TRC_OK);
    assert_true(pixels[319] >= 0.0f && pixels[320] == -5.0f);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

/* ---- queries ---- */

static void queries(void **state) {
    (void)state;
    static const float zero[70], one[70] = {1}, down[70] = {-1};
    static uint32_t instance[70];
    static uint8_t occluded[70];
    const trc_rays good = {.struct_size = sizeof good,
                           .visibility = TRC_VISIBLE_ALL,
                           .count = 70,
                           .origin_x = zero,
                           .origin_y = zero,
                           .origin_z = one,
                           .direction_x = zero,
                           .direction_y = zero,
                           .direction_z = down};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = instance};
    trc_hits bad_hits = hits;
    memset(instance, 0x11, sizeof instance);
    memset(occluded, 0x22, sizeof occluded);
#define REFUSE_RAYS(status, change)                                         \
    do {                                                                    \
        trc_rays rays = good;                                               \
        change;                                                             \
        REFUSED(status, trc_query_closest(scene, &rays, 0, &hits));         \
        REFUSED(status, trc_query_occluded(scene, &rays, 0, occluded, 70)); \
    } while (0)
    REFUSED(ARGUMENT, trc_query_closest(scene, NULL, 0, &hits));
    REFUSED(ARGUMENT, trc_query_occluded(scene, NULL, 0, occluded, 70));
    REFUSE_RAYS(SIZE, rays.struct_size--);
    REFUSE_RAYS(ARGUMENT, rays.visibility = 32);
    REFUSE_RAYS(ARGUMENT, rays.flags = 2);
    REFUSE_RAYS(ARGUMENT, rays.reserved = 1);
    REFUSE_RAYS(LARGE, rays.count = UINT64_MAX);
    REFUSE_RAYS(LARGE, rays.count = UINT64_C(1) << 62);
    REFUSE_RAYS(ARGUMENT, rays.origin_x = NULL);
    REFUSE_RAYS(ARGUMENT, rays.direction_z = NULL);
    REFUSE_RAYS(ARGUMENT, rays.origin_y = MISALIGNED(float));
    REFUSE_RAYS(ARGUMENT, rays.tmin = MISALIGNED(float));
    REFUSE_RAYS(ARGUMENT, rays.tmax = MISALIGNED(float));
    REFUSE_RAYS(ARGUMENT, rays.time = MISALIGNED(float));
    for (uint32_t size = 2; size < 300; size++) {
        if (size == 4 || size == 16 || size == 64 || size == 256)
            continue;
        REFUSED(ARGUMENT, trc_query_closest(scene, &good, size, &hits));
        REFUSED(ARGUMENT, trc_query_occluded(scene, &good, size, occluded, 70));
    }
    REFUSED(ARGUMENT, trc_query_closest(scene, &good, 0, NULL));
    bad_hits.struct_size = 0;
    REFUSED(SIZE, trc_query_closest(scene, &good, 0, &bad_hits));
    bad_hits = hits;
    bad_hits.instance = NULL;
    REFUSED(ARGUMENT, trc_query_closest(scene, &good, 0, &bad_hits));
    bad_hits = hits;
    bad_hits.normal_z = MISALIGNED(float);
    REFUSED(ARGUMENT, trc_query_closest(scene, &good, 0, &bad_hits));
    REFUSED(ARGUMENT, trc_query_occluded(scene, &good, 0, NULL, 70));
    REFUSED(ARGUMENT, trc_query_occluded(scene, &good, 0, occluded, 69));
    for (int i = 0; i < 70; i++) {
        assert_int_equal(instance[i], 0x11111111);
        assert_int_equal(occluded[i], 0x22);
    }
    trc_rays none = {.struct_size = sizeof none, .visibility = TRC_VISIBLE_ALL};
    assert_int_equal(trc_query_closest(scene, &none, 0, &hits), TRC_OK);
    assert_int_equal(trc_query_occluded(scene, &none, 0, NULL, 0), TRC_OK);
    assert_int_equal(trc_query_occluded(scene, &good, 0, occluded, 70), TRC_OK);
    for (int i = 0; i < 70; i++)
        assert_in_range(occluded[i], 0, 1);
}

static void isa_values(void **state) {
    (void)state;
    const uint32_t isa = trc_isa();
    REFUSED(ARGUMENT, trc_set_isa(6));
    REFUSED(ARGUMENT, trc_set_isa(UINT32_MAX));
    assert_int_equal(trc_isa(), isa);
    assert_string_equal(trc_isa_name(UINT32_MAX), "unknown");
}

/* ---- the host's floating-point state ---- */

#if defined(__SSE__)
/* Every kind of call, with all exceptions unmasked: an operation of the library in the host's state
 * would end the process. */
static void host_float_state_is_kept(void **state) {
    (void)state;
    const uint32_t former = _mm_getcsr();
    const uint32_t odd = 0x0040u | 0x8000u | 0x4000u; /* DAZ, FTZ, round up, nothing masked */
    const trc_scene_desc scene_desc = default_scene_desc();
    trc_mesh_desc mesh_desc = default_mesh_desc();
    mesh_desc.smooth = cube_smooth;
    const trc_camera_desc camera = default_camera_desc();
    const trc_light_desc light_desc = default_light_desc();
    const trc_render_desc render_desc = default_render_desc(33, 17, 2);
    const trc_image_desc image_desc = default_image_desc();
    struct default_material material_desc;
    default_material_init(&material_desc, TRC_NODE_EMISSION);
    trc_scene own = 0;
    trc_id mesh = 0, instance = 0, light = 0, image = 0;
    trc_id material = 0;
    trc_render render = 0;
    trc_render_progress progress = {.struct_size = sizeof progress};
    static float pixels[33 * 17 * 4];
    static const float zero[3], nan[3] = {NAN, INFINITY, 1e-42f};
    uint32_t hit[3];
    const trc_rays rays = {.struct_size = sizeof rays,
                           .visibility = TRC_VISIBLE_ALL,
                           .count = 3,
                           .origin_x = zero,
                           .origin_y = zero,
                           .origin_z = nan,
                           .direction_x = nan,
                           .direction_y = zero,
                           .direction_z = zero};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = hit};
    bool ok = true;
#define STEP(call)                              \
    do {                                        \
        _mm_setcsr(odd);                        \
        const trc_status s_ = (call);           \
        const uint32_t now_ = _mm_getcsr();     \
        _mm_setcsr(former);                     \
        ok = ok && s_ == TRC_OK && now_ == odd; \
    } while (0)
    STEP(trc_scene_create(&scene_desc, &own));
    STEP(trc_mesh_create(own, &mesh_desc, &mesh));
    STEP(trc_image_create(own, &image_desc, &image));
    STEP(trc_material_create(own, &material_desc.desc, &material));
    trc_instance_desc instance_desc = default_instance_desc(mesh);
    instance_desc.materials = &material;
    instance_desc.material_count = 1;
    STEP(trc_instance_create(own, &instance_desc, &instance));
    STEP(trc_light_create(own, &light_desc, &light));
    STEP(trc_scene_set_camera(own, &camera));
    STEP(trc_scene_commit(own));
    STEP(trc_query_closest(own, &rays, 4, &hits));
    STEP(trc_render_start(own, &render_desc, &render));
    STEP(trc_render_wait(render, 60.0));
    STEP(trc_render_poll(render, &progress));
    STEP(trc_render_read(render, TRC_PASS_COMBINED, pixels, 33 * 17 * 4));
    STEP(trc_render_destroy(render));
    STEP(trc_mesh_update(own, mesh, 1, cube_positions, 24, NULL, 0));
    STEP(trc_scene_commit(own));
    STEP(trc_scene_destroy(own));
    assert_true(ok);
}
#endif

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(render_frames),
        TEST(render_settings),
        TEST(render_reads),
        TEST(queries),
        TEST(isa_values),
#if defined(__SSE__)
        TEST(host_float_state_is_kept),
#endif
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
