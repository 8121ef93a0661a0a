/* Triangles of a part, as they stand in its tree. */
#ifndef TRACER_BVH_PART_H
#define TRACER_BVH_PART_H

#include "bvh/tree.h"
#include "core/box.h"

/* Corners of all triangles at a key: meshes at rest have the same ones at every key. */
static inline const float *trc_part_positions(const struct trc_part *part, uint32_t key) {
    const struct trc_mesh *mesh = part->mesh;
    return mesh->positions + (mesh->key_count > 1 ? 3 * (size_t)key * mesh->vertex_count : 0);
}

/* One of those positions in the tree's space. */
static inline f4 trc_part_point(const struct trc_part *part, f4 p) {
    if (!part->transform)
        return p;
    const float *m = part->transform->m;
    const f4 x = {m[0], m[4], m[8], 0.0f}, y = {m[1], m[5], m[9], 0.0f};
    const f4 z = {m[2], m[6], m[10], 0.0f}, w = {m[3], m[7], m[11], 0.0f};
    return x * f4_set(p[0]) + y * f4_set(p[1]) + z * f4_set(p[2]) + w;
}

/* Ends of a piece of a curve and their radii; curves stand in trees of their own, in object space.
 */
static inline void trc_piece_ends(const struct trc_mesh *mesh, uint32_t piece, uint32_t key,
                                  f4 ends[2], float radii[2]) {
    uint32_t index[3];
    trc_mesh_corners(mesh, piece, index);
    for (int end = 0; end < 2; end++) {
        const size_t vertex = (size_t)key * mesh->vertex_count + index[end];
        ends[end] = f4_load3_padded(mesh->positions + 3 * vertex);
        radii[end] = mesh->radii[vertex];
    }
}

/* The corners of the triangle with those vertices, in the part's space. */
static inline void trc_part_corners_unplaced(const struct trc_part *part, const uint32_t index[3],
                                             uint32_t key, f4 corner[3]) {
    const float *positions = trc_part_positions(part, key);
    for (int v = 0; v < 3; v++)
        corner[v] = f4_load3_padded(positions + 3 * (size_t)index[v]);
}

/* The same in the tree's. */
static inline void trc_part_corners(const struct trc_part *part, const uint32_t index[3],
                                    uint32_t key, f4 corner[3]) {
    trc_part_corners_unplaced(part, index, key, corner);
    for (int v = 0; v < 3; v++)
        corner[v] = trc_part_point(part, corner[v]);
}

#endif
