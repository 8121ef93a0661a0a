#include "counted_frame.h"

#include <stdlib.h>
#include <string.h>

#include "buffers.h"
#include "core/core.h"
#include "core/fpstate.h"
#include "film/film.h"
#include "model/filter.h"
#include "model/kernels.h"
#include "model/sobol.h"
#include "query_scene.h"
#include "render/render.h"

/* As the renderer has them: render/schedule.c and render/render.c. */
#define TILE_SIDE 32
#define SAMPLES_PER_JOB 16

extern const struct trc_kernels trc_kernels_counted;

struct trace_counts frame_tests[RAY_CLASSES];

enum ray_class frame_tests_class(uint32_t visibility) {
    switch (visibility) {
    case TRC_VISIBLE_CAMERA:
        return RAYS_CAMERA;
    case TRC_VISIBLE_GLOSSY:
        return RAYS_REFLECTION;
    case TRC_VISIBLE_TRANSMISSION:
        return RAYS_REFRACTION;
    case TRC_VISIBLE_SHADOW:
        return RAYS_SHADOW;
    default:
        return RAYS_MIXED;
    }
}

static void add_counts(struct frame_result *out, const struct trc_tile_counts *c) {
    out->rays_camera += c->rays_camera;
    out->rays_shadow += c->rays_shadow;
    out->rays_reflection += c->rays_reflection;
    out->rays_refraction += c->rays_refraction;
}

static void tile_render(struct trc_tile_job job, uint32_t x, uint32_t y, struct frame_result *out) {
    const trc_render_desc *d = job.desc;
    job.x = x;
    job.y = y;
    job.width = d->crop_width - x < TILE_SIDE ? d->crop_width - x : TILE_SIDE;
    job.height = d->crop_height - y < TILE_SIDE ? d->crop_height - y : TILE_SIDE;
    for (uint32_t s = 0; s < d->sample_count; s += SAMPLES_PER_JOB) {
        job.sample_begin = s;
        job.sample_end =
            d->sample_count - s < SAMPLES_PER_JOB ? d->sample_count : s + SAMPLES_PER_JOB;
        trc_kernels_counted.tile_render(&job);
    }
    add_counts(out, &job.counts);
}

static trc_status eye_render(const struct frame_scene *scene, const trc_render_desc *desc,
                             const uint32_t *table, struct frame_result *out) {
    struct trc_film film;
    float filter_table[TRC_FILTER_TABLE];
    const atomic_uint cancel = 0;
    trc_filter_table_fill(desc->filter, desc->filter_width, filter_table);
    const trc_status status = trc_film_create(desc, &film);
    if (status != TRC_OK)
        return status;
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene->scene);
    const struct trc_tile_job job = {
        .snapshot = snapshot,
        .desc = desc,
        .sampler_table = table,
        .filter_table = filter_table,
        .film = &film,
        .memory = buffer_alloc(1, trc_kernels_counted.tile_memory_bytes(desc, snapshot)),
        .cancel = &cancel};
    const uint64_t fp_state = trc_fp_enter();
    for (uint32_t y = 0; y < desc->crop_height; y += TILE_SIDE)
        for (uint32_t x = 0; x < desc->crop_width; x += TILE_SIDE)
            tile_render(job, x, y, out);
    trc_fp_leave(fp_state);
    free(job.memory);
    trc_film_destroy(&film);
    return TRC_OK;
}

trc_status counted_frame_render(const struct frame_scene *scene, const struct spec *spec,
                                struct frame_result *out, struct trace_counts *tests_out) {
    const trc_render_desc chosen = frame_desc(spec), desc = trc_render_resolve(&chosen);
    uint32_t *table = NULL;
    memset(out, 0, sizeof *out);
    memset(frame_tests, 0, sizeof frame_tests);
    trc_status status = trc_sobol_table_create(&table);
    for (uint32_t eye = 0; eye < spec->eyes && status == TRC_OK; eye++) {
        if (eye > 0)
            status = frame_scene_look(scene, spec, eye);
        if (status == TRC_OK)
            status = eye_render(scene, &desc, table, out);
    }
    trc_free(table);
    memcpy(tests_out, frame_tests, sizeof frame_tests);
    return status;
}
