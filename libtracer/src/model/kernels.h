/* The table of kernels of one instruction set, and the jobs they take. */
#ifndef TRACER_MODEL_KERNELS_H
#define TRACER_MODEL_KERNELS_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "model/adaptive.h"
#include "model/denoise.h"
#include "model/extra.h"
#include "model/film.h"
#include "model/snapshot.h"
#include "tracer/tracer.h"

struct trc_light_bound; /* model/lights.h */
struct trc_light_table;
struct trc_range; /* model/range.h */
struct trc_split; /* model/split.h */
struct trc_split_blocks;

/* Counts of one tile, summed by the renderer. */
struct trc_tile_counts {
    uint64_t rays_camera, rays_shadow, rays_reflection, rays_refraction;
    uint64_t dropped_samples;
    double seconds_trace, seconds_shade, seconds_other;
};

/* A rectangle of the crop and a range of its samples, for one thread. */
struct trc_tile_job {
    const struct trc_snapshot *snapshot;
    const trc_render_desc *desc;   /* resolved: no 0-means-chosen values left */
    const uint32_t *sampler_table; /* model/sobol.h */
    const float *filter_table;     /* model/filter.h */
    struct trc_film *film;
    struct trc_adaptive *adaptive; /* NULL: every pixel gets every sample */
    /* NULL, or the samples are extra ones, of the pixels that have this level or a higher one. */
    const struct trc_extra *extra;
    uint32_t extra_level;
    uint32_t x, y, width, height; /* in the crop, pixels */
    uint32_t sample_begin, sample_end;
    void *memory;                  /* tile_memory_bytes(...) bytes, 64-byte aligned, one thread's */
    const atomic_uint *cancel;     /* non-zero: return soon, the tile's pixels keep whole samples */
    struct trc_tile_counts counts; /* added to */
};

/* Vertices of an instance's mesh, to be moved by a program. */
struct trc_displace_job {
    const struct trc_snapshot *snapshot; /* its instances, meshes, images and camera are read */
    uint32_t instance;
    const struct trc_material *program; /* trc_material.displacement */
    const uint32_t *corners;            /* 3 * triangle + corner: where each vertex is looked at */
    uint32_t count;
    const float *normals; /* of all vertices, unit, object space */
    float *offsets;       /* of all vertices, object space: those of the corners are set */
};

struct trc_kernels {
    uint32_t isa;   /* TRC_ISA_* */
    uint32_t width; /* lanes */
    /* Bytes of scratch memory a tile job needs; desc is resolved. Read of the scene are its
     * features and how many rays a hit may send. */
    size_t (*tile_memory_bytes)(const trc_render_desc *desc, const struct trc_snapshot *snapshot);
    /* Renders a job; never fails. The thread's floating-point state must be the default. */
    void (*tile_render)(struct trc_tile_job *job);
    /* Bytes of scratch memory a job of reconstruction needs, and the job; never fails. */
    size_t (*denoise_memory_bytes)(void);
    void (*denoise_tile)(const struct trc_denoise_job *job);
    /* Sums of pixels side by side, at most TRC_TILE_SIZE of one tile of the film, into planes of
     * quick reconstruction, which begin at the first one's place. Read while they may be written:
     * the tile's sequence number tells. */
    void (*preview_load)(const struct trc_film *film, size_t pixel, int count, float *planes);
    /* Quick reconstruction of a strip, row by row: memory has TRC_PREVIEW_PLANES planes, the inputs
     * of row y filled in, from -TRC_PREVIEW_HALO on; row y - TRC_PREVIEW_HALO is done then. 64-byte
     * aligned. exposure: a factor of the colour. Never fails. */
    void (*preview_filter)(float *memory, int width, int y, float exposure);
    /* What is shown of pixels side by side, from planes that begin at the first one's place. */
    void (*preview_store)(const float *planes, int count, float *rgba);
    /* trc_query_*: arguments already validated; chunk [begin, end) of the arrays. packet_size
     * resolved. order: of the chunk's rays, less begin, with api/ray_order.h's room behind, or
     * NULL. */
    void (*query_closest)(const struct trc_snapshot *snapshot, const trc_rays *rays,
                          const trc_hits *hits, uint64_t begin, uint64_t end, uint32_t packet_size,
                          const uint32_t *order);
    void (*query_occluded)(const struct trc_snapshot *snapshot, const trc_rays *rays,
                           uint8_t *occluded, uint64_t begin, uint64_t end, uint32_t packet_size,
                           const uint32_t *order);
    /* Radiance of a world material for count directions (3 floats each) into 3 floats each: fills
     * importance maps at commit. */
    void (*world_evaluate)(const struct trc_snapshot *snapshot, const float *directions,
                           float *radiance, uint32_t count);
    /* Mean of what the program of a lamp emits, over its places and the points within bound that
     * are up to reach from it: tells what it counts among other lights. */
    void (*lamp_measure)(const struct trc_snapshot *snapshot, const struct trc_light_table *table,
                         uint32_t lamp, const struct trc_light_bound *bound, float reach,
                         float mean[3]);
    /* One pure operation of a program (model/program.h): out gets its outputs. table: if
     * trc_op_has_table. Of the one-lane kernels alone, NULL in others. */
    void (*program_fold)(uint32_t op, uint32_t mode, const float *table, const float *in,
                         float *out);
    /* Never fails. Of the one-lane kernels alone, NULL in others. */
    void (*displace)(const struct trc_displace_job *job);
    /* Builds: the cheapest plane of a range, or axis -1 if no plane parts its refs. Every
     * instruction set finds the same. May sort the refs. blocks: to be found by all threads; NULL:
     * by this one. */
    void (*split_find)(struct trc_split_blocks *blocks, const struct trc_range *r,
                       struct trc_split *out);
    /* Both sides of that plane, their refs in the range's order, in its spare memory; its refs'
     * memory is spare then. With blocks: those of the last search; cancelled, both leave refs in
     * any state. */
    void (*split_apply)(struct trc_split_blocks *blocks, const struct trc_range *r,
                        const struct trc_split *s, struct trc_range *left, struct trc_range *right);
};

/* The table of an instruction set that this build and CPU have, else NULL. Tables are
 * constants named trc_kernels_scalar, _sse42, _avx2, _avx512, _neon (kernels/table.c). */
const struct trc_kernels *trc_kernels_get(uint32_t isa);

/* The table in force: trc_set_isa, TRACER_ISA, CPU. Never NULL. */
const struct trc_kernels *trc_kernels_current(void);

#endif
