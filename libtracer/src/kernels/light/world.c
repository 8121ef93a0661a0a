/* The world's material along directions. */
#include "kernels/light/world.h"

#include "kernels/lobe/bsdf.h"
#include "kernels/simd/wide_math.h"
#include "kernels/trace/surface.h"

/* A shading point as Cycles gives it to the world: the position is the direction, the normals look
 * back, and it lies one bounce beyond what the ray left. */
static void world_surface(const struct trc_snapshot *snapshot, vvec3 direction, vuint path,
                          vuint depths, vmask active, struct trc_surface *s) {
    const vvec3 back = v3_neg(direction);
    *s = (struct trc_surface){
        .snapshot = snapshot,
        .active = active,
        .instance = vi_set(-1),
        .triangle = vi_set(-1),
        .time = vf_set(0.5f),
        .p = direction,
        .ng = back,
        .n = back,
        .wo = back,
        .backfacing = vm_none(),
        .path = path,
        .depths = trc_depths_beyond(depths, TRC_DEPTH_ALL_SHIFT),
    };
}

const struct trc_material *trc_world_run(const struct trc_snapshot *snapshot, vvec3 direction,
                                         vuint path, vuint depths, vmask active,
                                         struct trc_registers *regs) {
    const struct trc_material *m = snapshot->materials[snapshot->world.material];
    struct trc_surface s;
    world_surface(snapshot, direction, path, depths, active, &s);
    if (m->instruction_count)
        trc_program_run(m, &s, regs);
    return m;
}

vvec3 trc_world_shade(const struct trc_snapshot *snapshot, vvec3 direction, vuint path,
                      vuint depths, vmask active) {
    const struct trc_world *world = &snapshot->world;
    if (world->material == UINT32_MAX)
        return v3_zero();
    if (world->is_constant)
        return v3_where(active, v3_set(world->radiance));
    struct trc_registers regs;
    const struct trc_material *m = trc_world_run(snapshot, direction, path, depths, active, &regs);
    return v3_where(active, trc_lobes_emission(m, &regs));
}

void trc_world_shade_kinds(const struct trc_snapshot *snapshot, vvec3 direction, vmask behind,
                           vuint depths, vmask active, vvec3 seen_out[3]) {
    const vuint reflected = trc_depths_beyond(depths, TRC_DEPTH_ALL_SHIFT);
    const vuint transmitted = trc_depths_beyond(depths, TRC_DEPTH_TRANSMISSION_SHIFT);
    const vuint bounced[3] = {(vuint)vi_select(behind, (vint)transmitted, (vint)reflected),
                              trc_depths_beyond(depths, TRC_DEPTH_GLOSSY_SHIFT), transmitted};
    vuint kinds[3];
    trc_lobe_rays(behind, kinds);
    for (int i = 0; i < 3; i++)
        seen_out[i] = trc_world_shade(snapshot, direction, kinds[i], bounced[i], active);
}

void trc_world_evaluate(const struct trc_snapshot *snapshot, const float *directions,
                        float *radiance, uint32_t count) {
    const vuint path = vu_set(0);
    for (uint32_t first = 0; first < count; first += TRC_WIDTH) {
        const uint32_t left = count - first, n = left < TRC_WIDTH ? left : TRC_WIDTH;
        const vmask active = vm_first((int32_t)n);
        vvec3 d = v3_gather(directions + 3 * (size_t)first, vi_lane() * vi_set(3), active);
        d = v3_normalize(d);
        const vvec3 c = trc_world_shade(snapshot, d, path, path, active);
        float rgb[3][TRC_WIDTH];
        vf_store(rgb[0], c.x);
        vf_store(rgb[1], c.y);
        vf_store(rgb[2], c.z);
        for (uint32_t i = 0; i < n; i++) {
            for (int k = 0; k < 3; k++)
                radiance[3 * ((size_t)first + i) + k] = rgb[k][i];
        }
    }
}
