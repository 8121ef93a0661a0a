/* The tests of kernels/trace/curve.h, which includes this once for rays in the lanes and once for
 * pieces: REAL, MASK (of comparisons), SET, MINIMUM, MAXIMUM, ROOT, LE, BOTH, SELECT_LE(a, b, x, y)
 * (x where a <= b, else y) and NAMED(name) are defined there. */

/* A ray: origin, shear, turn, least distance, in the order u, v, z of its axes. */
struct NAMED(trc_curve_ray) {
    REAL ou, ov, oz, su, sv;
    REAL xx, xy, yy, zx, zy, zz;
    REAL per_length, tmin;
    REAL side; /* sign of the direction along z */
};
/* A piece: ends and radii, and the range of s where an end of a strand cuts it. */
struct NAMED(trc_piece) {
    REAL p[2][3], r[2];
    REAL low, high;
};
struct NAMED(trc_curve_hit) {
    MASK hit;
    REAL t, u, v;
};
TRC_INLINE void NAMED(trc_piece_turn)(const struct NAMED(trc_curve_ray) * ray, const REAL p[3],
                                      REAL *x, REAL *y, REAL *z) {
    const REAL pz = p[2] - ray->oz;
    const REAL px = (p[0] - ray->ou) - ray->su * pz, py = (p[1] - ray->ov) - ray->sv * pz;
    *x = ray->xx * px + ray->xy * py;
    *y = ray->yy * py;
    *z = ray->zz * pz + ray->zx * px + ray->zy * py;
}
TRC_INLINE struct NAMED(trc_curve_hit)
    NAMED(trc_ribbon_test)(const struct NAMED(trc_curve_ray) * ray,
                           const struct NAMED(trc_piece) * piece) {
    REAL x0, y0, z0, x1, y1, z1;
    NAMED(trc_piece_turn)(ray, piece->p[0], &x0, &y0, &z0);
    NAMED(trc_piece_turn)(ray, piece->p[1], &x1, &y1, &z1);
    const REAL zero = SET(0.0f), one = SET(1.0f);
    const REAL dx = x1 - x0, dy = y1 - y0;
    const REAL length2 = MAXIMUM(dx * dx + dy * dy, SET(1e-36f));
    const REAL at = (zero - (x0 * dx + y0 * dy)) / length2;
    const REAL s = MINIMUM(MAXIMUM(at, zero), one);
    const REAL x = x0 + s * dx, y = y0 + s * dy, z = z0 + s * (z1 - z0);
    const REAL r = piece->r[0] + s * (piece->r[1] - piece->r[0]);
    const REAL t = z * ray->per_length;
    const REAL ahead = ray->tmin + SET(TRC_RIBBON_AHEAD) * r * ray->per_length;
    struct NAMED(trc_curve_hit) h;
    h.hit = BOTH(BOTH(LE(x * x + y * y, r * r), LE(ahead, t)),
                 BOTH(LE(piece->low, at), LE(at, piece->high)));
    h.t = t;
    h.u = s;
    const REAL across = ray->side * (dy * x - dx * y) / (ROOT(length2) * r);
    h.v = MINIMUM(MAXIMUM(across, zero - one), one);
    return h;
}
TRC_INLINE struct NAMED(trc_curve_hit)
    NAMED(trc_round_test)(const struct NAMED(trc_curve_ray) * ray,
                          const struct NAMED(trc_piece) * piece) {
    REAL x0, y0, z0, x1, y1, z1;
    NAMED(trc_piece_turn)(ray, piece->p[0], &x0, &y0, &z0);
    NAMED(trc_piece_turn)(ray, piece->p[1], &x1, &y1, &z1);
    const REAL zero = SET(0.0f), one = SET(1.0f), never = SET(INFINITY);
    const REAL r0 = piece->r[0], r1 = piece->r[1];
    const REAL dx = x1 - x0, dy = y1 - y0, dz = z1 - z0, dr = r1 - r0;
    /* g(s) = a s^2 + 2 b s + c; the sphere about either end. */
    const REAL a = dr * dr - (dx * dx + dy * dy), b = r0 * dr - (x0 * dx + y0 * dy);
    const REAL g0 = r0 * r0 - (x0 * x0 + y0 * y0), g1 = r1 * r1 - (x1 * x1 + y1 * y1);
    const REAL in0 = ROOT(MAXIMUM(g0, zero)), in1 = ROOT(MAXIMUM(g1, zero));
    REAL near = SELECT_LE(zero, g0, z0 - in0, never), near_s = zero;
    REAL far = SELECT_LE(zero, g0, z0 + in0, zero - never), far_s = zero;
    const REAL near1 = SELECT_LE(zero, g1, z1 - in1, never);
    const REAL far1 = SELECT_LE(zero, g1, z1 + in1, zero - never);
    near_s = SELECT_LE(near, near1, near_s, one);
    near = MINIMUM(near1, near);
    far_s = SELECT_LE(far1, far, far_s, one);
    far = MAXIMUM(far1, far);
    /* Between them, where a s + b = +-dz sqrt(g): g = d / (dz^2 - a). NaN is neither. */
    const REAL d = b * b - a * g0;
    const REAL g = d / (dz * dz - a), in = ROOT(MAXIMUM(g, zero));
    const REAL s_near = (dz * in - b) / a, s_far = (zero - dz * in - b) / a;
    const REAL z_near = z0 + s_near * dz - in, z_far = z0 + s_far * dz + in;
    const REAL body_near =
        SELECT_LE(zero, MINIMUM(g, MINIMUM(s_near, one - s_near)), z_near, never);
    const REAL body_far =
        SELECT_LE(zero, MINIMUM(g, MINIMUM(s_far, one - s_far)), z_far, zero - never);
    near_s = SELECT_LE(body_near, near, s_near, near_s);
    near = MINIMUM(body_near, near);
    far_s = SELECT_LE(far, body_far, s_far, far_s);
    far = MAXIMUM(body_far, far);
    const REAL margin = SET(TRC_ROUND_AHEAD) * MAXIMUM(r0, r1) * ray->per_length;
    const REAL least = ray->tmin + margin;
    const REAL t_near = near * ray->per_length, t_far = far * ray->per_length;
    const REAL t = SELECT_LE(least, t_near, t_near, t_far);
    const REAL s = SELECT_LE(least, t_near, near_s, far_s);
    const REAL within = SELECT_LE(least, t_near, zero, SET(TRC_CURVE_WITHIN));
    const REAL x = x0 + s * dx, y = y0 + s * dy, r = r0 + s * dr;
    struct NAMED(trc_curve_hit) h;
    h.hit = LE(least, t); /* infinite: none */
    h.t = t;
    h.u = s;
    const REAL length = ROOT(MAXIMUM(dx * dx + dy * dy, SET(1e-36f)));
    const REAL across = ray->side * (dy * x - dx * y) / (length * r);
    h.v = MINIMUM(MAXIMUM(across, zero - one), one) + within;
    return h;
}
TRC_INLINE struct NAMED(trc_curve_hit) NAMED(trc_ball_test)(const struct NAMED(trc_curve_ray) * ray,
                                                            const struct NAMED(trc_piece) * piece) {
    REAL x, y, z;
    NAMED(trc_piece_turn)(ray, piece->p[0], &x, &y, &z);
    const REAL zero = SET(0.0f), r = piece->r[0];
    const REAL g = r * r - (x * x + y * y), in = ROOT(MAXIMUM(g, zero));
    const REAL t_near = (z - in) * ray->per_length, t_far = (z + in) * ray->per_length;
    const REAL least = ray->tmin + SET(TRC_ROUND_AHEAD) * r * ray->per_length;
    struct NAMED(trc_curve_hit) h;
    h.t = SELECT_LE(least, t_near, t_near, t_far);
    h.hit = BOTH(LE(zero, g), LE(least, h.t));
    /* From the middle to the ray, in radii. */
    h.u = (zero - x) / r;
    h.v = (zero - y) / r + SELECT_LE(least, t_near, zero, SET(TRC_CURVE_WITHIN));
    return h;
}
