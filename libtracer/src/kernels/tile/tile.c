/* A tile from camera rays to film. See kernels/tile/tile.h for the way of working. */
#include "kernels/tile/tile.h"

#include <assert.h>

#include "core/core.h"
#include "kernels/simd/wide_math.h"
#include "model/sequence.h"

/* ---- clocks: one reading per stage and step ---- */

static void clock_to(struct trc_tile *t, double *sum) {
    const double at = trc_seconds();
    *t->clock += at - t->clock_start;
    t->clock = sum;
    t->clock_start = at;
}
void trc_clock_trace(struct trc_tile *t) { clock_to(t, &t->job->counts.seconds_trace); }
void trc_clock_shade(struct trc_tile *t) { clock_to(t, &t->job->counts.seconds_shade); }
static void clock_other(struct trc_tile *t) { clock_to(t, &t->job->counts.seconds_other); }

/* ---- memory ---- */

static bool wants_light_passes(const trc_render_desc *desc) {
    return desc->passes >> TRC_PASS_DIFFUSE_DIRECT & 0x1ff;
}

/* Entries of columns: of samples, and of the rays of a step. */
static uint32_t column_entries(bool catchers) {
    return catchers ? TRC_CATCHER_ROWS * TRC_CATCHER_BATCH : TRC_BATCH;
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
        for (uint32_t k = 0; k < trc_film_channels(pass); k++)
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
    t->hit_branches = count_branches(desc, snapshot);
    /* Whitted's rays may meet a catcher, which splits them before they branch. Of other integrators
     * a sample has two rays at most, and a batch of them half as many samples. */
    const bool splits = catchers && desc->integrator == TRC_INTEGRATOR_WHITTED;
    t->ray_room = trc_ray_room_of(desc, t->hit_branches * (splits ? 2 : 1));
    const size_t batch = (column_entries(catchers) + TRC_WIDTH) * sizeof(float);
    trc_rays_carve(&c, &t->stack, t->ray_room.capacity, t->looks_back);
    trc_rays_carve(&c, &t->work, t->ray_room.capacity, t->looks_back);
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
    trc_shadows_carve(&c, &t->shadows, wants_light_passes(desc),
                      desc->passes >> TRC_PASS_SHADOW & 1);
    t->keys = trc_carve(&c, TRC_SHADOW_COLUMN * sizeof *t->keys);
    t->order = trc_carve(&c, batch);
    t->bins = trc_carve(&c, (TRC_BINS + 1) * sizeof *t->bins);
    t->carver = c;
    return c.used;
}

size_t trc_tile_memory_bytes(const trc_render_desc *desc, const struct trc_snapshot *snapshot) {
    struct trc_tile t;
    memset(&t, 0, sizeof t);
    return sizeof t + TRC_CARVER_ALIGNMENT + tile_carve(&t, desc, snapshot, NULL);
}

/* ---- sorting ---- */

void trc_tile_sort(struct trc_tile *t, const uint32_t *keys, uint32_t count, uint32_t *order) {
    uint32_t least = UINT32_MAX, most = 0;
    for (uint32_t i = 0; i < count; i++) {
        least = keys[i] < least ? keys[i] : least;
        most = keys[i] > most ? keys[i] : most;
    }
    if (least >= most) { /* mostly so for camera rays */
        for (uint32_t i = 0; i < count; i++)
            order[i] = i;
        return;
    }
    uint32_t *const bins = t->bins;
    const uint32_t bin_count = most - least + 1;
    memset(bins, 0, (bin_count + 1) * sizeof *bins);
    for (uint32_t i = 0; i < count; i++)
        bins[keys[i] - least + 1]++;
    for (uint32_t i = 1; i < bin_count; i++)
        bins[i] += bins[i - 1];
    for (uint32_t i = 0; i < count; i++)
        order[bins[keys[i] - least]++] = i;
}

/* ---- tracing a step's rays ---- */

uint32_t trc_hit_material(const struct trc_snapshot *snapshot, uint32_t instance,
                          uint32_t triangle) {
    const struct trc_instance *in = &snapshot->instances[instance];
    const struct trc_mesh *mesh = snapshot->meshes[in->mesh];
    const uint32_t slot = mesh->material_index ? mesh->material_index[triangle] : 0;
    return in->materials[slot < in->material_count ? slot : in->material_count - 1];
}

/* Rays of one packet share their visibility; beyond that the assembly decides (Boulos et al. 2007,
 * section 3.3). Keys are what rays of a packet share; runs break packets where the key changes. */
#define RAY_KIND (TRC_VISIBLE_ALL | TRC_VISIBLE_UNBLOCKED)
#define RAY_KIND_BITS 6
static bool all_see_the_same(const struct trc_tile *t) {
    return !(t->snapshot->features & (TRC_FEATURE_VISIBILITY | TRC_FEATURE_SHADOW_CATCHERS));
}
static uint32_t assembly_key(const struct trc_tile *t, uint32_t ray) {
    const struct trc_ray_store *r = &t->work;
    const uint32_t kind = r->w[TRC_RAY_PATH][ray] & RAY_KIND;
    switch (t->desc->assembly) {
    case TRC_ASSEMBLY_BLIND:
        return all_see_the_same(t) ? 0 : kind;
    case TRC_ASSEMBLY_GROUPS:
        return kind | (r->w[TRC_RAY_PARENT][ray] & 63u) << RAY_KIND_BITS;
    case TRC_ASSEMBLY_OCTANTS:
        return kind | (uint32_t)(r->f[TRC_RAY_DX][ray] < 0.0f) << RAY_KIND_BITS |
               (uint32_t)(r->f[TRC_RAY_DY][ray] < 0.0f) << (RAY_KIND_BITS + 1) |
               (uint32_t)(r->f[TRC_RAY_DZ][ray] < 0.0f) << (RAY_KIND_BITS + 2);
    default:
        return kind;
    }
}

/* The default: rays other than the camera's also share a cell of directions. */
static void keys_by_direction(struct trc_tile *t) {
    const struct trc_ray_store *r = &t->work;
    for (uint32_t i = 0; i < r->count; i += TRC_WIDTH) {
        const vuint kind = vu_load(r->w[TRC_RAY_PATH] + i) & vu_set(RAY_KIND);
        const vvec3 d = v3(vf_load(r->f[TRC_RAY_DX] + i), vf_load(r->f[TRC_RAY_DY] + i),
                           vf_load(r->f[TRC_RAY_DZ] + i));
        const vuint cell = kind * vu_set(TRC_DIRECTION_CELLS) + trc_direction_cell(d);
        const vmask camera =
            vi_eq((vint)(kind & vu_set(TRC_VISIBLE_CAMERA)), vi_set(TRC_VISIBLE_CAMERA));
        const vuint straight = (kind & vu_set(TRC_VISIBLE_UNBLOCKED)) * vu_set(TRC_DIRECTION_CELLS);
        vi_store((int32_t *)t->keys + i, vi_select(camera, (vint)straight, (vint)cell));
    }
}

static void packet_load(struct trc_tile *t, const uint32_t *order, uint32_t count,
                        struct trc_packet *p, struct trc_packet_hits *h) {
    const struct trc_ray_store *r = &t->work;
    float *const to[] = {p->o[0], p->o[1], p->o[2], p->d[0], p->d[1],
                         p->d[2], p->tmin, p->t,    p->time};
    static const int from[] = {TRC_RAY_OX, TRC_RAY_OY,   TRC_RAY_OZ,   TRC_RAY_DX,  TRC_RAY_DY,
                               TRC_RAY_DZ, TRC_RAY_TMIN, TRC_RAY_TMAX, TRC_RAY_TIME};
    const int columns = t->object_motion ? 9 : 8;
    if (order[count - 1] - order[0] == count - 1) { /* sorted stably, so they follow each other */
        for (int k = 0; k < columns; k++)
            memcpy(to[k], r->f[from[k]] + order[0], count * sizeof(float));
    } else {
        uint32_t at_padded[TRC_PACKET_SIZE] = {0};
        memcpy(at_padded, order, count * sizeof *order);
        for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
            const vmask m = vm_first((int32_t)(count - i));
            const vint at = vi_load((const int32_t *)at_padded + i);
            for (int k = 0; k < columns; k++)
                vf_store(to[k] + i, vf_gather(r->f[from[k]], at, m));
        }
    }
    const uint32_t path = r->w[TRC_RAY_PATH][order[0]];
    p->active = count < TRC_PACKET_SIZE ? (1ull << count) - 1 : ~0ull;
    p->visibility = t->desc->assembly == TRC_ASSEMBLY_BLIND && all_see_the_same(t)
                        ? TRC_VISIBLE_ALL
                        : path & TRC_VISIBLE_ALL;
    if (path & TRC_VISIBLE_UNBLOCKED)
        p->visibility <<= TRC_UNBLOCKED_SHIFT;
    p->common_origin = (path & TRC_VISIBLE_CAMERA) && t->camera_common;
    p->skip_transparent = false;
    memset(h->instance, 0xff, count * sizeof *h->instance);
}

static void hits_store(struct trc_tile *t, const uint32_t *order, uint32_t count,
                       const struct trc_packet *p, const struct trc_packet_hits *h) {
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t ray = order[i];
        t->hits.t[ray] = p->t[i];
        t->hits.instance[ray] = h->instance[i];
        if (h->instance[i] == TRC_NO_HIT)
            continue;
        t->hits.triangle[ray] = h->triangle[i];
        t->hits.u[ray] = h->u[i];
        t->hits.v[ray] = h->v[i];
        t->hits.material[ray] = trc_hit_material(t->snapshot, h->instance[i], h->triangle[i]);
    }
}

static void count_rays(struct trc_tile *t) {
    struct trc_tile_counts *counts = &t->job->counts;
    for (uint32_t i = 0; i < t->work.count; i++) {
        const uint32_t path = t->work.w[TRC_RAY_PATH][i];
        if (path & TRC_VISIBLE_CAMERA)
            counts->rays_camera++;
        else if (path & TRC_PATH_REFLECTED)
            counts->rays_reflection++;
        else
            counts->rays_refraction++;
    }
}

/* Packets of t->order, each from begin to end. */
struct bundle {
    uint32_t count;
    uint32_t begin[TRC_BUNDLE], end[TRC_BUNDLE];
};

/* Whether rays of this one's kind mostly meet the same nodes as their neighbours: not once they
 * have been scattered. */
static bool stays_together(const struct trc_tile *t, uint32_t ray) {
    return (t->work.w[TRC_RAY_PATH][ray] & TRC_VISIBLE_CAMERA) ||
           t->work.f[TRC_RAY_PDF][ray] < 0.0f;
}

/* Whether the packet that begins there goes with those of the bundle. */
static bool bundle_takes(const struct trc_tile *t, const struct bundle *b, uint32_t begin) {
    const uint32_t first = t->order[b->begin[0]], ray = t->order[begin];
    return b->count < t->bundle && t->keys[first] == t->keys[ray] && stays_together(t, first) &&
           stays_together(t, ray);
}

/* Traces a packet on its own if some of its rays look back. */
static bool looked_back(struct trc_tile *t, const uint32_t *order, uint32_t count,
                        struct trc_packet *p, struct trc_packet_hits *h) {
    uint32_t left[TRC_PACKET_SIZE];
    bool looks = false;
    for (uint32_t i = 0; i < count; i++)
        looks |= p->tmin[i] < 0.0f;
    if (!looks)
        return false;
    for (uint32_t i = 0; i < TRC_PACKET_SIZE; i++)
        left[i] = i < count ? t->work.w[TRC_RAY_LEFT][order[i]] : TRC_NO_HIT;
    trc_trace_looking_back(t->snapshot, p, h, left);
    p->active = 0;
    return true;
}

static void bundle_trace(struct trc_tile *t, struct bundle *b) {
    uint32_t together = 0;
    for (uint32_t k = 0; k < b->count; k++) {
        const uint32_t *order = t->order + b->begin[k], count = b->end[k] - b->begin[k];
        packet_load(t, order, count, &t->packets[k], &t->packet_hits[k]);
        together += !(t->looks_back && t->generation > 0 &&
                      looked_back(t, order, count, &t->packets[k], &t->packet_hits[k]));
    }
    if (together)
        trc_trace_closest(t->snapshot, t->packets, t->packet_hits, b->count);
    for (uint32_t k = 0; k < b->count; k++)
        hits_store(t, t->order + b->begin[k], b->end[k] - b->begin[k], &t->packets[k],
                   &t->packet_hits[k]);
    b->count = 0;
}

static void trace_batch(struct trc_tile *t) {
    const uint32_t count = t->work.count;
    const bool runs = t->desc->assembly == TRC_ASSEMBLY_RUNS;
    const uint32_t size = t->desc->assembly == TRC_ASSEMBLY_NONE ? 1 : t->packet_size;
    if (t->desc->assembly == TRC_ASSEMBLY_AUTO)
        keys_by_direction(t);
    else
        for (uint32_t i = 0; i < count; i++)
            t->keys[i] = assembly_key(t, i);
    struct bundle bundle = {0};
    trc_tile_sort(t, t->keys, count, t->order);
    for (uint32_t begin = 0; begin < count;) {
        const uint32_t key = t->keys[t->order[begin]];
        uint32_t end = begin + 1;
        while (end < count && end - begin < size && t->keys[t->order[end]] == key &&
               (!runs || t->work.w[TRC_RAY_PARENT][t->order[end]] ==
                             t->work.w[TRC_RAY_PARENT][t->order[begin]]))
            end++;
        if (bundle.count && !bundle_takes(t, &bundle, begin))
            bundle_trace(t, &bundle);
        bundle.begin[bundle.count] = begin;
        bundle.end[bundle.count++] = end;
        begin = end;
    }
    if (bundle.count)
        bundle_trace(t, &bundle);
    count_rays(t);
}

/* ---- a batch of samples ---- */

/* Deeper steps than this share their sample dimensions: their light is faint. */
#define LAST_GENERATION 200

static void samples_clear(struct trc_tile *t) {
    const size_t bytes = column_entries(t->catchers) * sizeof(float);
    for (int k = 0; k < 3; k++)
        memset(t->samples.radiance[k], 0, bytes);
    memset(t->samples.transparency, 0, bytes);
    for (uint32_t i = 0; i < t->samples.pass_count; i++)
        for (uint32_t k = 0; k < trc_film_channels(t->samples.passes[i]); k++)
            memset(t->samples.pass[t->samples.passes[i]][k], 0, bytes);
    /* What a miss has. */
    static const struct {
        uint32_t pass;
        float value;
    } miss[] = {{TRC_PASS_DEPTH, 1e10f}, {TRC_PASS_MIST, 1.0f}};
    for (size_t k = 0; k < sizeof miss / sizeof *miss; k++) {
        float *values = t->samples.pass[miss[k].pass][0];
        for (uint32_t i = 0; values && i < TRC_BATCH; i++)
            values[i] = miss[k].value;
    }
}

TRC_INLINE bool is_finite_sample(const struct trc_tile *t, uint32_t slot) {
    return isfinite(t->samples.radiance[0][slot] + t->samples.radiance[1][slot] +
                    t->samples.radiance[2][slot]);
}

/* Adds what shadow catchers of a sample got to its pixel, if it is finite. */
static void film_add_caught(struct trc_tile *t, uint32_t sample, size_t pixel) {
    const uint32_t blocked = sample + TRC_ROW_BLOCKED * TRC_CATCHER_BATCH;
    const uint32_t unblocked = sample + TRC_ROW_UNBLOCKED * TRC_CATCHER_BATCH;
    const uint32_t background = sample + TRC_ROW_BACKGROUND * TRC_CATCHER_BATCH;
    if (!is_finite_sample(t, blocked) || !is_finite_sample(t, unblocked) ||
        !is_finite_sample(t, background)) {
        t->job->counts.dropped_samples++;
        return;
    }
    struct trc_caught *sum = &t->job->film->caught[pixel];
    double *environment = t->job->film->sums[TRC_PASS_ENVIRONMENT];
    for (int c = 0; c < 3; c++) {
        const double behind = (double)t->samples.radiance[c][background];
        trc_sum_add(&sum->blocked[c], (double)t->samples.radiance[c][blocked]);
        trc_sum_add(&sum->unblocked[c], (double)t->samples.radiance[c][unblocked]);
        trc_sum_add(&sum->background[c], behind);
        if (environment)
            trc_sum_add(&environment[3 * pixel + (size_t)c], behind);
    }
    trc_sum_add(&sum->coverage, -(double)t->samples.transparency[blocked]);
}

/* Adds a sample's passes to its pixel. */
static void film_add_passes(struct trc_tile *t, uint32_t slot, size_t pixel, bool first) {
    for (uint32_t i = 0; i < t->samples.pass_count; i++) {
        const uint32_t pass = t->samples.passes[i];
        const uint32_t channels = trc_film_channels(pass);
        double *sum = t->job->film->sums[pass] + channels * pixel;
        for (uint32_t k = 0; k < channels; k++) {
            const double value = (double)t->samples.pass[pass][k][slot];
            if (!isfinite(value))
                continue;
            if (first)
                trc_sum_store(&sum[k], value);
            else if (!trc_film_is_first_sample(pass))
                trc_sum_add(&sum[k], value);
        }
    }
    if (t->catchers)
        film_add_caught(t, slot, pixel);
}

/* Adds the samples [begin, end), of one pixel, to it, in their order. Those that are not finite are
 * left out and counted. */
static void film_add_run(struct trc_tile *t, uint32_t begin, uint32_t end, size_t pixel) {
    struct trc_film *film = t->job->film;
    double *combined = film->sums[TRC_PASS_COMBINED] + 4 * pixel;
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    /* A pixel's first sample reads no sums: fresh memory that is read before it is written costs
     * each page a second fault, a third of a picture of one sample. */
    uint32_t count = film->sample_counts[pixel];
    if (count)
        memcpy(sum, combined, sizeof sum);
    for (uint32_t slot = begin; slot < end; slot++) {
        if (!is_finite_sample(t, slot)) {
            t->job->counts.dropped_samples++;
            continue;
        }
        for (int c = 0; c < 3; c++)
            sum[c] += (double)t->samples.radiance[c][slot];
        sum[3] += 1.0 - (double)t->samples.transparency[slot];
        if (t->extra_passes)
            film_add_passes(t, slot, pixel, count == 0);
        count++;
    }
    for (int c = 0; c < 4; c++)
        trc_sum_store(&combined[c], sum[c]);
    __atomic_store_n(&film->sample_counts[pixel], count, __ATOMIC_RELAXED);
    const size_t mattes = trc_tile_pixel(t, begin) * film->matte_count;
    for (int k = 0; film->matte_count && k < TRC_CRYPTOMATTE_KINDS; k++)
        if (t->mattes[k])
            trc_mattes_store(film->mattes[k] + pixel * film->matte_count, t->mattes[k] + mattes,
                             film->matte_count);
}

/* Adds the batch's samples to the film in the order of their slots. */
static void film_add(struct trc_tile *t) {
    const uint32_t *pixel = t->samples.pixel, count = t->samples.count;
    for (uint32_t begin = 0; begin < count;) {
        uint32_t end = begin + 1;
        while (end < count && pixel[end] == pixel[begin])
            end++;
        film_add_run(t, begin, end, trc_film_pixel(t, begin));
        begin = end;
    }
}

/* The same with adaptive sampling, whose sums may go on where the film's count has ended. */
static void film_add_adaptive(struct trc_tile *t) {
    for (uint32_t slot = 0; slot < t->samples.count; slot++) {
        if (!is_finite_sample(t, slot)) {
            t->job->counts.dropped_samples++;
            continue;
        }
        const size_t pixel = trc_film_pixel(t, slot);
        struct trc_adaptive_pixel *p = &t->job->adaptive->pixels[pixel];
        for (int c = 0; c < 3; c++)
            p->sum[c] += (double)t->samples.radiance[c][slot];
        /* A catcher's light is as noisy as the shadow on it. */
        for (int c = 0; t->catchers && c < 3; c++)
            p->sum[c] += (double)t->samples.radiance[c][slot + TRC_ROW_BLOCKED * TRC_CATCHER_BATCH];
        if (p->reasons & TRC_PIXEL_COUNTS)
            film_add_run(t, slot, slot + 1, pixel);
    }
}

/* Rows of a catcher's light belong to the pixels of the first. */
static void samples_repeat(struct trc_tile *t) {
    uint32_t *const columns[] = {t->samples.pixel, t->samples.index};
    for (int k = 0; k < 2; k++)
        for (uint32_t row = 1; row < TRC_CATCHER_ROWS; row++)
            memcpy(columns[k] + row * TRC_CATCHER_BATCH, columns[k],
                   TRC_CATCHER_BATCH * sizeof *columns[k]);
}

static void batch_render(struct trc_tile *t) {
    samples_clear(t);
    if (t->catchers)
        samples_repeat(t);
    trc_camera_rays(t);
    t->generation = 0;
    while (t->stack.count) {
        trc_rays_take(&t->stack, &t->work, trc_rays_step(&t->stack, &t->ray_room));
        trc_clock_trace(t);
        trace_batch(t);
        trc_clock_shade(t);
        trc_shade_batch(t);
        trc_shadow_flush(t);
        if (t->generation < LAST_GENERATION)
            t->generation++;
    }
    clock_other(t);
    atomic_uint *sequence = trc_film_sequence(t->job->film, t->job->x, t->job->y);
    trc_sequence_write_begin(sequence);
    if (t->job->adaptive)
        film_add_adaptive(t);
    else
        film_add(t);
    trc_sequence_write_end(sequence);
}

/* ---- the tile ---- */

/* Samples a pixel has in one batch, and the squares in which a batch takes pixels, in Z-order. A
 * packet of a pinhole camera then holds a 2x2 square of pixels: the narrowest beam. */
#define SAMPLES_PER_BATCH 16
#define SQUARE 8
/* With an open shutter packets hold a 4x4 square of pixels and a quarter of the time, else with a
 * wide lens a quarter of the lens. By tracer_bench, conference and character at 1024x1024: without
 * cells, packets in fast motion are up to 2.5 times as slow, in slow motion at most 1.2 times as
 * fast; with 16, up to 1.5 times as slow nearly everywhere. */
#define SHARED_CELLS 4
/* Radius of the circle of confusion far behind the focus, from which on a lens is wide. */
#define WIDE_LENS_PIXELS 8.0f

/* Whether a pixel of the tile gets samples. */
TRC_INLINE bool is_sampled(const struct trc_tile_job *job, uint32_t x, uint32_t y) {
    const struct trc_adaptive *a = job->adaptive;
    return !a || a->pixels[(size_t)(job->y + y) * a->width + job->x + x].reasons;
}

/* How many pixels of the square at x, y get samples, at most. */
static uint32_t square_pixels(const struct trc_tile *t, uint32_t x, uint32_t y) {
    const struct trc_tile_job *job = t->job;
    if (!job->adaptive)
        return SQUARE * SQUARE;
    uint32_t count = 0;
    for (uint32_t j = y; j < y + SQUARE && j < job->height; j++)
        for (uint32_t i = x; i < x + SQUARE && i < job->width; i++)
            count += is_sampled(job, i, j);
    return count;
}

/* Appends the samples [begin, end) of the square of pixels at x, y of the tile, clipped to it. */
static void square_append(struct trc_tile *t, uint32_t x, uint32_t y, uint32_t begin,
                          uint32_t end) {
    const struct trc_tile_job *job = t->job;
    for (uint32_t place = 0; place < SQUARE * SQUARE; place++) { /* in Z-order */
        uint32_t i = x, j = y;
        for (uint32_t bit = 0; 1u << bit < SQUARE; bit++) {
            i += (place >> (2 * bit) & 1u) << bit;
            j += (place >> (2 * bit + 1) & 1u) << bit;
        }
        if (i >= job->width || j >= job->height || !is_sampled(job, i, j))
            continue;
        const uint32_t px = t->desc->crop_x + job->x + i, py = t->desc->crop_y + job->y + j;
        for (uint32_t s = begin; s < end; s++) {
            t->samples.pixel[t->samples.count] = px | py << 16;
            t->samples.index[t->samples.count++] = s;
        }
    }
}

/* What rays of a packet share beside their neighbourhood. */
enum sharing { SHARE_NOTHING, SHARE_TIME, SHARE_LENS };

static enum sharing sharing_of(const struct trc_tile *t, uint32_t sample_count) {
    const struct trc_camera *c = &t->snapshot->camera;
    const float pixel = fabsf(c->windows[0][1] - c->windows[0][0]) / (float)t->desc->width *
                        (c->type == TRC_CAMERA_ORTHOGRAPHIC ? 1.0f : c->focus_distance);
    if (sample_count < SHARED_CELLS)
        return SHARE_NOTHING;
    if (c->has_motion)
        return SHARE_TIME;
    return c->aperture_radius > WIDE_LENS_PIXELS * pixel ? SHARE_LENS : SHARE_NOTHING;
}

/* Orders the batch by cells of lens or time, so that rays of a packet share one. This is what the
 * paper's interleaved tile does for coherence, without giving pixels the same pattern. */
static void samples_order(struct trc_tile *t, enum sharing sharing) {
    const uint32_t count = t->samples.count;
    for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
        const vuint pixel = vu_load(t->samples.pixel + i), index = vu_load(t->samples.index + i);
        vfloat cell;
        if (sharing == SHARE_TIME) {
            cell =
                trc_sample(&t->sampler, pixel, index, TRC_DIM_TIME) * vf_set((float)SHARED_CELLS);
        } else {
            const vfloat two = vf_set(2.0f);
            vfloat at[2];
            trc_samples(&t->sampler, pixel, index, TRC_DIM_LENS_X, 2, 0, 1, at);
            cell = vf_floor(two * at[0]) * two + two * at[1];
        }
        vi_store((int32_t *)t->keys + i, vf_to_int(cell));
    }
    trc_tile_sort(t, t->keys, count, t->order);
    uint32_t *const columns[] = {t->samples.pixel, t->samples.index};
    for (int k = 0; k < 2; k++) {
        memcpy(t->keys, columns[k], count * sizeof *t->keys);
        for (uint32_t i = 0; i < count; i++)
            columns[k][i] = t->keys[t->order[i]];
    }
}

static void batch_flush(struct trc_tile *t, enum sharing sharing) {
    if (!t->samples.count)
        return;
    if (sharing != SHARE_NOTHING)
        samples_order(t, sharing);
    batch_render(t);
    t->samples.count = 0;
}

/* The samples [begin, end) of the tile's pixels. */
static void samples_render(struct trc_tile *t, uint32_t begin, uint32_t end) {
    const struct trc_tile_job *job = t->job;
    const uint32_t most = t->catchers ? TRC_CATCHER_BATCH : TRC_BATCH;
    const enum sharing sharing = sharing_of(t, end - begin);
    t->samples.count = 0;
    for (uint32_t y = 0; y < job->height; y += SQUARE)
        for (uint32_t x = 0; x < job->width; x += SQUARE) {
            if (t->samples.count + square_pixels(t, x, y) * (end - begin) > most)
                batch_flush(t, sharing);
            square_append(t, x, y, begin, end);
        }
    batch_flush(t, sharing);
}

/* The beam of a camera sample: the narrowest of the frame, in a corner. The shear of a camera
 * narrows it by no more than its axes' volume. */
static void beam_setup(struct trc_tile *t) {
    const struct trc_camera *c = &t->snapshot->camera;
    const float *w = c->windows[0];
    const float x = fmaxf(fabsf(w[0]), fabsf(w[1])), y = fmaxf(fabsf(w[2]), fabsf(w[3]));
    const float pixel = fminf(fabsf(w[1] - w[0]) / (float)t->desc->width,
                              fabsf(w[3] - w[2]) / (float)t->desc->height);
    const float sample = c->axes_volume * pixel * fminf(t->desc->filter_width, 1.0f) /
                         sqrtf((float)t->desc->sample_count);
    if (c->type == TRC_CAMERA_ORTHOGRAPHIC)
        t->beam_width = sample;
    else
        t->beam_spread = sample / (1.0f + x * x + y * y);
}

/* The tables of mattes as the film has them. */
static void mattes_load(struct trc_tile *t) {
    const struct trc_tile_job *job = t->job;
    const struct trc_film *film = job->film;
    const size_t places = film->matte_count, row = job->width * places;
    for (int k = 0; k < TRC_CRYPTOMATTE_KINDS; k++)
        for (uint32_t y = 0; t->mattes[k] && y < job->height; y++) {
            struct trc_matte *to = t->mattes[k] + y * TRC_TILE_SIZE * places;
            const size_t pixel = (size_t)(job->y + y) * film->width + job->x;
            if (job->sample_begin == 0) /* fresh memory is not read: film_add_run */
                memset(to, 0, row * sizeof *to);
            else
                memcpy(to, film->mattes[k] + pixel * places, row * sizeof *to);
        }
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
                       job->snapshot->camera.type == TRC_CAMERA_PERSPECTIVE;
    t->packet_size =
        job->desc->packet_size < TRC_PACKET_SIZE ? job->desc->packet_size : TRC_PACKET_SIZE;
    t->bundle = job->desc->packet_size / t->packet_size;
    beam_setup(t);
    mattes_load(t);
    t->clock = &job->counts.seconds_other;
    t->clock_start = trc_seconds();
    const uint32_t most = t->catchers ? SAMPLES_PER_BATCH / 2 : SAMPLES_PER_BATCH;
    for (uint32_t s = job->sample_begin; s < job->sample_end && !*job->cancel;) {
        const uint32_t end = job->sample_end - s > most ? s + most : job->sample_end;
        samples_render(t, s, end);
        s = end;
    }
    assert(trc_carver_check(&t->carver));
    clock_other(t);
}
