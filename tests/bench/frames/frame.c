#include "frame.h"

#include <string.h>

trc_render_desc frame_desc(const struct spec *spec) {
    return (trc_render_desc){.struct_size = sizeof(trc_render_desc),
                             .width = spec->width,
                             .height = spec->height,
                             .integrator = spec->integrator,
                             .sample_count = spec->samples,
                             .light_samples = spec->light_samples,
                             .max_depth = spec->max_depth,
                             .max_transparent_depth = spec->max_depth,
                             .max_glossy_depth = UINT32_MAX,
                             .max_transmission_depth = UINT32_MAX,
                             .attenuation_cutoff = spec->cutoff,
                             .assembly = spec->assembly,
                             .packet_size = spec->packet_size,
                             .sampler = spec->sampler,
                             .filter = TRC_FILTER_BLACKMAN_HARRIS,
                             .filter_width = 1.5f,
                             .film_exposure = 1.0f,
                             .thread_count = spec->threads};
}

static void add_progress(struct frame_result *out, const trc_render_progress *p) {
    out->seconds += p->seconds;
    out->seconds_trace += p->seconds_trace;
    out->seconds_shade += p->seconds_shade;
    out->seconds_other += p->seconds_other;
    out->rays_camera += p->rays_camera;
    out->rays_shadow += p->rays_shadow;
    out->rays_reflection += p->rays_reflection;
    out->rays_refraction += p->rays_refraction;
    out->peak_bytes =
        p->peak_memory_bytes > out->peak_bytes ? p->peak_memory_bytes : out->peak_bytes;
}

static trc_status eye_render(const struct frame_scene *scene, const trc_render_desc *desc,
                             struct frame_result *out, float *picture) {
    trc_render render;
    trc_render_progress progress = {.struct_size = sizeof progress};
    trc_status status = trc_render_start(scene->scene, desc, &render);
    if (status != TRC_OK)
        return status;
    status = trc_render_wait(render, -1.0);
    if (status == TRC_OK)
        status = trc_render_poll(render, &progress);
    if (status == TRC_OK)
        add_progress(out, &progress);
    if (status == TRC_OK && picture)
        status = trc_render_read(render, TRC_PASS_COMBINED, picture,
                                 (uint64_t)4 * desc->width * desc->height);
    (void)trc_render_destroy(render);
    return status;
}

trc_status frame_render(const struct frame_scene *scene, const struct spec *spec,
                        struct frame_result *out, float *picture) {
    const trc_render_desc desc = frame_desc(spec);
    trc_scene_stats stats = {.struct_size = sizeof stats};
    memset(out, 0, sizeof *out);
    trc_status status = trc_scene_get_stats(scene->scene, &stats);
    out->build_seconds = stats.build_seconds;
    out->commit_seconds = stats.commit_seconds;
    out->triangle_count = stats.instanced_triangle_count;
    out->bvh_bytes = stats.bvh_bytes;
    out->geometry_bytes = stats.geometry_bytes;
    for (uint32_t eye = 0; eye < spec->eyes && status == TRC_OK; eye++) {
        if (eye > 0)
            status = frame_scene_look(scene, spec, eye);
        if (status == TRC_OK)
            status = eye_render(scene, &desc, out, eye == 0 ? picture : NULL);
    }
    return status;
}
