/* Operations that read the shading point, its object, its mesh and the camera.
 *
 * Lanes may be on different objects: what belongs to an object is done once for each object among
 * the lanes, with the others masked off. Hits come sorted, so mostly there is one. Meanings are
 * those of Cycles 3.4. Departures: Generated coordinates and tangents come from the mesh as it is
 * rendered, not from its undeformed shape; tangents of normal maps are made from the triangle's own
 * UVs, projected to the normal of each corner as MikkTSpace does but not averaged between
 * triangles. */
#ifndef TRACER_KERNELS_PROGRAM_INPUT_H
#define TRACER_KERNELS_PROGRAM_INPUT_H

#include "kernels/program/math.h"
#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/panorama.h"
#include "kernels/trace/surface.h"
#include "model/lights.h"
#include "model/nodes.h"

/* ---- objects among the lanes ---- */

struct lane_group {
    uint32_t rest; /* lanes still to come */
    vmask lanes;
    const struct trc_instance *instance; /* NULL: a lamp or the world */
    const struct trc_mesh *mesh;
    const struct trc_lamp *lamp; /* NULL: none */
};

TRC_INLINE struct lane_group groups_begin(const struct trc_surface *s) {
    return (struct lane_group){.rest = vm_bits(s->active)};
}
TRC_INLINE bool groups_next(const struct trc_surface *s, struct lane_group *g) {
    if (!g->rest)
        return false;
    const int32_t id = vi_get(s->instance, __builtin_ctz(g->rest));
    g->lanes = vm_and(vi_eq(s->instance, vi_set(id)), vm_from_bits(g->rest));
    g->rest &= ~vm_bits(g->lanes);
    g->instance = id >= 0 ? &s->snapshot->instances[id] : NULL;
    g->mesh = g->instance ? s->snapshot->meshes[g->instance->mesh] : NULL;
    g->lamp = id <= TRC_FIRST_LAMP ? &s->lamps->lamps[TRC_FIRST_LAMP - id] : NULL;
    return true;
}

static void affine_inverse(const struct trc_wide_affine *a, struct trc_wide_affine *out) {
    const vvec3 *c = a->column;
    const vvec3 r0 = v3_cross(c[1], c[2]), r1 = v3_cross(c[2], c[0]), r2 = v3_cross(c[0], c[1]);
    const vfloat scale = vf_divide(vf_one(), v3_dot(c[0], r0)); /* rows of the inverse */
    out->column[0] = v3_scale(v3(r0.x, r1.x, r2.x), scale);
    out->column[1] = v3_scale(v3(r0.y, r1.y, r2.y), scale);
    out->column[2] = v3_scale(v3(r0.z, r1.z, r2.z), scale);
    out->origin = v3_neg(trc_transform_vector(out, a->origin));
}

/* In place of the inverse of a matrix that is flat at a lane's time: between those of the keys. */
static void mend_inverse(const struct trc_instance *instance, const struct trc_wide_affine *a,
                         vfloat time, struct trc_wide_affine *m) {
    struct trc_wide_affine between;
    trc_load_keys(instance->world_to_object, instance->key_count, time, &between);
    const vvec3 *c = a->column;
    const vvec3 cofactors = v3_cross(c[1], c[2]);
    const vfloat volume = vf_abs(v3_dot(c[0], cofactors));
    const vfloat maximum = v3_dot(v3_abs(c[0]), v3_abs(cofactors));
    /* A few digits more than the sum of three products leaves: 2^-20. */
    const vmask flat = vf_le(volume, maximum * vf_set(0x1p-20f));
    for (int k = 0; k < 3; k++)
        m->column[k] = v3_select(flat, between.column[k], m->column[k]);
    m->origin = v3_select(flat, between.origin, m->origin);
}

/* The inverse of an instance's matrix at the lanes' times. */
static void load_world_to_instance(const struct trc_instance *instance, vfloat time,
                                   struct trc_wide_affine *m) {
    if (instance->key_count < 2) {
        const float *e = instance->world_to_object->m;
        for (int i = 0; i < 3; i++)
            m->column[i] = v3(vf_set(e[i]), vf_set(e[4 + i]), vf_set(e[8 + i]));
        m->origin = v3(vf_set(e[3]), vf_set(e[7]), vf_set(e[11]));
        return;
    }
    struct trc_wide_affine a;
    trc_load_affine(instance, time, &a);
    affine_inverse(&a, m);
    if (instance->is_thin)
        mend_inverse(instance, &a, time, m);
}

/* ---- object space ---- */

static void columns_of_rows(const float rows[9], vvec3 column[3]) {
    for (int i = 0; i < 3; i++)
        column[i] = v3(vf_set(rows[i]), vf_set(rows[3 + i]), vf_set(rows[6 + i]));
}

static const struct trc_lamp_program *lamp_program(const struct trc_surface *s,
                                                   const struct lane_group *g) {
    return &s->lamps->programs[g->lamp->program - 1];
}

static void load_lamp_to_world(const struct trc_surface *s, const struct lane_group *g,
                               struct trc_wide_affine *a) {
    const struct trc_lamp_program *program = lamp_program(s, g);
    columns_of_rows(program->to_world, a->column);
    a->origin = v3_set(program->origin);
}

/* Whether a group's lanes have object space: the world's have none, a lamp's as it says. */
TRC_INLINE bool has_space(const struct lane_group *g) {
    return g->instance || (g->lamp && (g->lamp->flags & TRC_LAMP_OBJECT));
}

/* Active lanes without. */
static vmask without_space(const struct trc_surface *s) {
    const vmask lamps = vm_and(s->active, vi_lt(s->instance, vi_set(TRC_FIRST_LAMP + 1)));
    const vmask none = vi_lt(s->instance, vi_set(0));
    if (!vm_any(lamps))
        return none;
    const vint at = (vi_set(TRC_FIRST_LAMP) - s->instance) * vi_set(TRC_LAMP_WORDS);
    const vint flags = vi_gather(&s->lamps->lamps->flags, at, lamps);
    return vm_andnot(none,
                     vm_and(lamps, vm_not(vi_eq(flags & vi_set(TRC_LAMP_OBJECT), vi_set(0)))));
}

/* Of a group with object space. */
static void load_object_to_world(const struct trc_surface *s, const struct lane_group *g,
                                 struct trc_wide_affine *a) {
    if (g->instance)
        trc_load_affine(g->instance, s->time, a);
    else
        load_lamp_to_world(s, g, a);
}
static void load_world_to_object(const struct trc_surface *s, const struct lane_group *g,
                                 struct trc_wide_affine *a) {
    if (g->instance) {
        load_world_to_instance(g->instance, s->time, a);
        return;
    }
    const struct trc_lamp_program *program = lamp_program(s, g);
    columns_of_rows(program->to_light, a->column);
    a->origin = v3_neg(trc_transform_vector(a, v3_set(program->origin)));
}

/* By the transposed matrix, unit: a normal from world to object space. */
static vvec3 normal_to_object(const struct trc_wide_affine *object_to_world, vvec3 n) {
    const vvec3 *c = object_to_world->column;
    return v3_normalize(v3(v3_dot(c[0], n), v3_dot(c[1], n), v3_dot(c[2], n)));
}
/* By the inverse transposed matrix, unit: a normal from object to world space. Columns are scaled
 * first, so that their products neither overflow nor vanish. */
static vvec3 normal_to_world(const struct trc_wide_affine *object_to_world, vvec3 n) {
    vvec3 c[3];
    vfloat maximum = vf_zero();
    for (int k = 0; k < 3; k++)
        maximum = vf_max(maximum, v3_max(v3_abs(object_to_world->column[k])));
    for (int k = 0; k < 3; k++) {
        c[k] = v3_scale(object_to_world->column[k], vf_divide(vf_one(), maximum));
    }
    const vvec3 x = v3_cross(c[1], c[2]), y = v3_cross(c[2], c[0]), z = v3_cross(c[0], c[1]);
    const vvec3 sum = v3_mad(x, n.x, v3_mad(y, n.y, v3_scale(z, n.z)));
    const vfloat determinant = v3_dot(c[0], x);
    return v3_scale(v3_normalize(sum), vf_copysign(vf_one(), determinant));
}

/* ---- the triangle ---- */

/* Weights of the corners. */
TRC_INLINE vvec3 corner_weights(const struct trc_surface *s) {
    return v3(vf_one() - s->u - s->v, s->u, s->v);
}
TRC_INLINE vvec3 corners_mix(vvec3 weights, const vvec3 c[3]) {
    return v3_mad(c[2], weights.z, v3_mad(c[1], weights.y, v3_scale(c[0], weights.x)));
}

/* Attribute of a name; TRC_NO_RESOURCE: the default UV map or, for width 4, the first colour. */
static const struct trc_attribute *mesh_attribute(const struct trc_mesh *mesh, uint32_t name,
                                                  uint32_t width) {
    if (name == TRC_NO_RESOURCE && width == 2) {
        return mesh->default_uv >= 0 ? &mesh->attributes[mesh->default_uv] : NULL;
    }
    for (uint32_t i = 0; i < mesh->attribute_count; i++) {
        const struct trc_attribute *a = &mesh->attributes[i];
        if (name == TRC_NO_RESOURCE ? a->width == width : a->name == name)
            return a;
    }
    return NULL;
}

/* Component c of an attribute at the three corners. */
TRC_INLINE void attribute_corners(const struct trc_attribute *a, uint32_t c, vint triangle,
                                  vmask lanes, vfloat out[3]) {
    if (a->strands) {
        const vint width = vi_set((int32_t)a->width);
        const vint strand = vi_gather((const int32_t *)a->strands, triangle, lanes);
        const vint piece = (triangle + strand) * width;
        const float *end = a->values + c + a->piece_end * a->width;
        out[0] = out[2] = vf_gather(a->values + c, piece, lanes);
        out[1] = vf_gather(end, piece, lanes);
        return;
    }
    const vint first = triangle * vi_set((int32_t)(3 * a->width));
    for (uint32_t k = 0; k < 3; k++)
        out[k] = vf_gather(a->values + k * a->width + c, first, lanes);
}

/* Positions of the corners in object space, of one object's lanes. */
static void group_corners(const struct trc_surface *s, const struct lane_group *g,
                          struct trc_corners *out) {
    const struct trc_mesh *mesh = g->mesh;
    vint index[3];
    trc_load_indices(mesh, s->triangle, g->lanes, index);
    trc_load_vectors(mesh->positions, index, mesh->vertex_count, mesh->key_count, s->time, g->lanes,
                     out);
}

/* The sides from the first corner to both others in world space, of one object's lanes. */
static void group_sides(const struct trc_surface *s, const struct lane_group *g, vvec3 out[2]) {
    struct trc_corners c;
    struct trc_wide_affine m;
    group_corners(s, g, &c);
    trc_load_affine(g->instance, s->time, &m);
    for (int i = 0; i < 2; i++)
        out[i] = trc_transform_vector(&m, v3_sub(c.corner[i + 1], c.corner[0]));
}

/* ---- attributes ---- */

/* A lamp's are Parametric, of any name, or 0. */
static void op_uv(const struct trc_surface *s, uint32_t name, vfloat *out) {
    const vvec3 w = corner_weights(s);
    out[0] = out[1] = vf_zero();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (g.lamp && (g.lamp->flags & TRC_LAMP_LOCAL_UV)) {
            out[0] = vf_select(g.lanes, w.x, out[0]);
            out[1] = vf_select(g.lanes, w.y, out[1]);
        }
        const struct trc_attribute *a = g.mesh ? mesh_attribute(g.mesh, name, 2) : NULL;
        for (uint32_t c = 0; a && c < 2; c++) {
            vfloat corner[3];
            attribute_corners(a, c, s->triangle, g.lanes, corner);
            const vfloat value = corner[1] * w.y + corner[2] * w.z + corner[0] * w.x;
            out[c] = vf_select(g.lanes, value, out[c]);
        }
    }
}

/* The smaller singular value of the map from the triangle to its UVs: what they change by per metre
 * in the direction in which they change least. */
static vfloat op_uv_density(const struct trc_surface *s, uint32_t name) {
    vfloat out = vf_zero();
    if (!vm_any(vm_and(s->active, vf_gt(s->footprint, vf_zero()))))
        return out; /* lookups stand for points */
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        const struct trc_attribute *a = g.mesh ? mesh_attribute(g.mesh, name, 2) : NULL;
        if (!a || !trc_mesh_in_reach(g.mesh))
            continue;
        vvec3 side[2];
        vfloat u[3], v[3];
        group_sides(s, &g, side);
        attribute_corners(a, 0, s->triangle, g.lanes, u);
        attribute_corners(a, 1, s->triangle, g.lanes, v);
        const vfloat u1 = u[1] - u[0], u2 = u[2] - u[0], v1 = v[1] - v[0], v2 = v[2] - v[0];
        const vfloat e11 = v3_dot(side[0], side[0]), e12 = v3_dot(side[0], side[1]);
        const vfloat e22 = v3_dot(side[1], side[1]);
        /* Trace and determinant of the map times its transpose, times that of the edges. */
        const vfloat area2 = e11 * e22 - e12 * e12, uv_area = u1 * v2 - u2 * v1;
        const vfloat trace = (u1 * u1 + v1 * v1) * e22 - vf_set(2.0f) * (u1 * u2 + v1 * v2) * e12 +
                             (u2 * u2 + v2 * v2) * e11;
        const vfloat determinant = uv_area * uv_area * area2;
        const vfloat root = vf_safe_sqrt(trace * trace - vf_set(4.0f) * determinant);
        const vfloat minimum = vf_divide(vf_set(2.0f) * uv_area * uv_area, trace + root);
        out = vf_select(vm_and(g.lanes, vf_lt(minimum, vf_set(INFINITY))), vf_safe_sqrt(minimum),
                        out);
    }
    return out;
}

/* Black where the mesh does not have it, with an alpha. */
static void op_color_attribute(const struct trc_surface *s, uint32_t name, vfloat missing_alpha,
                               vfloat *out) {
    const vvec3 w = corner_weights(s);
    for (int c = 0; c < 3; c++)
        out[c] = vf_zero();
    out[3] = missing_alpha;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        const struct trc_attribute *a = g.mesh ? mesh_attribute(g.mesh, name, 4) : NULL;
        for (uint32_t c = 0; a && c < a->width; c++) {
            vfloat corner[3];
            attribute_corners(a, c, s->triangle, g.lanes, corner);
            const vfloat value = corner[1] * w.y + corner[2] * w.z + corner[0] * w.x;
            out[c] = vf_select(g.lanes, value, out[c]);
        }
        if (a && a->width < 4)
            out[3] = vf_select(g.lanes, vf_one(), out[3]);
    }
}

/* ---- texture coordinates ---- */

static vvec3 position_of_group(const struct trc_surface *s, const struct lane_group *g) {
    struct trc_wide_affine a;
    load_world_to_object(s, g, &a);
    return trc_transform_point(&a, s->p);
}

/* Strands and points without coordinates of their own. */
static bool has_no_generated(const struct trc_mesh *mesh) {
    return mesh->strands && !mesh->generated;
}

/* Without coordinates of the mesh's own, Blender's default texture space: the bounding box becomes
 * the unit cube; a flat side becomes 0.5. */
static vvec3 generated_of_group(const struct trc_surface *s, const struct lane_group *g) {
    const struct trc_mesh *mesh = g->mesh;
    if (has_no_generated(mesh))
        return position_of_group(s, g);
    vint index[3];
    struct trc_corners c;
    trc_load_indices(mesh, s->triangle, g->lanes, index);
    const float *values = mesh->generated ? mesh->generated : mesh->positions;
    trc_load_vectors(values, index, mesh->vertex_count, 1, s->time, g->lanes, &c);
    const vvec3 p = corners_mix(corner_weights(s), c.corner);
    if (mesh->generated)
        return p;
    const vfloat co[3] = {p.x, p.y, p.z};
    vfloat out[3];
    for (int axis = 0; axis < 3; axis++) {
        const float low = mesh->bounds_lower[axis], high = mesh->bounds_upper[axis];
        const float half = 0.5f * (high - low), center = 0.5f * (low + high);
        const float scale = half == 0.0f ? 0.5f : 0.5f / (half < 1e-5f ? 1e-5f : half);
        out[axis] = co[axis] * vf_set(scale) - vf_set(center * scale - 0.5f);
    }
    return v3_read(out);
}

/* A lamp's are those of its object space. */
static vvec3 op_generated(const struct trc_surface *s) {
    vvec3 out = s->p; /* the world: the direction */
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (g.mesh)
            out = v3_select(g.lanes, generated_of_group(s, &g), out);
        else if (has_space(&g))
            out = v3_select(g.lanes, position_of_group(s, &g), out);
    }
    return out;
}

static vvec3 op_object_position(const struct trc_surface *s) {
    vvec3 out = s->p;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (has_space(&g))
            out = v3_select(g.lanes, position_of_group(s, &g), out);
    }
    return out;
}

static vvec3 op_object_normal(const struct trc_surface *s) {
    vvec3 out = s->n;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        struct trc_wide_affine a;
        if (g.instance)
            trc_load_affine(g.instance, s->time, &a);
        else if (g.lamp)
            load_lamp_to_world(s, &g, &a);
        else
            continue;
        out = v3_select(g.lanes, normal_to_object(&a, s->n), out);
    }
    return out;
}

/* The camera at the middle of the shutter, looking along +Z as in Cycles, of panoramas with their
 * own axes (kernels/trace/panorama.h). Without a camera it stands at the origin. */
static void load_camera_to_world(const struct trc_snapshot *snapshot, struct trc_wide_affine *m) {
    const struct trc_camera *camera = &snapshot->camera;
    uint32_t key = 0;
    float f = 0.0f, e[TRC_AFFINE_FLOATS] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    if (snapshot->has_camera) {
        trc_key_at(0.5f, camera->key_count, &key, &f);
        const float *a = camera->camera_to_world[key].m;
        const float *b = camera->camera_to_world[key + (camera->key_count > 1)].m;
        for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
            e[i] = a[i] + f * (b[i] - a[i]);
    }
    const struct trc_view_axis *axes = trc_view_axes(camera);
    for (int i = 0; i < 3; i++) {
        const float *column = e + axes[i].column;
        const vvec3 axis = v3(vf_set(column[0]), vf_set(column[4]), vf_set(column[8]));
        m->column[i] = axes[i].sign < 0.0f ? v3_neg(axis) : axis;
    }
    m->origin = v3(vf_set(e[3]), vf_set(e[7]), vf_set(e[11]));
}

static void load_world_to_camera(const struct trc_snapshot *snapshot, struct trc_wide_affine *m) {
    struct trc_wide_affine to_world;
    load_camera_to_world(snapshot, &to_world);
    affine_inverse(&to_world, m);
}

/* Lanes in the world have a direction for a position: it is seen from the camera's place. So are
 * positions on lamps without object space in texture coordinates, but not for the Camera Data
 * node. */
static vvec3 op_camera_position(const struct trc_surface *s, uint32_t mode) {
    struct trc_wide_affine a;
    load_world_to_camera(s->snapshot, &a);
    const vmask world = mode == TRC_CAMERA_DATA_POSITION
                            ? vi_eq(s->instance, vi_set(TRC_WORLD_LOOKUP))
                            : without_space(s);
    return v3_select(world, trc_transform_vector(&a, s->p), trc_transform_point(&a, s->p));
}

static void op_window(const struct trc_surface *s, vfloat *out) {
    const struct trc_camera *camera = &s->snapshot->camera;
    out[0] = out[1] = vf_zero();
    if (!s->snapshot->has_camera)
        return;
    if (trc_is_panorama(camera)) { /* of the whole one, without shift, as in Cycles */
        trc_panorama_place(camera, op_camera_position(s, TRC_CAMERA_COORDINATES), &out[0], &out[1]);
        return;
    }
    uint32_t key;
    float f;
    trc_key_at(0.5f, camera->key_count, &key, &f);
    const uint32_t next = key + (camera->key_count > 1);
    float window[4];
    for (int i = 0; i < 4; i++) {
        window[i] =
            camera->windows[key][i] + f * (camera->windows[next][i] - camera->windows[key][i]);
    }
    const vvec3 p = op_camera_position(s, TRC_CAMERA_COORDINATES);
    const bool perspective = camera->type == TRC_CAMERA_PERSPECTIVE;
    const vfloat x = perspective ? vf_divide(p.x, p.z) : p.x;
    const vfloat y = perspective ? vf_divide(p.y, p.z) : p.y;
    out[0] = (x - vf_set(window[0])) * vf_set(1.0f / (window[1] - window[0]));
    out[1] = (y - vf_set(window[2])) * vf_set(1.0f / (window[3] - window[2]));
}

/* A point, vector or normal from one space to another. In the world there is no object space. */
static vvec3 op_transform(const struct trc_surface *s, uint32_t mode, vvec3 v) {
    const uint32_t way = mode & TRC_TRANSFORM_SPACES_MASK;
    const bool is_point = mode & TRC_TRANSFORM_POINT;
    struct trc_wide_affine a;
    if (way == TRC_TRANSFORM_WORLD_TO_CAMERA || way == TRC_TRANSFORM_CAMERA_TO_WORLD) {
        if (way == TRC_TRANSFORM_WORLD_TO_CAMERA)
            load_world_to_camera(s->snapshot, &a);
        else
            load_camera_to_world(s->snapshot, &a);
        return is_point ? trc_transform_point(&a, v) : trc_transform_vector(&a, v);
    }
    vvec3 out = v;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!has_space(&g))
            continue;
        if (way == TRC_TRANSFORM_WORLD_TO_OBJECT)
            load_world_to_object(s, &g, &a);
        else
            load_object_to_world(s, &g, &a);
        vvec3 moved;
        if (mode & TRC_TRANSFORM_NORMAL)
            moved = normal_to_world(&a, v);
        else
            moved = is_point ? trc_transform_point(&a, v) : trc_transform_vector(&a, v);
        out = v3_select(g.lanes, moved, out);
    }
    return out;
}

TRC_INLINE vvec3 op_reflection(const struct trc_surface *s) {
    const vvec3 mirrored = v3_sub(v3_scale(s->n, vf_set(2.0f) * v3_dot(s->n, s->wo)), s->wo);
    return v3_select(without_space(s), s->wo, mirrored);
}

/* ---- the object ---- */

static vvec3 op_object_location(const struct trc_surface *s) {
    vvec3 out = v3_zero();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!has_space(&g))
            continue;
        struct trc_wide_affine a;
        load_object_to_world(s, &g, &a);
        out = v3_select(g.lanes, a.origin, out);
    }
    return out;
}

/* Numbers of an object: the components of its colour, and ... */
enum { OBJECT_INDEX = 4, OBJECT_RANDOM };

/* One of each lane's object; 0 in the world. */
static vfloat object_number(const struct trc_surface *s, int which) {
    vfloat out = vf_zero();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!g.instance && !g.lamp)
            continue;
        const struct trc_lamp_program *lamp = g.lamp ? lamp_program(s, &g) : NULL;
        const float value = which < OBJECT_INDEX ? (lamp ? lamp->color : g.instance->color)[which]
                            : which == OBJECT_INDEX
                                ? (float)(lamp ? lamp->pass_index : g.instance->pass_index)
                                : (lamp ? lamp->random : g.instance->random);
        out = vf_select(g.lanes, vf_set(value), out);
    }
    return out;
}

static void op_instance_values(const struct trc_surface *s, uint32_t first, vfloat out[3]) {
    for (uint32_t c = 0; c < 3; c++)
        out[c] = vf_zero();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        for (uint32_t c = 0; g.instance && c < 3 && first + c < g.instance->value_count; c++)
            out[c] = vf_select(g.lanes, vf_set(g.instance->values[first + c]), out[c]);
    }
}

/* ---- the ray ---- */

TRC_INLINE vfloat path_bit(const struct trc_surface *s, uint32_t bit) {
    const vint masked = (vint)(s->path & vu_set(bit));
    return vf_truth(vm_not(vi_eq(masked, vi_set(0))));
}

TRC_INLINE vfloat depth_of_ray(const struct trc_surface *s, int shift) {
    return vi_to_float((vint)trc_depth_of(s->depths, shift));
}

/* Cycles' camera rays start at the near clip, ours at the camera. */
static vfloat op_ray_length(const struct trc_surface *s) {
    const struct trc_camera *camera = &s->snapshot->camera;
    const vmask by_camera =
        vi_eq((vint)(s->path & vu_set(TRC_VISIBLE_CAMERA)), vi_set(TRC_VISIBLE_CAMERA));
    const vmask seen = vm_and(by_camera, vf_gt(s->ray_length, vf_zero())); /* 0 to the world */
    if (!s->snapshot->has_camera || !vm_any(seen))
        return s->ray_length;
    if (trc_is_panorama(camera))
        return vf_select(seen, s->ray_length - vf_set(camera->clip_start), s->ray_length);
    struct trc_wide_affine to_world, to_camera;
    trc_load_keys(camera->camera_to_world, camera->key_count, s->time, &to_world);
    affine_inverse(&to_world, &to_camera);
    const vvec3 back = v3_normalize(trc_transform_vector(&to_camera, s->wo));
    const vfloat near = vf_divide(vf_set(camera->clip_start), back.z);
    return vf_select(seen, s->ray_length - near, s->ray_length);
}

static vfloat op_light_path(const struct trc_surface *s, uint32_t output) {
    switch (output) {
    case TRC_OUTPUT_OF(LIGHT_PATH, is_camera):
        return path_bit(s, TRC_VISIBLE_CAMERA);
    case TRC_OUTPUT_OF(LIGHT_PATH, is_shadow):
        return path_bit(s, TRC_VISIBLE_SHADOW);
    case TRC_OUTPUT_OF(LIGHT_PATH, is_diffuse):
        return path_bit(s, TRC_VISIBLE_DIFFUSE);
    case TRC_OUTPUT_OF(LIGHT_PATH, is_glossy):
        /* As in Cycles also what was refracted, unlike for visibility, but not through translucent
         * lobes. */
        return path_bit(s, TRC_VISIBLE_GLOSSY | TRC_VISIBLE_TRANSMISSION) *
               (vf_one() - path_bit(s, TRC_VISIBLE_DIFFUSE));
    case TRC_OUTPUT_OF(LIGHT_PATH, is_singular):
        return path_bit(s, TRC_PATH_SINGULAR);
    case TRC_OUTPUT_OF(LIGHT_PATH, is_reflection):
        return path_bit(s, TRC_PATH_REFLECTED);
    case TRC_OUTPUT_OF(LIGHT_PATH, is_transmission):
        return path_bit(s, TRC_VISIBLE_TRANSMISSION);
    case TRC_OUTPUT_OF(LIGHT_PATH, ray_length):
        return op_ray_length(s);
    case TRC_OUTPUT_OF(LIGHT_PATH, ray_depth):
        return depth_of_ray(s, TRC_DEPTH_ALL_SHIFT);
    case TRC_OUTPUT_OF(LIGHT_PATH, diffuse_depth):
        /* Of light that is found for matt lobes alone. */
        return path_bit(s, TRC_VISIBLE_DIFFUSE) *
               (vf_one() - path_bit(s, TRC_VISIBLE_TRANSMISSION));
    case TRC_OUTPUT_OF(LIGHT_PATH, glossy_depth):
        return depth_of_ray(s, TRC_DEPTH_GLOSSY_SHIFT);
    case TRC_OUTPUT_OF(LIGHT_PATH, transparent_depth):
        return depth_of_ray(s, TRC_DEPTH_TRANSPARENT_SHIFT);
    case TRC_OUTPUT_OF(LIGHT_PATH, transmission_depth):
        return depth_of_ray(s, TRC_DEPTH_TRANSMISSION_SHIFT);
    case TRC_OUTPUT_OF(LIGHT_PATH, portal_depth):
        return vi_to_float((vint)(s->path >> TRC_PATH_PORTALS_SHIFT & vu_set(TRC_PATH_PORTALS)));
    default:
        return vf_zero();
    }
}

/* Reflectance of a smooth dielectric of relative index eta. */
static vfloat fresnel_dielectric(vfloat cosine, vfloat eta) {
    const vfloat one = vf_one(), c = vf_abs(cosine), square = eta * eta - one + c * c;
    const vmask passes = vf_gt(square, vf_zero());
    const vfloat g = vf_sqrt(vf_select(passes, square, one));
    const vfloat a = (g - c) / (g + c), b = (c * (g + c) - one) / (c * (g - c) + one);
    return vf_select(passes, vf_set(0.5f) * a * a * (one + b * b), one);
}

TRC_INLINE vfloat op_fresnel(const struct trc_surface *s, vfloat ior, vvec3 n) {
    const vfloat eta = vf_max(ior, vf_set(1e-5f));
    return fresnel_dielectric(v3_dot(s->wo, n), vf_select(s->backfacing, vf_rcp(eta), eta));
}
TRC_INLINE vfloat op_layer_fresnel(const struct trc_surface *s, vfloat blend, vvec3 n) {
    const vfloat eta = vf_max(vf_one() - blend, vf_set(1e-5f));
    return fresnel_dielectric(v3_dot(s->wo, n), vf_select(s->backfacing, eta, vf_rcp(eta)));
}
TRC_INLINE vfloat op_layer_facing(const struct trc_surface *s, vfloat blend, vvec3 n) {
    const vfloat half = vf_set(0.5f), b = vf_clamp(blend, 0.0f, 1.0f - 1e-5f);
    const vfloat exponent = vf_select(vf_lt(b, half), b + b, half / (vf_one() - b));
    const vfloat facing = vf_abs(v3_dot(s->wo, n));
    return vf_one() - vf_select(vf_eq(blend, half), facing, vf_pow(facing, exponent));
}

#endif
