/* The Radial Tiling node: the plane as the sectors of a polygon with rounded corners, whose number
 * of sides need not be whole. The values are those of Cycles 5.
 *
 * Each sector is seen from its bisector. Its outline is straight up to a corner, which is an arc;
 * of a fraction of a side the last sector is narrower, and so the two corners beside it are of
 * another size. Along the outline counts an angle in the outer part of an arc, and a length before;
 * towards the middle of the polygon one becomes the other. Angles are in radians, lengths in those
 * of a polygon whose sectors reach 1. */
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "model/program.h"

#define MIN_SIDES 2.0f

/* The arc of a corner: its middle as seen along and across the line between its sectors, the latter
 * towards the wider one, and its radius. */
struct arc {
    vfloat along, across, radius;
};

struct polygon {
    vfloat sides, roundness;
    vfloat half, last_half;   /* angles of sectors */
    vmask is_whole;           /* number of sides */
    vmask is_sharp, is_strip; /* corners that are no arcs; of two sides, without corners */
    vfloat bevel;             /* angle of a corner's half */
    vfloat inner, outer;      /* the same of the corners of the last sector, within it and beyond */
    vfloat outer_roundness;
    vfloat last_scale; /* of lengths in the last sector, to reach as far as the others */
    struct arc corner, last_corner;
};

/* Angle of the half of a corner whose sector has that half. */
static vfloat bevel_of(vfloat half, vfloat roundness) {
    return half - vf_atan((vf_one() - roundness) * vf_tan(half));
}

/* What the corners beside a narrower sector are. */
static void last_corners(struct polygon *g) {
    const vfloat one = vf_one(), half = vf_set(0.5f);
    vfloat sine, cosine, inner_sine, inner_cosine, half_sine, half_cosine;
    g->inner = bevel_of(g->last_half, g->roundness);
    vf_sincos(g->last_half, &sine, &cosine);
    vf_sincos(g->inner, &inner_sine, &inner_cosine);
    vf_sincos(g->half, &half_sine, &half_cosine);
    const vfloat start = one / vf_cos(g->last_half - g->inner);
    struct arc *a = &g->last_corner;
    a->radius = g->roundness * (sine / cosine) / vf_tan(half * (g->half + g->last_half));
    a->along = inner_cosine * start - a->radius * cosine;
    a->across = a->radius * sine - inner_sine * start;
    g->outer = vf_atan((a->across + a->radius * half_sine) / (a->along + a->radius * half_cosine));
    g->outer_roundness = one - vf_tan(g->half - g->outer) / vf_tan(g->half);
    g->last_scale = half_cosine / cosine;
}

static struct polygon polygon_of(vfloat sides, vfloat roundness) {
    const vfloat zero = vf_zero(), one = vf_one();
    struct polygon g = {.sides = vf_max(sides, vf_set(MIN_SIDES)),
                        .roundness = vf_saturate(roundness)};
    const vfloat whole = vf_floor(g.sides);
    g.is_whole = vf_eq(whole, g.sides);
    /* Two sides meet nowhere; only the circle that they are of the roundness 1 is another shape.
     * (Cycles has no numbers for what is between.) */
    g.is_strip = vm_and(vf_eq(g.sides, vf_set(MIN_SIDES)), vf_lt(g.roundness, one));
    g.is_sharp = vm_or(vf_eq(g.roundness, zero), g.is_strip);
    g.half = vf_set(TRC_PI) / g.sides;
    g.bevel = vf_select(g.is_sharp, zero, bevel_of(g.half, g.roundness));
    g.corner = (struct arc){.along = (one - g.roundness) / vf_cos(g.half), .radius = g.roundness};
    g.corner.across = zero;
    g.last_half = g.half;
    g.last_scale = one;
    if (vm_any(vm_not(g.is_whole))) {
        g.last_half = vf_set(TRC_PI) - whole * g.half;
        last_corners(&g);
        g.inner = vf_select(g.is_sharp, zero, g.inner);
        g.outer = vf_select(g.is_sharp, zero, g.outer);
        g.outer_roundness = vf_select(g.is_sharp, zero, g.outer_roundness);
    }
    return g;
}

/* How far an arc is from the middle of the polygon, in the direction of an angle from the line
 * between its sectors. */
static vfloat arc_reach(const struct arc *a, vfloat angle) {
    vfloat sine, cosine;
    vf_sincos(angle, &sine, &cosine);
    const vfloat b = sine * a->across + cosine * a->along;
    return b + vf_sqrt(b * b + a->radius * a->radius - a->along * a->along - a->across * a->across);
}

/* One half of a sector, at a place. */
struct sector {
    vfloat half;             /* angle */
    vfloat bevel, roundness; /* of its corner */
    vfloat from_bisector, to_corner;
    vfloat size; /* of the polygon through the place; in the last sector not scaled */
};

/* Where along its half of the outline a place is; beyond is the place's distance. */
static vfloat sector_place(const struct sector *s, vfloat distance, vmask is_straight) {
    const vfloat one = vf_one(), half = vf_set(0.5f);
    vfloat sine, cosine;
    vf_sincos(s->half - s->bevel, &sine, &cosine);
    const vfloat spline = (one - s->roundness) * s->bevel, turned = s->bevel - s->to_corner;
    const vfloat height = distance * cosine;
    const vfloat bent = height * turned + half * (one - height) * turned * turned / spline;
    const vfloat beyond = spline * (half * height - half) + turned;
    const vfloat arc = distance * sine + vf_select(vf_lt(turned, spline), bent, beyond);
    return vf_select(is_straight, s->size * vf_tan(s->from_bisector), arc);
}

/* How long that half of the outline is. */
static vfloat sector_length(const struct sector *s, vfloat distance, vmask is_straight) {
    const vfloat one = vf_one(), half = vf_set(0.5f);
    vfloat sine, cosine;
    vf_sincos(s->half - s->bevel, &sine, &cosine);
    const vfloat spline = (one - s->roundness) * s->bevel, bent = s->roundness * s->bevel;
    const vfloat straight = s->size * (sine / cosine) + spline * (half * s->size + half) + bent;
    const vfloat round = distance * sine + spline * (half * distance * cosine + half) + bent;
    const vfloat part = (s->bevel - s->to_corner) / s->bevel;
    return vf_select(is_straight, straight, vf_lerp(straight, round, part));
}

/* The length of a sector's half where the polygon has the size 1. */
static vfloat unit_length(const struct polygon *g, vmask is_last, vfloat half_angle, vfloat scale) {
    const vfloat one = vf_one(), half = vf_set(0.5f);
    const vfloat bevel = vf_select(is_last, g->inner, g->bevel);
    const vfloat length = vf_tan(half_angle - bevel) +
                          (one - g->roundness) * bevel * (half + half * scale) +
                          scale * g->roundness * bevel;
    return vf_select(g->is_strip, vf_zero(), length);
}

static void radial_tiling(uint32_t mode, const vfloat *in, vfloat *out) {
    const vfloat zero = vf_zero(), one = vf_one(), half = vf_set(0.5f), turn = vf_set(TRC_TWO_PI);
    const vvec3 p = v3_read(in + TRC_OP_AT(RADIAL_TILING, vector));
    const struct polygon g =
        polygon_of(in[TRC_OP_AT(RADIAL_TILING, sides)], in[TRC_OP_AT(RADIAL_TILING, roundness)]);
    const vfloat distance = vf_sqrt(p.x * p.x + p.y * p.y);
    const vfloat signed_angle = vf_atan2(p.y, p.x), below = vf_truth(vf_lt(p.y, zero));
    const vfloat angle = signed_angle + below * turn;
    const vfloat width = g.half + g.half, number = vf_floor(angle / width);
    const vfloat local = angle - number * width;

    const vfloat last_start = turn - (g.last_half + g.last_half);
    const vmask is_last = vm_andnot(vf_ge(angle, last_start), g.is_whole);
    const vmask is_beside = vm_andnot(
        vm_andnot(vm_or(vf_lt(angle, g.half), vf_ge(angle, last_start - g.half)), is_last),
        g.is_whole);
    struct sector s = {.half = vf_select(is_last, g.last_half, g.half)};
    s.bevel = vf_select(is_last, g.inner, vf_select(is_beside, g.outer, g.bevel));
    s.roundness = vf_select(is_beside, g.outer_roundness, g.roundness);
    s.from_bisector = vf_abs(s.half - local);
    s.to_corner = s.half - s.from_bisector;
    const vmask is_straight = vf_ge(s.to_corner, s.bevel);

    const vfloat last_scale = vf_select(vm_or(is_last, is_beside), g.last_scale, one);
    vfloat reach = arc_reach(&g.corner, s.to_corner);
    if (vm_any(vm_or(is_last, is_beside)))
        reach = vf_select(vm_or(is_last, is_beside),
                          arc_reach(&g.last_corner, vf_select(is_last, -s.to_corner, s.to_corner)),
                          reach);
    const vfloat scale = vf_select(is_last, last_scale, one);
    s.size = vf_select(is_straight, distance * vf_cos(s.from_bisector),
                       distance / reach * vf_select(is_beside, last_scale, one));

    vfloat place = sector_place(&s, distance, is_straight);
    if (mode & TRC_RADIAL_TILING_NORMALIZE) {
        place = place / vf_select(g.is_strip, one, sector_length(&s, distance, is_straight));
    } else {
        place = place * scale;
    }
    place = vf_select(vf_lt(local, s.half), -place, place);
    place = vf_where(vf_gt(distance, zero), place);
    vfloat size = s.size * scale;
    if (mode & TRC_RADIAL_TILING_NORMALIZE)
        place = half * place + half;
    else
        size = size - one;
    v3_write(out + TRC_OP_OUT_AT(RADIAL_TILING, coordinates), v3(place, size, zero));
    out[TRC_OP_OUT_AT(RADIAL_TILING, id)] = vf_floor(g.sides * (signed_angle / turn + below));
    out[TRC_OP_OUT_AT(RADIAL_TILING, width)] = unit_length(&g, is_last, s.half, scale);
    out[TRC_OP_OUT_AT(RADIAL_TILING, rotation)] = number * width + s.half;
}

const struct trc_texture TRC_TEXTURE_OF(RADIAL_TILING) = {.run = radial_tiling};
