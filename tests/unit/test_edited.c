/* A scene that has been edited shows what one shows that was made so: the same bits, whatever of
 * the former state a commit keeps. */
#include "level_test.h"
#include "query_scene.h"

/* A floor under a roof, a sun above, and what is edited of them. */
struct edited {
    trc_scene scene;
    trc_id roof, roof_mesh, roof_instance, world, image;
};

static trc_material_desc node_material(struct node_list *list, uint32_t type, float value) {
    memset(list, 0, sizeof *list);
    if (type == TRC_NODE_EMISSION)
        NODE_ADD(list, type, 0, node_color(value, value, value), node_number(1.0f));
    else if (type == TRC_NODE_TRANSPARENT)
        NODE_ADD(list, type, 0, node_color(value, value, value));
    else
        NODE_ADD(list, type, 0, node_color(value, value, value), node_number(0.0f),
                 node_standard());
    trc_material_desc desc = node_list_material(list, 0);
    desc.flags |= TRC_MATERIAL_SAMPLE_EMISSION;
    return desc;
}

/* An image of one bright texel in the upper half; until the next call. */
static trc_image_desc sky_desc(uint32_t bright) {
    enum { WIDTH = 16, HEIGHT = 8 };
    static float pixels[4 * WIDTH * HEIGHT];
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++)
        for (uint32_t c = 0; c < 4; c++)
            pixels[4 * i + c] = c == 3 || i != bright ? (c == 3 ? 1.0f : 0.01f) : 20.0f;
    trc_image_desc desc = default_image_desc();
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.pixels = pixels;
    desc.pixel_bytes = sizeof pixels;
    return desc;
}

static trc_image_desc no_contents(void) {
    return (trc_image_desc){.struct_size = sizeof(trc_image_desc)};
}

static trc_id add_sky_material(trc_scene scene, trc_id image) {
    struct node_list list = {0};
    const uint32_t texture = NODE_ADD(&list, TRC_NODE_ENVIRONMENT, 0, node_standard());
    list.nodes[texture].image = image;
    const uint32_t surface =
        NODE_ADD(&list, TRC_NODE_BACKGROUND, 0, node_link(texture, 0), node_number(1.0f));
    return level_material(scene, &list, surface, 0);
}

/* roof, value: of its material. */
static struct edited edited_under(uint32_t roof, float value, trc_image_desc sky) {
    struct edited e = {.scene = fixture_level_view()};
    struct node_list list;
    const trc_material_desc roof_desc = node_material(&list, roof, value);
    assert_ok(trc_material_create(e.scene, &roof_desc, &e.roof));
    fixture_level(e.scene, 20.0f, 0.0f, fixture_material(e.scene, TRC_NODE_DIFFUSE, 0.5f));
    static const float corners[12] = {1, -1, 3, 2, -1, 3, 2, 1, 3, 1, 1, 3};
    const trc_mesh_desc quad = fixture_quad_desc(corners);
    assert_ok(trc_mesh_create(e.scene, &quad, &e.roof_mesh));
    e.roof_instance = fixture_instance(e.scene, e.roof_mesh, identity_transform, e.roof, 0);
    trc_light_desc sun = default_light_desc();
    trc_id id = 0;
    sun.type = TRC_LIGHT_SUN;
    sun.strength = (float)PI;
    assert_ok(trc_light_create(e.scene, &sun, &id));
    assert_ok(trc_image_create(e.scene, &sky, &e.image));
    e.world = add_sky_material(e.scene, e.image);
    trc_world_desc world = default_world_desc(e.world);
    world.use_sampling = 1;
    world.map_resolution = 32;
    assert_ok(trc_scene_set_world(e.scene, &world));
    return e;
}

/* bright: the sky's texel. */
static struct edited edited_make(uint32_t roof, float value, uint32_t bright) {
    return edited_under(roof, value, sky_desc(bright));
}

static void draw(trc_scene scene, float pixels[4 * LEVEL_PIXELS]) {
    const trc_render_desc desc = level_desc(4);
    assert_ok(trc_scene_commit(scene));
    render(scene, &desc, pixels);
}

/* Both pictures have the same bits, and the edit is seen. */
static void expect_same(const struct edited *found, const struct edited *want,
                        const float before[4 * LEVEL_PIXELS]) {
    static float a[4 * LEVEL_PIXELS], b[4 * LEVEL_PIXELS];
    draw(found->scene, a);
    draw(want->scene, b);
    assert_memory_equal(a, b, sizeof a);
    assert_memory_not_equal(a, before, sizeof a);
    assert_ok(trc_scene_destroy(found->scene));
    assert_ok(trc_scene_destroy(want->scene));
}

static void materials_change(void **state) {
    (void)state;
    static const struct {
        uint32_t from, to;
        float from_value, to_value;
    } cases[] = {
        {TRC_NODE_DIFFUSE, TRC_NODE_TRANSPARENT, 0.5f, 0.5f},
        {TRC_NODE_TRANSPARENT, TRC_NODE_DIFFUSE, 0.5f, 0.5f},
        {TRC_NODE_DIFFUSE, TRC_NODE_EMISSION, 0.5f, 30.0f},
        {TRC_NODE_EMISSION, TRC_NODE_DIFFUSE, 30.0f, 0.5f},
        {TRC_NODE_EMISSION, TRC_NODE_EMISSION, 1.0f, 30.0f},
    };
    static float before[4 * LEVEL_PIXELS];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct edited e = edited_make(cases[i].from, cases[i].from_value, 40);
        const struct edited fresh = edited_make(cases[i].to, cases[i].to_value, 40);
        struct node_list list;
        draw(e.scene, before);
        const trc_material_desc desc = node_material(&list, cases[i].to, cases[i].to_value);
        assert_ok(trc_material_update(e.scene, e.roof, &desc));
        expect_same(&e, &fresh, before);
    }
}

/* Of the roof, transparent to shadow rays or not. */
static trc_material_desc clear_material(struct node_list *list, bool to_shadows) {
    trc_material_desc desc = node_material(list, TRC_NODE_TRANSPARENT, 0.5f);
    desc.flags &= ~(uint32_t)TRC_MATERIAL_TRANSPARENT_SHADOW;
    desc.flags |= to_shadows ? TRC_MATERIAL_TRANSPARENT_SHADOW : 0;
    return desc;
}

/* A mirror over the floor, and above the roof what shines through all, as far as shadows are asked.
 */
static struct edited edited_with_link(bool to_shadows) {
    static const float above[12] = {-9, -9, 5, 9, -9, 5, 9, 9, 5, -9, 9, 5};
    const struct edited e = edited_make(TRC_NODE_TRANSPARENT, 0.5f, 40);
    struct node_list list;
    trc_material_desc desc = clear_material(&list, to_shadows);
    trc_id lamp = 0, mesh = 0, id = 0;
    assert_ok(trc_material_update(e.scene, e.roof, &desc));
    fixture_level(e.scene, 20.0f, 0.1f, fixture_glossy(e.scene, 0.8f, 0.0f));
    desc = node_material(&list, TRC_NODE_EMISSION, 5.0f);
    assert_ok(trc_material_create(e.scene, &desc, &lamp));
    const trc_mesh_desc quad = fixture_quad_desc(above);
    assert_ok(trc_mesh_create(e.scene, &quad, &mesh));
    trc_instance_desc instance = default_instance_desc(mesh);
    instance.materials = &lamp;
    instance.material_count = 1;
    instance.shadow_exclude = 1; /* of what has set 0: all */
    assert_ok(trc_instance_create(e.scene, &instance, &id));
    return e;
}

/* What is transparent hides lights with linked shadows from reflections if it is not to shadow
 * rays. */
static void what_hides_linked_lights_changes(void **state) {
    (void)state;
    static float before[4 * LEVEL_PIXELS];
    for (int k = 0; k < 2; k++) {
        const struct edited e = edited_with_link(k == 0), fresh = edited_with_link(k == 1);
        struct node_list list;
        draw(e.scene, before);
        const trc_material_desc desc = clear_material(&list, k == 1);
        assert_ok(trc_material_update(e.scene, e.roof, &desc));
        expect_same(&e, &fresh, before);
    }
}

/* Trees whose leaves say what is transparent stay while that does, and are refitted. */
static void trees_of_transparent_meshes_stay(void **state) {
    (void)state;
    static const float moved[12] = {1.5f, -1, 3, 3, -1, 3, 3, 1, 2, 1.5f, 1, 2};
    static float before[4 * LEVEL_PIXELS];
    const struct edited e = edited_make(TRC_NODE_TRANSPARENT, 0.5f, 40);
    const struct edited fresh = edited_make(TRC_NODE_TRANSPARENT, 0.5f, 40);
    draw(e.scene, before);
    assert_int_equal(query_scene_stats(e.scene).built_count, 2);
    fixture_quad(e.scene, moved, e.roof);
    assert_ok(trc_scene_commit(e.scene));
    assert_int_equal(query_scene_stats(e.scene).built_count, 1); /* the new one */
    assert_ok(trc_mesh_update(e.scene, e.roof_mesh, 1, moved, 12, NULL, 0));
    assert_ok(trc_scene_commit(e.scene));
    assert_int_equal(query_scene_stats(e.scene).built_count, 0);
    assert_int_equal(query_scene_stats(e.scene).refitted_count, 1);
    assert_ok(trc_mesh_update(fresh.scene, fresh.roof_mesh, 1, moved, 12, NULL, 0));
    fixture_quad(fresh.scene, moved, fresh.roof);
    expect_same(&e, &fresh, before);
}

/* The image goes and the world is magenta; its map then is that of an even one. */
static void images_of_the_world_change(void **state) {
    (void)state;
    static float before[4 * LEVEL_PIXELS];
    const struct edited e = edited_make(TRC_NODE_DIFFUSE, 0.5f, 40);
    const struct edited fresh = edited_make(TRC_NODE_DIFFUSE, 0.5f, 40);
    draw(e.scene, before);
    assert_ok(trc_image_destroy(e.scene, e.image));
    assert_ok(trc_image_destroy(fresh.scene, fresh.image)); /* before its first commit */
    expect_same(&e, &fresh, before);
}

/* Without contents an image is magenta, as one that is gone; it gets them before or after the first
 * commit, others, and loses them. */
static void images_get_contents(void **state) {
    (void)state;
    static float before[4 * LEVEL_PIXELS];
    const trc_image_desc none = no_contents();
    const struct edited late = edited_under(TRC_NODE_DIFFUSE, 0.5f, none);
    const struct edited gone = edited_make(TRC_NODE_DIFFUSE, 0.5f, 40);
    assert_ok(trc_image_destroy(gone.scene, gone.image));
    memset(before, 0, sizeof before);
    expect_same(&late, &gone, before);
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t wanted = k == 2 ? 70 : 40;
        const struct edited e = edited_under(TRC_NODE_DIFFUSE, 0.5f, none);
        if (k == 0)
            memset(before, 0, sizeof before);
        else
            draw(e.scene, before);
        trc_image_desc sky = sky_desc(40);
        assert_ok(trc_image_update(e.scene, e.image, &sky));
        if (k == 2) {
            draw(e.scene, before);
            sky = sky_desc(wanted);
            assert_ok(trc_image_update(e.scene, e.image, &sky));
        }
        const struct edited fresh = edited_make(TRC_NODE_DIFFUSE, 0.5f, wanted);
        expect_same(&e, &fresh, before);
    }
    const struct edited emptied = edited_make(TRC_NODE_DIFFUSE, 0.5f, 40);
    const struct edited empty = edited_under(TRC_NODE_DIFFUSE, 0.5f, none);
    draw(emptied.scene, before);
    assert_ok(trc_image_update(emptied.scene, emptied.image, &none));
    expect_same(&emptied, &empty, before);
}

/* Several at once, as one by one; all or none. */
static void instances_move(void **state) {
    (void)state;
    static const float places[24] = {1, 0, 0, 0.7f, 0, 1, 0, 0,    0, 0, 1, 0,
                                     1, 0, 0, 1.5f, 0, 1, 0, 0.3f, 0, 0, 1, 1};
    static float before[4 * LEVEL_PIXELS], after[4 * LEVEL_PIXELS];
    const struct edited e = edited_make(TRC_NODE_DIFFUSE, 0.5f, 40);
    const struct edited fresh = edited_make(TRC_NODE_DIFFUSE, 0.5f, 40);
    trc_id moved[2] = {e.roof_instance};
    moved[1] = fixture_instance(e.scene, e.roof_mesh, identity_transform, e.roof, 0);
    draw(e.scene, before);
    const trc_id refused[2] = {moved[0], e.roof_mesh};
    assert_int_equal(trc_instances_move(e.scene, refused, 2, 1, places, 24),
                     TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_instances_move(e.scene, moved, 1, 2, places, 24),
                     TRC_ERROR_INVALID_ARGUMENT); /* it has one key */
    assert_int_equal(trc_instances_move(e.scene, moved, 2, 1, places, 12),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_instances_move(e.scene, moved, UINT64_MAX / 16, 32, places, 24),
                     TRC_ERROR_TOO_LARGE);
    assert_int_equal(trc_instances_move(e.scene, NULL, 2, 1, places, 24),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_ok(trc_instances_move(e.scene, NULL, 0, 1, NULL, 0));
    draw(e.scene, after);
    assert_memory_equal(before, after, sizeof before);
    assert_ok(trc_instances_move(e.scene, moved, 2, 1, places, 24));
    trc_instance_desc desc = default_instance_desc(fresh.roof_mesh);
    desc.transforms = places;
    desc.materials = &fresh.roof;
    desc.material_count = 1;
    assert_ok(trc_instance_update(fresh.scene, fresh.roof_instance, &desc));
    fixture_instance(fresh.scene, fresh.roof_mesh, places + 12, fresh.roof, 0);
    expect_same(&e, &fresh, before);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(materials_change),
        cmocka_unit_test(what_hides_linked_lights_changes),
        cmocka_unit_test(trees_of_transparent_meshes_stay),
        cmocka_unit_test(images_of_the_world_change),
        cmocka_unit_test(images_get_contents),
        cmocka_unit_test(instances_move),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
