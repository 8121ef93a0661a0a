/* The beam: the hull of a packet's rays, tested against eight boxes at once.
 *
 * Boulos et al. 2007, section 3.2, cull a box against intervals of a packet's origins and
 * directions. Here the rays of a beam share their dominant axis z and its sign, and the hull is
 * kept as two ranges per cross axis, at a near and a far plane of z, joined linearly: each ray is
 * linear in z, so the minimum and maximum x of all rays between the planes lie within the joined
 * lines. It is tighter than intervals of slopes when origins differ.
 *
 * Everything here only culls. Rounding is covered by slack, an absolute widening of boxes:
 * positions on a ray are wrong by less than 6 half-ulps (2^-24) of |o| + |p - o| (planes of a box
 * met by plane / d - o / d: 5 of the larger of |o| and |plane|), lines of the beam by as much
 * again, the triangle test moves vertices by less than 4 half-ulps of |v - o|, and interpolation
 * between keys moves vertices and boxes by less than 2 each of the larger key. All lengths are
 * below the largest |coordinate| of the origins plus that of the tree (M), twice: 20 half-ulps of 2
 * M is TRC_SLACK * M. */
#ifndef TRACER_KERNELS_TRACE_BEAM_H
#define TRACER_KERNELS_TRACE_BEAM_H

#include "kernels/trace/live.h"
#include "kernels/trace/triangle.h"
#include "model/tree.h"

#define TRC_SLACK 2.4e-6f
/* Of the slack, what unpacked boxes are wider by, 2 half-ulps of 2 M: a step times a byte is wrong
 * by a half-ulp of 2 M at most, its sum with the origin by one of M. */
#define TRC_UNPACK_SLACK 0.1f
/* Denormal coordinates: errors are absolute there. */
#define TRC_MIN_SLACK 1e-42f
/* Widest half of a narrow beam, per length. */
#define TRC_NARROW_BEAM 0.03f
/* Between planes nearer than this, slopes per z would overflow. */
#define TRC_SHORT_BEAM 1e-37f

/* Boxes of a moving node's children at a key. */
TRC_INLINE void trc_boxes_unpack(const struct trc_packed_boxes *packed, f8 lower[3], f8 upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        const f8 origin = f8_set(packed->origin[axis]), step = f8_set(packed->step[axis]);
        lower[axis] = f8_madd(f8_load_bytes(packed->bytes[axis][0]), step, origin);
        upper[axis] = f8_madd(f8_load_bytes(packed->bytes[axis][1]), step, origin);
    }
}

struct trc_beam {
    struct trc_shear axis;
    int side;   /* 0: rays go up z, 1: down; z below is mirrored when 1 */
    float sign; /* 1 or -1 */
    float slack;
    float z0, z1; /* near and far plane, mirrored z; z1 shrinks as hits are found */
    float length; /* between the planes at first */
    float u_min, u_max, v_min, v_max;                         /* at z0 */
    float u_min_slope, u_max_slope, v_min_slope, v_max_slope; /* per z */
    /* The same as middle and half width. */
    float u_mid, v_mid, u_half, v_half, u_mid_slope, v_mid_slope, u_half_slope, v_half_slope;
    float u_widest, v_widest; /* largest half width between the planes */
    float u_spread, v_spread; /* maximum change per z of a ray's distance from the middle */
    bool converges;           /* narrower at z1 than at z0 */
    bool is_narrow;           /* rays mostly meet the same boxes */
};

/* What a traversal derives from each ray of a packet. */
struct trc_sheared {
    float su[TRC_PACKET_SIZE], sv[TRC_PACKET_SIZE], sz[TRC_PACKET_SIZE]; /* shear; sz = 1 / dz */
    float inv[3][TRC_PACKET_SIZE], shift[3][TRC_PACKET_SIZE];            /* 1 / d, -o / d: finite */
    float f[TRC_PACKET_SIZE]; /* moving trees: position between the keys */
} __attribute__((aligned(64)));

/* Everything a traversal derives from the packets of a walk for one group of their rays. */
struct trc_group {
    struct trc_beam beam;
    struct trc_sheared of[TRC_WALK_PACKETS];
    float f_min, f_max;
    float z_origin; /* how far along z an origin is from the beam's near plane, at most */
    /* Packets of one origin: it, and the range of shears, in the order u, v, z. */
    float origin[3], su_min, su_max, sv_min, sv_max;
} __attribute__((aligned(64)));

/* A zero component becomes this, so that its reciprocal and products with coordinates stay finite.
 */
#define TRC_TINY_DIRECTION 1e-18f

TRC_INLINE vfloat trc_safe_inverse(vfloat d) {
    const vmask tiny = vf_lt(vf_abs(d), vf_set(TRC_TINY_DIRECTION));
    return vf_set(1.0f) / vf_select(tiny, vf_copysign(vf_set(TRC_TINY_DIRECTION), d), d);
}

/* The beam's cross-section at its near and its far plane, or over all rays of a group. */
struct trc_beam_ends {
    float u_low[2], u_high[2], v_low[2], v_high[2];
};

/* Of rays with one origin: sheared from it, so the extreme shears are the hull. */
TRC_INLINE void trc_ends_of_origin(struct trc_group *g, const float plane[2],
                                   struct trc_beam_ends *e) {
    for (int end = 0; end < 2; end++) {
        const float dz = plane[end] - g->origin[2];
        const float u0 = g->origin[0] + dz * g->su_min, u1 = g->origin[0] + dz * g->su_max,
                    v0 = g->origin[1] + dz * g->sv_min, v1 = g->origin[1] + dz * g->sv_max;
        e->u_low[end] = f_min(u0, u1);
        e->u_high[end] = f_max(u0, u1);
        e->v_low[end] = f_min(v0, v1);
        e->v_high[end] = f_max(v0, v1);
    }
}

TRC_INLINE void trc_ends_of_rays(const struct trc_group *g, const struct trc_packet *packets,
                                 const struct trc_live *mask, const float plane[2],
                                 struct trc_beam_ends *e) {
    const struct trc_shear axis = g->beam.axis;
    const vfloat inf = vf_set(INFINITY);
    vfloat u_low[2] = {inf, inf}, u_high[2] = {-inf, -inf}, v_low[2] = {inf, inf},
           v_high[2] = {-inf, -inf};
    for (int c = 0; c < TRC_WALK_CHUNKS; c++) {
        const uint32_t bits = trc_live_bits(mask, c);
        if (!bits)
            continue;
        const struct trc_packet *p = &packets[c / TRC_PACKET_CHUNKS];
        const struct trc_sheared *r = &g->of[c / TRC_PACKET_CHUNKS];
        const int i = c % TRC_PACKET_CHUNKS * TRC_WIDTH;
        const vmask m = vm_from_bits(bits);
        const vfloat oz = vf_load(&p->o[axis.z][i]);
        const vfloat su = vf_load(&r->su[i]), sv = vf_load(&r->sv[i]);
        for (int end = 0; end < 2; end++) {
            const vfloat dz = vf_set(plane[end]) - oz;
            const vfloat u = vf_load(&p->o[axis.u][i]) + dz * su;
            const vfloat v = vf_load(&p->o[axis.v][i]) + dz * sv;
            u_low[end] = vf_min_where(m, u_low[end], u);
            u_high[end] = vf_max_where(m, u_high[end], u);
            v_low[end] = vf_min_where(m, v_low[end], v);
            v_high[end] = vf_max_where(m, v_high[end], v);
        }
    }
    for (int end = 0; end < 2; end++) {
        e->u_low[end] = vf_lanes_min(u_low[end]);
        e->u_high[end] = vf_lanes_max(u_high[end]);
        e->v_low[end] = vf_lanes_min(v_low[end]);
        e->v_high[end] = vf_lanes_max(v_high[end]);
    }
}

/* What the rays of a group reach along their dominant axis, mirrored, and how far from 0 they
 * start. */
struct trc_group_reach {
    float z_near, z_far, origin;
    float z_origin_low, z_origin_high; /* mirrored */
};

/* Shear and inverses of the rays in mask; of packets of one origin the range of shears. */
TRC_INLINE struct trc_group_reach trc_group_rays(struct trc_group *g,
                                                 const struct trc_packet *packets,
                                                 const struct trc_live *mask) {
    const int au = g->beam.axis.u, av = g->beam.axis.v, z = g->beam.axis.z;
    const bool common = packets->common_origin;
    const vfloat sign = vf_set(g->beam.sign), inf = vf_set(INFINITY);
    vfloat z_near = inf, z_far = -inf, origin = vf_set(0.0f);
    vfloat z_origin_low = inf, z_origin_high = -inf;
    vfloat su_min = inf, su_max = -inf, sv_min = inf, sv_max = -inf;
    for (int c = 0; c < TRC_WALK_CHUNKS; c++) {
        const uint32_t bits = trc_live_bits(mask, c);
        if (!bits)
            continue;
        const struct trc_packet *p = &packets[c / TRC_PACKET_CHUNKS];
        struct trc_sheared *r = &g->of[c / TRC_PACKET_CHUNKS];
        const int i = c % TRC_PACKET_CHUNKS * TRC_WIDTH;
        const vmask m = vm_from_bits(bits);
        const vfloat du = vf_load(&p->d[au][i]), dv = vf_load(&p->d[av][i]),
                     dz = vf_load(&p->d[z][i]);
        const vfloat ou = vf_load(&p->o[au][i]), ov = vf_load(&p->o[av][i]),
                     oz = vf_load(&p->o[z][i]);
        const vfloat sz = vf_set(1.0f) / dz, su = du * sz, sv = dv * sz;
        vf_store(&r->sz[i], sz);
        vf_store(&r->su[i], su);
        vf_store(&r->sv[i], sv);
        const vfloat inv_u = trc_safe_inverse(du), inv_v = trc_safe_inverse(dv);
        vf_store(&r->inv[au][i], inv_u);
        vf_store(&r->inv[av][i], inv_v);
        vf_store(&r->inv[z][i], sz);
        vf_store(&r->shift[au][i], -ou * inv_u);
        vf_store(&r->shift[av][i], -ov * inv_v);
        vf_store(&r->shift[z][i], -oz * sz);
        z_near = vf_min_where(m, z_near, sign * (oz + vf_load(&p->tmin[i]) * dz));
        z_far = vf_max_where(m, z_far, sign * (oz + vf_load(&p->t[i]) * dz));
        if (common) {
            su_min = vf_min_where(m, su_min, su);
            su_max = vf_max_where(m, su_max, su);
            sv_min = vf_min_where(m, sv_min, sv);
            sv_max = vf_max_where(m, sv_max, sv);
        } else {
            origin = vf_max_where(m, origin, vf_max(vf_abs(ou), vf_max(vf_abs(ov), vf_abs(oz))));
            z_origin_low = vf_min_where(m, z_origin_low, sign * oz);
            z_origin_high = vf_max_where(m, z_origin_high, sign * oz);
        }
    }
    struct trc_group_reach reach = {.z_near = vf_lanes_min(z_near), .z_far = vf_lanes_max(z_far)};
    if (!common) {
        reach.origin = vf_lanes_max(origin);
        reach.z_origin_low = vf_lanes_min(z_origin_low);
        reach.z_origin_high = vf_lanes_max(z_origin_high);
        return reach;
    }
    const int k = trc_live_first(mask), first = __builtin_ctzll(mask->of[k]);
    const struct trc_packet *p = &packets[k];
    g->origin[0] = p->o[au][first];
    g->origin[1] = p->o[av][first];
    g->origin[2] = p->o[z][first];
    g->su_min = vf_lanes_min(su_min);
    g->su_max = vf_lanes_max(su_max);
    g->sv_min = vf_lanes_min(sv_min);
    g->sv_max = vf_lanes_max(sv_max);
    reach.origin = f_max(fabsf(g->origin[0]), f_max(fabsf(g->origin[1]), fabsf(g->origin[2])));
    reach.z_origin_low = reach.z_origin_high = g->beam.sign * g->origin[2];
    return reach;
}

/* Shear, inverses and beam of the rays in mask, all of dominant axis z and that side, against a
 * tree. False: none can reach the tree. */
TRC_INLINE bool trc_group_setup(struct trc_group *g, const struct trc_packet *packets,
                                const struct trc_tree *tree, const struct trc_live *mask, int z,
                                int side) {
    struct trc_beam *b = &g->beam;
    b->axis = (struct trc_shear){(z + 1) % 3, (z + 2) % 3, z};
    b->side = side;
    b->sign = side ? -1.0f : 1.0f;
    const struct trc_group_reach reach = trc_group_rays(g, packets, mask);
    b->slack = TRC_SLACK * (reach.origin + tree->extent) + TRC_MIN_SLACK;
    const float low = side ? -tree->upper[z] : tree->lower[z];
    const float high = side ? -tree->lower[z] : tree->upper[z];
    b->z0 = f_max(reach.z_near, low) - b->slack;
    b->z1 = f_min(reach.z_far, high) + b->slack;
    if (!(b->z0 <= b->z1))
        return false;
    g->z_origin =
        b->slack + f_max(fabsf(reach.z_origin_low - b->z0), fabsf(reach.z_origin_high - b->z0));
    const float plane[2] = {b->sign * b->z0, b->sign * b->z1};
    struct trc_beam_ends e;
    if (packets->common_origin)
        trc_ends_of_origin(g, plane, &e);
    else
        trc_ends_of_rays(g, packets, mask, plane, &e);
    const float length = b->length = b->z1 - b->z0;
    /* In a beam no longer than its slack, rounding would be most of a slope. */
    const bool is_short = length < f_max(b->slack, TRC_SHORT_BEAM);
    const float per_z = is_short ? 0.0f : 1.0f / length;
    if (is_short) { /* one range over both planes */
        e.u_low[0] = f_min(e.u_low[0], e.u_low[1]);
        e.u_high[0] = f_max(e.u_high[0], e.u_high[1]);
        e.v_low[0] = f_min(e.v_low[0], e.v_low[1]);
        e.v_high[0] = f_max(e.v_high[0], e.v_high[1]);
    }
    b->u_min = e.u_low[0] - b->slack;
    b->u_max = e.u_high[0] + b->slack;
    b->v_min = e.v_low[0] - b->slack;
    b->v_max = e.v_high[0] + b->slack;
    b->u_min_slope = (e.u_low[1] - b->slack - b->u_min) * per_z;
    b->u_max_slope = (e.u_high[1] + b->slack - b->u_max) * per_z;
    b->v_min_slope = (e.v_low[1] - b->slack - b->v_min) * per_z;
    b->v_max_slope = (e.v_high[1] + b->slack - b->v_max) * per_z;
    b->u_mid = 0.5f * (b->u_min + b->u_max);
    b->v_mid = 0.5f * (b->v_min + b->v_max);
    b->u_half = 0.5f * (b->u_max - b->u_min);
    b->v_half = 0.5f * (b->v_max - b->v_min);
    b->u_mid_slope = 0.5f * (b->u_min_slope + b->u_max_slope);
    b->v_mid_slope = 0.5f * (b->v_min_slope + b->v_max_slope);
    b->u_half_slope = 0.5f * (b->u_max_slope - b->u_min_slope);
    b->v_half_slope = 0.5f * (b->v_max_slope - b->v_min_slope);
    const float u_end = b->u_half + length * b->u_half_slope,
                v_end = b->v_half + length * b->v_half_slope;
    b->u_spread = is_short ? INFINITY : (b->u_half + u_end) * per_z;
    b->v_spread = is_short ? INFINITY : (b->v_half + v_end) * per_z;
    b->u_widest = f_max(b->u_half, u_end);
    b->v_widest = f_max(b->v_half, v_end);
    b->converges = b->u_half_slope + b->v_half_slope < 0.0f;
    b->is_narrow = f_max(b->u_widest, b->v_widest) < TRC_NARROW_BEAM * length;
    return true;
}

/* Bits of the boxes that the beam may touch; key: their nearest mirrored z, for ordering. bounds:
 * lower and upper by axis. */
TRC_INLINE uint32_t trc_beam_test(const struct trc_beam *b, const f8 lower[3], const f8 upper[3],
                                  f8 *key) {
    const int u = b->axis.u, v = b->axis.v, z = b->axis.z;
    const f8 near = b->side ? -upper[z] : lower[z], far = b->side ? -lower[z] : upper[z];
    const f8 z0 = f8_set(b->z0);
    const f8 za = f8_max(near, z0), zb = f8_min(far, f8_set(b->z1 + b->slack));
    const f8 da = za - z0, db = f8_max(zb, za) - z0;
    const f8 u_low = f8_min(f8_madd(da, f8_set(b->u_min_slope), f8_set(b->u_min)),
                            f8_madd(db, f8_set(b->u_min_slope), f8_set(b->u_min)));
    const f8 u_high = f8_max(f8_madd(da, f8_set(b->u_max_slope), f8_set(b->u_max)),
                             f8_madd(db, f8_set(b->u_max_slope), f8_set(b->u_max)));
    const f8 v_low = f8_min(f8_madd(da, f8_set(b->v_min_slope), f8_set(b->v_min)),
                            f8_madd(db, f8_set(b->v_min_slope), f8_set(b->v_min)));
    const f8 v_high = f8_max(f8_madd(da, f8_set(b->v_max_slope), f8_set(b->v_max)),
                             f8_madd(db, f8_set(b->v_max_slope), f8_set(b->v_max)));
    *key = near;
    return f8_le(za, zb) & f8_le(u_low, upper[u]) & f8_le(lower[u], u_high) &
           f8_le(v_low, upper[v]) & f8_le(lower[v], v_high);
}

/* Corners of eight triangles in the beam's space: u, v from its middle, z from its near plane. */
struct trc_beam_corners {
    f8 u[3], v[3], z[3];
};

TRC_INLINE void trc_beam_corners_set(const struct trc_beam *b, int corner, f8 u, f8 v, f8 z,
                                     struct trc_beam_corners *c) {
    c->z[corner] = f8_set(b->sign) * z - f8_set(b->z0);
    c->u[corner] = u - f8_madd(c->z[corner], f8_set(b->u_mid_slope), f8_set(b->u_mid));
    c->v[corner] = v - f8_madd(c->z[corner], f8_set(b->v_mid_slope), f8_set(b->v_mid));
}

/* Edge functions: rounding of their terms, and products that underflow. */
#define TRC_EDGE_ROUNDING 1e-6f
#define TRC_MIN_EDGE 1e-36f

/* What trc_triangle_test knows beforehand of triangles in that range of z whose corners are so far
 * from the beam's middle: a vertex is no farther from a ray than from the middle and that from the
 * ray. Beyond the planes rays cross the beam's sides, at most by its spread. */
TRC_INLINE struct trc_precision8 trc_beam_precision(const struct trc_group *g, f8 z_low, f8 z_high,
                                                    f8 u, f8 v) {
    const struct trc_beam *b = &g->beam;
    const f8 zero = f8_set(0.0f), length = f8_set(b->length), slack = f8_set(b->slack);
    const f8 excess = f8_max(zero, f8_max(z_high - length, -z_low));
    const f8 x = u + slack + f8_madd(excess, f8_set(b->u_spread), f8_set(b->u_widest));
    const f8 y = v + slack + f8_madd(excess, f8_set(b->v_spread), f8_set(b->v_widest));
    const f8 z = f8_max(f8_abs(z_low), f8_abs(z_high)) + f8_set(g->z_origin);
    return trc_precision_maximum(x, y, z, z_high - z_low + slack);
}

/* Bits of the triangles that some ray of the beam may hit. later: where the corners are at the end
 * of the group's interval of time (linear between), or NULL.
 *
 * A ray that meets a triangle does so at a place of the beam's cross-section, a rectangle about the
 * middle; seen along the middle, the triangle must overlap the largest rectangle of its stretch of
 * z: compared by their boxes and by the sides of the triangle's edges, for either winding. An edge
 * in motion has a quadratic edge function: its ends, and a quarter of its square term, bound it.
 * Rounding of the corners, 16 half-ulps of M at most (slopes are below 1.1, products below 3 M), is
 * within another slack on the rectangle. edges: false to compare boxes alone. precision_out: see
 * trc_beam_precision. */
TRC_INLINE uint32_t trc_beam_triangles(const struct trc_group *g, const struct trc_beam_corners *c,
                                       const struct trc_beam_corners *later, bool edges,
                                       struct trc_precision8 *precision_out) {
    const struct trc_beam *b = &g->beam;
    f8 z_low = f8_min(c->z[0], f8_min(c->z[1], c->z[2]));
    f8 z_high = f8_max(c->z[0], f8_max(c->z[1], c->z[2]));
    f8 u_low = f8_min(c->u[0], f8_min(c->u[1], c->u[2]));
    f8 u_high = f8_max(c->u[0], f8_max(c->u[1], c->u[2]));
    f8 v_low = f8_min(c->v[0], f8_min(c->v[1], c->v[2]));
    f8 v_high = f8_max(c->v[0], f8_max(c->v[1], c->v[2]));
    for (int k = 0; later && k < 3; k++) {
        z_low = f8_min(z_low, later->z[k]);
        z_high = f8_max(z_high, later->z[k]);
        u_low = f8_min(u_low, later->u[k]);
        u_high = f8_max(u_high, later->u[k]);
        v_low = f8_min(v_low, later->v[k]);
        v_high = f8_max(v_high, later->v[k]);
    }
    const f8 zero = f8_set(0.0f), slack = f8_set(b->slack);
    const f8 from = f8_max(z_low, zero), to = f8_min(z_high, f8_set(b->z1 - b->z0 + b->slack));
    const f8 u_slope = f8_set(b->u_half_slope), v_slope = f8_set(b->v_half_slope);
    const f8 u_half =
        f8_max(f8_madd(from, u_slope, f8_set(b->u_half)), f8_madd(to, u_slope, f8_set(b->u_half))) +
        slack;
    const f8 v_half =
        f8_max(f8_madd(from, v_slope, f8_set(b->v_half)), f8_madd(to, v_slope, f8_set(b->v_half))) +
        slack;
    const uint32_t boxes = f8_le(from, to) & f8_le(u_low, u_half) & f8_le(-u_half, u_high) &
                           f8_le(v_low, v_half) & f8_le(-v_half, v_high);
    *precision_out = trc_beam_precision(g, z_low, z_high, f8_max(f8_abs(u_low), f8_abs(u_high)),
                                        f8_max(f8_abs(v_low), f8_abs(v_high)));
    if (!boxes || !edges)
        return boxes;
    const f8 rounding = f8_set(TRC_EDGE_ROUNDING);
    const f8 u_reach = f8_madd(rounding, f8_max(f8_abs(u_low), f8_abs(u_high)) + u_half, u_half);
    const f8 v_reach = f8_madd(rounding, f8_max(f8_abs(v_low), f8_abs(v_high)) + v_half, v_half);
    f8 maximum = f8_set(INFINITY), minimum = f8_set(-INFINITY); /* of the edge functions' bounds */
    for (int k = 0; k < 3; k++) {
        const int next = (k + 1) % 3;
        const f8 du = c->u[next] - c->u[k], dv = c->v[next] - c->v[k];
        f8 high = dv * c->u[k] - du * c->v[k], low = high;
        f8 reach = f8_madd(f8_abs(du), v_reach, f8_abs(dv) * u_reach);
        if (later) {
            const f8 eu = later->u[next] - later->u[k], ev = later->v[next] - later->v[k];
            const f8 end = ev * later->u[k] - eu * later->v[k];
            const f8 square = f8_abs(ev - dv) * f8_abs(later->u[k] - c->u[k]) +
                              f8_abs(eu - du) * f8_abs(later->v[k] - c->v[k]);
            high = f8_max(high, end);
            low = f8_min(low, end);
            reach = f8_max(reach, f8_madd(f8_abs(eu), v_reach, f8_abs(ev) * u_reach)) +
                    f8_set(0.2501f) * square;
        }
        maximum = f8_min(maximum, high + reach);
        minimum = f8_max(minimum, low - reach);
    }
    /* Outside of an edge, whichever way it turns. Not a number stays in. */
    const uint32_t outside =
        f8_le(maximum, f8_set(-TRC_MIN_EDGE)) & f8_le(f8_set(TRC_MIN_EDGE), minimum);
    return boxes & ~outside;
}

#endif
