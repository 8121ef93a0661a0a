/* Early split clipping: see clip.h. */
#include "bvh/clip.h"

#include <math.h>

#include "bvh/part.h"
#include "model/ref.h"

/* Boxes are cut while they have so much more area than the triangles in them, seen along the axes:
 * upright, half a rectangle has 2, and stays whole. */
#define EMPTY_RATIO 2.2f
/* Planes stay that part of a box's length away from its ends. */
#define MIN_PART 0.05f
/* Corners of a triangle cut six times: one more each time; where rounding makes them zigzag, half
 * as many more. */
#define POLYGON_CORNERS 28
/* Where a plane cuts an edge is off by less than 11 half-ulps (2^-24) of the largest coordinate:
 * three of the quotient, each of up to twice that coordinate, as are the difference and the product
 * that it goes into, and one of the sum. Six cuts are off by less than this part of it. */
#define CLIP_ERROR 4e-6f
/* Pieces that wait while others are cut: one more for each cut on the way to them. */
#define STACK_PIECES 40

struct polygon {
    f4 corner[POLYGON_CORNERS];
    int count;
};

struct piece {
    struct trc_ref ref;
    float area; /* of its triangles within its box, seen along all three axes */
};

/* Keeps what is above a plane across an axis, or below it. */
static void polygon_cut(struct polygon *p, int axis, float plane, bool above) {
    struct polygon out = {.count = 0};
    for (int i = 0; i < p->count; i++) {
        const f4 a = p->corner[i], b = p->corner[i + 1 < p->count ? i + 1 : 0];
        const bool has_a = above ? a[axis] >= plane : a[axis] <= plane;
        const bool has_b = above ? b[axis] >= plane : b[axis] <= plane;
        if (has_a)
            out.corner[out.count++] = a;
        if (has_a == has_b)
            continue;
        f4 cut = a + (b - a) * f4_set((plane - a[axis]) / (b[axis] - a[axis]));
        cut[axis] = plane;
        out.corner[out.count++] = cut;
    }
    *p = out;
}

static struct box polygon_bounds(const struct polygon *p) {
    struct box b = box_empty();
    for (int i = 0; i < p->count; i++)
        box_add(&b, p->corner[i]);
    return b;
}

/* Sum of its areas seen along the axes. */
static float polygon_area(const struct polygon *p) {
    f4 sum = f4_set(0.0f);
    for (int i = 2; i < p->count; i++) {
        const f4 a = p->corner[i - 1] - p->corner[0], b = p->corner[i] - p->corner[0];
        sum += a * f4_yzx(b) - b * f4_yzx(a);
    }
    sum = f4_abs(sum);
    return 0.5f * (sum[0] + sum[1] + sum[2]);
}

static struct box box_widened(struct box b, float margin) {
    const f4 all = {margin, margin, margin, 0.0f};
    return (struct box){b.lower - all, b.upper + all};
}

/* What lies of a triangle in a box, and is added to area; empty: nothing. It is looked for in a
 * wider box, and its bounds are widened as well, so that no point of it is lost to rounding, in
 * however thin a triangle; neighbours still have but the plane between them in common. */
static struct box triangle_within(const struct trc_part *part, uint32_t triangle, struct box within,
                                  float *area) {
    struct polygon p = {.count = 3};
    trc_part_corners(part, part->mesh->indices + 3 * (size_t)triangle, 0, p.corner);
    const struct box whole = polygon_bounds(&p);
    const f4 largest = f4_max(f4_abs(whole.lower), f4_abs(whole.upper));
    const float error = CLIP_ERROR * fmaxf(largest[0], fmaxf(largest[1], largest[2]));
    const struct box wider = box_widened(within, error);
    for (int axis = 0; axis < 3; axis++) {
        if (whole.lower[axis] < wider.lower[axis])
            polygon_cut(&p, axis, wider.lower[axis], true);
        if (whole.upper[axis] > wider.upper[axis])
            polygon_cut(&p, axis, wider.upper[axis], false);
    }
    if (p.count == 0)
        return box_empty();
    *area += polygon_area(&p);
    return box_common(box_common(box_widened(polygon_bounds(&p), error), whole), within);
}

/* The piece of a ref within a box: its triangles from the first to the last that has a part in it.
 * False: none has. */
static bool piece_cut(const struct trc_part *part, const struct trc_ref *ref, struct box within,
                      struct piece *out) {
    const uint32_t first = trc_ref_first(ref), count = trc_ref_count(ref);
    uint32_t begin = count, end = 0;
    struct box bounds = box_empty();
    out->area = 0.0f;
    for (uint32_t i = 0; i < count; i++) {
        const struct box b = triangle_within(part, first + i, within, &out->area);
        if (i4_any(b.lower > b.upper))
            continue;
        box_grow(&bounds, b);
        begin = i < begin ? i : begin;
        end = i + 1;
    }
    if (end == 0)
        return false;
    out->ref = (struct trc_ref){.part = ref->part | TRC_PART_CLIPPED,
                                .primitive = (first + begin) | (end - begin - 1) * TRC_REF_NEXT};
    f4_store3(out->ref.lower, bounds.lower);
    f4_store3(out->ref.upper, bounds.upper);
    return true;
}

/* Where a box is cut: at a plane of the coarsest grid that has one well within it. */
static float grid_plane(const struct trc_clip *clip, struct box b, int axis) {
    const float origin = clip->bounds.lower[axis], length = b.upper[axis] - b.lower[axis];
    const float low = b.lower[axis] + MIN_PART * length, high = b.upper[axis] - MIN_PART * length;
    float cell = clip->bounds.upper[axis] - origin;
    /* Cells as long as what is between low and high have a plane there. */
    while (cell > 0.5f * length) {
        cell *= 0.5f;
        const float plane = origin + cell * floorf((high - origin) / cell);
        if (plane > low && plane < high)
            return plane;
    }
    return 0.5f * (b.lower[axis] + b.upper[axis]);
}

/* Both sides of a piece that is worth cutting go to sides_out: how many there are. 0: it stays. */
static uint32_t piece_divide(const struct trc_part *part, const struct trc_clip *clip,
                             const struct piece *p, struct piece sides_out[2]) {
    const struct box box = trc_ref_box(&p->ref);
    const float area = box_area(box);
    if (area <= clip->min_area || area <= EMPTY_RATIO * p->area || p->area == 0.0f)
        return 0;
    const int axis = f4_largest_axis(box_size(box));
    const float plane = grid_plane(clip, box, axis);
    if (!(plane > box.lower[axis] && plane < box.upper[axis]))
        return 0;
    struct box below = box, above = box;
    below.upper[axis] = above.lower[axis] = plane;
    const uint32_t count = piece_cut(part, &p->ref, below, &sides_out[0]);
    return count + piece_cut(part, &p->ref, above, &sides_out[count]);
}

uint32_t trc_ref_clip(const struct trc_part *part, const struct trc_ref *ref,
                      const struct trc_clip *clip, struct trc_ref *pieces_out,
                      uint32_t *triangles_out) {
    struct piece stack[STACK_PIECES];
    uint32_t top = 0, count = 0, triangles = 0;
    (void)piece_cut(part, ref, trc_ref_box(ref), &stack[top++]); /* for its area */
    stack[0].ref = *ref;
    while (top > 0) {
        const struct piece p = stack[--top];
        const bool has_room = top + 2 <= STACK_PIECES && count + top + 2 <= TRC_CLIP_MAX_PIECES;
        const uint32_t sides = has_room ? piece_divide(part, clip, &p, stack + top) : 0;
        top += sides;
        if (sides > 0)
            continue;
        if (pieces_out)
            pieces_out[count] = p.ref;
        count++;
        triangles += trc_ref_count(&p.ref);
    }
    *triangles_out = triangles;
    return count;
}
