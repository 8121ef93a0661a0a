/* The tests of kernels/trace/curve.h, which includes this once for rays in the lanes and once for
 * pieces: REAL, MASK (of comparisons), SET, MINIMUM, MAXIMUM, ROOT, LE, ANY (of a mask), BOTH,
 * SELECT_LE(a, b, x, y) (x where a <= b, else y) and NAMED(name) are defined there, and undefined
 * here. */

/* A ray: origin, shear, turn, least distance, in the order u, v, z of its axes. */
struct NAMED(trc_curve_ray) {
    REAL ou, ov, oz, su, sv;
    REAL xx, xy, yy, zx, zy, zz;
    REAL per_length, tmin;
    REAL near; /* from where on TRC_RIBBON_AHEAD counts */
    REAL side; /* sign of the direction along z */
};

/* A piece: ends and radii, and the vertices before and after it, or the ends themselves. */
struct NAMED(trc_piece) {
    REAL p[2][3], r[2];
    REAL before[3], after[3];
    REAL r_before, r_after;
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

/* What is not left to the neighbours: rays within the lines that halve the angles at the ends. Both
 * pieces at an end find the same bits for it; where it turns back on itself there is no such line,
 * and rounding lets both have what is near. Strands end upright. r: of the piece, about. */
TRC_INLINE MASK NAMED(trc_ribbon_owns)(const struct NAMED(trc_curve_ray) * ray,
                                       const struct NAMED(trc_piece) * piece, REAL x0, REAL y0,
                                       REAL x1, REAL y1, REAL r) {
    REAL xb, yb, xa, ya, ignored;
    NAMED(trc_piece_turn)(ray, piece->before, &xb, &yb, &ignored);
    NAMED(trc_piece_turn)(ray, piece->after, &xa, &ya, &ignored);
    const REAL zero = SET(0.0f), one = SET(1.0f);
    const REAL bx = x0 - xb, by = y0 - yb, dx = x1 - x0, dy = y1 - y0, ax = xa - x1, ay = ya - y1;
    const REAL d = ROOT(dx * dx + dy * dy), b = ROOT(bx * bx + by * by),
               a = ROOT(ax * ax + ay * ay);
    /* Where there is no neighbour both terms are of this piece. */
    const REAL to_b = SELECT_LE(b, zero, one, b), to_a = SELECT_LE(a, zero, one, a);
    const REAL e0 = x0 * (bx * d + dx * to_b) + y0 * (by * d + dy * to_b);
    const REAL e1 = x1 * (dx * to_a + ax * d) + y1 * (dy * to_a + ay * d);
    const REAL doubt = SET(TRC_RIBBON_DOUBT) * d * (d + r);
    return BOTH(LE(e0, doubt * to_b), LE(zero - doubt * to_a, e1));
}

/* Where the axis of a ribbon passes a ray, without a look at its neighbours. */
struct NAMED(trc_ribbon_pass) {
    REAL x0, y0, x1, y1;  /* its ends, turned */
    REAL s, t, r, square; /* along it, distance, radius and squared distance across there */
    MASK hit;
};

TRC_INLINE struct NAMED(trc_ribbon_pass)
    NAMED(trc_ribbon_pass_of)(const struct NAMED(trc_curve_ray) * ray,
                              const struct NAMED(trc_piece) * piece) {
    struct NAMED(trc_ribbon_pass) p;
    REAL z0, z1;
    NAMED(trc_piece_turn)(ray, piece->p[0], &p.x0, &p.y0, &z0);
    NAMED(trc_piece_turn)(ray, piece->p[1], &p.x1, &p.y1, &z1);
    const REAL zero = SET(0.0f), one = SET(1.0f);
    const REAL dx = p.x1 - p.x0, dy = p.y1 - p.y0;
    const REAL length2 = MAXIMUM(dx * dx + dy * dy, SET(TRC_CURVE_TINY));
    const REAL at = (zero - (p.x0 * dx + p.y0 * dy)) / length2;
    p.s = MINIMUM(MAXIMUM(at, zero), one);
    const REAL x = p.x0 + p.s * dx, y = p.y0 + p.s * dy, z = z0 + p.s * (z1 - z0);
    p.r = piece->r[0] + p.s * (piece->r[1] - piece->r[0]);
    p.square = x * x + y * y;
    const REAL ahead = ray->near + SET(TRC_RIBBON_AHEAD) * p.r * ray->per_length;
    p.t = z * ray->per_length;
    p.hit = BOTH(LE(p.square, p.r * p.r), BOTH(LE(ahead, p.t), LE(ray->tmin, p.t)));
    return p;
}

TRC_INLINE struct NAMED(trc_curve_hit)
    NAMED(trc_ribbon_hit)(const struct NAMED(trc_curve_ray) * ray,
                          const struct NAMED(trc_piece) * piece,
                          const struct NAMED(trc_ribbon_pass) * p) {
    const REAL zero = SET(0.0f), one = SET(1.0f);
    const REAL dx = p->x1 - p->x0, dy = p->y1 - p->y0;
    const REAL x = p->x0 + p->s * dx, y = p->y0 + p->s * dy;
    const REAL across = MINIMUM(ROOT(p->square) / p->r, one), sign = ray->side * (dy * x - dx * y);
    return (struct NAMED(trc_curve_hit)){
        .hit = BOTH(p->hit, NAMED(trc_ribbon_owns)(ray, piece, p->x0, p->y0, p->x1, p->y1, p->r)),
        .t = p->t,
        .u = p->s,
        .v = SELECT_LE(zero, sign, across, zero - across)};
}

/* Where a round piece leaves off at one of its ends: hits at z on the ray are its own where
 * slope * z <= from. */
struct NAMED(trc_round_limit) {
    REAL slope, from;
};

/* Strands end upright and open; without a limit at joints, pieces shorter than their radius would
 * close them. Both pieces at a joint have some of what is beyond the plane that halves its angle,
 * by how much it bends and how they taper, as they do not meet in that plane; where that is a
 * radius or more, or the planes of this joint and the next meet within the radius, there is no
 * limit. x, y, z, r: the end, dx, dy, dz, dr: from the other; next: the vertex beyond. */
TRC_INLINE struct NAMED(trc_round_limit)
    NAMED(trc_round_limit_of)(const struct NAMED(trc_curve_ray) * ray, const REAL next[3],
                              REAL next_r, REAL x, REAL y, REAL z, REAL r, REAL dx, REAL dy,
                              REAL dz, REAL dr) {
    REAL nx, ny, nz;
    NAMED(trc_piece_turn)(ray, next, &nx, &ny, &nz);
    nx = nx - x;
    ny = ny - y;
    nz = nz - z;
    const REAL zero = SET(0.0f), one = SET(1.0f), tiny = SET(TRC_CURVE_TINY), never = SET(INFINITY);
    const REAL d2 = dx * dx + dy * dy + dz * dz, n2 = nx * nx + ny * ny + nz * nz;
    const REAL to_d = one / ROOT(MAXIMUM(d2, tiny));
    const REAL to_n = SELECT_LE(n2, zero, zero, one / ROOT(MAXIMUM(n2, tiny)));
    const REAL bx = nx * to_n - dx * to_d, by = ny * to_n - dy * to_d, bz = nz * to_n - dz * to_d;
    const REAL bend2 = bx * bx + by * by + bz * bz, bend = ROOT(bend2);
    const REAL wx = nx * to_n + dx * to_d, wy = ny * to_n + dy * to_d, wz = nz * to_n + dz * to_d;
    const REAL nr = next_r - r;
    const REAL taper = MAXIMUM(dr, zero - dr) * to_d + MAXIMUM(nr, zero - nr) * to_n;
    const REAL share = SET(TRC_ROUND_OVERLAP) + bend + taper,
               widest = MAXIMUM(r, MAXIMUM(next_r, r - dr));
    REAL margin = SELECT_LE(share, one, SET(TRC_ROUND_MARGIN) * share * widest, never);
    margin = SELECT_LE(bend2 * widest * widest, SET(TRC_ROUND_BEND_SQUARED) * MINIMUM(d2, n2),
                       margin, never);
    margin = SELECT_LE(n2, zero, zero, margin);
    return (struct NAMED(trc_round_limit)){wz, x * wx + y * wy + z * wz + margin};
}

/* Where a ray is inside a round piece without limits, in lengths along z: [near, far]; infinite
 * where it is not. */
struct NAMED(trc_round_pass) {
    REAL x0, y0, z0, x1, y1, z1;   /* its ends, turned */
    REAL near, far, near_s, far_s; /* s: along the piece */
    MASK hit;                      /* may be */
};

TRC_INLINE struct NAMED(trc_round_pass)
    NAMED(trc_round_pass_of)(const struct NAMED(trc_curve_ray) * ray,
                             const struct NAMED(trc_piece) * piece) {
    struct NAMED(trc_round_pass) p;
    NAMED(trc_piece_turn)(ray, piece->p[0], &p.x0, &p.y0, &p.z0);
    NAMED(trc_piece_turn)(ray, piece->p[1], &p.x1, &p.y1, &p.z1);
    const REAL zero = SET(0.0f), one = SET(1.0f), never = SET(INFINITY);
    const REAL r0 = piece->r[0], r1 = piece->r[1];
    const REAL dx = p.x1 - p.x0, dy = p.y1 - p.y0, dz = p.z1 - p.z0, dr = r1 - r0;
    /* g(s) = a s^2 + 2 b s + c; the sphere about either end. */
    const REAL a = dr * dr - (dx * dx + dy * dy), b = r0 * dr - (p.x0 * dx + p.y0 * dy);
    const REAL g0 = r0 * r0 - (p.x0 * p.x0 + p.y0 * p.y0),
               g1 = r1 * r1 - (p.x1 * p.x1 + p.y1 * p.y1);
    const REAL in0 = ROOT(MAXIMUM(g0, zero)), in1 = ROOT(MAXIMUM(g1, zero));
    REAL near = SELECT_LE(zero, g0, p.z0 - in0, never), near_s = zero;
    REAL far = SELECT_LE(zero, g0, p.z0 + in0, zero - never), far_s = zero;
    const REAL near1 = SELECT_LE(zero, g1, p.z1 - in1, never);
    const REAL far1 = SELECT_LE(zero, g1, p.z1 + in1, zero - never);
    near_s = SELECT_LE(near, near1, near_s, one);
    near = MINIMUM(near1, near);
    far_s = SELECT_LE(far1, far, far_s, one);
    far = MAXIMUM(far1, far);
    /* Between them, where a s + b = +-dz sqrt(g): g = d / (dz^2 - a). NaN is neither. */
    const REAL d = b * b - a * g0;
    const REAL g = d / (dz * dz - a), in = ROOT(MAXIMUM(g, zero));
    const REAL s_near = (dz * in - b) / a, s_far = (zero - dz * in - b) / a;
    const REAL z_near = p.z0 + s_near * dz - in, z_far = p.z0 + s_far * dz + in;
    const REAL body_near =
        SELECT_LE(zero, MINIMUM(g, MINIMUM(s_near, one - s_near)), z_near, never);
    const REAL body_far =
        SELECT_LE(zero, MINIMUM(g, MINIMUM(s_far, one - s_far)), z_far, zero - never);
    p.near_s = SELECT_LE(body_near, near, s_near, near_s);
    p.near = MINIMUM(body_near, near);
    p.far_s = SELECT_LE(far, body_far, s_far, far_s);
    p.far = MAXIMUM(body_far, far);
    p.hit = LE(MINIMUM(p.near, zero - p.far), SET(FLT_MAX)); /* infinite: none */
    return p;
}

TRC_INLINE struct NAMED(trc_curve_hit)
    NAMED(trc_round_hit)(const struct NAMED(trc_curve_ray) * ray,
                         const struct NAMED(trc_piece) * piece,
                         const struct NAMED(trc_round_pass) * p) {
    const REAL zero = SET(0.0f), one = SET(1.0f), never = SET(INFINITY);
    const REAL r0 = piece->r[0], r1 = piece->r[1];
    const REAL dx = p->x1 - p->x0, dy = p->y1 - p->y0, dz = p->z1 - p->z0, dr = r1 - r0;
    const REAL radius = MAXIMUM(r0, r1);
    const struct NAMED(trc_round_limit)
        begin = NAMED(trc_round_limit_of)(ray, piece->before, piece->r_before, p->x0, p->y0, p->z0,
                                          r0, zero - dx, zero - dy, zero - dz, zero - dr),
        end = NAMED(trc_round_limit_of)(ray, piece->after, piece->r_after, p->x1, p->y1, p->z1, r1,
                                        dx, dy, dz, dr);
    const REAL near_in =
        MINIMUM(begin.from - begin.slope * p->near, end.from - end.slope * p->near);
    const REAL far_in = MINIMUM(begin.from - begin.slope * p->far, end.from - end.slope * p->far);
    const REAL least = ray->tmin + SET(TRC_ROUND_AHEAD) * radius * ray->per_length;
    const REAL t_near = SELECT_LE(zero, near_in, p->near * ray->per_length, zero - never);
    const REAL t_far = SELECT_LE(zero, far_in, p->far * ray->per_length, zero - never);
    struct NAMED(trc_curve_hit) h;
    h.t = SELECT_LE(least, t_near, t_near, t_far);
    h.u = SELECT_LE(least, t_near, p->near_s, p->far_s);
    h.hit = LE(least, h.t); /* infinite: none */
    const REAL within = SELECT_LE(least, t_near, zero, SET(TRC_CURVE_WITHIN));
    const REAL x = p->x0 + h.u * dx, y = p->y0 + h.u * dy, r = r0 + h.u * dr;
    const REAL length = ROOT(MAXIMUM(dx * dx + dy * dy, SET(TRC_CURVE_TINY)));
    const REAL across = ray->side * (dy * x - dx * y) / (length * r);
    h.v = MINIMUM(MAXIMUM(across, zero - one), one) + within;
    return h;
}

TRC_INLINE struct NAMED(trc_curve_hit)
    NAMED(trc_ball_test)(const struct NAMED(trc_curve_ray) * ray,
                         const struct NAMED(trc_piece) * piece, bool counts_once) {
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
    const REAL within = SELECT_LE(least, t_near, zero, SET(TRC_CURVE_WITHIN));
    h.v = (zero - y) / r + within;
    if (counts_once)
        h.v = h.v + SELECT_LE(t_near, zero, zero, within);
    return h;
}

#undef REAL
#undef MASK
#undef SET
#undef MINIMUM
#undef MAXIMUM
#undef ROOT
#undef LE
#undef ANY
#undef BOTH
#undef SELECT_LE
#undef NAMED
