/* The node trees of lamps at the places that points see. */
#include "kernels/light/lamp_shade.h"

#include <float.h>

#include "kernels/light/lamps.h"
#include "kernels/lobe/bsdf.h"
#include "kernels/program/program.h"

/* ---- the shading point ---- */

/* Enters the lanes' place on one lamp: as Cycles gives it to the lamp's nodes. A distant lamp's
 * position is the direction of its light. */
static void set_place(const struct trc_lamp_view *v, int32_t number, vmask m,
                      struct trc_surface *s) {
    const struct trc_lamp *lamp = &v->table->lamps[number];
    const struct trc_wide_lamp l = trc_lamp_broadcast(lamp);
    const vvec3 out = v3_neg(v->wi);
    const vvec3 p = lamp->flags & TRC_LAMP_DISTANT ? out : v3_mad(v->wi, v->distance, v->p);
    const struct trc_lamp_axes axes = {v->table->programs[lamp->program - 1].to_light,
                                       lamp->flags & TRC_LAMP_LOCAL_UV};
    struct trc_lamp_place q = {.n = out, .x = vf_one(), .y = vf_zero()};
    switch (lamp->kind) {
#define TRC_LAMP_KIND(NAME, name, is_it)                               \
    case TRC_KIND_##NAME:                                              \
        trc_##name##_place(&l, &axes, v3_sub(p, l.position), out, &q); \
        break;
#include "model/light_kinds.def"
    default:
        break;
    }
    s->p = v3_select(m, p, s->p);
    s->n = v3_select(m, q.n, s->n);
    /* TRC_OP_PARAMETRIC gives 1 - u - v and u. */
    s->u = vf_select(m, q.y, s->u);
    s->v = vf_select(m, vf_one() - q.x - q.y, s->v);
}

/* Lanes in m that have the number of the first of them. */
TRC_INLINE vmask same_number(vint numbers, vmask m, int32_t *number) {
    *number = vi_get(numbers, __builtin_ctz(vm_bits(m)));
    return vm_and(m, vi_eq(numbers, vi_set(*number)));
}

vvec3 trc_lamp_emission(const struct trc_lamp_view *v, vmask m) {
    const struct trc_lamp *lamps = v->table->lamps;
    const vint own =
        vi_gather((const int32_t *)&lamps->program, v->light * vi_set(TRC_LAMP_WORDS), m);
    m = vm_andnot(m, vi_eq(own, vi_set(0)));
    vvec3 emission = v3(vf_one(), vf_one(), vf_one());
    if (!vm_any(m))
        return emission;
    /* Light Path is no kind of ray, as in Cycles, and one bounce beyond the point. */
    struct trc_surface s = {
        .snapshot = v->scene,
        .lamps = v->table,
        .active = m,
        .instance = vi_set(TRC_FIRST_LAMP) - v->light,
        .triangle = vi_set(-1),
        .time = v->time,
        .wo = v3_neg(v->wi),
        .backfacing = vm_none(),
        .smooth = vm_none(),
        .ray_length = vf_select(vf_lt(v->distance, vf_set(TRC_FAR)), v->distance, vf_set(FLT_MAX)),
        .path = vu_set(0),
        .depths = v->depths + vu_set(1u << TRC_DEPTH_ALL_SHIFT),
    };
    int32_t number;
    for (vmask left = m; vm_any(left);) {
        const vmask same = same_number(v->light, left, &number);
        set_place(v, number, same, &s);
        left = vm_andnot(left, same);
    }
    s.ng = s.n;
    for (vmask left = m; vm_any(left);) {
        s.active = same_number(own, left, &number);
        left = vm_andnot(left, s.active);
        const struct trc_material *program =
            v->scene->materials[v->table->programs[number - 1].material];
        struct trc_registers registers;
        trc_program_run(program, &s, &registers);
        emission = v3_select(s.active, trc_lobes_emission(program, &registers), emission);
    }
    return emission;
}

/* ---- the mean ---- */

/* Places that are looked at. */
#define MEASURED 256u

/* An additive recurrence: the part behind the point of k * step (M. Roberts, "The Unreasonable
 * Effectiveness of Quasirandom Sequences", 2018, for five dimensions). */
TRC_INLINE vfloat spread(vint k, float step) {
    const vfloat x = vi_to_float(k + vi_set(1)) * vf_set(step);
    return x - vf_floor(x);
}

/* What each place counts: the lamp's own radiance, without the fall-off of a point. */
static vfloat place_weight(const struct trc_lamp *lamp, const struct trc_place *place) {
    const vfloat light = vf_abs(v3_luminance(place->radiance));
    const uint32_t kind = (uint32_t)lamp->flags & (TRC_LAMP_DELTA | TRC_LAMP_DISTANT);
    const vfloat even = kind == TRC_LAMP_DELTA ? light * place->distance * place->distance : light;
    return vf_where(vf_gt(place->pdf, vf_zero()), even);
}

static struct trc_place sample_one(const struct trc_lamp *lamp, vvec3 p, vfloat u1, vfloat u2) {
    const struct trc_wide_lamp l = trc_lamp_broadcast(lamp);
    switch (lamp->kind) {
#define TRC_LAMP_KIND(NAME, name, is_it) \
    case TRC_KIND_##NAME:                \
        return trc_##name##_sample(&l, p, u1, u2);
#include "model/light_kinds.def"
    default:
        return (struct trc_place){.pdf = vf_zero()};
    }
}

/* Sum of the lanes in m. */
static float sum_of(vfloat x, vmask m) {
    float lanes[TRC_WIDTH], sum = 0.0f;
    vf_store(lanes, vf_where(m, x));
    for (int i = 0; i < TRC_WIDTH; i++)
        sum += lanes[i];
    return sum;
}

void trc_lamp_measure(const struct trc_snapshot *scene, const struct trc_light_table *table,
                      uint32_t number, const struct trc_light_bound *bound, float reach,
                      float mean[3]) {
    const struct trc_lamp *lamp = &table->lamps[number];
    const float lowest = bound->cos_o <= -1.0f ? -1.0f : bound->cos_e;
    const vvec3 axis = v3_set(lamp->normal);
    float sums[4] = {0};
    vvec3 a, b;
    v3_frame(axis, &a, &b);
    for (uint32_t first = 0; first < MEASURED; first += TRC_WIDTH) {
        const vint k = vi_set((int32_t)first) + vi_lane();
        const vmask m = vm_first((int32_t)(MEASURED - first));
        const vfloat cosine = vf_one() - spread(k, 0.8812714617f) * vf_set(1.0f - lowest);
        const vfloat sine = vf_safe_sqrt(vf_one() - cosine * cosine);
        vfloat x, y;
        vf_sincos_turns(spread(k, 0.7766393890f), &y, &x);
        const vvec3 way = v3_from_frame(v3(x * sine, y * sine, cosine), a, b, axis);
        struct trc_lamp_view view = {.scene = scene,
                                     .table = table,
                                     .light = vi_set((int32_t)number),
                                     .time = vf_set(0.5f),
                                     .depths = vu_set(0)};
        view.p = v3_mad(way, spread(k, 0.6844301295f) * vf_set(reach), v3_set(lamp->position));
        const struct trc_place place =
            sample_one(lamp, view.p, spread(k, 0.6031687406f), spread(k, 0.5315532977f));
        view.wi = place.wi;
        view.distance = place.distance;
        const vfloat weight = place_weight(lamp, &place);
        const vmask lit = vm_and(m, vf_gt(weight, vf_zero()));
        const vvec3 light = v3_scale(v3_abs(trc_lamp_emission(&view, lit)), weight);
        sums[0] += sum_of(light.x, lit);
        sums[1] += sum_of(light.y, lit);
        sums[2] += sum_of(light.z, lit);
        sums[3] += sum_of(weight, lit);
    }
    for (int c = 0; c < 3; c++)
        mean[c] = sums[3] > 0.0f ? sums[c] / sums[3] : 1.0f;
}
