/* Renders: started in the background, polled, cancelled, read back. */
#ifndef TRACER_RENDER_H
#define TRACER_RENDER_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

enum trc_integrator_type {
    TRC_INTEGRATOR_RAYCAST = 0,
    TRC_INTEGRATOR_WHITTED = 1,
    TRC_INTEGRATOR_DISTRIBUTION = 2
};

enum trc_sampler_type {
    TRC_SAMPLER_SOBOL = 0,  /* joint Owen-scrambled Sobol */
    TRC_SAMPLER_SUDOKU = 1, /* the paper's interleaved tile */
    TRC_SAMPLER_JITTER = 2, /* stratified */
    TRC_SAMPLER_INDEPENDENT = 3,
    TRC_SAMPLER_BLUE_NOISE = 4 /* Sobol with blue-noise ordering over the screen, for previews */
};

/* How secondary rays are put into packets. */
enum trc_assembly_type {
    TRC_ASSEMBLY_AUTO = 0, /* the library chooses */
    TRC_ASSEMBLY_TYPES,    /* shadow, reflection and refraction rays apart */
    TRC_ASSEMBLY_RUNS,     /* neighbours that hit the same material */
    TRC_ASSEMBLY_GROUPS,   /* by material over the whole packet */
    TRC_ASSEMBLY_OCTANTS,  /* by the signs of the direction */
    TRC_ASSEMBLY_BLIND,    /* in the order the rays arise */
    TRC_ASSEMBLY_NONE      /* every secondary ray alone */
};

enum trc_filter_type {
    TRC_FILTER_BOX = 0,
    TRC_FILTER_GAUSSIAN = 1,
    TRC_FILTER_BLACKMAN_HARRIS = 2
};

/* The list of passes is tracer/passes.def. */
enum trc_pass_id {
#define TRC_PASS(NAME, number, channels, kind, color, miss) TRC_PASS_##NAME = number,
#include "tracer/passes.def"
    TRC_PASS_COUNT /* numbers below it are single passes, bits of trc_render_desc.passes */
};

/* Passes of which a render has as many as it asks for: the numbers of the first ones. */
enum trc_pass_range {
#define TRC_PASS_RANGE(NAME, first, count, channels, kind) TRC_PASS_FIRST_##NAME = first,
#include "tracer/passes.def"
};

#define TRC_MAX_AOVS 16 /* of values, and of colours */
#define TRC_PASS_AOV_VALUE(number) ((uint32_t)TRC_PASS_FIRST_AOV_VALUE + (number))
#define TRC_PASS_AOV_COLOR(number) ((uint32_t)TRC_PASS_FIRST_AOV_COLOR + (number))
#define TRC_PASS_LIGHT_GROUP(number) \
    ((uint32_t)TRC_PASS_FIRST_LIGHT_GROUP + (number)) /* of group number + 1 */

enum trc_cryptomatte_kind {
    TRC_CRYPTOMATTE_OBJECT = 0,
    TRC_CRYPTOMATTE_MATERIAL,
    TRC_CRYPTOMATTE_ASSET
};
#define TRC_CRYPTOMATTE_KINDS 3
#define TRC_CRYPTOMATTE_LAYER_RANKS 2
#define TRC_MAX_CRYPTOMATTE_LAYERS 8 /* of each kind */
#define TRC_MAX_CRYPTOMATTE_DEPTH (TRC_CRYPTOMATTE_LAYER_RANKS * TRC_MAX_CRYPTOMATTE_LAYERS)

/* Reconstruction: noise goes, edges and textures stay, and where the estimated error says so, the
 * plain pixel does. With more samples the picture goes to the same limit. */
enum trc_denoise_type {
    TRC_DENOISE_NONE = 0, /* takes no memory and no time */
    /* Once all samples are there. Combined, the passes of light, light groups, shadow catchers and
     * the colours that light is divided by are filtered alike, so that they still add up; others
     * stay as they are. Takes about 200 bytes a pixel, and 24 more for each pass of light. Until it
     * is done, and after a cancel, passes are without it. trc_render_read_preview, too. */
    TRC_DENOISE_FINAL,
    TRC_DENOISE_PREVIEW /* by trc_render_read_preview alone; takes about 110 bytes a pixel */
};

/* What reconstruction knows of a pixel beside its light. With less of it, textures and edges lose
 * sharpness where there is noise. */
enum trc_guides_type {
    TRC_GUIDES_ALBEDO_NORMAL = 0, /* albedo, normal and depth */
    TRC_GUIDES_ALBEDO,
    TRC_GUIDES_NONE
};

/* The number of a Cryptomatte layer for trc_render_read. */
#define TRC_PASS_CRYPTOMATTE(kind, layer) \
    ((uint32_t)TRC_PASS_FIRST_CRYPTOMATTE + TRC_MAX_CRYPTOMATTE_LAYERS * (kind) + (layer))

/* The id of a name: its bytes' MurmurHash3_x86_32 with seed 0 (A. Appleby, public domain) as the
 * bits of a float, the exponent kept off the ends so that it is finite and normal. name: UTF-8,
 * NULL gives 0, which stands for no id. */
TRC_API float trc_cryptomatte_id(const char *name);

/* What passes mean in Blender 5 and not before. */
enum trc_passes_flags {
    TRC_PASSES_BLENDED_FEATURES = 1,  /* in TRC_PASS_DENOISING_NORMAL and ALBEDO what mirrors and
                                         transparent surfaces show counts by how much they pass on;
                                         else a sample has its first surface's alone */
    TRC_PASSES_BACKGROUND_MOTION = 2, /* TRC_PASS_VECTOR has the motion of the background, as of
                                         points far away; 0 for orthographic cameras */
    TRC_PASSES_MEAN_REFRACTION = 4    /* in TRC_PASS_TRANSMISSION_COLOR and the denoising albedo
                                         rough glass has what its micro-normals do not reflect on
                                         average; else what its normal does not */
};

typedef struct trc_render_desc {
    uint32_t struct_size;             /* of this structure; checked */
    uint32_t width, height;           /* the full frame, 1..65536 each */
    uint32_t crop_x, crop_y;          /* lower left corner of the part that is rendered */
    uint32_t crop_width, crop_height; /* 0: the full frame */
    uint32_t integrator;              /* TRC_INTEGRATOR_* */
    uint32_t sample_count;            /* per pixel, 1..2^20 */
    uint32_t light_samples;           /* shadow rays per camera hit, 1..64; 0 chooses */
    uint32_t max_depth;               /* bounces; 0: direct light only */
    uint32_t max_transparent_depth;   /* transparent surfaces that a path passes straight */
    uint32_t max_shadow_depth;        /* that it passes with its shadow ray; UINT32_MAX: as many */
    uint32_t max_glossy_depth, max_transmission_depth; /* further limits; UINT32_MAX none */
    float attenuation_cutoff; /* a ray whose throughput is below is not traced; Distribution decides
                                 by chance instead, unbiased, and does not read it */
    float filter_glossy;      /* Cycles' Filter Glossy; 0 off */
    /* As Cycles: largest mean of the channels of one contribution to a sample; 0 off. Passes of
     * light are clamped with Combined, that of ambient occlusion as direct light. */
    float clamp_direct, clamp_indirect;
    uint32_t assembly;    /* TRC_ASSEMBLY_* */
    uint32_t packet_size; /* 4, 16, 64 or 256; 0 chooses. 256, the paper's largest: where rays stay
                             together (camera, ideal bounces, one light), and 64 elsewhere */
    uint32_t sampler;     /* TRC_SAMPLER_* */
    uint32_t seed;        /* another number gives other noise */
    uint32_t filter;      /* TRC_FILTER_* */
    float filter_width;   /* pixels, > 0, up to 100 */
    uint32_t film_transparent; /* 1: the background adds no radiance and no alpha */
    /* 1: a transparent film is so behind glass, too, up to a roughness (0..1, as Principled has
     * it): what refracted rays see of the background adds neither radiance nor alpha. */
    uint32_t film_transparent_glass;
    float film_transparent_roughness;
    float film_exposure;   /* factor on Combined and light passes */
    uint64_t passes;       /* bit per TRC_PASS_*, COMBINED is always there */
    uint32_t thread_count; /* up to 1024; 0: one per logical processor */
    uint32_t progressive;  /* 1: whole frame, samples in rising batches (previews); 0: tiles to
                              the end one after the other */
    /* Adaptive sampling, off where noise_threshold is 0: a pixel gets min_samples (rounded up to a
     * power of two; 0 chooses by the threshold, 64 for 0.01) and then doubles its count until the
     * estimated error is below the threshold, in units of Cycles' Noise Threshold, or sample_count
     * is reached. Pixels decide for their neighbours, not for themselves, so the mean is unbiased
     * (with TRC_SAMPLER_SUDOKU and BLUE_NOISE, whose pixels share sequences, nearly). Counts:
     * TRC_PASS_SAMPLE_COUNT. */
    float noise_threshold;
    uint32_t min_samples; /* as said above; not read without noise_threshold */
    /* Of TRC_PASS_MIST, else not read: ((distance - mist_start) / mist_depth)^mist_falloff, the
     * quotient cut to [0, 1]; distance from the camera (orthographic: along its axis). */
    float mist_start, mist_depth; /* metres, >= 0; a mist_depth of 0 is no mist */
    float mist_falloff;         /* > 0; Blender's Quadratic is 2, Linear 1, Inverse Quadratic 0.5 */
    uint32_t cryptomattes;      /* bit per TRC_CRYPTOMATTE_* */
    uint32_t cryptomatte_depth; /* ranks, 1..TRC_MAX_CRYPTOMATTE_DEPTH, rounded up to an even
                                   number; not read without cryptomattes */
    uint32_t aov_value_count, aov_color_count; /* passes of each, 0..TRC_MAX_AOVS */
    uint32_t light_group_count;                /* passes, 0..TRC_MAX_LIGHT_GROUPS */
    uint32_t denoise;                          /* TRC_DENOISE_* */
    /* A part of the picture: samples [sample_offset, sample_offset + sample_subset) of
     * sample_count, with the numbers that they have in the whole; 0 samples: all from sample_offset
     * on. Progress and what is read are of these samples alone. Parts are put together by
     * trc_merge_add; a part itself is not reconstructed, and takes all samples where
     * noise_threshold says to stop. */
    uint32_t sample_offset, sample_subset;
    uint32_t pass_flags; /* TRC_PASSES_* */
    uint32_t guides;     /* TRC_GUIDES_*, of denoise */
    /* 0..1: up to this share of all rays besides, for samples where noise remains once every pixel
     * has sample_count: few pixels get 2, 4 or 8 times as many (TRC_PASS_SAMPLE_COUNT). Without
     * bias, as the neighbours of a pixel decide. Not read where progressive or noise_threshold is
     * set, of parts, and of fewer than 4 samples. 53 bytes a pixel, 5 with denoise. */
    float extra_samples;
} trc_render_desc;

/* No frame yet (width and height are to be set); Distribution, 16 samples, 50 bounces, a pixel
 * filter of Blackman-Harris 1.5 pixels wide, nothing clamped or cut off, Combined alone. */
TRC_API trc_render_desc trc_render_desc_default(void);

/* Starts a render, which the caller owns until trc_render_destroy: of the scene's current snapshot,
 * in threads of the library. All memory of the frame is taken before anything starts, and before
 * the first of it is taken, the sum is checked against what the machine, its container (control
 * groups) and a limit of address space (RLIMIT_AS) leave: TOO_LARGE. A missing camera is
 * INVALID_ARGUMENT. */
TRC_API trc_status trc_render_start(trc_scene scene, const trc_render_desc *desc,
                                    trc_render *render_out);

enum trc_progress_state {
    TRC_PROGRESS_RUNNING = 0,
    TRC_PROGRESS_DONE = 1,
    TRC_PROGRESS_CANCELLED = 2
};

typedef struct trc_render_progress {
    uint32_t struct_size;  /* of this structure; checked */
    uint32_t state;        /* TRC_PROGRESS_* */
    float fraction;        /* [0, 1] of the samples; those that adaptive sampling spares are done */
    uint32_t samples_done; /* lowest count over all pixels, as if every pixel took them all */
    double seconds;        /* since the start, stands still at the end */
    uint64_t rays_camera, rays_shadow, rays_reflection, rays_refraction; /* traced so far */
    uint64_t dropped_samples;                                            /* not finite, left out */
    uint64_t memory_bytes, peak_memory_bytes;                            /* of the library */
    uint32_t tiles_done, tile_count;                                     /* finished, and in all */
    uint32_t version;  /* rises with every finished tile or batch: something to draw */
    uint32_t reserved; /* 0 */
    double seconds_trace, seconds_shade, seconds_other; /* summed over threads */
} trc_render_progress;

/* Zeros, for trc_render_poll. */
TRC_API trc_render_progress trc_render_progress_default(void);

/* How far a render is, at once. struct_size of progress_out is set by the caller. */
TRC_API trc_status trc_render_poll(trc_render render, trc_render_progress *progress_out);

/* Returns when the render has ended or after timeout_seconds (0: at once, < 0: no limit). */
TRC_API trc_status trc_render_wait(trc_render render, double timeout_seconds);

/* Asks a render to stop; does not wait. Idempotent; what is finished stays readable. */
TRC_API trc_status trc_render_cancel(trc_render render);

/* Copies one pass of the crop, bottom row first, channels interleaved, float32. At any time: of
 * tiles that are being rendered each shows the means of all samples of some moment, so that nothing
 * is too bright or too dark; pixels without samples are 0. float_count must be crop width * height
 * * channels. */
TRC_API trc_status trc_render_read(trc_render render, uint32_t pass, float *pixels_out,
                                   uint64_t float_count);

/* Copies Combined, quickly reconstructed: for pictures that are looked at while they gather
 * samples. At any time, as trc_render_read, of which it takes the tiles as they are; threads of its
 * own, as many as the render has, work on it meanwhile. The more samples there are, the less is
 * changed. Without denoise in the render's descriptor, and of scenes with shadow catchers, the same
 * as trc_render_read. float_count must be crop width * height * 4. OUT_OF_MEMORY and NO_THREAD
 * leave pixels_out as it was. */
TRC_API trc_status trc_render_read_preview(trc_render render, float *pixels_out,
                                           uint64_t float_count);

/* Channels of a pass, 0 for an unknown one. */
TRC_API uint32_t trc_pass_channels(uint32_t pass);

/* ---- parts of a picture, put together ----
 *
 * What a film has of a part are sums, of which there are as many as passes, by their numbers, and
 * those below. Sums of a part that go to another process and are added to a film there give the
 * picture that one render of all samples gives: the same bits, unless a sum has rounding errors
 * (samples of a pixel that differ by more than about 2^28), then within one unit in the last place.
 * Cryptomattes have the same bits as long as no pixel of a part meets more than
 * TRC_MAX_CRYPTOMATTE_DEPTH + 2 ids of a kind. */

/* Sums beside those of passes. Those of TRC_PASS_SAMPLE_COUNT are there of every film; mattes of a
 * kind are together at TRC_PASS_CRYPTOMATTE(kind, 0). */
enum trc_sums_id {
    TRC_SUMS_CATCHERS = 192, /* what shadow catchers got */
    TRC_SUMS_HALVES = 193    /* what reconstruction needs */
};
#define TRC_SUMS_END 194 /* all numbers of sums are below it */

/* Doubles that a render's film keeps of each pixel under that number; 0: none, or no such render.
 */
TRC_API uint32_t trc_sums_channels(trc_render render, uint32_t sums);

/* Copies sums of a render that has ended, in the order of trc_render_read. double_count must be
 * crop width * height * trc_sums_channels. */
TRC_API trc_status trc_sums_read(trc_render render, uint32_t sums, double *sums_out,
                                 uint64_t double_count);

typedef struct trc_sums {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t number;
    const double *values; /* as trc_sums_read gives them */
    uint64_t value_count;
} trc_sums;

/* None. */
TRC_API trc_sums trc_sums_default(void);

typedef struct trc_part_desc {
    uint32_t struct_size;                  /* of this structure; checked */
    uint32_t sample_offset, sample_subset; /* its samples, at least one */
    uint32_t sums_count;
    const trc_sums *sums; /* each that a film of such a part has, once, in any order */
} trc_part_desc;

/* No samples and no sums yet. */
TRC_API trc_part_desc trc_part_desc_default(void);

/* A render whose samples come by trc_merge_add instead of from a scene; the caller owns it until
 * trc_render_destroy. desc: of the whole, with no sample_offset and sample_subset; settings of
 * rendering are not read. has_catchers: 1 if the parts have TRC_SUMS_CATCHERS, else 0. It runs, and
 * trc_render_wait does not return, until trc_merge_finish. TOO_LARGE as trc_render_start. */
TRC_API trc_status trc_merge_start(const trc_render_desc *desc, uint32_t has_catchers,
                                   trc_render *render_out);

/* Adds a part, which begins where the one before it ended. With adaptive sampling the pixels that
 * would have stopped do not take it; then parts have to end at each count of samples at which
 * pixels may stop. INVALID_ARGUMENT leaves the film as it is. Not from two threads at once. */
TRC_API trc_status trc_merge_add(trc_render render, const trc_part_desc *part);

/* All parts are there, or INVALID_ARGUMENT, as after a cancel: the picture is reconstructed, where
 * desc says so, in the background, and the render ends. OUT_OF_MEMORY or NO_THREAD, for which it
 * can be called again. Not while trc_merge_add runs. */
TRC_API trc_status trc_merge_finish(trc_render render);

/* Cancels, waits and frees. The handle becomes stale. */
TRC_API trc_status trc_render_destroy(trc_render render);

TRC_END_DECLS

#endif
