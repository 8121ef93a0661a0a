/* The Voronoi texture: one random point in every cell of a grid, and how far the nearest are.
 *
 * S. Worley, "A Cellular Texture Basis Function" (1996); the smooth minimum and the distance to the
 * edge after I. Quilez, "Smooth Voronoi" (2014) and "Voronoi Edges" (2012). Points, order of search
 * and limits as in Cycles 3.4, octaves and what their sums are divided by as in Cycles 4.3. */
#include <math.h>

#include "kernels/program/hash.h"
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "model/program.h"

/* What is farther counts as nothing, unless TRC_VORONOI_UNLIMITED. */
#define VORONOI_FAR 8.0f
/* Two points whose distance squared is below it are one: no edge runs between them. */
#define VORONOI_SAME 0.0001f

/* A place among the points of its cell and those around it, in coordinates from the cell's corner.
 */
struct voronoi {
    int dims;
    uint32_t metric; /* TRC_VORONOI_* */
    bool has_pcg;    /* TRC_VORONOI_PCG, where it matters */
    float far;       /* what is farther counts as nothing */
    vfloat exponent, randomness;
    vfloat cell[TRC_MAX_DIMENSIONS], local[TRC_MAX_DIMENSIONS];
};

/* A point found: distance, the cell it is in relative to that of the place, position. */
struct voronoi_point {
    vfloat distance, offset[TRC_MAX_DIMENSIONS], at[TRC_MAX_DIMENSIONS];
};

/* ---- points and distances ---- */

/* Cells around the place within reach, X running fastest: offset of cell number index. */
TRC_INLINE int voronoi_cell_count(int dims, int reach) {
    int count = 1;
    for (int i = 0; i < dims; i++)
        count *= 2 * reach + 1;
    return count;
}
TRC_INLINE void voronoi_offset(int dims, int reach, int index, vfloat *offset) {
    for (int i = 0; i < dims; i++) {
        offset[i] = vf_set((float)(index % (2 * reach + 1) - reach));
        index /= 2 * reach + 1;
    }
}

/* The cell at an offset from the place's; 0 beyond the dimensions. */
TRC_INLINE void voronoi_cell(const struct voronoi *v, const vfloat *offset, vfloat *cell) {
    for (int i = 0; i < TRC_MAX_DIMENSIONS; i++)
        cell[i] = i < v->dims ? v->cell[i] + offset[i] : vf_zero();
}

TRC_INLINE void voronoi_at(const struct voronoi *v, const vfloat *offset, vfloat *at) {
    vfloat cell[TRC_MAX_DIMENSIONS], random[TRC_MAX_DIMENSIONS];
    voronoi_cell(v, offset, cell);
    if (v->has_pcg)
        cell_point(v->dims, cell, random);
    else
        hash_point(v->dims, cell, random);
    for (int i = 0; i < v->dims; i++)
        at[i] = offset[i] + random[i] * v->randomness;
}

static vvec3 voronoi_color(const struct voronoi *v, const vfloat *offset) {
    vfloat cell[TRC_MAX_DIMENSIONS];
    voronoi_cell(v, offset, cell);
    return v->has_pcg ? cell_color(v->dims, cell) : hash_color(v->dims, cell);
}

TRC_INLINE vfloat voronoi_square(int dims, const vfloat *a, const vfloat *b) {
    vfloat sum = vf_square(a[0] - b[0]);
    for (int i = 1; i < dims; i++)
        sum = sum + vf_square(a[i] - b[i]);
    return sum;
}

static vfloat voronoi_distance(const struct voronoi *v, const vfloat *a, const vfloat *b) {
    vfloat sum = vf_abs(a[0] - b[0]);
    if (v->dims == 1)
        return sum;
    switch (v->metric) {
    case TRC_VORONOI_MANHATTAN:
        for (int i = 1; i < v->dims; i++)
            sum = sum + vf_abs(a[i] - b[i]);
        return sum;
    case TRC_VORONOI_CHEBYCHEV:
        for (int i = 1; i < v->dims; i++)
            sum = vf_max(sum, vf_abs(a[i] - b[i]));
        return sum;
    case TRC_VORONOI_MINKOWSKI:
        sum = vf_pow(sum, v->exponent);
        for (int i = 1; i < v->dims; i++)
            sum = sum + vf_pow(vf_abs(a[i] - b[i]), v->exponent);
        return vf_pow(sum, vf_rcp(v->exponent));
    default:
        return vf_sqrt(voronoi_square(v->dims, a, b));
    }
}

TRC_INLINE void voronoi_copy(int dims, vmask m, const struct voronoi_point *from,
                             struct voronoi_point *to) {
    to->distance = vf_select(m, from->distance, to->distance);
    for (int i = 0; i < dims; i++) {
        to->offset[i] = vf_select(m, from->offset[i], to->offset[i]);
        to->at[i] = vf_select(m, from->at[i], to->at[i]);
    }
}

static void voronoi_nothing(const struct voronoi *v, struct voronoi_point *p) {
    p->distance = vf_set(v->far);
    for (int i = 0; i < TRC_MAX_DIMENSIONS; i++)
        p->offset[i] = p->at[i] = vf_zero();
}

/* ---- features ---- */

/* The nearest point and, if second is given, the one after it. */
static void voronoi_nearest(const struct voronoi *v, struct voronoi_point *first,
                            struct voronoi_point *second) {
    const int count = voronoi_cell_count(v->dims, 1);
    voronoi_nothing(v, first);
    if (second)
        voronoi_nothing(v, second);
    for (int k = 0; k < count; k++) {
        struct voronoi_point p;
        voronoi_offset(v->dims, 1, k, p.offset);
        voronoi_at(v, p.offset, p.at);
        p.distance = voronoi_distance(v, p.at, v->local);
        const vmask nearer = vf_lt(p.distance, first->distance);
        if (second) {
            const vmask between = vm_andnot(vf_lt(p.distance, second->distance), nearer);
            voronoi_copy(v->dims, nearer, first, second);
            voronoi_copy(v->dims, between, &p, second);
        }
        voronoi_copy(v->dims, nearer, &p, first);
    }
}

/* Distance, position and colour of the nearest point, each passing smoothly into the next. */
static void voronoi_smooth(const struct voronoi *v, vfloat smoothness, bool has_color,
                           struct voronoi_point *mean, vvec3 *color) {
    const vfloat one = vf_one(), half = vf_set(0.5f);
    const int count = voronoi_cell_count(v->dims, 2);
    voronoi_nothing(v, mean);
    *color = v3_zero();
    for (int k = 0; k < count; k++) {
        struct voronoi_point p;
        voronoi_offset(v->dims, 2, k, p.offset);
        voronoi_at(v, p.offset, p.at);
        p.distance = voronoi_distance(v, p.at, v->local);
        if (k == 0 && isinf(v->far)) { /* which nothing can be mixed with */
            voronoi_copy(v->dims, vm_all_set(), &p, mean);
            *color = has_color ? voronoi_color(v, p.offset) : *color;
            continue;
        }
        const vfloat t = vf_saturate(half + half * (mean->distance - p.distance) / smoothness);
        const vfloat h = t * t * (vf_set(3.0f) - vf_set(2.0f) * t);
        const vfloat dip = smoothness * h * (one - h);
        mean->distance = mean->distance + h * (p.distance - mean->distance) - dip;
        const vfloat less = dip / (one + vf_set(3.0f) * smoothness);
        for (int i = 0; i < v->dims; i++)
            mean->at[i] = mean->at[i] + h * (p.at[i] - mean->at[i]) - less;
        if (!has_color)
            continue;
        const vvec3 c = v3_sub(voronoi_color(v, p.offset), *color);
        *color = v3_sub(v3_mad(c, h, *color), v3_splat(less));
    }
}

/* From a place on a line to the middle between its point and a neighbouring one. */
static vfloat voronoi_edge_1d(const struct voronoi *v) {
    vfloat at[3];
    for (int k = 0; k < 3; k++) {
        const vfloat offset[1] = {vf_set((float)(k - 1))};
        voronoi_at(v, offset, &at[k]);
    }
    const vfloat half = vf_set(0.5f);
    const vfloat left = vf_abs((at[1] + at[0]) * half - v->local[0]);
    return vf_min(left, vf_abs((at[1] + at[2]) * half - v->local[0]));
}

/* To the plane halfway between the nearest point and any other. */
static vfloat voronoi_edge(const struct voronoi *v) {
    if (v->dims == 1)
        return voronoi_edge_1d(v);
    const int count = voronoi_cell_count(v->dims, 1);
    vfloat best = vf_set(VORONOI_FAR), closest[TRC_MAX_DIMENSIONS], edge = best;
    for (int i = 0; i < v->dims; i++)
        closest[i] = vf_zero();
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < count; k++) {
            vfloat offset[TRC_MAX_DIMENSIONS], way[TRC_MAX_DIMENSIONS];
            vfloat square = vf_zero(), along = vf_zero();
            voronoi_offset(v->dims, 1, k, offset);
            voronoi_at(v, offset, way);
            for (int i = 0; i < v->dims; i++) {
                way[i] = way[i] - v->local[i];
                const vfloat across = pass ? way[i] - closest[i] : way[i];
                square = square + across * across;
                along = along + (closest[i] + way[i]) * vf_set(0.5f) * across;
            }
            if (pass) {
                const vmask apart = vf_gt(square, vf_set(VORONOI_SAME));
                const vfloat distance = along / vf_sqrt(vf_select(apart, square, vf_one()));
                edge = vf_select(apart, vf_min(edge, distance), edge);
                continue;
            }
            const vmask nearer = vf_lt(square, best);
            best = vf_select(nearer, square, best);
            for (int i = 0; i < v->dims; i++)
                closest[i] = vf_select(nearer, way[i], closest[i]);
        }
    }
    return edge;
}

/* Half the way from the nearest point to the point nearest to that one. */
static vfloat voronoi_radius(const struct voronoi *v) {
    struct voronoi euclidean = *v;
    struct voronoi_point first;
    euclidean.metric = TRC_VORONOI_EUCLIDEAN;
    voronoi_nearest(&euclidean, &first, NULL);
    const int count = voronoi_cell_count(v->dims, 1);
    vfloat best = vf_set(VORONOI_FAR);
    struct voronoi_point other;
    voronoi_nothing(v, &other); /* gcc 16 believes that those beyond the dimensions are read */
    for (int k = 0; k < count; k++) {
        if (k == count / 2) /* the point itself */
            continue;
        voronoi_offset(v->dims, 1, k, other.offset);
        for (int i = 0; i < v->dims; i++)
            other.offset[i] = other.offset[i] + first.offset[i];
        voronoi_at(v, other.offset, other.at);
        best = vf_min(voronoi_distance(&euclidean, first.at, other.at), best);
    }
    return best * vf_set(0.5f);
}

/* ---- octaves ---- */

/* What one octave or several give: a distance and, unless to an edge, colour and position. */
struct voronoi_value {
    vfloat distance, at[TRC_MAX_DIMENSIONS];
    vvec3 color;
};

/* octaves after the first: whole ones, and a last one that counts by the rest. */
struct voronoi_detail {
    vfloat detail, roughness, lacunarity;
};

static void voronoi_enter(struct voronoi *v, const vfloat *place, vfloat scale) {
    for (int i = 0; i < v->dims; i++) {
        const vfloat p = place[i] * scale;
        v->cell[i] = vf_floor(p);
        v->local[i] = p - v->cell[i];
    }
}

/* One octave of any feature but the radius, around the place that v was made to enter. */
static void voronoi_octave(const struct voronoi *v, uint32_t feature, vfloat smoothness,
                           bool has_color, struct voronoi_value *out) {
    struct voronoi_point first, second;
    out->color = v3_zero();
    switch (feature) {
    case TRC_VORONOI_DISTANCE_TO_EDGE:
        voronoi_nothing(v, &first);
        first.distance = voronoi_edge(v);
        break;
    case TRC_VORONOI_F2:
        voronoi_nearest(v, &second, &first);
        break;
    case TRC_VORONOI_SMOOTH_F1:
        voronoi_smooth(v, smoothness, has_color, &first, &out->color);
        break;
    default:
        voronoi_nearest(v, &first, NULL);
        break;
    }
    if (has_color && (feature == TRC_VORONOI_F1 || feature == TRC_VORONOI_F2))
        out->color = voronoi_color(v, first.offset);
    out->distance = first.distance;
    for (int i = 0; i < v->dims; i++)
        out->at[i] = first.at[i] + v->cell[i];
}

/* The farthest that a feature's first octave is taken to be, for normalisation. */
static vfloat voronoi_reach(const struct voronoi *v, uint32_t feature) {
    const vfloat half = vf_set(0.5f), side = half + half * v->randomness;
    vfloat origin[TRC_MAX_DIMENSIONS], corner[TRC_MAX_DIMENSIONS];
    if (feature == TRC_VORONOI_DISTANCE_TO_EDGE)
        return side;
    for (int i = 0; i < v->dims; i++) {
        origin[i] = vf_zero();
        corner[i] = side;
    }
    const vfloat farthest = voronoi_distance(v, origin, corner);
    return feature == TRC_VORONOI_F2 ? farthest + farthest : farthest;
}

/* Adds weight times a, which may be infinite elsewhere, in these lanes. */
TRC_INLINE void voronoi_add(vmask m, vfloat weight, vfloat a, vfloat *sum) {
    *sum = vf_select(m, *sum + weight * a, *sum);
}

/* Octaves, each finer by the lacunarity and fainter by the roughness. Distances and colours add up;
 * positions, and edges where an octave's are nearer, go over to the octave's by its weight. */
static void voronoi_fractal(struct voronoi *v, uint32_t mode, vfloat smoothness,
                            const struct voronoi_detail *d, const vfloat *place,
                            struct voronoi_value *sum) {
    const uint32_t feature = (mode >> TRC_VORONOI_FEATURE_SHIFT) & TRC_VORONOI_FEATURE_MASK;
    const bool has_color = !(mode & TRC_MODE_NO_COLOR);
    const bool is_edge = feature == TRC_VORONOI_DISTANCE_TO_EDGE;
    const bool normalizes = mode & TRC_VORONOI_NORMALIZE;
    const vfloat reach = normalizes ? voronoi_reach(v, feature) : vf_one();
    const vfloat whole = vf_floor(d->detail), rest = d->detail - whole;
    vfloat amplitude = vf_one(), scale = vf_one(), maximum = is_edge ? reach : vf_one();
    voronoi_enter(v, place, scale);
    voronoi_octave(v, feature, smoothness, has_color, sum);
    for (float number = 1.0f; number < TRC_MAX_OCTAVES; number++) {
        const vfloat behind = vf_set(number) - whole; /* the last whole octave by so many */
        const vmask full = vf_le(behind, vf_zero());
        const vmask counts = vm_or(full, vm_and(vf_eq(behind, vf_one()), vf_gt(rest, vf_zero())));
        if (!vm_any(counts))
            break;
        struct voronoi_value octave;
        amplitude = amplitude * d->roughness;
        scale = scale * d->lacunarity;
        const vfloat weight = vf_select(full, amplitude, amplitude * rest);
        voronoi_enter(v, place, scale);
        voronoi_octave(v, feature, smoothness, has_color, &octave);
        if (is_edge) {
            const vfloat nearest = vf_min(sum->distance, vf_divide(octave.distance, scale));
            voronoi_add(counts, weight, nearest - sum->distance, &sum->distance);
            voronoi_add(counts, weight, vf_divide(reach, scale) - maximum, &maximum);
            continue;
        }
        voronoi_add(counts, weight, octave.distance, &sum->distance);
        voronoi_add(counts, weight, vf_one(), &maximum);
        if (has_color)
            sum->color = v3_select(counts, v3_mad(octave.color, weight, sum->color), sum->color);
        for (int i = 0; i < v->dims; i++)
            voronoi_add(counts, weight, vf_divide(octave.at[i], scale) - sum->at[i], &sum->at[i]);
    }
    if (!normalizes)
        return;
    sum->color = v3_scale(sum->color, vf_rcp(maximum));
    sum->distance = sum->distance / (is_edge ? maximum : maximum * reach);
}

/* ---- the texture ---- */

void trc_program_voronoi(uint32_t mode, const vfloat *in, vfloat *out) {
    const int dims = (int)(mode & TRC_DIMENSIONS_MASK) + 1;
    struct voronoi v = {.dims = dims,
                        .has_pcg = dims > 1 && (mode & TRC_VORONOI_PCG),
                        .far = mode & TRC_VORONOI_UNLIMITED ? INFINITY : VORONOI_FAR,
                        .metric = (mode >> TRC_VORONOI_METRIC_SHIFT) & TRC_VORONOI_METRIC_MASK,
                        .exponent = in[TRC_OP_AT(VORONOI, exponent)],
                        .randomness = vf_saturate(in[TRC_OP_AT(VORONOI, randomness)])};
    const uint32_t feature = (mode >> TRC_VORONOI_FEATURE_SHIFT) & TRC_VORONOI_FEATURE_MASK;
    const vfloat roughness = in[TRC_OP_AT(VORONOI, roughness)];
    const vfloat lacunarity = in[TRC_OP_AT(VORONOI, lacunarity)];
    const vfloat zero = vf_zero();
    vfloat place[TRC_MAX_DIMENSIONS];
    struct voronoi_value value;
    place_of(v.dims, in + TRC_OP_AT(VORONOI, vector), in[TRC_OP_AT(VORONOI, w)], place);
    for (uint32_t i = 0; i < TRC_OP_OUT_AT(VORONOI, end); i++)
        out[i] = zero;
    if (feature == TRC_VORONOI_N_SPHERE_RADIUS) {
        voronoi_enter(&v, place, vf_one());
        out[TRC_OP_OUT_AT(VORONOI, radius)] = voronoi_radius(&v);
        return;
    }
    /* Octaves of no weight are left out, and edges infinitely far. */
    vmask has_octaves = vf_gt(roughness, zero);
    if (feature == TRC_VORONOI_DISTANCE_TO_EDGE)
        has_octaves = vm_and(has_octaves, vf_ne(lacunarity, zero));
    const struct voronoi_detail detail = {
        .detail = vf_where(has_octaves,
                           vf_clamp(in[TRC_OP_AT(VORONOI, detail)], 0.0f, TRC_MAX_OCTAVES - 1.0f)),
        .roughness = vf_saturate(roughness),
        .lacunarity = lacunarity};
    const vfloat smoothness = in[TRC_OP_AT(VORONOI, smoothness)] * vf_set(0.5f);
    voronoi_fractal(&v, mode, vf_clamp(smoothness, 0.0f, 0.5f), &detail, place, &value);
    out[TRC_OP_OUT_AT(VORONOI, distance)] = value.distance;
    if (feature == TRC_VORONOI_DISTANCE_TO_EDGE)
        return;
    v3_write(out + TRC_OP_OUT_AT(VORONOI, color), value.color);
    for (int i = 0; i < v.dims; i++) {
        const bool is_w = v.dims == 1 || i == 3;
        out[is_w ? TRC_OP_OUT_AT(VORONOI, w) : TRC_OP_OUT_AT(VORONOI, position) + (uint32_t)i] =
            value.at[i];
    }
}
