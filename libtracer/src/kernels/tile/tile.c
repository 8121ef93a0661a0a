/* A tile from camera rays to film. See kernels/tile/tile.h for how it works. */
#include "kernels/tile/tile.h"

#include <assert.h>
#include <math.h>

#include "core/core.h"
#include "kernels/light/clamp.h"

/* ---- clocks: one reading per stage and step ---- */

static void clock_to(struct trc_tile *t, double *sum) {
    const double at = trc_seconds();
    *t->clock += at - t->clock_start;
    t->clock = sum;
    t->clock_start = at;
}
void trc_clock_trace(struct trc_tile *t) { clock_to(t, &t->job->counts.seconds_trace); }
void trc_clock_shade(struct trc_tile *t) { clock_to(t, &t->job->counts.seconds_shade); }
void trc_clock_other(struct trc_tile *t) { clock_to(t, &t->job->counts.seconds_other); }

/* ---- memory ---- */

static bool wants_light_passes(const trc_render_desc *desc) {
    return desc->passes & trc_passes_divided();
}

/* Rays that a hit sends on at most. */
static uint32_t count_branches(const trc_render_desc *desc, const struct trc_snapshot *snapshot) {
    if (desc->integrator != TRC_INTEGRATOR_WHITTED)
        return 1;
    return snapshot->branch_count < TRC_MAX_LOBES ? snapshot->branch_count : TRC_MAX_LOBES;
}

static void sums_carve(struct trc_carver *c, struct trc_sample_store *s,
                       const trc_render_desc *desc, size_t column_bytes) {
    for (int i = 0; i < 3; i++)
        s->radiance[i] = trc_carve(c, column_bytes);
    s->transparency = trc_carve(c, column_bytes);
    for (uint32_t pass = 1; pass < TRC_SUM_COUNT; pass++) {
        if (!trc_film_has_sums(desc, pass))
            continue;
        s->passes[s->pass_count++] = (uint8_t)pass;
        for (uint32_t k = 0; k < trc_pass_info_of(pass)->sums; k++)
            s->pass[pass][k] = trc_carve(c, column_bytes);
    }
}

/* Also sets what of the scene decides about memory. */
static size_t tile_carve(struct trc_tile *t, const trc_render_desc *desc,
                         const struct trc_snapshot *snapshot, void *memory) {
    struct trc_carver c = {.base = memory};
    const uint32_t features = snapshot->features;
    const bool catchers = t->catchers = features & TRC_FEATURE_SHADOW_CATCHERS;
    t->looks_back = features & TRC_FEATURE_REFRACTION;
    t->remembers_left = features & (TRC_FEATURE_REFRACTION | TRC_FEATURE_LINKS);
    t->measures_paths = features & TRC_FEATURE_SLOPES;
    t->hit_branches = count_branches(desc, snapshot);
    t->splits = desc->integrator == TRC_INTEGRATOR_DISTRIBUTION && snapshot->branch_count > 1;
    t->scales_clamps = t->splits && trc_clamps(desc);
    /* Whitted's rays may meet a catcher, which splits them before they branch. Of other integrators
     * a sample has two rays at most, and a batch of them half as many samples. Second rays of hits
     * go on by themselves. */
    const bool doubles = catchers && desc->integrator == TRC_INTEGRATOR_WHITTED;
    t->ray_room = trc_ray_room_of(desc, t->hit_branches * (doubles ? 2 : 1));
    const size_t batch = (trc_column_entries(catchers) + TRC_WIDTH) * sizeof(float);
    const bool splits_light = wants_light_passes(desc);
    const bool curves = features & TRC_FEATURE_CURVES;
    const struct trc_ray_columns columns = {t->measures_paths, t->scales_clamps, t->remembers_left,
                                            splits_light, curves};
    trc_rays_carve(&c, &t->stack, t->ray_room.capacity, columns);
    trc_rays_carve(&c, &t->work, t->ray_room.capacity, columns);
    if (t->splits)
        trc_rays_carve(&c, &t->later, t->ray_room.capacity, columns);
    float **const hit_floats[] = {&t->hits.t, &t->hits.u, &t->hits.v};
    for (int i = 0; i < 3; i++)
        *hit_floats[i] = trc_carve(&c, batch);
    uint32_t **const hit_words[] = {&t->hits.instance, &t->hits.triangle, &t->hits.material,
                                    &t->samples.pixel, &t->samples.index};
    for (int i = 0; i < 5; i++)
        *hit_words[i] = trc_carve(&c, batch);
    sums_carve(&c, &t->samples, desc, batch);
    const size_t places = (size_t)trc_film_matte_count(desc) * TRC_TILE_SIZE * TRC_TILE_SIZE;
    for (uint32_t k = 0; k < TRC_CRYPTOMATTE_KINDS; k++)
        if (desc->cryptomattes >> k & 1)
            t->mattes[k] = trc_carve(&c, places * sizeof *t->mattes[k]);
    trc_shadows_carve(&c, &t->shadows,
                      (struct trc_shadow_columns){.splits = splits_light,
                                                  .lamps = desc->passes >> TRC_PASS_SHADOW & 1,
                                                  .strands = curves,
                                                  .passes = features & TRC_FEATURE_TRANSPARENCY,
                                                  .pixels = features & TRC_FEATURE_SHADOW_SLOPES,
                                                  .split_scales = t->scales_clamps});
    if (curves)
        t->left = trc_carve(&c, TRC_BUNDLE * sizeof *t->left);
    t->keys = trc_carve(&c, TRC_SHADOW_COLUMN * sizeof *t->keys);
    t->order = trc_carve(&c, batch);
    for (int k = 0; k < 2; k++)
        t->bins[k] = trc_carve(&c, TRC_BINS * sizeof *t->bins[k]);
    t->carver = c;
    return c.used;
}

size_t trc_tile_memory_bytes(const trc_render_desc *desc, const struct trc_snapshot *snapshot) {
    struct trc_tile t;
    memset(&t, 0, sizeof t);
    return sizeof t + TRC_CARVER_ALIGNMENT + tile_carve(&t, desc, snapshot, NULL);
}

/* ---- the job ---- */

/* The beam of a camera sample: the narrowest of the frame, in a corner. The shear of a camera
 * narrows it by no more than its axes' volume. Of panoramas, whose pixels differ most, it is a
 * share of each pixel's own. */
static void beam_setup(struct trc_tile *t) {
    const struct trc_camera *c = &t->snapshot->camera;
    const float *w = c->windows[0];
    const float x = fmaxf(fabsf(w[0]), fabsf(w[1])), y = fmaxf(fabsf(w[2]), fabsf(w[3]));
    const float pixel = fminf(fabsf(w[1] - w[0]) / (float)t->desc->width,
                              fabsf(w[3] - w[2]) / (float)t->desc->height);
    const float share =
        c->axes_volume * fminf(t->desc->filter_width, 1.0f) / sqrtf((float)t->desc->sample_count);
    const float sample = pixel * share;
    if (trc_is_panorama(c))
        t->beam_spread = share;
    else if (c->type == TRC_CAMERA_ORTHOGRAPHIC)
        t->beam_width = sample;
    else
        t->beam_spread = sample / (1.0f + x * x + y * y);
}

void trc_tile_render(struct trc_tile_job *job) {
    char *memory = job->memory;
    struct trc_tile *t = (struct trc_tile *)memory;
    memset(t, 0, sizeof *t);
    const size_t align = TRC_CARVER_ALIGNMENT - 1;
    tile_carve(t, job->desc, job->snapshot, memory + ((sizeof *t + align) & ~align));
    t->job = job;
    t->snapshot = job->snapshot;
    t->desc = job->desc;
    t->sampler = (struct trc_sampler){job->desc->sampler, job->desc->seed, job->desc->sample_count,
                                      job->sampler_table};
    t->extra_passes = t->samples.pass_count || job->desc->cryptomattes || t->catchers;
    t->light_passes = wants_light_passes(job->desc);
    t->occlusion_passes = t->samples.pass[TRC_PASS_AMBIENT_OCCLUSION][0] || t->shadows.lamp[0];
    t->object_motion =
        job->snapshot->features & (TRC_FEATURE_OBJECT_MOTION | TRC_FEATURE_DEFORMATION);
    t->camera_common = job->snapshot->camera.aperture_radius <= 0.0f &&
                       job->snapshot->camera.key_count < 2 &&
                       job->snapshot->camera.stereo.eye_offset == 0.0f &&
                       job->snapshot->camera.type != TRC_CAMERA_ORTHOGRAPHIC &&
                       !(job->snapshot->features & TRC_FEATURE_PORTALS);
    t->packet_size =
        job->desc->packet_size < TRC_PACKET_SIZE ? job->desc->packet_size : TRC_PACKET_SIZE;
    t->bundle = job->desc->packet_size / t->packet_size;
    beam_setup(t);
    trc_film_load_mattes(t);
    t->clock = &job->counts.seconds_other;
    t->clock_start = trc_seconds();
    trc_samples_render(t);
    assert(trc_carver_check(&t->carver));
    trc_clock_other(t);
}
