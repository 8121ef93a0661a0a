/* Buffers of meshes and curves, instances, poses and rays: any bits. */
#include <stdbool.h>

#include "bytes.h"
#include "stage.h"

#define MOST_KEYS 3
#define MOST_VERTICES 24
#define MOST_TRIANGLES 32
#define RAYS 16

struct buffers {
    float positions[4 * MOST_VERTICES * MOST_KEYS]; /* of points of curves, with radii */
    float normals[9 * MOST_TRIANGLES * MOST_KEYS];
    float generated[3 * MOST_VERTICES];
    uint32_t indices[3 * MOST_TRIANGLES];
    uint8_t smooth[MOST_TRIANGLES];
    uint16_t material[MOST_TRIANGLES];
    uint32_t lengths[MOST_VERTICES];
    float transforms[12 * MOST_KEYS];
};

static trc_status create_mesh(struct bytes *b, trc_scene scene, struct buffers *f,
                              uint32_t *key_count, uint32_t *vertex_count, trc_id *mesh) {
    const uint32_t keys = 1 + bytes_below(b, MOST_KEYS), vertices = bytes_below(b, MOST_VERTICES),
                   triangles = bytes_below(b, MOST_TRIANGLES), kind = bytes_below(b, 3);
    bytes_floats(b, f->positions, (size_t)3 * vertices * keys);
    for (uint32_t i = 0; i < 3 * triangles; i++)
        f->indices[i] = bytes_below(b, vertices + (bytes_below(b, 64) == 0) + !vertices);
    const uint64_t normals = 3ull * keys * (kind == 1 ? vertices : kind == 2 ? 3 * triangles : 0);
    bytes_floats(b, f->normals, normals);
    bytes_floats(b, f->generated, (size_t)3 * vertices);
    bytes_read(b, f->smooth, triangles);
    for (uint32_t i = 0; i < triangles; i++)
        f->material[i] = bytes_byte(b);
    const trc_mesh_desc desc = {
        .struct_size = sizeof desc,
        .key_count = keys,
        .vertex_count = vertices,
        .triangle_count = triangles,
        .positions = f->positions,
        .position_count = 3ull * vertices * keys,
        .indices = f->indices,
        .index_count = 3ull * triangles,
        .normals = kind ? f->normals : NULL,
        .normal_count = normals,
        .normal_kind = kind,
        .smooth = bytes_below(b, 2) ? f->smooth : NULL,
        .material_index = bytes_below(b, 2) ? f->material : NULL,
        .generated = bytes_below(b, 2) ? f->generated : NULL,
        .generated_count = 3ull * vertices,
    };
    *key_count = keys;
    *vertex_count = vertices;
    return trc_mesh_create(scene, &desc, mesh);
}

/* Strands, or balls, of that many points: lengths that sum up to them, now and then one more. */
static trc_status create_curves(struct bytes *b, trc_scene scene, struct buffers *f,
                                uint32_t *key_count, uint32_t *point_count, trc_id *mesh) {
    const uint32_t keys = 1 + bytes_below(b, MOST_KEYS), points = bytes_below(b, MOST_VERTICES);
    uint32_t strands = 0;
    for (uint32_t left = points; left > 0 && strands < MOST_VERTICES; strands++) {
        f->lengths[strands] = 1 + bytes_below(b, left);
        left -= f->lengths[strands];
    }
    if (strands && bytes_below(b, 64) == 0)
        f->lengths[strands - 1] += bytes_below(b, 3) - 1;
    bytes_floats(b, f->positions, (size_t)4 * points * keys);
    bytes_floats(b, f->generated, (size_t)3 * points);
    trc_curves_desc desc = trc_curves_desc_default();
    desc.key_count = keys;
    desc.shape = bytes_below(b, TRC_CURVE_HOLLOW_BALL + 1);
    desc.piece_count = 1 + bytes_below(b, TRC_MAX_CURVE_PIECES);
    desc.point_count = points;
    desc.points = f->positions;
    desc.point_value_count = 4ull * points * keys;
    const bool has_lengths = desc.shape < TRC_CURVE_BALL;
    desc.lengths = has_lengths != (bytes_below(b, 16) == 0) ? f->lengths : NULL;
    desc.strand_count = desc.lengths ? strands : 0;
    desc.generated = bytes_below(b, 2) ? f->generated : NULL;
    desc.generated_count = desc.generated ? 3ull * (desc.lengths ? strands : points) : 0;
    if (bytes_below(b, 2))
        bytes_floats(b, &desc.tolerance, 1);
    *key_count = keys;
    *point_count = points;
    return trc_curves_create(scene, &desc, mesh);
}

static void create_instance(struct bytes *b, trc_scene scene, trc_id mesh, float *transforms) {
    const uint32_t keys = 1 + bytes_below(b, MOST_KEYS);
    for (uint32_t k = 0; k < keys; k++)
        for (int i = 0; i < 12; i++)
            transforms[12 * k + (uint32_t)i] = identity_transform[i];
    if (bytes_below(b, 2))
        bytes_floats(b, transforms, (size_t)12 * keys);
    const trc_instance_desc desc = {.struct_size = sizeof desc,
                                    .key_count = keys,
                                    .mesh = mesh,
                                    .transforms = transforms,
                                    .visibility = bytes_byte(b) & TRC_VISIBLE_ALL,
                                    .shadow_terminator_geometry = 0.1f};
    trc_id id;
    (void)trc_instance_create(scene, &desc, &id);
}

static void query(struct bytes *b, trc_scene scene) {
    float f[9][RAYS];
    uint32_t instance[RAYS], triangle[RAYS];
    uint8_t occluded[RAYS];
    for (int k = 0; k < 9; k++)
        bytes_floats(b, f[k], RAYS);
    const trc_rays rays = {.struct_size = sizeof rays,
                           .visibility = TRC_VISIBLE_ALL,
                           .count = RAYS,
                           .origin_x = f[0],
                           .origin_y = f[1],
                           .origin_z = f[2],
                           .direction_x = f[3],
                           .direction_y = f[4],
                           .direction_z = f[5],
                           .tmin = f[6],
                           .tmax = f[7],
                           .time = f[8]};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = instance, .triangle = triangle};
    (void)trc_query_closest(scene, &rays, bytes_below(b, 2) ? 1 : 64, &hits);
    (void)trc_query_occluded(scene, &rays, 0, occluded, RAYS);
}

/* Another pose of the mesh, or of the curves. */
static void update(struct bytes *b, trc_scene scene, trc_id mesh, bool curves, uint32_t key_count,
                   uint32_t vertex_count, float *values) {
    const uint64_t floats = (curves ? 4ull : 3ull) * vertex_count * key_count;
    bytes_floats(b, values, floats);
    if (curves)
        (void)trc_curves_update(scene, mesh, key_count, values, floats);
    else
        (void)trc_mesh_update(scene, mesh, key_count, values, floats, NULL, 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct buffers f; /* large; one input runs at a time */
    struct bytes b = {data, size};
    const trc_scene scene = stage_scene();
    trc_id mesh = 0;
    uint32_t key_count = 0, vertex_count = 0;
    stage_camera(scene);
    stage_light(scene);
    const bool curves = bytes_below(&b, 2);
    const trc_status status =
        (curves ? create_curves : create_mesh)(&b, scene, &f, &key_count, &vertex_count, &mesh);
    if (status == TRC_OK) {
        for (uint32_t i = bytes_below(&b, 4); i > 0; i--)
            create_instance(&b, scene, mesh, f.transforms);
        const trc_render_desc render = stage_render();
        stage_run(scene, &render);
        query(&b, scene);
        update(&b, scene, mesh, curves, key_count, vertex_count, f.positions);
        stage_run(scene, &render);
    }
    (void)trc_scene_destroy(scene);
    return 0;
}
