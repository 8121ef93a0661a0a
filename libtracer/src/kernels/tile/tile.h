/* The workspace of a tile: rays waiting, their hits, shadow rays, samples in flight.
 *
 * A tile works in batches of up to TRC_BATCH camera samples. Rays of a batch are traced as packets,
 * hits are sorted by material and shaded TRC_WIDTH at a time, shadow rays collect in a queue that
 * is flushed as full packets, continuation rays go on a stack that is worked off batch by batch.
 * Everything is one thread's and in a fixed order. */
#ifndef TRACER_KERNELS_TILE_TILE_H
#define TRACER_KERNELS_TILE_TILE_H

#include "kernels/lobe/bsdf.h"
#include "kernels/tile/ray_stack.h"
#include "kernels/tile/sampler.h"
#include "kernels/tile/shadow_queue.h"
#include "kernels/trace/direction.h"
#include "kernels/trace/packet.h"
#include "model/kernels.h"

/* Bits of a ray's path word above those of kernels/trace/surface.h. */
enum {
    TRC_PATH_CATEGORY_SHIFT = 12, /* TRC_CATEGORY_* */
    TRC_PATH_LAST = 1 << 14,      /* only emission counts at the next surface */
    TRC_PATH_DATA_DONE = 1 << 15, /* data passes of the sample are written */
    TRC_PATH_OCCLUSION = 1 << 17, /* shadow rays: of the pass of ambient occlusion, no light */
    TRC_PATH_CAUGHT = 1 << 18,    /* the camera sees this path through a shadow catcher */
    TRC_PATH_CLAMPED = 1 << 19,   /* shadow rays: what they carry is clamped already */
    TRC_PATH_FOUND = 1 << 23,     /* shadow rays: along a ray of the path (linked.c) */
    TRC_PATH_CLASS_SHIFT = 24,    /* shadow rays: the shadow class of their light, 4 bits */
    TRC_PATH_FEATURES_SHIFT = 24  /* others: what its surfaces took of the sample's denoising
                                     passes, 8 bits: 255 for all */
};
#define TRC_PATH_FEATURES (255u << TRC_PATH_FEATURES_SHIFT)

/* What part of the denoising passes the surfaces of a path have left to what comes next. */
TRC_INLINE vfloat trc_features_left(vuint path) {
    return vf_set(1.0f) -
           vi_to_float((vint)(path >> TRC_PATH_FEATURES_SHIFT)) * vf_set(1.0f / 255.0f);
}

/* What objects a ray of that path word may see by: diffuse rays that are transmitted count as
 * transmitted alone, as in Cycles; lamps tell them by either (kernels/light/hit.c). */
TRC_INLINE uint32_t trc_ray_visibility(uint32_t path) {
    const uint32_t bits = path & TRC_VISIBLE_ALL;
    return bits & TRC_VISIBLE_TRANSMISSION ? bits & ~(uint32_t)TRC_VISIBLE_DIFFUSE : bits;
}

/* What a path's first bounce was. */
enum {
    TRC_CATEGORY_CAMERA, /* there was none */
    TRC_CATEGORY_GLOSSY,
    TRC_CATEGORY_TRANSMISSION,
    TRC_CATEGORY_MIXED /* either, in one direction: the shares say how much of each */
};

struct trc_hit_store {
    float *t, *u, *v;
    uint32_t *instance, *triangle, *material;
};

/* With shadow catchers a batch holds half as many samples, as each may be two rays, and the columns
 * of samples have four rows of them (kernels/tile/catcher.c). */
#define TRC_CATCHER_BATCH (TRC_BATCH / 2)
enum trc_sample_row {
    TRC_ROW_PICTURE, /* all but what is behind a catcher's surface; the only row without catchers */
    TRC_ROW_BLOCKED, /* the catcher's light as it is; transparency: minus its coverage */
    TRC_ROW_UNBLOCKED, /* and with nothing but catchers in its way */
    TRC_ROW_BACKGROUND /* what the world shows behind it */
};
#define TRC_CATCHER_ROWS 4

/* Entries of columns: of samples, and of the rays of a step. */
TRC_INLINE uint32_t trc_column_entries(bool catchers) {
    return catchers ? TRC_CATCHER_ROWS * TRC_CATCHER_BATCH : TRC_BATCH;
}

/* A pixel's place in one word. */
#define TRC_PIXEL_Y_SHIFT 16
#define TRC_PIXEL_X_MASK 0xffffu

/* Samples of the batch, by slot: row * TRC_CATCHER_BATCH + number. */
struct trc_sample_store {
    uint32_t count;
    uint32_t *pixel; /* x | y << TRC_PIXEL_Y_SHIFT in the full frame */
    uint32_t *index; /* number of the sample */
    float *radiance[3];
    float *transparency; /* part of the film that is seen through */
    float *pass[TRC_SUM_COUNT]
               [TRC_MAX_PASS_SUMS]; /* trc_pass_info.sums each; NULL unless asked for */
    uint8_t passes[TRC_SUM_COUNT];  /* the numbers of those */
    uint32_t pass_count;
};

struct trc_tile {
    struct trc_tile_job *job;
    const struct trc_snapshot *snapshot;
    const trc_render_desc *desc;
    struct trc_sampler sampler;
    bool catchers;              /* the scene has shadow catchers */
    bool extra_passes;          /* more than Combined, or mattes, or shadow catchers */
    bool light_passes;          /* some pass wants light by kind */
    bool occlusion_passes;      /* some pass wants what shadow rays find, not light */
    bool object_motion;         /* rays need times */
    bool looks_back;            /* rays go through surfaces: kernels/trace/spawn.h */
    bool remembers_left;        /* rays know what they left: they look back, or lights are linked */
    bool measures_paths;        /* rays know how long their path is */
    bool scales_clamps;         /* rays know by what part they are one of two */
    bool camera_common;         /* what the camera sees starts at one point */
    uint32_t packet_size;       /* 1..TRC_PACKET_SIZE */
    uint32_t bundle;            /* packets of a bundle at most, where rays stay together */
    float beam_width;           /* of a camera sample where it starts, metres */
    float beam_spread;          /* and what it widens by per metre; of panoramas times the angle
                                   of its pixel */
    double *clock, clock_start; /* the stage whose time is running */
    uint32_t generation;        /* bounces the rays of this step have behind them */
    struct trc_carver carver;   /* of the memory behind this */
    uint32_t hit_branches;      /* rays that a hit sends on at most, of the stack */
    bool splits;                /* and one besides that waits, where the camera looks */
    struct trc_ray_room ray_room;
    struct trc_ray_store stack, work;
    struct trc_ray_store later; /* second rays of hits, for when the stack is empty; if splits */
    struct trc_hit_store hits;
    struct trc_sample_store samples;
    struct trc_shadow_store shadows;
    /* Tables of the tile's pixels (trc_film.matte_count places each, rows of TRC_TILE_SIZE): those
     * of the film with the samples in flight. NULL: not asked for. */
    struct trc_matte *mattes[TRC_CRYPTOMATTE_KINDS];
    uint32_t *order;   /* of the rays of a step */
    uint32_t *keys;    /* scratch of sorts: TRC_SHADOW_COLUMN */
    uint32_t *bins[2]; /* and TRC_BINS each */
    struct trc_packet packets[TRC_BUNDLE];
    struct trc_packet_hits packet_hits[TRC_BUNDLE];
    struct trc_left_strands *left; /* TRC_BUNDLE, of the packets; NULL: there are no curves */
};

/* Cells that rays are sorted by: of their direction (kernels/trace/direction.h) or of a place on a
 * light are below this. */
#define TRC_DIRECTION_CELLS 16u

/* Cell of a place on a light, below TRC_DIRECTION_CELLS: rays to one cell share packets. More cells
 * mean packets of more pixels, so a light that is small as seen from the point has fewer: 4x4, 2x2
 * or one, by the density per solid angle. The bounds are where either is as fast, at 1024x1024 and
 * 16 samples. */
#define TRC_NARROW_LIGHT 64.0f
#define TRC_MIDDLING_LIGHT 4.0f
TRC_INLINE vuint trc_light_cell(vfloat u, vfloat v, vfloat density) {
    const vint x = vf_to_int(u * vf_set(4.0f)), y = vf_to_int(v * vf_set(4.0f));
    const vint one = vi_set(1), two = vi_set(2);
    const vint coarse = ((x & two) >> 1 | (y & two)) << 2, fine = (x & one) | (y & one) << 1;
    const vint cell =
        coarse | vi_select(vf_gt(density, vf_set(TRC_MIDDLING_LIGHT)), vi_set(0), fine);
    return (vuint)vi_select(vf_gt(density, vf_set(TRC_NARROW_LIGHT)), vi_set(0), cell);
}

/* Number of bins of the counting sorts. */
#define TRC_BINS 4096

/* order[0..count) = indices sorted stably by keys[i] < TRC_BINS. (kernels/tile/sort.c) */
void trc_tile_sort(struct trc_tile *t, const uint32_t *keys, uint32_t count, uint32_t *order);

/* Material of a hit, into the snapshot's. */
uint32_t trc_hit_material(const struct trc_snapshot *snapshot, uint32_t instance,
                          uint32_t triangle);

/* Finds what the rays of t->work hit, into t->hits. (kernels/tile/assembly.c) */
void trc_assembly_trace(struct trc_tile *t);

/* From here on time counts as tracing, as shading, as neither. */
void trc_clock_trace(struct trc_tile *t);
void trc_clock_shade(struct trc_tile *t);
void trc_clock_other(struct trc_tile *t);

size_t trc_tile_memory_bytes(const trc_render_desc *desc, const struct trc_snapshot *snapshot);
void trc_tile_render(struct trc_tile_job *job);

/* Renders all samples of the job's pixels. (kernels/tile/samples.c) */
void trc_samples_render(struct trc_tile *t);

/* Adds the batch's samples to the film in the order of their slots. Those that are not finite are
 * left out and counted. (kernels/tile/film.c) */
void trc_film_add(struct trc_tile *t);

/* The tables of mattes as the film has them. */
void trc_film_load_mattes(struct trc_tile *t);

/* Camera rays of the samples' slots, into the empty stack; also their times.
 * (kernels/tile/camera.c) */
void trc_camera_rays(struct trc_tile *t);

/* Splits the rays of t->work that see a shadow catcher; appends their other halves.
 * (kernels/tile/catcher.c) */
void trc_catcher_split(struct trc_tile *t);

/* Which rays carry light without what blocks it. */
TRC_INLINE vmask trc_is_unblocked(vuint path) {
    const vint unblocked = vi_set(TRC_VISIBLE_UNBLOCKED);
    return vi_eq((vint)path & unblocked, unblocked);
}

/* A slot's sample, whatever its row; of scenes with shadow catchers. */
TRC_INLINE vuint trc_sample_of(vuint slot) { return slot & vu_set(TRC_CATCHER_BATCH - 1); }

/* Shades the hits of t->work, sorted by material, and what missed. (kernels/tile/shade.c) */
void trc_shade_batch(struct trc_tile *t);

/* Features for denoisers of a group of hits: weight: throughputs of the rays that arrived; length:
 * of these. Returns their path words, which remember what is written. (kernels/tile/denoising.c) */
vuint trc_denoising_passes(struct trc_tile *t, const struct trc_surface *s,
                           const struct trc_lobes *lobes, vvec3 weight, vfloat length,
                           const uint32_t slots[TRC_WIDTH]);

/* Passes that hold no light but what surfaces are, for a group of hits of one material:
 * found_weight and indirect_scale as kernels/lobe/bsdf.h has them, of the rays that arrived;
 * length: of their path since the last surface or the near clip. Returns the rays' path words,
 * which remember what is written. Called only with more passes than Combined.
 * (kernels/tile/data_passes.c) */
vuint trc_data_passes(struct trc_tile *t, const struct trc_surface *s, const struct trc_material *m,
                      const struct trc_registers *regs, const struct trc_lobes *lobes,
                      vvec3 found_weight, vfloat indirect_scale, vfloat length,
                      const uint32_t slots[TRC_WIDTH]);

/* Adds the lanes' vectors to a pass, if it is asked for. (kernels/tile/data_passes.c) */
void trc_pass_add_lanes(struct trc_tile *t, uint32_t pass, vvec3 value,
                        const uint32_t slots[TRC_WIDTH], vmask active);

/* Whether the vector pass has the background, and its motion for the lanes that leave the scene in
 * direction d; path: their words. (kernels/tile/data_passes.c) */
bool trc_shows_background_motion(const struct trc_tile *t);
void trc_background_motion(struct trc_tile *t, vvec3 d, vuint path, const uint32_t slots[TRC_WIDTH],
                           vmask active);

/* What the world's material gives to AOVs where rays in direction d leave the scene; path, depths:
 * their words. (kernels/tile/data_passes.c) */
void trc_world_aovs(struct trc_tile *t, vvec3 d, vuint path, vuint depths,
                    const uint32_t slots[TRC_WIDTH], vmask active);

/* Traces and empties the shadow queue. (kernels/tile/shadow.c) */
void trc_shadow_flush(struct trc_tile *t);

/* Traces count rays of the queue that nothing opaque blocks through what is transparent to shadow
 * rays, and takes what of their light does not arrive. rays: is used up; visibility: of what they
 * see. (kernels/tile/see_through.c) */
void trc_see_through(struct trc_tile *t, uint32_t *rays, uint32_t count, uint32_t visibility);

/* Makes room in the queue for so many shadow rays of each lane of a group. */
TRC_INLINE void trc_shadow_reserve(struct trc_tile *t, uint32_t per_lane) {
    const uint32_t count = per_lane * TRC_WIDTH;
    if (t->shadows.count + count > TRC_SHADOW_QUEUE)
        trc_shadow_flush(t);
    t->shadows.reserved_end = t->shadows.count + count;
}

/* A sample's pixel in the film. */
TRC_INLINE size_t trc_film_pixel(const struct trc_tile *t, uint32_t slot) {
    const uint32_t x = (t->samples.pixel[slot] & TRC_PIXEL_X_MASK) - t->desc->crop_x;
    const uint32_t y = (t->samples.pixel[slot] >> TRC_PIXEL_Y_SHIFT) - t->desc->crop_y;
    return (size_t)y * t->job->film->width + x;
}

/* And in the tile. */
TRC_INLINE size_t trc_tile_pixel(const struct trc_tile *t, uint32_t slot) {
    const uint32_t x = (t->samples.pixel[slot] & TRC_PIXEL_X_MASK) - t->desc->crop_x - t->job->x;
    const uint32_t y = (t->samples.pixel[slot] >> TRC_PIXEL_Y_SHIFT) - t->desc->crop_y - t->job->y;
    return (size_t)y * TRC_TILE_SIZE + x;
}

/* Whether the slots of the active lanes, of which there are some, follow each other as the lanes
 * do, as those of neighbouring samples that see one material; the slot that lane 0 has then. */
TRC_INLINE bool trc_slots_follow(const uint32_t slots[TRC_WIDTH], vmask active,
                                 uint32_t *first_out) {
    const uint32_t lane = (uint32_t)__builtin_ctz(vm_bits(active)), first = slots[lane] - lane;
    const vint expected = vi_lane() + vi_set((int32_t)first);
    const vmask others = vm_andnot(active, vi_eq((vint)vu_load(slots), expected));
    *first_out = first;
    return slots[lane] >= lane && !vm_any(others);
}

/* Adds the active lanes' values to a column, from the slot of lane 0 on. */
TRC_INLINE void trc_column_add(float *column, uint32_t first, vfloat value, vmask active) {
    vf_store(column + first, vf_load(column + first) + vf_select(active, value, vf_set(0.0f)));
}

/* Adds light that reached a sample to its radiance, to a pass. */
TRC_INLINE void trc_sample_add(struct trc_tile *t, uint32_t slot, const float rgb[3]) {
    for (int c = 0; c < 3; c++)
        t->samples.radiance[c][slot] += rgb[c];
}
TRC_INLINE void trc_pass_add(struct trc_tile *t, uint32_t pass, uint32_t slot, const float rgb[3]) {
    float *const *p = t->samples.pass[pass];
    for (int c = 0; c < 3; c++)
        if (p[c])
            p[c][slot] += rgb[c];
}

#endif
