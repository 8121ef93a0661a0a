/* Ambient occlusion of each vertex of an OBJ file by the public ray queries of libtracer.
 *
 *   ambient_occlusion IN.obj OUT.obj [REACH]
 *
 * OUT is IN's triangles with a grey of 0 to 1 behind each vertex: the part of the hemisphere about
 * its normal, by the cosine, from which nothing within REACH (1) is seen. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tracer/tracer.h"

#define RAYS 256          /* of a vertex; all of one go to one query */
#define OFFSET_SHARE 1e-4 /* of REACH, how far rays start off the surface */

struct model {
    float *positions, *normals; /* three numbers for each vertex */
    uint32_t *indices;
    size_t vertex_count, index_count, vertex_room, index_room;
};

static void fail(const char *what) {
    fprintf(stderr, "ambient_occlusion: %s\n", what);
    exit(EXIT_FAILURE);
}

static void check(trc_status status) {
    if (status != TRC_OK)
        fail(trc_last_message());
}

static void *grown(void *block, size_t count, size_t *room, size_t size) {
    if (count < *room)
        return block;
    *room = 2 * count + 1024;
    block = realloc(block, *room * size);
    if (!block)
        fail("out of memory");
    return block;
}

static void add_face(struct model *m, char *text) {
    uint32_t corners[3];
    int count = 0;
    for (char *word = strtok(text, " \t\r\n"); word; word = strtok(NULL, " \t\r\n")) {
        const long number = strtol(word, NULL, 10);
        corners[count < 2 ? count : 2] =
            (uint32_t)(number < 0 ? (long)m->vertex_count + number : number - 1);
        if (++count < 3)
            continue;
        m->indices = grown(m->indices, m->index_count + 3, &m->index_room, sizeof *m->indices);
        memcpy(m->indices + m->index_count, corners, sizeof corners);
        m->index_count += 3;
        corners[1] = corners[2];
    }
}

static struct model load(const char *path) {
    struct model m = {0};
    char line[4096];
    FILE *file = fopen(path, "r");
    if (!file)
        fail("the model cannot be opened");
    while (fgets(line, sizeof line, file)) {
        float p[3];
        if (sscanf(line, "v %f %f %f", &p[0], &p[1], &p[2]) == 3) {
            m.positions = grown(m.positions, m.vertex_count, &m.vertex_room, sizeof p);
            memcpy(m.positions + 3 * m.vertex_count++, p, sizeof p);
        } else if (line[0] == 'f' && line[1] == ' ') {
            add_face(&m, line + 2);
        }
    }
    fclose(file);
    m.normals = calloc(m.vertex_count + 1, 3 * sizeof *m.normals);
    if (!m.normals)
        fail("out of memory");
    return m;
}

/* The scene: one mesh, one instance. It refuses numbers of vertices that are not there. */
static trc_scene scene_of(const struct model *m) {
    static const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    trc_scene_desc settings = trc_scene_desc_default();
    trc_mesh_desc mesh = trc_mesh_desc_default();
    trc_instance_desc instance = trc_instance_desc_default();
    trc_scene scene;
    trc_id made;
    settings.is_final = 1;
    check(trc_scene_create(&settings, &scene));
    mesh.vertex_count = m->vertex_count, mesh.position_count = 3 * m->vertex_count;
    mesh.triangle_count = m->index_count / 3, mesh.index_count = m->index_count;
    mesh.positions = m->positions, mesh.indices = m->indices;
    check(trc_mesh_create(scene, &mesh, &instance.mesh));
    instance.transforms = identity;
    check(trc_instance_create(scene, &instance, &made));
    check(trc_scene_commit(scene));
    return scene;
}

/* Sums of the faces' normals, by their area. */
static void add_normals(struct model *m) {
    for (size_t i = 0; i < m->index_count; i += 3) {
        const float *p[3];
        for (int c = 0; c < 3; c++)
            p[c] = m->positions + 3 * (size_t)m->indices[i + (size_t)c];
        for (int k = 0; k < 3; k++) {
            const int x = (k + 1) % 3, y = (k + 2) % 3;
            const float area = (p[1][x] - p[0][x]) * (p[2][y] - p[0][y]) -
                               (p[1][y] - p[0][y]) * (p[2][x] - p[0][x]);
            for (int c = 0; c < 3; c++)
                m->normals[3 * (size_t)m->indices[i + (size_t)c] + (size_t)k] += area;
        }
    }
}

/* The open part of one vertex's hemisphere. Directions by the cosine are points on a unit sphere
 * that rests on the surface; those are a Fibonacci lattice. */
static float open_part(trc_scene scene, const float position[3], const float normal[3],
                       float reach) {
    static float origin[3][RAYS], direction[3][RAYS], tmax[RAYS];
    static uint8_t occluded[RAYS];
    const float length =
        sqrtf(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (length == 0.0f)
        return 1.0f; /* a vertex without faces */
    for (int i = 0; i < RAYS; i++) {
        const float z = 1.0f - (2.0f * (float)i + 1.0f) / RAYS, turn = 2.39996323f * (float)i;
        const float r = sqrtf(1.0f - z * z), sphere[3] = {r * cosf(turn), r * sinf(turn), z};
        for (int k = 0; k < 3; k++) {
            direction[k][i] = sphere[k] + 1.0001f * normal[k] / length; /* never zero */
            origin[k][i] = position[k] + (float)OFFSET_SHARE * reach * normal[k] / length;
        }
        tmax[i] =
            reach / sqrtf(direction[0][i] * direction[0][i] + direction[1][i] * direction[1][i] +
                          direction[2][i] * direction[2][i]);
    }
    trc_rays rays = trc_rays_default();
    rays.count = RAYS;
    rays.origin_x = origin[0], rays.origin_y = origin[1], rays.origin_z = origin[2];
    rays.direction_x = direction[0], rays.direction_y = direction[1],
    rays.direction_z = direction[2];
    rays.tmax = tmax;
    check(trc_query_occluded(scene, &rays, 0, occluded, RAYS));
    int open = 0;
    for (int i = 0; i < RAYS; i++)
        open += !occluded[i];
    return (float)open / RAYS;
}

int main(int argc, char **argv) {
    if (argc < 3 || argc > 4)
        fail("usage: ambient_occlusion IN.obj OUT.obj [REACH]");
    const float reach = argc > 3 ? strtof(argv[3], NULL) : 1.0f;
    if (!(reach > 0.0f && reach < INFINITY))
        fail("REACH must be a length above 0");
    struct model m = load(argv[1]);
    const trc_scene scene = scene_of(&m);
    add_normals(&m);
    FILE *out = fopen(argv[2], "w");
    if (!out)
        fail("the result cannot be opened");
    for (size_t i = 0; i < m.vertex_count; i++) {
        const float *p = m.positions + 3 * i;
        const double grey = open_part(scene, p, m.normals + 3 * i, reach);
        fprintf(out, "v %g %g %g %g %g %g\n", (double)p[0], (double)p[1], (double)p[2], grey, grey,
                grey);
    }
    for (size_t i = 0; i < m.index_count; i += 3)
        fprintf(out, "f %u %u %u\n", m.indices[i] + 1, m.indices[i + 1] + 1, m.indices[i + 2] + 1);
    if (fclose(out) != 0)
        fail("the result cannot be written");
    check(trc_scene_destroy(scene));
    free(m.positions), free(m.normals), free(m.indices);
    return EXIT_SUCCESS;
}
