/* Hashes of whole numbers and floats for procedural textures, and where they place things.
 *
 * Bob Jenkins, "lookup3.c" (2006, public domain), for keys of one to four words, with the seeds and
 * the order of words that Cycles uses: patterns come out the same. M. Jarzynski, M. Olano, "Hash
 * Functions for GPU Rendering" (2020), for cells of Blender 5. */
#ifndef TRACER_KERNELS_PROGRAM_HASH_H
#define TRACER_KERNELS_PROGRAM_HASH_H

#include "kernels/simd/wide_math.h"

/* Coordinates of a place; components beyond the dimensions in use are not read. */
#define TRC_MAX_DIMENSIONS 4

/* Where a vector and a number w lie in a space of dims dimensions. */
TRC_INLINE void place_of(int dims, const vfloat *vector, vfloat w, vfloat *p) {
    for (int i = 0; i < 3; i++)
        p[i] = vector[i];
    p[dims == 1 ? 0 : 3] = w;
}

/* ---- words ---- */

TRC_INLINE vuint vu_rotate(vuint x, int bits) { return (x << bits) | (x >> (32 - bits)); }

TRC_INLINE void lookup3_mix(vuint *a, vuint *b, vuint *c) {
    *a = (*a - *c) ^ vu_rotate(*c, 4);
    *c = *c + *b;
    *b = (*b - *a) ^ vu_rotate(*a, 6);
    *a = *a + *c;
    *c = (*c - *b) ^ vu_rotate(*b, 8);
    *b = *b + *a;
    *a = (*a - *c) ^ vu_rotate(*c, 16);
    *c = *c + *b;
    *b = (*b - *a) ^ vu_rotate(*a, 19);
    *a = *a + *c;
    *c = (*c - *b) ^ vu_rotate(*b, 4);
    *b = *b + *a;
}

TRC_INLINE vuint lookup3_final(vuint a, vuint b, vuint c) {
    c = (c ^ b) - vu_rotate(b, 14);
    a = (a ^ c) - vu_rotate(c, 11);
    b = (b ^ a) - vu_rotate(a, 25);
    c = (c ^ b) - vu_rotate(b, 16);
    a = (a ^ c) - vu_rotate(c, 4);
    b = (b ^ a) - vu_rotate(a, 14);
    return (c ^ b) - vu_rotate(b, 24);
}

/* count: 1 to 4 words of key. */
TRC_INLINE vuint hash_words(int count, const vuint *key) {
    const vuint seed = vu_set(0xdeadbeefu + ((uint32_t)count << 2) + 13u);
    vuint a = seed + key[0];
    vuint b = count > 1 ? seed + key[1] : seed;
    vuint c = count > 2 ? seed + key[2] : seed;
    if (count > 3) {
        lookup3_mix(&a, &b, &c);
        a = a + key[3];
    }
    return lookup3_final(a, b, c);
}

/* ---- floats ---- */

/* [0, 1]: the word over 2^32 - 1, which as a float is 2^32. Both halves convert exactly, so that
 * the sum is rounded once. */
TRC_INLINE vfloat hash_to_unit(vuint x) {
    const vfloat high = vi_to_float((vint)(x >> 16)), low = vi_to_float((vint)(x & vu_set(0xffff)));
    return (high * vf_set(65536.0f) + low) * vf_set(0x1p-32f);
}

TRC_INLINE vfloat hash1(vfloat x) {
    const vuint key[1] = {vf_as_uint(x)};
    return hash_to_unit(hash_words(1, key));
}
TRC_INLINE vfloat hash2(vfloat x, vfloat y) {
    const vuint key[2] = {vf_as_uint(x), vf_as_uint(y)};
    return hash_to_unit(hash_words(2, key));
}
TRC_INLINE vfloat hash3(vfloat x, vfloat y, vfloat z) {
    const vuint key[3] = {vf_as_uint(x), vf_as_uint(y), vf_as_uint(z)};
    return hash_to_unit(hash_words(3, key));
}
TRC_INLINE vfloat hash4(vfloat x, vfloat y, vfloat z, vfloat w) {
    const vuint key[4] = {vf_as_uint(x), vf_as_uint(y), vf_as_uint(z), vf_as_uint(w)};
    return hash_to_unit(hash_words(4, key));
}

/* One number for a place. */
TRC_INLINE vfloat hash_value(int dims, const vfloat *p) {
    switch (dims) {
    case 1:
        return hash1(p[0]);
    case 2:
        return hash2(p[0], p[1]);
    case 3:
        return hash3(p[0], p[1], p[2]);
    default:
        return hash4(p[0], p[1], p[2], p[3]);
    }
}

/* A colour for a place: numbers of longer keys, or of the components in another order. */
TRC_INLINE vvec3 hash_color(int dims, const vfloat *p) {
    const vfloat one = vf_one(), two = vf_set(2.0f), first = hash_value(dims, p);
    switch (dims) {
    case 1:
        return v3(first, hash2(p[0], one), hash2(p[0], two));
    case 2:
        return v3(first, hash3(p[0], p[1], one), hash3(p[0], p[1], two));
    case 3:
        return v3(first, hash4(p[0], p[1], p[2], one), hash4(p[0], p[1], p[2], two));
    default:
        return v3(first, hash4(p[2], p[0], p[3], p[1]), hash4(p[3], p[2], p[1], p[0]));
    }
}

/* As many numbers as the place has components. */
TRC_INLINE void hash_point(int dims, const vfloat *p, vfloat *out) {
    const vfloat one = vf_one();
    out[0] = hash_value(dims, p);
    switch (dims) {
    case 1:
        break;
    case 2:
        out[1] = hash3(p[0], p[1], one);
        break;
    case 3:
        out[1] = hash4(p[0], p[1], p[2], one);
        out[2] = hash4(p[0], p[1], p[2], vf_set(2.0f));
        break;
    default:
        out[1] = hash4(p[3], p[0], p[1], p[2]);
        out[2] = hash4(p[2], p[3], p[0], p[1]);
        out[3] = hash4(p[1], p[2], p[3], p[0]);
        break;
    }
}

/* ---- cells, whose coordinates are whole; those beyond the dimensions are 0 ---- */

/* A linear congruential generator's (W. H. Press et al., "Numerical Recipes"). */
#define PCG_MULTIPLIER 1664525u
#define PCG_INCREMENT 1013904223u

/* The paper's pcg2d, pcg3d and pcg4d have this round twice; count: 2 to 4. */
TRC_INLINE void pcg_round(int count, vuint v[TRC_MAX_DIMENSIONS]) {
    const vuint multiplier = vu_set(PCG_MULTIPLIER);
    if (count == 2) {
        v[0] = v[0] + v[1] * multiplier;
        v[1] = v[1] + v[0] * multiplier;
        return;
    }
    v[0] = v[0] + v[1] * (count == 3 ? v[2] : v[3]);
    v[1] = v[1] + v[2] * v[0];
    v[2] = v[2] + v[0] * v[1];
    v[3] = v[3] + v[1] * v[2];
}

/* The point of a cell of two to four dimensions, each coordinate in [0, 1]. As in Cycles, words
 * are signed where they are shifted. */
TRC_INLINE void cell_point(int dims, const vfloat cell[TRC_MAX_DIMENSIONS],
                           vfloat point[TRC_MAX_DIMENSIONS]) {
    vuint v[TRC_MAX_DIMENSIONS];
    for (int i = 0; i < TRC_MAX_DIMENSIONS; i++)
        v[i] = (vuint)vf_to_int(cell[i]) * vu_set(PCG_MULTIPLIER) + vu_set(PCG_INCREMENT);
    pcg_round(dims, v);
    for (int i = 0; i < TRC_MAX_DIMENSIONS; i++)
        v[i] = v[i] ^ (vuint)((vint)v[i] >> 16);
    pcg_round(dims, v);
    for (int i = 0; i < TRC_MAX_DIMENSIONS; i++)
        point[i] = vi_to_float((vint)(v[i] & vu_set(0x7fffffffu))) * vf_set(0x1p-31f);
}

/* Its colour: a plane's cells are those of space at height 0. */
TRC_INLINE vvec3 cell_color(int dims, const vfloat cell[TRC_MAX_DIMENSIONS]) {
    vfloat color[TRC_MAX_DIMENSIONS];
    cell_point(dims == 4 ? 4 : 3, cell, color);
    return v3(color[0], color[1], color[2]);
}

#endif
