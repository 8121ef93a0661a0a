/* The watertight ray-triangle test, for many rays against one triangle and one ray against eight.
 *
 * Sven Woop, Carsten Benthin, Ingo Wald, "Watertight Ray/Triangle Intersection", 2013. Vertices are
 * moved to the ray's origin and sheared so that the ray is the axis of its dominant direction; each
 * vertex is rounded the same way whatever triangle it belongs to, so a closed mesh stays closed in
 * the sheared plane. An edge function a*b - c*d of floats, without contraction, can lose its sign
 * to 0 but never change it, because rounding is monotonic; where one is (nearly) 0 all three are
 * computed in double, where products of floats are exact. Departures: barycentrics are normalised
 * before the distance is formed (no overflow up to 1.8e18), both windings hit, edge functions below
 * TINY_EDGE also go to double (tiny triangles). Both forms make the same operations in the same
 * order: the same bits. */
#ifndef TRACER_KERNELS_TRACE_TRIANGLE_H
#define TRACER_KERNELS_TRACE_TRIANGLE_H

#include "kernels/simd/simd8.h"
#include "kernels/trace/packet.h"

/* Below it products may have lost bits to underflow, and 1 / det may overflow. */
#define TRC_TINY_EDGE 1e-36f

/* Bounds of rounding errors, after M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering",
 * 3rd ed. 2016, section 3.9.6, in half-ulps: z 1, sheared x and y 5 of x + z, edge functions 2 of
 * x y and what x and y carry. Their section multiplies the edge functions' errors by z; but those
 * of a hit have one sign, and weights that sum up to 1 carry them on only as far as the vertices'
 * depths differ: t is off by no more than that, and by the 10 half-ulps of z of sum, quotient,
 * products, and scale. */
#define TRC_GAMMA(n) ((n)*0x1p-24f / (1.0f - (n)*0x1p-24f))
/* Largest |x|, |y|, |z| of the sheared vertices, 1 / |det|: the errors of the three edge functions
 * over |det|, which are those of the barycentrics. */
#define TRC_WEIGHT_ERROR(name, type, set)                                                 \
    TRC_INLINE type name(type x, type y, type z, type inv) {                              \
        const type xi = x * inv, zi = z * inv; /* first, so that nothing overflows */     \
        const type dxi = set(TRC_GAMMA(5)) * (xi + zi), dy = set(TRC_GAMMA(5)) * (y + z); \
        return set(6.0f) * (set(TRC_GAMMA(2)) * xi * y + dy * xi + dxi * y);              \
    }
TRC_WEIGHT_ERROR(trc_weight_error, vfloat, vf_set)
TRC_WEIGHT_ERROR(trc_weight_error8, f8, f8_set)

/* Hits that are computed in double: those whose barycentrics are off by more than that, needles,
 * whose edge functions lose what their length has over their width; and those whose distance is, by
 * more than one part in so many, such as of the surface that a ray leaves. What floats say is not
 * ahead is not asked again: that would meet what is less than ten floats ahead, and slow rays down
 * that leave surfaces. With these two, distances on needles 1e4 times as long as wide are off by at
 * most 287 ulps. */
#define TRC_WEIGHT_IMPRECISE (1.0f / 64.0f)
#define TRC_T_IMPRECISE 512.0f
/* Errors of higher order, of weights as precise as that. */
#define TRC_WEIGHT_ORDERS 1.1f
/* Largest |z|, its range, error of the barycentrics: the distance over sz up to which it is
 * imprecise. */
#define TRC_T_DOUBT(name, type, set)                                             \
    TRC_INLINE type name(type z, type range, type weight_error) {                \
        return set(TRC_T_IMPRECISE * TRC_WEIGHT_ORDERS) * weight_error * range + \
               set(TRC_T_IMPRECISE * TRC_GAMMA(10)) * z;                         \
    }
TRC_T_DOUBT(trc_t_doubt, vfloat, vf_set)
TRC_T_DOUBT(trc_t_doubt8, f8, f8_set)

/* Of eight triangles, as far as all rays of a beam may see them: what these bounds are at most. */
struct trc_precision8 {
    f8 weight_error; /* over |inv| */
    f8 z, range;
};
/* 1.001: both this and a ray's own are rounded. */
TRC_INLINE struct trc_precision8 trc_precision_maximum(f8 x, f8 y, f8 z, f8 range) {
    const f8 error = f8_set(1.001f * 6.0f * (TRC_GAMMA(2) + 2.0f * TRC_GAMMA(5))) * x * y +
                     f8_set(1.001f * 6.0f * TRC_GAMMA(5)) * z * (x + y);
    return (struct trc_precision8){error, z, range};
}
/* One of them, for lanes. */
struct trc_precision {
    float weight_error, z, range;
};
/* Below it products may have underflowed: then it says nothing. */
#define TRC_MIN_WEIGHT_ERROR 1e-30f
TRC_INLINE struct trc_precision trc_precision_of(const struct trc_precision8 *p, int i) {
    return (struct trc_precision){p->weight_error[i] >= TRC_MIN_WEIGHT_ERROR ? p->weight_error[i]
                                                                             : INFINITY,
                                  p->z[i], p->range[i]};
}

/* What the test needs of a ray: axes u, v, z with z dominant. */
struct trc_shear {
    int u, v, z;
};

/* Where all vertices are on one side of the origin, along z, so is the hit, however steep the
 * plane: nearest is sure to be beyond what moves the vertices. Else the inner sides of a spike
 * would be lost. */
#define TRC_Z_ERROR TRC_GAMMA(8)

/* A ray and one triangle: [vertex][axis u, v, z] as they are, and moved to the ray's origin and
 * sheared. */
struct trc_doubtful {
    float ou, ov, oz, su, sv, sz;
    float v[3][3], sheared[3][3];
};

/* One ray against one triangle in double. Edge functions are those of the sheared vertices, so that
 * meshes stay closed; the distance is that to the plane of the vertices as they are, to 1e-14 of
 * their distances: a ray that leaves a surface starts outside the box of its point's error, and
 * what it leaves is behind it, what is one float ahead of it is not. Where the two disagree, at the
 * edges of steep planes, the distance stays within that of the vertices. False for a miss. */
static __attribute__((noinline)) bool trc_triangle_exact(const struct trc_doubtful *d, float *t,
                                                         float *u, float *v) {
    const float *a = d->sheared[0], *b = d->sheared[1], *c = d->sheared[2];
    const double e0 = (double)c[0] * b[1] - (double)c[1] * b[0];
    const double e1 = (double)a[0] * c[1] - (double)a[1] * c[0];
    const double e2 = (double)b[0] * a[1] - (double)b[1] * a[0];
    const bool inside =
        (e0 >= 0.0 && e1 >= 0.0 && e2 >= 0.0) || (e0 <= 0.0 && e1 <= 0.0 && e2 <= 0.0);
    const double det = e0 + e1 + e2;
    if (!inside || det == 0.0)
        return false;
    double p[3], q[3], way[3];
    const float o[3] = {d->ou, d->ov, d->oz};
    for (int k = 0; k < 3; k++) {
        p[k] = (double)d->v[1][k] - d->v[0][k];
        q[k] = (double)d->v[2][k] - d->v[0][k];
        way[k] = (double)d->v[0][k] - o[k];
    }
    const double n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2],
                         p[0] * q[1] - p[1] * q[0]};
    const double scale = (double)d->sz, low = (double)f_min(a[2], f_min(b[2], c[2])),
                 high = (double)f_max(a[2], f_max(b[2], c[2]));
    const bool sure = fmax(low, -high) > (double)TRC_Z_ERROR * fmax(high, -low);
    const double nearest = fmin(low * scale, high * scale),
                 farthest = fmax(low * scale, high * scale);
    const double minimum = sure ? nearest : fmin(nearest, 0.0);
    double distance = (n[0] * way[0] + n[1] * way[1] + n[2] * way[2]) /
                      (n[0] * (double)d->su + n[1] * (double)d->sv + n[2]) * scale;
    /* In this order NaN stays: the ray is in the triangle's plane. */
    distance = farthest < distance ? farthest : distance;
    distance = distance < minimum ? minimum : distance;
    *t = (float)distance;
    *u = (float)(e1 / det);
    *v = (float)(e2 / det);
    return distance == distance;
}

/* Vertex coordinates of one triangle for the lanes: broadcast (static) or per ray (moving). */
struct trc_triangle_lanes {
    vfloat v[3][3]; /* vertex, axis in the order u, v, z */
};

/* Lanes whose triangle is flat in u or v and not ahead of the ray's origin: floors and walls, which
 * rays that start on them would otherwise ask for in double. du, dv: have the signs of the
 * direction. Says nothing about rays with a negative tmin, which meet what is behind them. */
TRC_INLINE vmask trc_flat_behind(const struct trc_triangle_lanes *p, vfloat ou, vfloat ov,
                                 vfloat du, vfloat dv) {
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    const vmask flat_u = vm_and(vf_eq(p->v[0][0], p->v[1][0]), vf_eq(p->v[0][0], p->v[2][0]));
    const vmask flat_v = vm_and(vf_eq(p->v[0][1], p->v[1][1]), vf_eq(p->v[0][1], p->v[2][1]));
    return vm_or(vm_and(flat_u, vf_le((p->v[0][0] - ou) * vf_copysign(one, du), zero)),
                 vm_and(flat_v, vf_le((p->v[0][1] - ov) * vf_copysign(one, dv), zero)));
}

/* A triangle moved to the origins of the lanes' rays and sheared: coordinates by vertex, and edge
 * functions by the vertex opposite. */
struct trc_triangle_sheared {
    vfloat x[3], y[3], z[3], e[3];
    vfloat low, high; /* of the edge functions */
};

#if TRC_WIDTH > 1
/* trc_triangle_exact for lanes side by side: a packet that leaves a surface asks it of that
 * surface's triangle in every lane. */
typedef double trc_vdouble __attribute__((vector_size(8 * TRC_WIDTH)));
typedef int64_t trc_vlong __attribute__((vector_size(8 * TRC_WIDTH)));
TRC_INLINE trc_vdouble trc_vd_of(vfloat x) { return __builtin_convertvector(x, trc_vdouble); }
TRC_INLINE trc_vdouble trc_vd_select(trc_vlong m, trc_vdouble a, trc_vdouble b) {
    return (trc_vdouble)((m & (trc_vlong)a) | (~m & (trc_vlong)b));
}
/* The second where either is NaN. */
TRC_INLINE trc_vdouble trc_vd_min(trc_vdouble a, trc_vdouble b) {
    return trc_vd_select(a < b, a, b);
}
TRC_INLINE trc_vdouble trc_vd_max(trc_vdouble a, trc_vdouble b) {
    return trc_vd_select(a > b, a, b);
}

static __attribute__((noinline)) vmask trc_triangle_exact_lanes(
    const struct trc_triangle_lanes *tri, const struct trc_triangle_sheared *s, const vfloat o[3],
    vfloat su, vfloat sv, vfloat sz, vfloat *t, vfloat *u, vfloat *v) {
    trc_vdouble x[3], y[3];
    for (int k = 0; k < 3; k++) {
        x[k] = trc_vd_of(s->x[k]);
        y[k] = trc_vd_of(s->y[k]);
    }
    const trc_vdouble e0 = x[2] * y[1] - y[2] * x[1], e1 = x[0] * y[2] - y[0] * x[2],
                      e2 = x[1] * y[0] - y[1] * x[0];
    const trc_vdouble det = e0 + e1 + e2;
    const trc_vlong inside =
        ((e0 >= 0.0) & (e1 >= 0.0) & (e2 >= 0.0)) | ((e0 <= 0.0) & (e1 <= 0.0) & (e2 <= 0.0));
    trc_vdouble p[3], q[3], way[3];
    for (int k = 0; k < 3; k++) {
        const trc_vdouble first = trc_vd_of(tri->v[0][k]);
        p[k] = trc_vd_of(tri->v[1][k]) - first;
        q[k] = trc_vd_of(tri->v[2][k]) - first;
        way[k] = first - trc_vd_of(o[k]);
    }
    const trc_vdouble n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2],
                              p[0] * q[1] - p[1] * q[0]};
    const trc_vdouble scale = trc_vd_of(sz);
    const vfloat low = vf_min(s->z[0], vf_min(s->z[1], s->z[2])),
                 high = vf_max(s->z[0], vf_max(s->z[1], s->z[2]));
    const trc_vdouble begin = trc_vd_of(low) * scale, end = trc_vd_of(high) * scale;
    const trc_vdouble nearest = trc_vd_min(begin, end), farthest = trc_vd_max(begin, end);
    const trc_vdouble zero = {0.0};
    const trc_vlong sure = trc_vd_max(trc_vd_of(low), -trc_vd_of(high)) >
                           (double)TRC_Z_ERROR * trc_vd_max(trc_vd_of(high), -trc_vd_of(low));
    const trc_vdouble minimum = trc_vd_select(sure, nearest, trc_vd_min(nearest, zero));
    trc_vdouble distance = (n[0] * way[0] + n[1] * way[1] + n[2] * way[2]) /
                           (n[0] * trc_vd_of(su) + n[1] * trc_vd_of(sv) + n[2]) * scale;
    distance = trc_vd_min(farthest, distance);
    distance = trc_vd_max(minimum, distance);
    *t = __builtin_convertvector(distance, vfloat);
    *u = __builtin_convertvector(e1 / det, vfloat);
    *v = __builtin_convertvector(e2 / det, vfloat);
    const trc_vlong cuts = inside & (det != 0.0) & (distance == distance);
    return vi_lt(__builtin_convertvector(cuts, vint), vi_set(0));
}
#endif

/* Lanes whose ray passes through the triangle's edges. */
TRC_INLINE vmask trc_triangle_edges(const struct trc_triangle_lanes *p, vfloat ou, vfloat ov,
                                    vfloat oz, vfloat su, vfloat sv,
                                    struct trc_triangle_sheared *s) {
    for (int k = 0; k < 3; k++) {
        s->z[k] = p->v[k][2] - oz;
        s->x[k] = (p->v[k][0] - ou) - su * s->z[k];
        s->y[k] = (p->v[k][1] - ov) - sv * s->z[k];
    }
    for (int k = 0; k < 3; k++) {
        const int b = (k + 1) % 3, c = (k + 2) % 3;
        s->e[k] = s->x[c] * s->y[b] - s->y[c] * s->x[b];
    }
    const vfloat zero = vf_set(0.0f);
    s->low = vf_min(s->e[0], vf_min(s->e[1], s->e[2]));
    s->high = vf_max(s->e[0], vf_max(s->e[1], s->e[2]));
    return vm_or(vf_ge(s->low, zero), vf_le(s->high, zero));
}

/* Lanes whose ray may pass through the triangle's edges, by fewer operations: trc_triangle_edges
 * has none beside. weight_error: of trc_precision, three times what an edge function is off by at
 * most; two of them lie between both forms. */
TRC_INLINE vmask trc_triangle_near(const struct trc_triangle_lanes *p, vfloat ou, vfloat ov,
                                   vfloat oz, vfloat su, vfloat sv, float weight_error) {
    vfloat x[3], y[3], e[3];
    for (int k = 0; k < 3; k++) {
        const vfloat z = p->v[k][2] - oz;
        x[k] = vf_madd(-su, z, p->v[k][0] - ou);
        y[k] = vf_madd(-sv, z, p->v[k][1] - ov);
    }
    for (int k = 0; k < 3; k++) {
        const int b = (k + 1) % 3, c = (k + 2) % 3;
        e[k] = vf_madd(x[c], y[b], -(y[c] * x[b]));
    }
    const vfloat margin = vf_set(weight_error);
    return vm_or(vf_ge(vf_min(e[0], vf_min(e[1], e[2])), -margin),
                 vf_le(vf_max(e[0], vf_max(e[1], e[2])), margin));
}

/* Lanes of active whose ray passes through the triangle at distance *t; also barycentrics. maximum:
 * of all rays, so that few need to compute their own bounds. */
TRC_INLINE vmask trc_triangle_test(const struct trc_triangle_lanes *p, vfloat ou, vfloat ov,
                                   vfloat oz, vfloat su, vfloat sv, vfloat sz, vfloat tmin,
                                   const struct trc_precision *maximum, vmask active, vfloat *t,
                                   vfloat *u, vfloat *v) {
    struct trc_triangle_sheared s;
    vmask hit = vm_and(active, trc_triangle_edges(p, ou, ov, oz, su, sv, &s));
    if (!vm_any(hit))
        return hit;
    const vfloat inv = vf_set(1.0f) / (s.e[0] + s.e[1] + s.e[2]);
    *u = s.e[1] * inv;
    *v = s.e[2] * inv;
    *t = (s.e[0] * inv * s.z[0] + *u * s.z[1] + *v * s.z[2]) * sz;
    /* Of hits: the minimum of |edge function|. */
    const vmask near_edge = vf_le(vf_max(s.low, -s.high), vf_set(TRC_TINY_EDGE));
    const vfloat inv_size = vf_abs(inv), sz_size = vf_abs(sz), t_size = vf_abs(*t);
    const vfloat error_maximum = vf_set(maximum->weight_error) * inv_size;
    const vfloat doubt_maximum =
        trc_t_doubt(vf_set(maximum->z), vf_set(maximum->range), error_maximum);
    const vmask surely_precise = vm_and(vf_le(error_maximum, vf_set(TRC_WEIGHT_IMPRECISE)),
                                        vf_gt(t_size, doubt_maximum * sz_size));
    const vmask maybe = vm_or(near_edge, vm_andnot(vf_gt(*t, tmin), surely_precise));
    if (!vm_any(vm_and(hit, maybe)))
        return hit;
    const vfloat x = vf_max(vf_abs(s.x[0]), vf_max(vf_abs(s.x[1]), vf_abs(s.x[2])));
    const vfloat y = vf_max(vf_abs(s.y[0]), vf_max(vf_abs(s.y[1]), vf_abs(s.y[2])));
    const vfloat z_low = vf_min(s.z[0], vf_min(s.z[1], s.z[2])),
                 z_high = vf_max(s.z[0], vf_max(s.z[1], s.z[2]));
    const vfloat z = vf_max(vf_abs(z_low), vf_abs(z_high));
    const vfloat error = trc_weight_error(x, y, z, inv_size);
    const vmask precise = vm_and(vf_le(error, vf_set(TRC_WEIGHT_IMPRECISE)),
                                 vf_gt(t_size, trc_t_doubt(z, z_high - z_low, error) * sz_size));
    const vmask imprecise = vm_andnot(vf_gt(*t, tmin), precise);
    vmask doubtful = vm_and(hit, vm_or(near_edge, imprecise));
    if (__builtin_expect(vm_any(doubtful), 0)) {
        const vmask behind =
            vm_and(vf_ge(tmin, vf_set(0.0f)), trc_flat_behind(p, ou, ov, su * sz, sv * sz));
        hit = vm_andnot(hit, vm_and(doubtful, behind));
        doubtful = vm_andnot(doubtful, behind);
        if (!vm_any(doubtful))
            return hit;
#if TRC_WIDTH > 1
        const vfloat o[3] = {ou, ov, oz};
        vfloat exact_t, exact_u, exact_v;
        const vmask exact =
            trc_triangle_exact_lanes(p, &s, o, su, sv, sz, &exact_t, &exact_u, &exact_v);
        hit = vm_andnot(hit, vm_andnot(doubtful, exact));
        *t = vf_select(doubtful, exact_t, *t);
        *u = vf_select(doubtful, exact_u, *u);
        *v = vf_select(doubtful, exact_v, *v);
#else
        struct trc_doubtful d = {.ou = ou, .ov = ov, .oz = oz, .su = su, .sv = sv, .sz = sz};
        for (int k = 0; k < 3; k++) {
            d.sheared[k][0] = s.x[k];
            d.sheared[k][1] = s.y[k];
            d.sheared[k][2] = s.z[k];
            for (int axis = 0; axis < 3; axis++)
                d.v[k][axis] = p->v[k][axis];
        }
        if (!trc_triangle_exact(&d, t, u, v))
            hit = vm_none();
#endif
    }
    return hit;
}

/* Eight triangles in the lanes: vertex, axis in the order u, v, z. */
struct trc_triangle8 {
    f8 v[3][3];
};

TRC_INLINE uint32_t trc_flat_behind8(const struct trc_triangle8 *p, float ou, float ov, float du,
                                     float dv) {
    const f8 zero = f8_set(0.0f);
    const f8 u = p->v[0][0], v = p->v[0][1];
    const uint32_t flat_u = f8_le(f8_abs(u - p->v[1][0]) + f8_abs(u - p->v[2][0]), zero);
    const uint32_t flat_v = f8_le(f8_abs(v - p->v[1][1]) + f8_abs(v - p->v[2][1]), zero);
    return (flat_u & f8_le((u - f8_set(ou)) * f8_set(copysignf(1.0f, du)), zero)) |
           (flat_v & f8_le((v - f8_set(ov)) * f8_set(copysignf(1.0f, dv)), zero));
}

/* Bits of candidates the ray passes through at distance t[lane]; also barycentrics. */
TRC_INLINE uint32_t trc_triangle8_test(const struct trc_triangle8 *p, float ou, float ov, float oz,
                                       float su, float sv, float sz, float tmin,
                                       uint32_t candidates, f8 *t, f8 *u, f8 *v) {
    const f8 az = p->v[0][2] - oz, bz = p->v[1][2] - oz, cz = p->v[2][2] - oz;
    const f8 ax = (p->v[0][0] - ou) - su * az, ay = (p->v[0][1] - ov) - sv * az;
    const f8 bx = (p->v[1][0] - ou) - su * bz, by = (p->v[1][1] - ov) - sv * bz;
    const f8 cx = (p->v[2][0] - ou) - su * cz, cy = (p->v[2][1] - ov) - sv * cz;
    const f8 e0 = cx * by - cy * bx;
    const f8 e1 = ax * cy - ay * cx;
    const f8 e2 = bx * ay - by * ax;
    const f8 zero = f8_set(0.0f);
    const f8 minimum = f8_min(e0, f8_min(e1, e2)), maximum = f8_max(e0, f8_max(e1, e2));
    uint32_t hit = candidates & (f8_le(zero, minimum) | f8_le(maximum, zero));
    if (!hit)
        return 0;
    const f8 inv = f8_set(1.0f) / (e0 + e1 + e2);
    *u = e1 * inv;
    *v = e2 * inv;
    *t = (e0 * inv * az + *u * bz + *v * cz) * sz;
    const f8 nearest = f8_min(f8_abs(e0), f8_min(f8_abs(e1), f8_abs(e2)));
    const f8 x = f8_max(f8_abs(ax), f8_max(f8_abs(bx), f8_abs(cx)));
    const f8 y = f8_max(f8_abs(ay), f8_max(f8_abs(by), f8_abs(cy)));
    const f8 z_low = f8_min(az, f8_min(bz, cz)), z_high = f8_max(az, f8_max(bz, cz));
    const f8 z = f8_max(f8_abs(z_low), f8_abs(z_high));
    const f8 error = trc_weight_error8(x, y, z, f8_abs(inv));
    const f8 doubt = trc_t_doubt8(z, z_high - z_low, error) * f8_set(fabsf(sz));
    const uint32_t precise = f8_le(error, f8_set(TRC_WEIGHT_IMPRECISE)) & ~f8_le(f8_abs(*t), doubt);
    const uint32_t imprecise = ~f8_le(*t, f8_set(tmin)) & ~precise;
    uint32_t doubtful = hit & (f8_le(nearest, f8_set(TRC_TINY_EDGE)) | imprecise);
    if (__builtin_expect(doubtful != 0, 0) && tmin >= 0.0f) {
        const uint32_t behind = doubtful & trc_flat_behind8(p, ou, ov, su * sz, sv * sz);
        hit &= ~behind;
        doubtful &= ~behind;
    }
    for (; __builtin_expect(doubtful != 0, 0); doubtful &= doubtful - 1) {
        const int i = __builtin_ctz(doubtful);
        struct trc_doubtful d = {
            .ou = ou,
            .ov = ov,
            .oz = oz,
            .su = su,
            .sv = sv,
            .sz = sz,
            .sheared = {{ax[i], ay[i], az[i]}, {bx[i], by[i], bz[i]}, {cx[i], cy[i], cz[i]}}};
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 3; axis++)
                d.v[k][axis] = p->v[k][axis][i];
        float rt, ru, rv;
        if (trc_triangle_exact(&d, &rt, &ru, &rv)) {
            (*t)[i] = rt;
            (*u)[i] = ru;
            (*v)[i] = rv;
        } else {
            hit &= ~(1u << i);
        }
    }
    return hit;
}

#endif
