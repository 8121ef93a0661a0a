/* The light tree: binary, split by the surface-area-orientation heuristic of Conty Estevez and
 * Kulla (2018), one light per leaf. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/box.h"
#include "core/core.h"
#include "core/pool.h"
#include "shading/lights.h"

#define PI 3.14159265358979f
#define BIN_COUNT 12
/* Turns are kept in 32 bits: where an uneven split could need more, the count is halved. */
#define DEPTH_MAX 31u
/* Larger sets are split without regard to orientation: with it a picture of 200,000 lights takes a
 * tenth longer and has the same error. */
#define ORIENTED_COUNT_MAX 4096u
/* Rounding must not lose a direction: cosines of united cones are lowered by so much. */
#define CONE_SLACK 1e-4f
/* Sets of more lights than SERIAL_COUNT_MAX are split until there are TASK_MAX for the threads. */
#define SERIAL_COUNT_MAX 2048u
#define TASK_MAX 32u

/* What a set of lights is bounded by. A cone of all directions has cos_o -1. */
struct cluster {
    struct box box;
    f4 axis;
    float cos_o, sin_o, cos_e, intensity;
    int32_t two_sided;
    uint32_t count;
};

static float dot(f4 a, f4 b) {
    const f4 c = a * b;
    return c[0] + c[1] + c[2];
}
/* fminf and fmaxf are calls. */
static float minimum(float a, float b) { return a < b ? a : b; }
static float maximum(float a, float b) { return a > b ? a : b; }
static float sine(float cosine) { return sqrtf(maximum(1.0f - cosine * cosine, 0.0f)); }

static struct cluster empty_cluster(void) { return (struct cluster){.box = box_empty()}; }

static void shine_everywhere(struct cluster *c) {
    c->cos_o = -1.0f;
    c->sin_o = 0.0f;
    c->two_sided = 0;
}

/* Smallest cone that holds two cones (Conty Estevez and Kulla, supplement). Angles are added by
 * their sines and cosines; a cone that would reach beyond the opposite of the wide cone's axis
 * becomes all directions. */
static void unite_cones(struct cluster *a, const struct cluster *b) {
    if (a->two_sided != b->two_sided || a->cos_o <= -1.0f || b->cos_o <= -1.0f) {
        shine_everywhere(a);
        return;
    }
    f4 other = b->axis;
    float d = dot(a->axis, other);
    if (a->two_sided && d < 0.0f) {
        d = -d;
        other = -other;
    }
    d = minimum(maximum(d, -1.0f), 1.0f);
    const float s = sine(d);
    const bool a_is_wide = a->cos_o <= b->cos_o;
    const struct cluster *wide = a_is_wide ? a : b, *narrow = a_is_wide ? b : a;
    const f4 from = a_is_wide ? a->axis : other, to = a_is_wide ? other : a->axis;
    const float cos_w = wide->cos_o, sin_w = wide->sin_o;
    /* From the axis of the wide cone to the far rim of the narrow one. */
    const float cos_far = d * narrow->cos_o - s * narrow->sin_o;
    const float sin_far = s * narrow->cos_o + d * narrow->sin_o;
    if (sin_far < 0.0f || (s < 1e-6f && d < 0.0f)) {
        shine_everywhere(a);
        return;
    }
    a->axis = from;
    a->cos_o = cos_w;
    a->sin_o = sin_w;
    if (cos_far >= cos_w || s < 1e-6f)
        return;
    /* Half of the angle between both rims. */
    const float cos_rims = cos_w * cos_far - sin_w * sin_far;
    const float sin_rims = sin_w * cos_far + cos_w * sin_far;
    const float cos_u = copysignf(sqrtf(maximum(0.5f + 0.5f * cos_rims, 0.0f)), sin_rims);
    const float sin_u = sqrtf(maximum(0.5f - 0.5f * cos_rims, 0.0f));
    /* The axis turns by what the half angle has grown. */
    const float cos_t = cos_u * cos_w + sin_u * sin_w, sin_t = sin_u * cos_w - cos_u * sin_w;
    const f4 axis = from * f4_set(cos_t - sin_t * d / s) + to * f4_set(sin_t / s);
    a->axis = axis / f4_set(sqrtf(dot(axis, axis)));
    a->cos_o = maximum(cos_u - CONE_SLACK, -1.0f);
    a->sin_o = sine(a->cos_o);
}

static void unite(struct cluster *a, const struct cluster *b) {
    if (b->count == 0)
        return;
    if (a->count == 0) {
        *a = *b;
        return;
    }
    box_grow(&a->box, b->box);
    unite_cones(a, b);
    a->cos_e = minimum(a->cos_e, b->cos_e);
    a->intensity += b->intensity;
    a->count += b->count;
}

static struct cluster leaf_cluster(const struct trc_light_bound *b, bool is_oriented) {
    const f4 center = f4_load3(b->center), radius = f4_set(b->radius);
    struct cluster c = {.box = {center - radius, center + radius},
                        .axis = f4_load3(b->axis),
                        .cos_o = b->cos_o,
                        .sin_o = b->sin_o,
                        .cos_e = b->cos_e,
                        .intensity = b->intensity,
                        .two_sided = b->two_sided,
                        .count = 1};
    if (!is_oriented)
        shine_everywhere(&c);
    return c;
}

/* acos to 7e-5 (Abramowitz and Stegun 1964, 4.4.45), close enough to compare costs. */
static float angle_of(float cosine) {
    const float x = minimum(fabsf(cosine), 1.0f);
    const float angle =
        sqrtf(1.0f - x) * (1.5707288f + x * (-0.2121144f + x * (0.0742610f - x * 0.0187293f)));
    return cosine < 0.0f ? PI - angle : angle;
}

/* Measure of the directions a cluster shines in, times its area and intensity. */
static float cluster_cost(const struct cluster *c) {
    const float cos_o = c->cos_o, sin_o = c->sin_o, cos_e = c->cos_e;
    float outside; /* what shines beyond the cone */
    if (cos_o <= -cos_e) {
        outside = 2.0f * (PI - angle_of(cos_o)) * sin_o;
    } else {
        const float cos_2e = 2.0f * cos_e * cos_e - 1.0f, sin_2e = 2.0f * cos_e * sine(cos_e);
        outside = 2.0f * angle_of(cos_e) * sin_o - (cos_o * cos_2e - sin_o * sin_2e) + cos_o;
    }
    const float omega = 2.0f * PI * (1.0f - cos_o) + 0.5f * PI * outside;
    return c->intensity * omega * box_area(c->box);
}

static void set_node(struct trc_light_bound *node, const struct cluster *c) {
    const f4 center = f4_set(0.5f) * (c->box.lower + c->box.upper), half = c->box.upper - center;
    f4_store3(node->center, center);
    node->radius = sqrtf(dot(half, half));
    f4_store3(node->axis, c->axis);
    node->cos_o = c->cos_o;
    node->sin_o = c->sin_o;
    node->cos_e = c->cos_e;
    node->intensity = c->intensity;
    node->two_sided = c->two_sided;
    node->light = -1;
}

/* Where a set is cut: leaves in bins below the border go to the first child. */
struct cut {
    int axis, border;
    float low, scale;
};

/* Bin of a leaf along an axis. */
static int bin_of(const struct trc_light_bound *b, int axis, float low, float scale) {
    const int bin = (int)((b->center[axis] - low) * scale);
    return bin < 0 ? 0 : bin >= BIN_COUNT ? BIN_COUNT - 1 : bin;
}

static struct box center_range(const struct trc_light_bound *leaves, uint32_t count) {
    struct box range = box_empty();
    for (uint32_t k = 0; k < count; k++)
        box_add(&range, f4_load3(leaves[k].center));
    return range;
}

/* Cheapest border between the bins of an axis; costs are multiplied by factor. */
static void sweep_bins(const struct cluster bins[BIN_COUNT], float factor, float *best,
                       struct cut *cut, struct cut here) {
    float right_cost[BIN_COUNT];
    struct cluster right = empty_cluster(), left = empty_cluster();
    for (int i = BIN_COUNT - 1; i > 0; i--) {
        unite(&right, &bins[i]);
        right_cost[i] = right.count && bins[i - 1].count ? cluster_cost(&right) : INFINITY;
    }
    for (int i = 1; i < BIN_COUNT; i++) {
        unite(&left, &bins[i - 1]);
        if (!(right_cost[i] < INFINITY))
            continue; /* nothing beyond, or the same sets as before */
        const float cost = (cluster_cost(&left) + right_cost[i]) * factor;
        if (cost < *best) {
            *best = cost;
            *cut = here;
            cut->border = i;
        }
    }
}

/* Best bin border by the heuristic; false when all centres coincide. */
static bool best_cut(const struct trc_light_bound *leaves, uint32_t count, struct cut *cut) {
    const struct box range = center_range(leaves, count);
    const f4 extent = box_size(range);
    const float longest = maximum(extent[0], maximum(extent[1], extent[2]));
    f4 scale;
    struct cluster bins[3][BIN_COUNT];
    for (int axis = 0; axis < 3; axis++) {
        scale[axis] = extent[axis] > 0.0f ? BIN_COUNT / extent[axis] : 0.0f;
        for (int i = 0; i < BIN_COUNT; i++)
            bins[axis][i] = empty_cluster();
    }
    for (uint32_t k = 0; k < count; k++) {
        const struct cluster c = leaf_cluster(&leaves[k], count <= ORIENTED_COUNT_MAX);
        for (int axis = 0; axis < 3; axis++)
            unite(&bins[axis][bin_of(&leaves[k], axis, range.lower[axis], scale[axis])], &c);
    }
    float best = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        if (extent[axis] > 0.0f)
            sweep_bins(bins[axis], longest / extent[axis], &best, cut,
                       (struct cut){axis, 0, range.lower[axis], scale[axis]});
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
    const f4 extent = box_size(center_range(leaves, count));
    int axis = 0;
    for (int i = 1; i < 3; i++)
        if (extent[i] > extent[axis])
            axis = i;
    qsort(leaves, count, sizeof *leaves, axis == 0 ? compare_x : axis == 1 ? compare_y : compare_z);
    return count / 2;
}

/* Leaves up to the returned count go to the first child. */
static uint32_t split(struct trc_light_bound *leaves, uint32_t count, uint32_t depth) {
    struct cut cut;
    if (count == 2)
        return 1;
    const uint32_t levels = 32u - (uint32_t)__builtin_clz(count - 1u);
    if (depth + levels >= DEPTH_MAX || !best_cut(leaves, count, &cut))
        return split_middle(leaves, count);
    uint32_t first = 0, last = count;
    while (first < last) {
        if (bin_of(&leaves[first], cut.axis, cut.low, cut.scale) < cut.border) {
            first++;
        } else {
            const struct trc_light_bound other = leaves[--last];
            leaves[last] = leaves[first];
            leaves[first] = other;
        }
    }
    return first > 0 && first < count ? first : split_middle(leaves, count);
}

/* A subtree: what it covers, and what it was found to be bounded by. A set of n lights has 2 n - 1
 * nodes, so the numbers of a subtree's nodes are known before it is built. */
struct subtree {
    uint32_t number, first, count, depth;
    struct cluster cluster;
};

struct builder {
    const struct trc_light_options *options;
    struct trc_light_table *table;
    struct trc_light_bound *leaves;
    struct subtree tasks[TASK_MAX];
    uint32_t task_count;
};

static struct subtree divide(const struct builder *b, struct subtree *t) {
    const uint32_t left = split(b->leaves + t->first, t->count, t->depth);
    const struct subtree second = {t->number + 2 * left, t->first + left, t->count - left,
                                   t->depth + 1, empty_cluster()};
    b->table->bounds[t->number].child = (int32_t)second.number;
    *t = (struct subtree){t->number + 1, t->first, left, t->depth + 1, empty_cluster()};
    return second;
}

/* Recursion is at most 32 deep. */
static struct cluster build_subtree(const struct builder *b, struct subtree t) {
    struct trc_light_bound *node = &b->table->bounds[t.number];
    if (t.count == 1) {
        *node = b->leaves[t.first];
        node->child = -1;
        return leaf_cluster(node, true);
    }
    const struct subtree second = divide(b, &t);
    struct cluster c = build_subtree(b, t);
    const struct cluster right = build_subtree(b, second);
    unite(&c, &right);
    set_node(node, &c);
    return c;
}

static void build_task(void *context, uint32_t index, uint32_t worker) {
    struct builder *b = context;
    (void)worker;
    if (!trc_lights_are_cancelled(b->options))
        b->tasks[index].cluster = build_subtree(b, b->tasks[index]);
}

/* Splits the largest set, again and again. */
static void make_tasks(struct builder *b, uint32_t count) {
    b->tasks[0] = (struct subtree){0, 0, count, 0, empty_cluster()};
    b->task_count = 1;
    while (b->task_count < TASK_MAX) {
        uint32_t largest = 0;
        for (uint32_t i = 1; i < b->task_count; i++)
            if (b->tasks[i].count > b->tasks[largest].count)
                largest = i;
        if (b->tasks[largest].count <= SERIAL_COUNT_MAX || trc_lights_are_cancelled(b->options))
            return;
        b->tasks[b->task_count++] = divide(b, &b->tasks[largest]);
    }
}

/* Bounds the nodes above the tasks. Recursion is at most TASK_MAX deep. */
static struct cluster bound_top(const struct builder *b, uint32_t number) {
    for (uint32_t i = 0; i < b->task_count; i++)
        if (b->tasks[i].number == number)
            return b->tasks[i].cluster;
    struct trc_light_bound *node = &b->table->bounds[number];
    struct cluster c = bound_top(b, number + 1);
    const struct cluster right = bound_top(b, (uint32_t)node->child);
    unite(&c, &right);
    set_node(node, &c);
    return c;
}

/* Parts of the whole below which a node of the cut stays closed: each gets one of the 16 shares of
 * kernels/light/select.h at least. */
#define MIN_PART (1.0f / 16.0f)

/* Opens nodes that are strong, first where lights are far apart, until there are cut_max. */
static void choose_cut(struct trc_light_table *table, uint32_t cut_max) {
    const float floor = table->bounds[0].intensity * MIN_PART;
    table->cut[0] = 0;
    table->cut_count = 1;
    while (table->cut_count < cut_max) {
        int best = -1;
        float best_gain = -1.0f;
        for (uint32_t i = 0; i < table->cut_count; i++) {
            const struct trc_light_bound *b = &table->bounds[table->cut[i]];
            const float gain = b->intensity * b->radius * b->radius;
            if (b->child >= 0 && b->intensity > floor && gain > best_gain) {
                best_gain = gain;
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

/* Children come after their parents. */
static void unite_excluded(struct trc_light_table *table) {
    for (uint32_t i = table->bound_count; i-- > 0;) {
        struct trc_light_bound *node = &table->bounds[i];
        for (int k = 0; node->child >= 0 && k < 2; k++)
            node->excluded[k] =
                table->bounds[i + 1].excluded[k] & table->bounds[node->child].excluded[k];
    }
}

trc_status trc_light_tree_build(struct trc_light_table *table, struct trc_light_bound *leaves,
                                uint32_t count, uint32_t cut_max,
                                const struct trc_light_options *options) {
    const size_t lights = (size_t)table->first_triangle + table->triangle_count;
    table->bounds = trc_alloc_zeroed(2 * (size_t)count, sizeof *table->bounds);
    table->trails = trc_alloc_zeroed(lights, sizeof *table->trails);
    if (!table->bounds || !table->trails)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the tree of %u lights", count);
    struct builder b = {.options = options, .table = table, .leaves = leaves};
    make_tasks(&b, count);
    trc_pool_run(options->pool, b.task_count, build_task, &b);
    if (trc_lights_are_cancelled(options))
        return trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled");
    bound_top(&b, 0);
    table->bound_count = 2 * count - 1;
    if (table->linked)
        unite_excluded(table);
    choose_cut(table, cut_max);
    for (uint32_t i = 0; i < table->cut_count; i++)
        enter_lights(table, table->cut[i], i, 0, 0);
    return TRC_OK;
}
