/* Lights that continuation and camera rays find by themselves, and the weights of that. */
#include "kernels/light/clamp.h"
#include "kernels/light/lamp_shade.h"
#include "kernels/light/lamps.h"
#include "kernels/light/light.h"
#include "kernels/light/select.h"
#include "kernels/light/triangle.h"
#include "kernels/light/world.h"
#include "kernels/light/world_place.h"

/* Power heuristic (E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997) for
 * the ray, one of them, against count light samples of density pl. Negative pb: no light sample
 * could have been. */
TRC_INLINE vfloat ray_weight(vfloat pb, vfloat pl, vfloat count) {
    const vfloat b2 = pb * pb, l = pl * count, l2 = l * l;
    const vfloat w = vf_divide(b2, b2 + l2);
    return vf_select(vf_lt(pb, vf_zero()), vf_one(), w);
}

/* Lanes that an object of these visibility bits hides from, as Cycles tests lights: diffuse,
 * transmitted and unblocked rays by their bit, glossy ones only when reflected. */
TRC_INLINE vmask hidden_from(uint32_t visibility, vuint path) {
    uint32_t hides =
        ~visibility & (TRC_VISIBLE_DIFFUSE | TRC_VISIBLE_TRANSMISSION | TRC_VISIBLE_UNBLOCKED);
    vmask hidden = vm_none();
    if (hides)
        hidden = vm_not(vi_eq((vint)(path & vu_set(hides)), vi_set(0)));
    if (!(visibility & TRC_VISIBLE_GLOSSY)) {
        const vuint both = vu_set(TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED);
        hidden = vm_or(hidden, vi_eq((vint)(path & both), (vint)both));
    }
    return hidden;
}
TRC_INLINE vmask is_camera_ray(vuint path) {
    return vi_eq((vint)(path & vu_set(TRC_VISIBLE_CAMERA)), vi_set(TRC_VISIBLE_CAMERA));
}
/* Of the lanes in active, those that may see the lamp. */
static vmask lamp_viewers(const struct trc_lamp *lamp, vuint path, vmask active) {
    const vmask camera = is_camera_ray(path);
    const bool mis = lamp->flags & TRC_LAMP_MIS;
    if (!mis && !(lamp->visibility & TRC_VISIBLE_CAMERA))
        return vm_none();
    vmask viewers = vm_andnot(active, hidden_from(lamp->visibility, path));
    if (!(lamp->visibility & TRC_VISIBLE_CAMERA))
        viewers = vm_andnot(viewers, camera);
    if (!mis)
        viewers = vm_and(viewers, camera);
    return viewers;
}

/* Lanes whose ray comes within the sphere about the lamp: most lamps are missed by all. */
TRC_INLINE vmask near_lamp(const struct trc_lamp *lamp, vvec3 p, vvec3 wi) {
    if (lamp->flags & TRC_LAMP_DISTANT)
        return vf_ge(v3_dot(v3_set(lamp->position), wi), vf_set(lamp->cos_cone));
    const vvec3 to = v3_sub(v3_set(lamp->position), p);
    const vfloat along = v3_dot(to, wi);
    const float r2 = lamp->square_reach;
    /* Rounding of the difference grows with the squared distance. */
    const vfloat d2 = v3_dot(to, to), slack = d2 * vf_set(1e-5f) + vf_set(1.001f * r2);
    return vf_le(d2 - along * along, slack);
}

/* Chance that a light was chosen where a ray of direction wi left. The only light always is, but
 * not where all of it lies below the surface: rays of fibres alone go there. */
TRC_INLINE vfloat chance_from(const struct trc_light_table *t, const struct trc_receiver *r,
                              vint light, vvec3 wi, vmask m) {
    const vfloat chance = trc_light_chance(t, r, light, m);
    const vmask below = vm_and(vm_and(m, r->has_n), vf_lt(v3_dot(r->n, wi), vf_zero()));
    if (!t->single || !vm_any(below))
        return chance;
    const vmask reaches = vf_gt(trc_candidate_importance(t, 0, r), vf_zero());
    return vf_where(vm_or(reaches, vm_not(below)), chance);
}

/* Distance to the lamp along the ray, infinite where it is missed; density of sampling that place,
 * radiance. */
static vfloat meet_lamp(const struct trc_lamp *lamp, vvec3 p, vvec3 wi, vfloat *pdf,
                        vvec3 *radiance) {
    const struct trc_wide_lamp l = trc_lamp_broadcast(lamp);
    switch (lamp->kind) {
#define TRC_LAMP_KIND(NAME, name, is_it) \
    case TRC_KIND_##NAME:                \
        return trc_##name##_hit(&l, p, wi, pdf, radiance);
#include "model/light_kinds.def"
    default:
        return vf_set(INFINITY);
    }
}

/* What the nodes of a lamp emit towards the rays that meet it at that distance. */
static vvec3 emission_met(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                          uint32_t number, vfloat distance, vmask m) {
    const struct trc_lamp_view view = {.scene = snapshot,
                                       .table = snapshot->lights,
                                       .light = vi_set((int32_t)number),
                                       .p = ray->p,
                                       .wi = ray->wi,
                                       .distance = distance,
                                       .time = ray->time,
                                       .depths = ray->depths};
    return trc_lamp_emission(&view, m);
}

/* Under which clamp lamps are seen. */
struct lamp_clamp {
    vvec3 weight; /* of the path */
    vfloat limit;
};

/* Of the lanes that may see a lamp, those whose rays left what it lights. */
static vmask linked_viewers(const struct trc_lamp *lamp, const struct trc_light_ray *ray,
                            const struct trc_receiver *r, vmask viewers) {
    const vmask unlit = trc_is_unlit(vu_set(lamp->excluded[0]), vu_set(lamp->excluded[1]), r->sets);
    return vm_andnot(viewers, vm_andnot(unlit, is_camera_ray(ray->path)));
}

/* Of the lanes that may see the lamp, those that meet it between tmin and tmax; where, and what
 * they see, weighted. */
TRC_INLINE vmask lamp_meet(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                           const struct trc_receiver *receiver, uint32_t number, vmask viewers,
                           vfloat *distance_out, vvec3 *light_out, vfloat *weight_out) {
    const struct trc_light_table *t = snapshot->lights;
    const struct trc_lamp *lamp = &t->lamps[number];
    vfloat pdf = vf_zero();
    vvec3 light;
    const vfloat distance = meet_lamp(lamp, ray->p, ray->wi, &pdf, &light);
    vmask hit = vm_and(viewers, vm_and(vf_gt(distance, ray->tmin), vf_le(distance, ray->tmax)));
    hit = vm_and(hit, vf_lt(distance, vf_set(INFINITY)));
    if (!vm_any(hit))
        return hit;
    if (lamp->program)
        light = v3_mul(light, emission_met(snapshot, ray, number, distance, hit));
    vfloat weight = vf_one();
    vmask weighed = vm_andnot(hit, vf_lt(ray->bsdf_pdf, vf_zero()));
    if (lamp->bounce_limit) /* beyond it there were no samples */
        weighed = vm_andnot(weighed, vi_lt(vi_set((int32_t)lamp->bounce_limit),
                                           (vint)trc_depth_of(ray->depths, TRC_DEPTH_ALL_SHIFT)));
    if (vm_any(weighed)) {
        const vfloat chance = chance_from(t, receiver, vi_set((int32_t)number), ray->wi, weighed);
        weight = ray_weight(ray->bsdf_pdf, pdf * chance, ray->light_sample_count);
        if (lamp->bounce_limit)
            weight = vf_select(weighed, weight, vf_one());
    }
    *distance_out = distance;
    *light_out = light;
    *weight_out = weight;
    return hit;
}

/* sets: where those of the receiver are kept. */
TRC_INLINE struct trc_receiver receiver_of(const struct trc_snapshot *snapshot,
                                           const struct trc_light_ray *ray, vmask active,
                                           vuint sets[2]) {
    struct trc_receiver receiver = trc_receiver_make(ray->p, ray->n);
    if (snapshot->lights->linked)
        trc_receiver_sets(snapshot, ray->left, active, sets);
    receiver.sets = sets;
    return receiver;
}

/* clamp: NULL for none. */
TRC_INLINE void lamps_meet(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                           uint32_t group, const struct lamp_clamp *clamp, vmask active,
                           vvec3 *radiance) {
    const struct trc_light_table *t = snapshot->lights;
    const bool all = group == TRC_ALL_GROUPS;
    const uint32_t end = t->group_seen[all ? TRC_MAX_LIGHT_GROUPS + 1 : group + 1];
    vuint sets[2];
    const struct trc_receiver receiver = receiver_of(snapshot, ray, active, sets);
    for (uint32_t i = all ? 0 : t->group_seen[group]; i < end; i++) {
        const uint32_t number = t->seen[i];
        const struct trc_lamp *lamp = &t->lamps[number];
        vmask viewers = vm_and(active, near_lamp(lamp, ray->p, ray->wi));
        if (!vm_any(viewers))
            continue;
        viewers = lamp_viewers(lamp, ray->path, viewers);
        if (t->linked)
            viewers = linked_viewers(lamp, ray, &receiver, viewers);
        if (lamp->shadow_class)
            viewers = vm_and(viewers, is_camera_ray(ray->path));
        if (!vm_any(viewers))
            continue;
        vfloat distance, weight;
        vvec3 light;
        const vmask hit =
            lamp_meet(snapshot, ray, &receiver, number, viewers, &distance, &light, &weight);
        if (!vm_any(hit))
            continue;
        if (clamp)
            weight = weight *
                     trc_clamp_factor(v3_mul(clamp->weight, v3_scale(light, weight)), clamp->limit);
        *radiance = v3_add(*radiance, v3_where(hit, v3_scale(light, weight)));
    }
}

void trc_light_hit(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                   uint32_t group, vmask active, vvec3 *radiance) {
    lamps_meet(snapshot, ray, group, NULL, active, radiance);
}

void trc_light_hit_clamped(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                           uint32_t group, vvec3 weight, vfloat limit, vmask active,
                           vvec3 *radiance) {
    const struct lamp_clamp clamp = {weight, limit};
    lamps_meet(snapshot, ray, group, &clamp, active, radiance);
}

vvec3 trc_light_hit_one(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                        uint32_t number, vmask active, vfloat *distance) {
    const struct trc_lamp *lamp = &snapshot->lights->lamps[number];
    vmask viewers = vm_andnot(active, is_camera_ray(ray->path));
    viewers = vm_and(viewers, near_lamp(lamp, ray->p, ray->wi));
    if (!vm_any(viewers))
        return v3_zero();
    struct trc_light_ray whole = *ray;
    whole.tmin = vf_zero();
    whole.tmax = vf_set(TRC_FAR);
    vuint sets[2];
    const struct trc_receiver receiver = receiver_of(snapshot, ray, active, sets);
    viewers = linked_viewers(lamp, ray, &receiver, lamp_viewers(lamp, ray->path, viewers));
    vfloat weight;
    vvec3 light;
    const vmask hit =
        lamp_meet(snapshot, &whole, &receiver, number, viewers, distance, &light, &weight);
    return vm_any(hit) ? v3_where(hit, v3_scale(light, weight)) : v3_zero();
}

uint32_t trc_light_group(const struct trc_snapshot *snapshot, uint32_t light) {
    const struct trc_light_table *t = snapshot->lights;
    const struct trc_world *world = &snapshot->world;
    if (light < t->lamp_count)
        return t->lamps[light].group;
    if (light == t->world_light)
        return world->light_group;
    if (light - t->first_triangle < t->triangle_count)
        return snapshot->instances[t->triangles[light - t->first_triangle].instance].light_group;
    return world->ao_method == TRC_AO_REPLACE ? world->light_group : 0;
}

/* Lights of an instance are in the order of its triangles: usually all of them are lights, else a
 * search finds the place. */
vint trc_light_of_triangle(const struct trc_surface *s, vmask m) {
    const struct trc_light_table *t = s->snapshot->lights;
    vint light = vi_set(-1);
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const uint32_t number = (uint32_t)vi_get(s->instance, lane);
        const struct trc_instance *instance = &s->snapshot->instances[number];
        if (instance->first_light == UINT32_MAX)
            continue;
        const int32_t wanted = vi_get(s->triangle, lane);
        uint32_t first = instance->first_light - t->first_triangle;
        uint32_t count = t->instance_triangles[number];
        if ((uint32_t)wanted < count && t->triangles[first + (uint32_t)wanted].triangle == wanted) {
            first += (uint32_t)wanted;
        } else {
            while (count > 1) {
                const uint32_t half = count / 2;
                if (t->triangles[first + half].triangle <= wanted)
                    first += half;
                count -= half;
            }
        }
        if (t->triangles[first].triangle == wanted)
            light = vi_select(vm_from_bits(1u << lane),
                              vi_set((int32_t)(first + t->first_triangle)), light);
    }
    return light;
}

/* World corners of the surface's triangles. */
static struct trc_corners surface_corners(const struct trc_surface *s, vmask m) {
    float p[TRC_WIDTH * 9];
    memset(p, 0, sizeof p);
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        trc_world_corners_at(s->snapshot, (uint32_t)vi_get(s->instance, lane),
                             (uint32_t)vi_get(s->triangle, lane), vf_get(s->time, lane),
                             p + 9 * lane);
    }
    return trc_corners_of(p);
}

vfloat trc_light_triangle_weight(const struct trc_surface *s, vvec3 p_from, vvec3 n_from, vint left,
                                 vfloat bsdf_pdf, vfloat light_sample_count) {
    const struct trc_light_table *t = s->snapshot->lights;
    vmask m = vm_andnot(s->active, vf_lt(bsdf_pdf, vf_zero()));
    if (!t->triangle_count || !vm_any(m))
        return vf_one();
    const vint light = trc_light_of_triangle(s, m);
    m = vm_andnot(m, vi_lt(light, vi_set(0)));
    if (!vm_any(m))
        return vf_one();
    struct trc_receiver receiver = trc_receiver_make(p_from, n_from);
    vuint sets[2];
    if (t->linked)
        trc_receiver_sets(s->snapshot, left, m, sets);
    receiver.sets = sets;
    const struct trc_corners corners = surface_corners(s, m);
    const struct trc_view_triangle view = trc_triangle_view(&corners, p_from);
    const vfloat distance = v3_length(v3_sub(s->p, p_from));
    const vfloat pdf = trc_triangle_density(&view, s->wo, distance);
    const vfloat chance = chance_from(t, &receiver, light, v3_neg(s->wo), m);
    return vf_select(m, ray_weight(bsdf_pdf, pdf * chance, light_sample_count), vf_one());
}

vvec3 trc_world_radiance(const struct trc_snapshot *snapshot, vvec3 p_from, vvec3 n_from, vint left,
                         vvec3 wi, vfloat bsdf_pdf, vfloat light_sample_count, vuint path,
                         vuint depths, vmask active) {
    const struct trc_light_table *t = snapshot->lights;
    vmask m = active;
    const uint32_t visibility = snapshot->world.visibility;
    if ((visibility & TRC_VISIBLE_ALL) != TRC_VISIBLE_ALL) {
        m = vm_andnot(m, hidden_from(visibility, path));
        if (!(visibility & TRC_VISIBLE_CAMERA))
            m = vm_andnot(m, is_camera_ray(path));
    }
    if (!vm_any(m))
        return v3_zero();
    const vvec3 radiance = trc_world_shade(snapshot, wi, path, depths, m);
    const vmask alone =
        vi_eq((vint)(path & vu_set(TRC_PATH_WORLD_ALONE)), vi_set(TRC_PATH_WORLD_ALONE));
    const vmask weighed = vm_andnot(m, vm_or(alone, vf_lt(bsdf_pdf, vf_zero())));
    if (t->world_light == UINT32_MAX || !vm_any(weighed))
        return v3_where(m, radiance);
    struct trc_receiver receiver = trc_receiver_make(p_from, n_from);
    vuint sets[2];
    if (t->linked)
        trc_receiver_sets(snapshot, left, weighed, sets);
    receiver.sets = sets;
    const vfloat density = trc_world_density(t, n_from, receiver.has_n, wi, weighed);
    const vfloat chance = trc_light_chance(t, &receiver, vi_set((int32_t)t->world_light), weighed);
    const vfloat weight = ray_weight(bsdf_pdf, density * chance, light_sample_count);
    return v3_where(m, v3_scale(radiance, vf_select(weighed, weight, vf_one())));
}
