/* Triangles as leaves hold them, four side by side in the lanes. */
#ifndef TRACER_BVH_TRIANGLES4_H
#define TRACER_BVH_TRIANGLES4_H

#include "bvh/part.h"

/* [corner][axis] */
struct triangles4 {
    f4 v[3][3];
};

/* From triangles with their corners. */
static inline void triangles4_turn(const f4 triangle[4][3], struct triangles4 *out) {
    for (int corner = 0; corner < 3; corner++) {
        f4 rows[4];
        for (int i = 0; i < 4; i++)
            rows[i] = triangle[i][corner];
        f4_transpose(rows);
        for (int axis = 0; axis < 3; axis++)
            out->v[corner][axis] = rows[axis];
    }
}

/* Whether floats tell of all four that their corners are not on a line: nearly always. They do not
 * where the square of a sine is below this or edges are so short that products underflow. A
 * component of the cross product is off by less than 4 half-ulps of both its products, so the sine
 * by less than 4e-7. */
#define BENT_SINE_SQUARED 1e-10f
static inline bool triangles4_are_bent(const struct triangles4 *t) {
    f4 p[3], q[3], n = f4_set(0.0f);
    for (int axis = 0; axis < 3; axis++) {
        p[axis] = t->v[1][axis] - t->v[0][axis];
        q[axis] = t->v[2][axis] - t->v[0][axis];
    }
    for (int axis = 0; axis < 3; axis++) {
        const int next = (axis + 1) % 3;
        const f4 x = p[axis] * q[next] - p[next] * q[axis];
        n += x * x;
    }
    const f4 p_squared = p[0] * p[0] + p[1] * p[1] + p[2] * p[2],
             q_squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    return i4_all(n > f4_set(BENT_SINE_SQUARED) * p_squared * q_squared);
}

/* Whether a triangle's corners, by double arithmetic, lie on a line. */
static inline bool is_on_a_line(const f4 corner[3]) {
    double p[3], q[3];
    for (int i = 0; i < 3; i++) {
        p[i] = (double)corner[1][i] - corner[0][i];
        q[i] = (double)corner[2][i] - corner[0][i];
    }
    return p[1] * q[2] == p[2] * q[1] && p[2] * q[0] == p[0] * q[2] && p[0] * q[1] == p[1] * q[0];
}

/* A triangle of a part as it stands in the tree. Corners on a line, which are asked for only where
 * they may be, become one point. */
static inline void triangle_place(const struct trc_part *part, bool is_bent, f4 corner[3]) {
    const bool is_line = !is_bent && is_on_a_line(corner);
    for (int v = 0; v < 3; v++)
        corner[v] = trc_part_point(part, corner[v]);
    if (is_line)
        corner[1] = corner[2] = corner[0];
}

/* The triangles of those parts, alike in their number of keys, with those vertices. */
static inline void triangles4_load(const struct trc_part *const part[4],
                                   const uint32_t *const index[4], uint32_t key,
                                   struct triangles4 *out) {
    f4 p[4][3];
    bool is_placed = false;
    for (int i = 0; i < 4; i++) {
        const float *positions = trc_part_positions(part[i], key);
        is_placed = is_placed || part[i]->transform;
        for (int v = 0; v < 3; v++)
            p[i][v] = f4_load4(positions + 3 * (size_t)index[i][v]);
    }
    triangles4_turn(p, out);
    const bool is_bent = part[0]->mesh->key_count > 1 || triangles4_are_bent(out);
    if (is_bent && !is_placed)
        return;
    for (int i = 0; i < 4; i++)
        triangle_place(part[i], is_bent, p[i]);
    triangles4_turn(p, out);
}

#endif
