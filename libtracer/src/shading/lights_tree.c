/* The light tree: binary, split by the surface-area-orientation heuristic of Conty Estevez and
 * Kulla (2018), one light per leaf. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "shading/lights.h"

#define PI 3.14159265358979f
#define BIN_COUNT 12
/* Turns are kept in 32 bits: where an uneven split could need more, the count is halved. */
#define DEPTH_MAX 31u
/* Larger sets are split without regard to orientation, which costs most of the time and says little
 * there. */
#define ORIENTED_COUNT_MAX 4096u

/* What a set of lights is bounded by. */
struct cluster {
    float lower[3], upper[3];
    float axis[3], cos_o, cos_e, intensity;
    int32_t two_sided;
    uint32_t count;
};

static struct cluster empty_cluster(void) {
    struct cluster c;
    memset(&c, 0, sizeof c);
    for (int i = 0; i < 3; i++) {
        c.lower[i] = INFINITY;
        c.upper[i] = -INFINITY;
    }
    return c;
}

static float clamp_cos(float x) { return x < -1.0f ? -1.0f : x > 1.0f ? 1.0f : x; }

/* Smallest cone that holds two cones (Conty Estevez and Kulla, supplement). */
static void unite_cones(struct cluster *a, const struct cluster *b) {
    if (a->cos_o <= -1.0f || b->cos_o <= -1.0f) {
        a->cos_o = -1.0f;
        a->two_sided = 0;
        return;
    }
    float other[3];
    memcpy(other, b->axis, sizeof other);
    float d = a->axis[0] * other[0] + a->axis[1] * other[1] + a->axis[2] * other[2];
    if (a->two_sided != b->two_sided) {
        a->cos_o = -1.0f;
        a->two_sided = 0;
    }
    if (a->two_sided && d < 0.0f) {
        d = -d;
        for (int i = 0; i < 3; i++)
            other[i] = -other[i];
    }
    const float wide = fmaxf(acosf(a->cos_o), acosf(b->cos_o));
    const float narrow = fminf(acosf(a->cos_o), acosf(b->cos_o));
    const bool a_is_wide = a->cos_o <= b->cos_o;
    const float between = acosf(clamp_cos(d));
    if (fminf(between + narrow, PI) <= wide) {
        if (!a_is_wide)
            memcpy(a->axis, other, sizeof other);
        a->cos_o = fminf(a->cos_o, b->cos_o);
        return;
    }
    const float united = 0.5f * (wide + narrow + between);
    if (united >= PI || between < 1e-6f) {
        a->cos_o = united >= PI ? -1.0f : cosf(united);
        return;
    }
    /* Turns the axis of the wide cone towards the other. */
    const float *from = a_is_wide ? a->axis : other, *to = a_is_wide ? other : a->axis;
    const float turn = united - wide;
    const float k1 = sinf(between - turn) / sinf(between), k2 = sinf(turn) / sinf(between);
    float axis[3], size = 0.0f;
    for (int i = 0; i < 3; i++) {
        axis[i] = from[i] * k1 + to[i] * k2;
        size += axis[i] * axis[i];
    }
    if (!(size > 1e-12f)) {
        a->cos_o = -1.0f;
        return;
    }
    for (int i = 0; i < 3; i++)
        a->axis[i] = axis[i] / sqrtf(size);
    /* Rounding must not lose a direction. */
    a->cos_o = fmaxf(cosf(united) - 1e-4f, -1.0f);
}

static void unite(struct cluster *a, const struct cluster *b) {
    if (b->count == 0)
        return;
    if (a->count == 0) {
        *a = *b;
        return;
    }
    for (int i = 0; i < 3; i++) {
        a->lower[i] = fminf(a->lower[i], b->lower[i]);
        a->upper[i] = fmaxf(a->upper[i], b->upper[i]);
    }
    unite_cones(a, b);
    a->cos_e = fminf(a->cos_e, b->cos_e);
    a->intensity += b->intensity;
    a->count += b->count;
}

static struct cluster leaf_cluster(const struct trc_light_bound *b, bool is_oriented) {
    struct cluster c = empty_cluster();
    for (int i = 0; i < 3; i++) {
        c.lower[i] = b->center[i] - b->radius;
        c.upper[i] = b->center[i] + b->radius;
    }
    memcpy(c.axis, b->axis, sizeof c.axis);
    c.cos_o = is_oriented ? b->cos_o : -1.0f;
    c.cos_e = b->cos_e;
    c.intensity = b->intensity;
    c.two_sided = is_oriented ? b->two_sided : 0;
    c.count = 1;
    return c;
}

/* Measure of the directions a cluster shines in, times its area and intensity. */
static float cluster_cost(const struct cluster *c) {
    if (c->count == 0)
        return 0.0f;
    const float o = acosf(clamp_cos(c->cos_o)), e = acosf(clamp_cos(c->cos_e));
    const float w = fminf(o + e, PI);
    const float so = sinf(o);
    const float omega = 2.0f * PI * (1.0f - c->cos_o) +
                        0.5f * PI * (2.0f * w * so - cosf(o - 2.0f * w) - 2.0f * o * so + c->cos_o);
    float d[3];
    for (int i = 0; i < 3; i++)
        d[i] = c->upper[i] - c->lower[i];
    const float area = d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    return c->intensity * omega * area;
}

struct builder {
    struct trc_light_table *table;
    struct trc_light_bound *leaves;
    uint32_t node_count;
};

static void set_node(struct trc_light_bound *node, const struct cluster *c) {
    float half[3];
    for (int i = 0; i < 3; i++) {
        node->center[i] = 0.5f * (c->lower[i] + c->upper[i]);
        half[i] = c->upper[i] - node->center[i];
    }
    node->radius = sqrtf(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]);
    memcpy(node->axis, c->axis, sizeof node->axis);
    node->cos_o = c->cos_o;
    node->sin_o = sqrtf(fmaxf(1.0f - c->cos_o * c->cos_o, 0.0f));
    node->cos_e = c->cos_e;
    node->intensity = c->intensity;
    node->two_sided = c->two_sided;
    node->light = -1;
}

/* Bin of a leaf along an axis. */
static int bin_of(const struct trc_light_bound *b, int axis, float low, float scale) {
    const int bin = (int)((b->center[axis] - low) * scale);
    return bin < 0 ? 0 : bin >= BIN_COUNT ? BIN_COUNT - 1 : bin;
}

static void center_range(const struct trc_light_bound *leaves, uint32_t count, float low[3],
                         float high[3]) {
    for (int i = 0; i < 3; i++) {
        low[i] = INFINITY;
        high[i] = -INFINITY;
        for (uint32_t k = 0; k < count; k++) {
            low[i] = fminf(low[i], leaves[k].center[i]);
            high[i] = fmaxf(high[i], leaves[k].center[i]);
        }
    }
}

/* Best bin border by the heuristic; false when all centres coincide. */
static bool best_split(const struct trc_light_bound *leaves, uint32_t count, int *axis_out,
                       int *border_out, float *low_out, float *scale_out) {
    float low[3], high[3];
    center_range(leaves, count, low, high);
    const float longest = fmaxf(high[0] - low[0], fmaxf(high[1] - low[1], high[2] - low[2]));
    float best = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        const float extent = high[axis] - low[axis];
        if (!(extent > 0.0f))
            continue;
        const float scale = BIN_COUNT / extent;
        struct cluster bins[BIN_COUNT], right[BIN_COUNT];
        for (int i = 0; i < BIN_COUNT; i++)
            bins[i] = empty_cluster();
        for (uint32_t k = 0; k < count; k++) {
            const struct cluster c = leaf_cluster(&leaves[k], count <= ORIENTED_COUNT_MAX);
            unite(&bins[bin_of(&leaves[k], axis, low[axis], scale)], &c);
        }
        right[BIN_COUNT - 1] = bins[BIN_COUNT - 1];
        for (int i = BIN_COUNT - 2; i > 0; i--) {
            right[i] = bins[i];
            unite(&right[i], &right[i + 1]);
        }
        struct cluster left = empty_cluster();
        for (int i = 1; i < BIN_COUNT; i++) {
            unite(&left, &bins[i - 1]);
            if (left.count == 0 || right[i].count == 0)
                continue;
            const float cost = (cluster_cost(&left) + cluster_cost(&right[i])) * (longest / extent);
            if (cost < best) {
                best = cost;
                *axis_out = axis;
                *border_out = i;
                *low_out = low[axis];
                *scale_out = scale;
            }
        }
    }
    return best < INFINITY;
}

static int compare_axis(const struct trc_light_bound *a, const struct trc_light_bound *b,
                        int axis) {
    if (a->center[axis] != b->center[axis])
        return a->center[axis] < b->center[axis] ? -1 : 1;
    return a->light < b->light ? -1 : 1;
}
static int compare_x(const void *a, const void *b) { return compare_axis(a, b, 0); }
static int compare_y(const void *a, const void *b) { return compare_axis(a, b, 1); }
static int compare_z(const void *a, const void *b) { return compare_axis(a, b, 2); }

static uint32_t split_middle(struct trc_light_bound *leaves, uint32_t count) {
    float low[3], high[3];
    center_range(leaves, count, low, high);
    int axis = 0;
    for (int i = 1; i < 3; i++)
        if (high[i] - low[i] > high[axis] - low[axis])
            axis = i;
    qsort(leaves, count, sizeof *leaves, axis == 0 ? compare_x : axis == 1 ? compare_y : compare_z);
    return count / 2;
}

/* Leaves up to the returned count go to the first child. */
static uint32_t split(struct trc_light_bound *leaves, uint32_t count, uint32_t depth) {
    int axis, border;
    float low, scale;
    const uint32_t levels = 32u - (uint32_t)__builtin_clz(count - 1u);
    if (depth + levels >= DEPTH_MAX || !best_split(leaves, count, &axis, &border, &low, &scale))
        return split_middle(leaves, count);
    uint32_t first = 0, last = count;
    while (first < last) {
        if (bin_of(&leaves[first], axis, low, scale) < border) {
            first++;
        } else {
            const struct trc_light_bound other = leaves[--last];
            leaves[last] = leaves[first];
            leaves[first] = other;
        }
    }
    return first > 0 && first < count ? first : split_middle(leaves, count);
}

/* Recursion is at most 32 deep. */
static struct cluster build_node(struct builder *b, uint32_t first, uint32_t count,
                                 uint32_t depth) {
    const uint32_t number = b->node_count++;
    struct trc_light_bound *node = &b->table->bounds[number];
    if (count == 1) {
        *node = b->leaves[first];
        node->child = -1;
        return leaf_cluster(node, true);
    }
    const uint32_t left = split(b->leaves + first, count, depth);
    struct cluster c = build_node(b, first, left, depth + 1);
    node->child = (int32_t)b->node_count;
    const struct cluster right = build_node(b, first + left, count - left, depth + 1);
    unite(&c, &right);
    set_node(node, &c);
    return c;
}

/* Parts of the whole below which a node of the cut stays closed: each gets one of the 16 shares of
 * kernels/light_select.h at least. */
#define LEAST_PART (1.0f / 16.0f)

/* Opens nodes that are strong, first where lights are far apart, until there are cut_max. */
static void choose_cut(struct trc_light_table *table, uint32_t cut_max) {
    const float least = table->bounds[0].intensity * LEAST_PART;
    table->cut[0] = 0;
    table->cut_count = 1;
    while (table->cut_count < cut_max) {
        int best = -1;
        float most = -1.0f;
        for (uint32_t i = 0; i < table->cut_count; i++) {
            const struct trc_light_bound *b = &table->bounds[table->cut[i]];
            const float gain = b->intensity * b->radius * b->radius;
            if (b->child >= 0 && b->intensity > least && gain > most) {
                most = gain;
                best = (int)i;
            }
        }
        if (best < 0)
            return;
        const uint32_t node = table->cut[best];
        table->cut[best] = node + 1;
        table->cut[table->cut_count++] = (uint32_t)table->bounds[node].child;
    }
}

/* Enters the lights below a node. Recursion is at most 32 deep. */
static void enter_lights(struct trc_light_table *table, uint32_t node, uint32_t candidate,
                         uint32_t depth, uint32_t trail) {
    const struct trc_light_bound *b = &table->bounds[node];
    if (b->child < 0) {
        table->candidates[b->light] = candidate;
        table->trails[b->light] = trail;
        return;
    }
    enter_lights(table, node + 1, candidate, depth + 1, trail);
    enter_lights(table, (uint32_t)b->child, candidate, depth + 1, trail | 1u << depth);
}

trc_status trc_light_tree_build(struct trc_light_table *table, struct trc_light_bound *leaves,
                                uint32_t count, uint32_t cut_max) {
    const size_t lights = (size_t)table->first_triangle + table->triangle_count;
    table->bounds = trc_alloc_zeroed(2 * (size_t)count, sizeof *table->bounds);
    table->trails = trc_alloc_zeroed(lights, sizeof *table->trails);
    if (!table->bounds || !table->trails)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the tree of %u lights", count);
    struct builder b = {table, leaves, 0};
    build_node(&b, 0, count, 0);
    table->bound_count = b.node_count;
    choose_cut(table, cut_max);
    for (uint32_t i = 0; i < table->cut_count; i++)
        enter_lights(table, table->cut[i], i, 0, 0);
    return TRC_OK;
}
