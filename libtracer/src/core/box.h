/* Points and boxes as builders hold them: four floats at once, lane 3 is 0. */
#ifndef TRACER_CORE_BOX_H
#define TRACER_CORE_BOX_H

#include <float.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef float f4 __attribute__((vector_size(16)));
typedef int32_t i4 __attribute__((vector_size(16)));

/* Both give b where a lane is not a number. */
#if defined(__SSE__)
#include <xmmintrin.h>
static inline f4 f4_min(f4 a, f4 b) { return (f4)_mm_min_ps((__m128)a, (__m128)b); }
static inline f4 f4_max(f4 a, f4 b) { return (f4)_mm_max_ps((__m128)a, (__m128)b); }
static inline bool i4_all(i4 m) { return _mm_movemask_ps((__m128)m) == 15; }
static inline bool i4_any(i4 m) { return _mm_movemask_ps((__m128)m) != 0; }
#else
static inline f4 f4_min(f4 a, f4 b) {
    const i4 m = a < b;
    return (f4)(((i4)a & m) | ((i4)b & ~m));
}
static inline f4 f4_max(f4 a, f4 b) {
    const i4 m = a > b;
    return (f4)(((i4)a & m) | ((i4)b & ~m));
}
static inline bool i4_all(i4 m) { return m[0] & m[1] & m[2] & m[3]; }
static inline bool i4_any(i4 m) { return m[0] | m[1] | m[2] | m[3]; }
#endif

static inline f4 f4_set(float a) { return (f4){a, a, a, a}; }
static inline f4 f4_abs(f4 a) {
    return (f4)((i4)a & (i4){0x7fffffff, 0x7fffffff, 0x7fffffff, 0x7fffffff});
}
/* Lanes y, z, x. */
static inline f4 f4_yzx(f4 a) { return __builtin_shufflevector(a, a, 1, 2, 0, 3); }

static inline f4 f4_load4(const float p[4]) {
    f4 a;
    memcpy(&a, p, sizeof a);
    return a;
}
static inline f4 f4_load3(const float p[3]) { return (f4){p[0], p[1], p[2], 0.0f}; }
/* The same where a fourth float can be read. */
static inline f4 f4_load3_padded(const float p[4]) {
    const i4 three = {-1, -1, -1, 0};
    return (f4)((i4)f4_load4(p) & three);
}
static inline void f4_store4(float p[4], f4 a) { memcpy(p, &a, sizeof a); }
static inline void f4_store3(float p[3], f4 a) { memcpy(p, &a, 3 * sizeof *p); }

/* Rows to columns. */
static inline void f4_transpose(f4 rows[4]) {
    const f4 a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 1, 5),
             b = __builtin_shufflevector(rows[2], rows[3], 0, 4, 1, 5),
             c = __builtin_shufflevector(rows[0], rows[1], 2, 6, 3, 7),
             d = __builtin_shufflevector(rows[2], rows[3], 2, 6, 3, 7);
    rows[0] = __builtin_shufflevector(a, b, 0, 1, 4, 5);
    rows[1] = __builtin_shufflevector(a, b, 2, 3, 6, 7);
    rows[2] = __builtin_shufflevector(c, d, 0, 1, 4, 5);
    rows[3] = __builtin_shufflevector(c, d, 2, 3, 6, 7);
}
struct box {
    f4 lower, upper;
};

static inline struct box box_empty(void) {
    return (struct box){{FLT_MAX, FLT_MAX, FLT_MAX, 0.0f}, {-FLT_MAX, -FLT_MAX, -FLT_MAX, 0.0f}};
}
static inline void box_grow(struct box *b, struct box o) {
    b->lower = f4_min(b->lower, o.lower);
    b->upper = f4_max(b->upper, o.upper);
}
static inline void box_add(struct box *b, f4 point) { box_grow(b, (struct box){point, point}); }
/* The same; a lane that is not a number changes nothing. */
static inline void box_add_number(struct box *b, f4 point) {
    b->lower = f4_min(point, b->lower);
    b->upper = f4_max(point, b->upper);
}
/* Around four boxes side by side in the lanes, by axis. */
static inline struct box box_around4(const f4 lower[3], const f4 upper[3]) {
    f4 l[4] = {lower[0], lower[1], lower[2]}, u[4] = {upper[0], upper[1], upper[2]};
    f4_transpose(l);
    f4_transpose(u);
    return (struct box){f4_min(f4_min(l[0], l[1]), f4_min(l[2], l[3])),
                        f4_max(f4_max(u[0], u[1]), f4_max(u[2], u[3]))};
}
/* What both have in common. */
static inline struct box box_common(struct box a, struct box b) {
    return (struct box){f4_max(a.lower, b.lower), f4_min(a.upper, b.upper)};
}
/* Lengths of the edges; 0 for an empty box. */
static inline f4 box_size(struct box b) { return f4_max(b.upper - b.lower, f4_set(0.0f)); }
/* The axis of the largest of three sizes. */
static inline int f4_largest_axis(f4 size) {
    const int xy = size[0] >= size[1] ? 0 : 1;
    return size[xy] >= size[2] ? xy : 2;
}
/* Half the surface of a box that is longer by margin along each axis; of an empty one, as of a
 * point. */
static inline float box_area_wider(struct box b, float margin) {
    const f4 d = box_size(b) + f4_set(margin), face = d * f4_yzx(d);
    return face[0] + face[1] + face[2];
}
/* Half the surface; 0 for an empty box. */
static inline float box_area(struct box b) { return box_area_wider(b, 0.0f); }
/* The same of four boxes by their sizes. */
static inline f4 box_areas(const f4 size[4]) {
    const f4 xy0 = __builtin_shufflevector(size[0], size[1], 0, 4, 1, 5),
             xy1 = __builtin_shufflevector(size[2], size[3], 0, 4, 1, 5),
             z0 = __builtin_shufflevector(size[0], size[1], 2, 6, 2, 6),
             z1 = __builtin_shufflevector(size[2], size[3], 2, 6, 2, 6);
    const f4 x = __builtin_shufflevector(xy0, xy1, 0, 1, 4, 5),
             y = __builtin_shufflevector(xy0, xy1, 2, 3, 6, 7),
             z = __builtin_shufflevector(z0, z1, 0, 1, 4, 5);
    return x * y + y * z + z * x;
}

#endif
