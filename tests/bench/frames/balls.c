#include "balls.h"

#include <math.h>
#include <string.h>

#define CUBE 4.0f           /* edge, metres; its middle is the origin */
#define SHARE_OF_CELL 0.4f  /* a ball's radius */
#define INSTANCED_STACKS 16 /* 960 triangles */

static void stage_look(struct stage *stage) {
    for (int i = 0; i < STAGE_EYES; i++) {
        const float angle = 0.6f + 0.5f * (float)i;
        const float eye[3] = {1.6f * CUBE * cosf(angle), 1.6f * CUBE * sinf(angle), 0.6f * CUBE};
        memcpy(stage->eyes[i], eye, sizeof eye);
    }
    stage->field_of_view = 0.7f;
    stage->light[0] = 0.3f * CUBE;
    stage->light[2] = 1.5f * CUBE;
    stage->light_size = 0.2f * CUBE;
}

static uint32_t edge_of(uint32_t count) {
    uint32_t edge = 1;
    while (edge * edge * edge < count)
        edge++;
    return edge;
}

void balls_place(uint32_t edge, uint32_t i, float transform_out[12]) {
    const uint32_t at[3] = {i % edge, i / edge % edge, i / edge / edge};
    const float cell = CUBE / (float)edge;
    memset(transform_out, 0, 12 * sizeof(float));
    for (int k = 0; k < 3; k++) {
        transform_out[5 * k] = SHARE_OF_CELL * cell;
        transform_out[4 * k + 3] = ((float)at[k] + 0.5f) * cell - 0.5f * CUBE;
    }
}

void balls_make(uint32_t triangle_count, struct stage *stage) {
    /* A ball of s stacks and r slices has 2 r (s - 1) triangles; about twice as many slices as
     * stacks make them even. */
    const float each = (float)triangle_count / BALLS_COUNT;
    const uint32_t stacks = (uint32_t)(0.5f + 0.5f * sqrtf(1.0f + each));
    const uint32_t slices = (uint32_t)lrintf(0.5f * each / (float)(stacks - 1));
    const uint32_t edge = edge_of(BALLS_COUNT);
    static const float origin[3] = {0, 0, 0};
    memset(stage, 0, sizeof *stage);
    mesh_init(&stage->mesh);
    for (uint32_t i = 0; i < BALLS_COUNT; i++) {
        const uint32_t first = stage->mesh.vertex_count;
        float transform[12];
        balls_place(edge, i, transform);
        mesh_add_uv_sphere(&stage->mesh, origin, 1.0f, stacks, slices);
        mesh_transform(&stage->mesh, first, transform);
    }
    stage_look(stage);
}

void balls_make_one(uint32_t count, struct stage *stage, uint32_t *edge_out) {
    static const float origin[3] = {0, 0, 0};
    memset(stage, 0, sizeof *stage);
    mesh_init(&stage->mesh);
    mesh_add_uv_sphere(&stage->mesh, origin, 1.0f, INSTANCED_STACKS, 2 * INSTANCED_STACKS);
    stage_look(stage);
    *edge_out = edge_of(count);
}
