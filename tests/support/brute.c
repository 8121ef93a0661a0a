/* Error bounds. HALF_ULP is u = 2^-24. All in the space where a kernel tests triangles (object
 * space).
 *
 * The test (Woop, Benthin and Wald 2013) moves vertices to the ray's origin and shears them along
 * the ray. With L the largest component of vertex - origin: the difference, the shear factor (two
 * roundings) and their product and sum move a vertex in the sheared plane by less than 6 u L. A
 * direction that is wrong by e_d moves it by e_d L / |dz| more, an origin by e_o. The decision is
 * then exact for the moved vertices: so a ray that is farther from the outline than the vertices
 * move (times sqrt 2 for two axes) has a sure answer.
 *
 * Barycentrics are edge functions over their sum: products of lengths up to the outline's size s
 * are wrong by 4 u s^2, moved vertices (by m) add 3 m s. The distance is a convex combination of
 * the vertices' depths, never outside their range. */
#include "brute.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"

#define HALF_ULP 0x1p-24
#define COORDINATE_LIMIT 1.8e18f
/* Twice the smallest float: what underflow may add. */
#define UNDERFLOW_ERROR 0x1p-148
/* Largest share of a triangle's depth within which kernels may drop hits. */
#define BLIND_SHARE 0x1p-8

/* A ray in the object space of an instance, with the errors of getting there. */
struct view {
    double o[3], d[3];
    int u, v, z;   /* z: dominant axis of d */
    double su, sv; /* shear */
    double origin_error, direction_error;
    double condition;  /* of the transform: 1 for identity */
    double world_size; /* |M| and |translation| in object units: for trees joined in world space */
    double translation;
};

/* Evenly spaced keys: the first of the segment, and the place within it. */
static uint32_t key_at(float time, uint32_t key_count, float *f) {
    *f = 0.0f;
    if (key_count < 2)
        return 0;
    const float x = (time > 0.0f ? (time < 1.0f ? time : 1.0f) : 0.0f) * (float)(key_count - 1);
    const uint32_t key = (uint32_t)x < key_count - 1 ? (uint32_t)x : key_count - 2;
    *f = x - (float)key;
    return key;
}

static double largest(const double v[3]) { return fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2]))); }

static double frobenius(const double m[12]) {
    double sum = 0.0;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            sum += m[4 * row + column] * m[4 * row + column];
    return sqrt(sum);
}

/* False for a singular matrix. */
static bool invert(const double m[12], double inverse[12]) {
    double det = 0.0;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++) {
            const int a = (column + 1) % 3, b = (column + 2) % 3;
            const int c = (row + 1) % 3, d = (row + 2) % 3;
            inverse[4 * row + column] = m[4 * a + c] * m[4 * b + d] - m[4 * a + d] * m[4 * b + c];
        }
    for (int k = 0; k < 3; k++)
        det += m[k] * inverse[4 * k];
    if (det == 0.0)
        return false;
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++)
            inverse[4 * row + column] /= det;
        inverse[4 * row + 3] =
            -(inverse[4 * row] * m[3] + inverse[4 * row + 1] * m[7] + inverse[4 * row + 2] * m[11]);
    }
    return true;
}

static void shear_setup(struct view *view) {
    const double x = fabs(view->d[0]), y = fabs(view->d[1]), z = fabs(view->d[2]);
    view->z = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    view->u = (view->z + 1) % 3;
    view->v = (view->z + 2) % 3;
    view->su = view->d[view->u] / view->d[view->z];
    view->sv = view->d[view->v] / view->d[view->z];
}

/* The matrix of a time; true if it is the identity at all times. */
static bool matrix_at(const struct query_instance *instance, float time, double m[12]) {
    static const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    bool same = true;
    float f;
    const uint32_t key = key_at(time, instance->key_count, &f);
    for (uint32_t k = 0; k < instance->key_count; k++)
        same = same && memcmp(instance->transforms[k], identity, sizeof identity) == 0;
    for (int i = 0; i < 12; i++) {
        m[i] = instance->transforms[key][i];
        if (instance->key_count > 1)
            m[i] = (1.0 - f) * m[i] + f * (double)instance->transforms[key + 1][i];
    }
    return same;
}

/* The ray in the instance's space at its time. False where the transform cannot be undone. */
static bool view_setup(const struct query_instance *instance, const float origin[3],
                       const float direction[3], float time, struct view *view) {
    double m[12], inverse[12], o[3], d[3];
    *view = (struct view){.condition = 1.0};
    for (int i = 0; i < 3; i++) {
        o[i] = view->o[i] = origin[i];
        d[i] = view->d[i] = direction[i];
    }
    if (!matrix_at(instance, time, m)) {
        if (!invert(m, inverse))
            return false;
        for (int i = 0; i < 3; i++) {
            const double *row = inverse + 4 * i;
            view->o[i] = row[0] * o[0] + row[1] * o[1] + row[2] * o[2] + row[3];
            view->d[i] = row[0] * d[0] + row[1] * d[1] + row[2] * d[2];
        }
        /* Entries of the inverse: one rounding, or those of an inversion in single precision. */
        const double undo = frobenius(inverse), k = frobenius(m) * undo;
        const double entry = HALF_ULP * (instance->key_count > 1 ? 10.0 + 16.0 * k * k : 10.0);
        const double translation[3] = {m[3], m[7], m[11]};
        view->origin_error = entry * undo * (largest(o) + largest(translation));
        view->direction_error = entry * undo * largest(d);
        view->condition = k;
        view->translation = undo * largest(translation);
        view->world_size = k;
    }
    shear_setup(view);
    return true;
}

static double segment_distance(const double a[2], const double b[2]) {
    const double x = b[0] - a[0], y = b[1] - a[1], square = x * x + y * y;
    double t = square > 0.0 ? -(a[0] * x + a[1] * y) / square : 0.0;
    t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
    return hypot(a[0] + t * x, a[1] + t * y);
}

/* How far vertices may move in the sheared plane. */
static double vertex_movement(const struct view *view, const double p[3][3], double vertex_error) {
    double reach = 0.0, size = 0.0;
    for (int i = 0; i < 3; i++) {
        size = fmax(size, largest(p[i]));
        for (int k = 0; k < 3; k++)
            reach = fmax(reach, fabs(p[i][k] - view->o[k]));
    }
    const double slope_error = view->direction_error / fabs(view->d[view->z]);
    const double joined = 6.0 * HALF_ULP * (view->world_size * size + view->translation);
    return 6.0 * HALF_ULP * reach * view->condition + 2.0 * view->origin_error +
           2.0 * slope_error * reach + 2.0 * vertex_error + joined + UNDERFLOW_ERROR;
}

/* Sets everything but the numbers. False: the ray surely misses. */
static bool classify(const struct view *view, const double p[3][3], double vertex_error,
                     struct brute_candidate *c) {
    const double movement = vertex_movement(view, p, vertex_error), margin = 1.5 * movement;
    double q[3][2], z[3], e[3];
    for (int i = 0; i < 3; i++) {
        z[i] = p[i][view->z] - view->o[view->z];
        q[i][0] = p[i][view->u] - view->o[view->u] - view->su * z[i];
        q[i][1] = p[i][view->v] - view->o[view->v] - view->sv * z[i];
    }
    for (int k = 0; k < 2; k++)
        if ((q[0][k] > margin && q[1][k] > margin && q[2][k] > margin) ||
            (q[0][k] < -margin && q[1][k] < -margin && q[2][k] < -margin))
            return false;
    double outline = INFINITY, perimeter = 0.0;
    for (int i = 0; i < 3; i++) {
        const double *a = q[(i + 1) % 3], *b = q[(i + 2) % 3];
        e[i] = a[0] * b[1] - a[1] * b[0];
        outline = fmin(outline, segment_distance(a, b));
        perimeter += hypot(b[0] - a[0], b[1] - a[1]);
    }
    const double det = e[0] + e[1] + e[2];
    c->inside = det != 0.0 && ((e[0] >= 0.0 && e[1] >= 0.0 && e[2] >= 0.0) ||
                               (e[0] <= 0.0 && e[1] <= 0.0 && e[2] <= 0.0));
    if (!c->inside && outline > margin)
        return false;
    c->sure = c->inside && outline > margin;
    c->u = det != 0.0 ? e[1] / det : 0.0;
    c->v = det != 0.0 ? e[2] / det : 0.0;
    c->barycentric_error =
        det != 0.0 ? 2.0 * (3.0 * movement * perimeter + 4.0 * HALF_ULP * perimeter * perimeter) /
                             fabs(det) +
                         8.0 * HALF_ULP
                   : INFINITY;
    const double low = fmin(z[0], fmin(z[1], z[2])), high = fmax(z[0], fmax(z[1], z[2]));
    const double depth = (1.0 - c->u - c->v) * z[0] + c->u * z[1] + c->v * z[2];
    const double rounding = 10.0 * HALF_ULP * fmax(fabs(low), fabs(high)) + 4.0 * movement;
    c->distance = fmin(fmax(depth, low), high) / view->d[view->z];
    c->distance_error =
        (fmin(1.0, c->barycentric_error) * (high - low) + rounding * view->condition) /
        fabs(view->d[view->z]);
    const double share = 4.0 * c->barycentric_error + 20.0 * HALF_ULP;
    const double farthest = fmax(fabs(low), fabs(high)) / fabs(view->d[view->z]);
    const bool in_front = view->d[view->z] > 0.0 ? low > rounding : high < -rounding;
    c->blind_distance = in_front ? 0.0 : fmin(share, BLIND_SHARE) * farthest * view->condition;
    return true;
}

static bool is_valid(const float p[3]) {
    return fabsf(p[0]) <= COORDINATE_LIMIT && fabsf(p[1]) <= COORDINATE_LIMIT &&
           fabsf(p[2]) <= COORDINATE_LIMIT;
}

/* Vertices at a time. False if the triangle is skipped: a vertex is not valid at some key. */
static bool triangle_at(const struct mesh *mesh, uint32_t triangle, float time, double p[3][3],
                        double *error) {
    float f;
    const uint32_t key = key_at(time, mesh->key_count, &f);
    *error = 0.0;
    for (int i = 0; i < 3; i++) {
        const size_t at = 3 * (size_t)mesh->indices[3 * (size_t)triangle + (size_t)i];
        for (uint32_t k = 0; k < mesh->key_count; k++)
            if (!is_valid(mesh_key(mesh, k) + at))
                return false;
        const float *a = mesh_key(mesh, key) + at;
        const float *b = mesh->key_count > 1 ? mesh_key(mesh, key + 1) + at : a;
        for (int axis = 0; axis < 3; axis++) {
            p[i][axis] = (1.0 - f) * a[axis] + f * (double)b[axis];
            if (mesh->key_count > 1)
                *error = fmax(*error, 3.0 * HALF_ULP * fmax(fabsf(a[axis]), fabsf(b[axis])));
        }
    }
    return true;
}

static struct brute_candidate *list_next(struct brute_list *list) {
    if (list->count == list->capacity) {
        list->capacity = list->capacity ? 2 * list->capacity : 64;
        list->candidates = buffer_grow(list->candidates, list->count * sizeof *list->candidates,
                                       list->capacity, sizeof *list->candidates);
    }
    return &list->candidates[list->count];
}

void brute_list_free(struct brute_list *list) {
    free(list->candidates);
    *list = (struct brute_list){0};
}

static bool ray_is_valid(const struct ray_set *rays, uint32_t ray, const float o[3],
                         const float d[3]) {
    for (int i = 0; i < 3; i++)
        if (!isfinite(o[i]) || !isfinite(d[i]))
            return false;
    if (isnan(rays->time[ray]))
        return false;
    return (d[0] != 0.0f || d[1] != 0.0f || d[2] != 0.0f) && rays->tmin[ray] <= rays->tmax[ray];
}

void brute_collect(const struct query_world *world, const struct ray_set *rays, uint32_t ray,
                   struct brute_list *list) {
    float o[3], d[3];
    list->count = 0;
    ray_set_get(rays, ray, o, d);
    if (!ray_is_valid(rays, ray, o, d))
        return;
    for (uint32_t i = 0; i < world->instance_count; i++) {
        const struct query_instance *instance = &world->instances[i];
        const struct mesh *mesh = &world->meshes[instance->mesh];
        struct view view;
        if (!(instance->visibility & rays->visibility))
            continue;
        if (!view_setup(instance, o, d, rays->time[ray], &view))
            continue;
        for (uint32_t t = 0; t < mesh->triangle_count; t++) {
            double p[3][3], error;
            if (!triangle_at(mesh, t, rays->time[ray], p, &error))
                continue;
            struct brute_candidate *c = list_next(list);
            if (!classify(&view, p, error, c))
                continue;
            c->instance = i;
            c->triangle = t;
            list->count++;
        }
    }
}

const struct brute_candidate *brute_nearest(const struct brute_list *list,
                                            const struct ray_set *rays, uint32_t ray) {
    const struct brute_candidate *best = NULL; /* collected in rising order: the first wins ties */
    for (uint32_t i = 0; i < list->count; i++) {
        const struct brute_candidate *c = &list->candidates[i];
        if (!c->inside || !(c->distance > rays->tmin[ray] && c->distance <= rays->tmax[ray]))
            continue;
        if (!best || c->distance < best->distance)
            best = c;
    }
    return best;
}

/* Whether the ray's interval holds the candidate after rounding: at all, and whatever happens. */
static bool may_count(const struct brute_candidate *c, double tmin, double tmax) {
    return c->distance + c->distance_error >= tmin && c->distance - c->distance_error <= tmax;
}
static bool must_count(const struct brute_candidate *c, double tmin, double tmax) {
    return c->sure && c->distance - c->distance_error > tmin &&
           c->distance + c->distance_error < tmax &&
           fabs(c->distance) > c->blind_distance + c->distance_error;
}

static enum brute_verdict judge_hit(const struct brute_list *list, const struct ray_set *rays,
                                    uint32_t ray, const struct hit_set *hits, double limit) {
    const double tmin = rays->tmin[ray], tmax = rays->tmax[ray], t = hits->distance[ray];
    const struct brute_candidate *found = NULL;
    for (uint32_t i = 0; i < list->count && !found; i++)
        if (list->candidates[i].instance == hits->instance[ray] &&
            list->candidates[i].triangle == hits->triangle[ray])
            found = &list->candidates[i];
    if (!found || !(t > tmin && t <= tmax))
        return BRUTE_DIFFERS;
    if (!(fabs(t - found->distance) <= found->distance_error))
        return BRUTE_DIFFERS;
    if (found->distance - found->distance_error > limit)
        return BRUTE_DIFFERS;
    if (found->sure && (!(fabs(hits->u[ray] - found->u) <= found->barycentric_error) ||
                        !(fabs(hits->v[ray] - found->v) <= found->barycentric_error)))
        return BRUTE_DIFFERS;
    for (uint32_t i = 0; i < list->count; i++) {
        const struct brute_candidate *c = &list->candidates[i];
        if (c != found && may_count(c, tmin, tmax) &&
            c->distance - c->distance_error <= found->distance + found->distance_error)
            return BRUTE_DOUBTFUL;
    }
    return must_count(found, tmin, tmax) ? BRUTE_AGREES : BRUTE_DOUBTFUL;
}

enum brute_verdict brute_judge_closest(const struct brute_list *list, const struct ray_set *rays,
                                       uint32_t ray, const struct hit_set *hits) {
    const double tmin = rays->tmin[ray], tmax = rays->tmax[ray];
    double limit = INFINITY; /* something is hit by here */
    bool any = false, must = false;
    for (uint32_t i = 0; i < list->count; i++) {
        const struct brute_candidate *c = &list->candidates[i];
        any = any || may_count(c, tmin, tmax);
        if (!must_count(c, tmin, tmax))
            continue;
        must = true;
        limit = fmin(limit, c->distance + c->distance_error);
    }
    if (hits->instance[ray] != TRC_NO_HIT)
        return judge_hit(list, rays, ray, hits, limit);
    if (must)
        return BRUTE_DIFFERS;
    return any ? BRUTE_DOUBTFUL : BRUTE_AGREES;
}

enum brute_verdict brute_judge_occluded(const struct brute_list *list, const struct ray_set *rays,
                                        uint32_t ray, const struct hit_set *hits) {
    const double tmin = rays->tmin[ray], tmax = rays->tmax[ray];
    bool any = false, must = false;
    for (uint32_t i = 0; i < list->count; i++) {
        any = any || may_count(&list->candidates[i], tmin, tmax);
        must = must || must_count(&list->candidates[i], tmin, tmax);
    }
    if (must)
        return hits->occluded[ray] == 1 ? BRUTE_AGREES : BRUTE_DIFFERS;
    if (any)
        return BRUTE_DOUBTFUL;
    return hits->occluded[ray] == 0 ? BRUTE_AGREES : BRUTE_DIFFERS;
}

void brute_list_print(const struct brute_list *list) {
    for (uint32_t i = 0; i < list->count; i++) {
        const struct brute_candidate *c = &list->candidates[i];
        fprintf(stderr, "  candidate %u/%u %s at %.17g +- %.3g (%.9g, %.9g +- %.3g)\n", c->instance,
                c->triangle,
                c->sure     ? "sure"
                : c->inside ? "inside"
                            : "near",
                c->distance, c->distance_error, c->u, c->v, c->barycentric_error);
    }
}
