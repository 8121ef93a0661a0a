/* Public calls on renders. */
#include <float.h>
#include <math.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/fpstate.h"
#include "core/handle.h"
#include "core/thread.h"
#include "render/render.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

/* Limits of the public header. */
#define MAX_SIDE 65536
#define MAX_SAMPLES (1u << 20)
#define MAX_LIGHT_SAMPLES 64

/* Pixels; wider filters blur beyond use. */
#define MAX_FILTER_WIDTH 100.0f

static trc_status check_frame(const trc_render_desc *desc) {
    TRC_TRY(trc_check_count(desc->width, 1, MAX_SIDE, "width"));
    TRC_TRY(trc_check_count(desc->height, 1, MAX_SIDE, "height"));
    if (!desc->crop_width != !desc->crop_height) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "crop_width and crop_height must both be 0 or neither");
    }
    if (!desc->crop_width)
        return TRC_OK;
    if ((uint64_t)desc->crop_x + desc->crop_width > desc->width ||
        (uint64_t)desc->crop_y + desc->crop_height > desc->height) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the crop is not within the frame");
    }
    return TRC_OK;
}

static trc_status check_packet_size(uint32_t size) {
    if (size == 0 || size == 4 || size == 16 || size == 64 || size == 256)
        return TRC_OK;
    return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "packet_size is %u, it can be 0, 4, 16, 64 or 256",
                    size);
}

static trc_status check_sampling(const trc_render_desc *desc) {
    TRC_TRY(trc_check_enum(desc->integrator, TRC_INTEGRATOR_DISTRIBUTION + 1, "integrator"));
    TRC_TRY(trc_check_count(desc->sample_count, 1, MAX_SAMPLES, "sample_count"));
    TRC_TRY(trc_check_count(desc->light_samples, 0, MAX_LIGHT_SAMPLES, "light_samples"));
    TRC_TRY(trc_check_float(desc->attenuation_cutoff, 0.0f, FLT_MAX, "attenuation_cutoff"));
    TRC_TRY(trc_check_float(desc->filter_glossy, 0.0f, FLT_MAX, "filter_glossy"));
    TRC_TRY(trc_check_float(desc->clamp_direct, 0.0f, FLT_MAX, "clamp_direct"));
    TRC_TRY(trc_check_float(desc->clamp_indirect, 0.0f, FLT_MAX, "clamp_indirect"));
    TRC_TRY(trc_check_float(desc->noise_threshold, 0.0f, FLT_MAX, "noise_threshold"));
    TRC_TRY(trc_check_count(desc->min_samples, 0, MAX_SAMPLES, "min_samples"));
    TRC_TRY(trc_check_float(desc->extra_samples, 0.0f, 1.0f, "extra_samples"));
    TRC_TRY(trc_check_enum(desc->assembly, TRC_ASSEMBLY_NONE + 1, "assembly"));
    TRC_TRY(check_packet_size(desc->packet_size));
    TRC_TRY(trc_check_enum(desc->sampler, TRC_SAMPLER_BLUE_NOISE + 1, "sampler"));
    TRC_TRY(trc_check_count(desc->thread_count, 0, TRC_MAX_THREADS, "thread_count"));
    return trc_check_enum(desc->progressive, 2, "progressive");
}

static trc_status check_range(const trc_render_desc *desc) {
    TRC_TRY(trc_check_count(desc->sample_offset, 0, desc->sample_count - 1, "sample_offset"));
    return trc_check_count(desc->sample_subset, 0, desc->sample_count - desc->sample_offset,
                           "sample_subset");
}

static trc_status check_mist(const trc_render_desc *desc) {
    TRC_TRY(trc_check_float(desc->mist_start, 0.0f, FLT_MAX, "mist_start"));
    TRC_TRY(trc_check_float(desc->mist_depth, 0.0f, FLT_MAX, "mist_depth"));
    return trc_check_float(desc->mist_falloff, FLT_MIN, FLT_MAX, "mist_falloff");
}

static trc_status check_film(const trc_render_desc *desc) {
    TRC_TRY(trc_check_enum(desc->filter, TRC_FILTER_BLACKMAN_HARRIS + 1, "filter"));
    TRC_TRY(trc_check_float(desc->filter_width, FLT_MIN, MAX_FILTER_WIDTH, "filter_width"));
    TRC_TRY(trc_check_enum(desc->film_transparent, 2, "film_transparent"));
    TRC_TRY(trc_check_enum(desc->film_transparent_glass, 2, "film_transparent_glass"));
    TRC_TRY(trc_check_float(desc->film_transparent_roughness, 0.0f, 1.0f,
                            "film_transparent_roughness"));
    TRC_TRY(trc_check_float(desc->film_exposure, 0.0f, FLT_MAX, "film_exposure"));
    if (desc->passes >> TRC_PASS_COUNT) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "passes has bits of no pass");
    }
    TRC_TRY(trc_check_enum(desc->cryptomattes, 1u << TRC_CRYPTOMATTE_KINDS, "cryptomattes"));
    if (desc->cryptomattes) {
        TRC_TRY(trc_check_count(desc->cryptomatte_depth, 1, TRC_MAX_CRYPTOMATTE_DEPTH,
                                "cryptomatte_depth"));
    }
    TRC_TRY(trc_check_count(desc->aov_value_count, 0, TRC_MAX_AOVS, "aov_value_count"));
    TRC_TRY(trc_check_count(desc->aov_color_count, 0, TRC_MAX_AOVS, "aov_color_count"));
    TRC_TRY(trc_check_count(desc->light_group_count, 0, TRC_MAX_LIGHT_GROUPS, "light_group_count"));
    TRC_TRY(trc_check_enum(desc->denoise, TRC_DENOISE_PREVIEW + 1, "denoise"));
    TRC_TRY(trc_check_enum(desc->guides, TRC_GUIDES_NONE + 1, "guides"));
    TRC_TRY(trc_check_enum(desc->pass_flags, 2 * TRC_PASSES_MEAN_REFRACTION, "pass_flags"));
    return desc->passes >> TRC_PASS_MIST & 1 ? check_mist(desc) : TRC_OK;
}

static trc_status check_render(const trc_render_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_render_desc"));
    TRC_TRY(check_frame(desc));
    TRC_TRY(check_sampling(desc));
    TRC_TRY(check_range(desc));
    return check_film(desc);
}

static trc_status start(struct trc_scene_state *scene, const trc_render_desc *desc,
                        trc_render *render_out) {
    TRC_TRY(check_render(desc));
    TRC_TRY(trc_check_out(render_out, sizeof *render_out, "render_out"));
    struct trc_snapshot *snapshot = scene->snapshot;
    if (!snapshot) {
        return trc_fail(TRC_ERROR_NOT_COMMITTED, "the scene has not been committed yet");
    }
    if (!snapshot->has_camera) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the committed scene has no camera");
    }
    const trc_render_desc resolved = trc_render_resolve(desc);
    struct trc_render_state *render;
    TRC_TRY(trc_render_state_start(snapshot, &resolved, &render));
    const trc_status status = trc_handle_create(TRC_HANDLE_RENDER, render, render_out);
    if (status != TRC_OK)
        trc_render_state_destroy(render);
    return status;
}

trc_status trc_render_start(trc_scene scene, const trc_render_desc *desc, trc_render *render_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = start(access.scene, desc, render_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_render_poll(trc_render render, trc_render_progress *progress_out) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    const trc_status status =
        trc_check_struct(progress_out, sizeof *progress_out, "trc_render_progress");
    if (status == TRC_OK) {
        const uint64_t fp_state = trc_fp_enter();
        trc_render_state_poll(object, progress_out);
        trc_fp_leave(fp_state);
    }
    trc_handle_release(render);
    return status;
}

trc_status trc_render_wait(trc_render render, double timeout_seconds) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    trc_status status = TRC_OK;
    if (isnan(timeout_seconds)) {
        status = trc_fail(TRC_ERROR_INVALID_ARGUMENT, "timeout_seconds is not a number");
    } else {
        const uint64_t fp_state = trc_fp_enter();
        trc_render_state_wait(object, timeout_seconds);
        trc_fp_leave(fp_state);
    }
    trc_handle_release(render);
    return status;
}

trc_status trc_render_cancel(trc_render render) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    trc_render_state_cancel(object);
    trc_handle_release(render);
    return TRC_OK;
}

trc_status trc_render_read(trc_render render, uint32_t pass, float *pixels_out,
                           uint64_t float_count) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    const uint64_t fp_state = trc_fp_enter();
    const trc_status status = trc_render_state_read(object, pass, pixels_out, float_count);
    trc_fp_leave(fp_state);
    trc_handle_release(render);
    return status;
}

trc_status trc_render_read_preview(trc_render render, float *pixels_out, uint64_t float_count) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    const uint64_t fp_state = trc_fp_enter();
    const trc_status status = trc_render_state_read_preview(object, pixels_out, float_count);
    trc_fp_leave(fp_state);
    trc_handle_release(render);
    return status;
}

/* ---- parts ---- */

uint32_t trc_sums_channels(trc_render render, uint32_t sums) {
    void *object;
    if (trc_handle_acquire(render, TRC_HANDLE_RENDER, &object) != TRC_OK)
        return 0;
    const uint32_t channels = trc_render_state_sums_channels(object, sums);
    trc_handle_release(render);
    return channels;
}

trc_status trc_sums_read(trc_render render, uint32_t sums, double *sums_out,
                         uint64_t double_count) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    const trc_status status = trc_render_state_read_sums(object, sums, sums_out, double_count);
    trc_handle_release(render);
    return status;
}

trc_status trc_merge_start(const trc_render_desc *desc, uint32_t has_catchers,
                           trc_render *render_out) {
    TRC_TRY(check_render(desc));
    TRC_TRY(trc_check_enum(has_catchers, 2, "has_catchers"));
    TRC_TRY(trc_check_out(render_out, sizeof *render_out, "render_out"));
    if (desc->sample_offset || desc->sample_subset)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "parts are merged into a whole");
    const trc_render_desc resolved = trc_render_resolve(desc);
    struct trc_render_state *render;
    TRC_TRY(trc_render_state_merge(&resolved, has_catchers, &render));
    const trc_status status = trc_handle_create(TRC_HANDLE_RENDER, render, render_out);
    if (status != TRC_OK)
        trc_render_state_destroy(render);
    return status;
}

trc_status trc_merge_add(trc_render render, const trc_part_desc *part) {
    TRC_TRY(trc_check_struct(part, sizeof *part, "trc_part_desc"));
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    const uint64_t fp_state = trc_fp_enter();
    const trc_status status = trc_render_state_add(object, part);
    trc_fp_leave(fp_state);
    trc_handle_release(render);
    return status;
}

trc_status trc_merge_finish(trc_render render) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    const trc_status status = trc_render_state_finish(object);
    trc_handle_release(render);
    return status;
}

/* Cancelled first, so that another thread that waits for the end lets go of the render. */
trc_status trc_render_destroy(trc_render render) {
    void *object;
    TRC_TRY(trc_handle_acquire(render, TRC_HANDLE_RENDER, &object));
    trc_render_state_cancel(object);
    TRC_TRY(trc_handle_remove(render));
    trc_render_state_destroy(object);
    return TRC_OK;
}
