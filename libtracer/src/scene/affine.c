#include "scene/affine.h"

#include <math.h>
#include <string.h>

/* Below this ratio of volume to the product of edge lengths, columns that are exact floats lie in
 * one plane but for rounding. Scale alone does not lower it. */
#define SINGULAR_RATIO 1e-12

/* Below this ratio a ray's direction is off by more than a 16,000th after it went through the
 * inverse in floats: 2^-24 over the ratio. */
#define THIN_RATIO 1e-3

/* The same of the shortest column to the longest, far from where squares overflow. */
#define THIN_LENGTHS 1e-6

/* Below this ratio of volume to edges, what is left of the third dimension is rounding of floats:
 * they have 24 bits, and products of a few matrices lose some. */
#define FLAT_RATIO 1e-6

/* Cosine between two axes below which they are perpendicular but for what products of rotations in
 * floats leave. Of a picture of 1,000 pixels it moves the corners by a hundredth of one. */
#define SHEAR_MIN 1e-5

struct columns {
    double x[3], y[3], z[3], origin[3];
};

static struct columns columns_of(const struct trc_affine *a) {
    struct columns c;
    for (int row = 0; row < 3; row++) {
        c.x[row] = a->m[4 * row];
        c.y[row] = a->m[4 * row + 1];
        c.z[row] = a->m[4 * row + 2];
        c.origin[row] = a->m[4 * row + 3];
    }
    return c;
}

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

const struct trc_affine trc_affine_identity = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};

bool trc_affine_is_identity(const struct trc_affine *a) {
    bool same = true;
    for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
        same = same && a->m[i] == trc_affine_identity.m[i]; /* -0, too */
    return same;
}

bool trc_affine_keeps_angles(const struct trc_affine *a) {
    const double rounding = 1e-5; /* of a product of rotations and a scale in floats, and more */
    double product[3][3] = {{0}}; /* of the axes */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                product[i][j] += (double)a->m[4 * k + i] * (double)a->m[4 * k + j];
    bool keeps = true;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            keeps = keeps && fabs(product[i][j] - (i == j ? product[0][0] : 0.0)) <=
                                 rounding * product[0][0];
    return keeps;
}

bool trc_affine_is_finite(const struct trc_affine *a) {
    bool finite = true;
    for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
        finite = finite && isfinite(a->m[i]);
    return finite;
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void scale(double v[3], double s) {
    for (int i = 0; i < 3; i++)
        v[i] *= s;
}

static double length_of(const double v[3]) { return sqrt(dot(v, v)); }

/* Volume between the columns over the product of their lengths, 0 where one has none; NaN where
 * something is not finite. */
static double volume_ratio(const struct columns *c) {
    double n[3];
    cross(c->y, c->z, n);
    const double lengths = length_of(c->x) * length_of(c->y) * length_of(c->z);
    return lengths == 0.0 ? 0.0 : fabs(dot(c->x, n)) / lengths;
}

/* Determinant, or 0 if it is not worth the name. */
static double determinant(const struct columns *c) {
    double n[3];
    cross(c->y, c->z, n);
    const double volume = dot(c->x, n);
    const double lengths = sqrt(dot(c->x, c->x)) * sqrt(dot(c->y, c->y)) * sqrt(dot(c->z, c->z));
    return fabs(volume) > SINGULAR_RATIO * lengths && isfinite(volume) ? volume : 0.0;
}

static bool invert(const struct columns *c, struct trc_affine *inverse_out) {
    const double volume = determinant(c);
    if (volume == 0.0 || !isfinite(dot(c->origin, c->origin)))
        return false;
    double rows[3][3];
    cross(c->y, c->z, rows[0]);
    cross(c->z, c->x, rows[1]);
    cross(c->x, c->y, rows[2]);
    struct trc_affine inverse;
    bool usable = true;
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            inverse.m[4 * row + column] = (float)(rows[row][column] / volume);
        }
        inverse.m[4 * row + 3] = (float)(-dot(rows[row], c->origin) / volume);
    }
    for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
        usable = usable && isfinite(inverse.m[i]);
    if (usable)
        *inverse_out = inverse;
    return usable;
}

bool trc_affine_invert(const struct trc_affine *a, struct trc_affine *inverse_out) {
    const struct columns c = columns_of(a);
    return invert(&c, inverse_out);
}

bool trc_affine_is_thin(const struct trc_affine *a) {
    const struct columns c = columns_of(a);
    const double x = length_of(c.x), y = length_of(c.y), z = length_of(c.z);
    return volume_ratio(&c) < THIN_RATIO ||
           fmin(x, fmin(y, z)) < THIN_LENGTHS * fmax(x, fmax(y, z));
}

/* The longest cross product of two of three vectors, unit, from those of lengths at longest 1.
 * False where they all lie on a line. */
static bool widest_normal(const double *const v[3], double normal_out[3]) {
    double longest = SINGULAR_RATIO;
    bool found = false;
    for (int i = 0; i < 3; i++) {
        double n[3];
        cross(v[(i + 1) % 3], v[(i + 2) % 3], n);
        const double length = length_of(n);
        if (!(length > longest))
            continue;
        longest = length;
        found = true;
        memcpy(normal_out, n, sizeof n);
    }
    if (found)
        scale(normal_out, 1.0 / longest);
    return found;
}

/* Makes the direction that is lost that of the plane's normal, stretched by size. */
static bool add_depth(struct columns *c, double size) {
    double *const columns[3] = {c->x, c->y, c->z};
    double rows[3][3], normal[3], lost[3];
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            rows[row][column] = columns[column][row] / size;
    struct columns unit = *c;
    scale(unit.x, 1.0 / size);
    scale(unit.y, 1.0 / size);
    scale(unit.z, 1.0 / size);
    if (!widest_normal((const double *const[]){unit.x, unit.y, unit.z}, normal) ||
        !widest_normal((const double *const[]){rows[0], rows[1], rows[2]}, lost))
        return false;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            columns[column][row] += size * normal[row] * lost[column];
    return true;
}

bool trc_affine_invert_thin(const struct trc_affine *a, struct trc_affine *inverse_out) {
    struct columns c = columns_of(a);
    const double size = fmax(length_of(c.x), fmax(length_of(c.y), length_of(c.z)));
    if (volume_ratio(&c) >= FLAT_RATIO && trc_affine_invert(a, inverse_out))
        return true;
    return size > 0.0 && isfinite(size) && add_depth(&c, size) && invert(&c, inverse_out);
}

bool trc_affine_flips(const struct trc_affine *a) {
    const struct columns c = columns_of(a);
    return determinant(&c) < 0.0;
}

static void subtract_along(double v[3], const double unit[3]) {
    const double s = dot(v, unit);
    for (int i = 0; i < 3; i++)
        v[i] -= s * unit[i];
}

static void normalize(double v[3]) { scale(v, 1.0 / sqrt(dot(v, v))); }

bool trc_affine_make_unit(const struct trc_affine *a, struct trc_affine *unit_out,
                          float *volume_out) {
    struct columns c = columns_of(a);
    if (determinant(&c) == 0.0 || !isfinite(dot(c.origin, c.origin)))
        return false;
    normalize(c.x);
    normalize(c.y);
    normalize(c.z);
    const double shear = fmax(fabs(dot(c.x, c.y)), fmax(fabs(dot(c.y, c.z)), fabs(dot(c.z, c.x))));
    *volume_out = (float)fabs(determinant(&c));
    if (shear < SHEAR_MIN) {
        *volume_out = 1.0f;
        subtract_along(c.y, c.z);
        normalize(c.y);
        subtract_along(c.x, c.z);
        subtract_along(c.x, c.y);
        normalize(c.x);
    }
    for (int row = 0; row < 3; row++) {
        unit_out->m[4 * row] = (float)c.x[row];
        unit_out->m[4 * row + 1] = (float)c.y[row];
        unit_out->m[4 * row + 2] = (float)c.z[row];
        unit_out->m[4 * row + 3] = (float)c.origin[row];
    }
    return true;
}
