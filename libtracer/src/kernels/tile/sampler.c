/* Sample sequences, TRC_WIDTH numbers at once.
 *
 * Sources: A. Owen, "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences" (1995); S. Laine and T.
 * Karras, "Stratified Sampling for Stochastic Transparency" (2011), the hash that scrambles a
 * number in Owen's sense when its digits are reversed; B. Burley, "Practical Hash-based Owen
 * Scrambling" (2020), shuffled padding; N. Vegdahl, "Building a Better LK Hash" (2021), constants
 * of the hash; H. Faure and S. Tezuka, "Another Random Scrambling of Digital (t,s)-Sequences"
 * (2002), orders of points (model/sobol.h); A. Ahmed and P. Wonka, "Screen-Space Blue-Noise
 * Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels" (2020); A. Keller
 * and W. Heidrich, "Interleaved Sampling" (2001), and S. Boulos et al., "Packet-based Whitted and
 * Distribution Ray Tracing" (2007), the tile of static samples.
 *
 * Every number is a function of (seed, pixel, index, dimension) alone: pictures do not depend on
 * threads, tiles or widths. */
#include "kernels/tile/sampler.h"

#include "kernels/simd/wide_math.h"
#include "model/sobol.h"
#include "tracer/tracer.h"

#define POINT_MASK (TRC_SOBOL_POINTS - 1u)

_Static_assert(TRC_JOINT_DIMENSIONS == TRC_SOBOL_DIMENSIONS, "one table row per joint dimension");
_Static_assert(TRC_DIM_BOUNCE + 2 * TRC_DIMS_PER_BOUNCE == TRC_JOINT_DIMENSIONS,
               "the joint sequence ends with a whole bounce");

/* ---- bits ---- */

/* Bits of every lane in reverse order. */
TRC_INLINE vuint reverse_bits(vuint x) {
#if TRC_WIDTH == 16 || (TRC_WIDTH == 8 && defined(__AVX2__)) || \
    (TRC_WIDTH == 4 && defined(__SSSE3__))
    /* Reversed nibbles by table, low ones to the high half, and reversed bytes by shuffle. */
#define TRC_TABLE_LOW 0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15
#define TRC_BYTES 3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12
    const __m128i table = _mm_setr_epi8(TRC_TABLE_LOW), bytes = _mm_setr_epi8(TRC_BYTES);
    const vuint nibbles = vu_set(0x0f0f0f0fu);
    const vuint low = x & nibbles, high = (x >> 4) & nibbles;
#if TRC_WIDTH == 16
    const __m512i t = _mm512_broadcast_i32x4(table);
    const vuint r = ((vuint)_mm512_shuffle_epi8(t, (__m512i)low) << 4) |
                    (vuint)_mm512_shuffle_epi8(t, (__m512i)high);
    return (vuint)_mm512_shuffle_epi8((__m512i)r, _mm512_broadcast_i32x4(bytes));
#elif TRC_WIDTH == 8
    const __m256i t = _mm256_broadcastsi128_si256(table);
    const vuint r = ((vuint)_mm256_shuffle_epi8(t, (__m256i)low) << 4) |
                    (vuint)_mm256_shuffle_epi8(t, (__m256i)high);
    return (vuint)_mm256_shuffle_epi8((__m256i)r, _mm256_broadcastsi128_si256(bytes));
#else
    const vuint r = ((vuint)_mm_shuffle_epi8(table, (__m128i)low) << 4) |
                    (vuint)_mm_shuffle_epi8(table, (__m128i)high);
    return (vuint)_mm_shuffle_epi8((__m128i)r, bytes);
#endif
#elif TRC_WIDTH == 4 && defined(__aarch64__)
    return (vuint)vrev32q_u8(vrbitq_u8((uint8x16_t)x));
#else
    x = (x >> 16) | (x << 16);
    x = ((x >> 8) & vu_set(0x00ff00ffu)) | ((x & vu_set(0x00ff00ffu)) << 8);
    x = ((x >> 4) & vu_set(0x0f0f0f0fu)) | ((x & vu_set(0x0f0f0f0fu)) << 4);
    x = ((x >> 2) & vu_set(0x33333333u)) | ((x & vu_set(0x33333333u)) << 2);
    return ((x >> 1) & vu_set(0x55555555u)) | ((x & vu_set(0x55555555u)) << 1);
#endif
}

/* Owen scrambling of numbers whose first digit is bit 0: each step lets a digit depend on earlier
 * ones only. */
TRC_INLINE vuint scramble_reversed(vuint x, vuint seed) {
    x ^= x * vu_set(0x3d20adeau);
    x += seed;
    x *= (seed >> 16) | vu_set(1u);
    x ^= x * vu_set(0x05526c56u);
    return x ^ (x * vu_set(0x53a22864u));
}

TRC_INLINE vmask vu_eq(vuint a, vuint b) { return vi_eq((vint)a, (vint)b); }
TRC_INLINE vuint vu_select(vmask m, vuint a, vuint b) {
    return (vuint)vi_select(m, (vint)a, (vint)b);
}

/* Least k with 2^k >= n. */
TRC_INLINE uint32_t log2_ceiling(uint32_t n) {
    return n > 1 ? 32u - (uint32_t)__builtin_clz(n - 1u) : 0u;
}

/* ---- Sobol ---- */

/* Points of the lanes as the table is read for them. */
struct table_points {
    vuint index;
    uint32_t first; /* of lane 0 */
    enum { POINTS_EQUAL, POINTS_RUN, POINTS_MIXED } kind;
    bool small; /* all within the first row of the table */
};

TRC_INLINE struct table_points points_of(vuint index) {
    struct table_points p = {.index = index, .first = (uint32_t)vi_get((vint)index, 0)};
    const uint32_t place = p.first & POINT_MASK;
    const vuint from_first = index - vu_set(p.first);
    p.small = vm_all(vu_eq(index >> TRC_SOBOL_POINT_BITS, vu_set(0)));
    if (vm_all(vu_eq(from_first, vu_set(0))))
        p.kind = POINTS_EQUAL;
    else if (place <= TRC_SOBOL_POINTS - TRC_WIDTH && vm_all(vu_eq(from_first, (vuint)vi_lane())))
        p.kind = POINTS_RUN;
    else
        p.kind = POINTS_MIXED;
    return p;
}

/* What the bits of point index above the first row add. */
TRC_INLINE uint32_t upper_rows(const uint32_t *table, uint32_t index, uint32_t dimension) {
    const uint32_t upper = index >> TRC_SOBOL_POINT_BITS;
    return table[trc_sobol_offset(1, dimension) + (upper & POINT_MASK)] ^
           table[trc_sobol_offset(2, dimension) + (upper >> TRC_SOBOL_POINT_BITS & POINT_MASK)];
}

/* Reversed numbers of points in a dimension of the table. */
TRC_INLINE vuint sobol_reversed(const uint32_t *table, const struct table_points *p,
                                uint32_t dimension) {
    const uint32_t *row = table + trc_sobol_offset(0, dimension);
    const vuint mask = vu_set(POINT_MASK);
    if (p->kind != POINTS_MIXED) {
        const uint32_t place = p->first & POINT_MASK;
        const vuint x = p->kind == POINTS_EQUAL ? vu_set(row[place]) : vu_load(row + place);
        return p->small ? x : x ^ vu_set(upper_rows(table, p->first, dimension));
    }
    vuint x = vu_gather(row, (vint)(p->index & mask), vm_all_set());
    if (!p->small) {
        const vuint upper = p->index >> TRC_SOBOL_POINT_BITS;
        const vmask large = vm_not(vu_eq(upper, vu_set(0)));
        x ^= vu_gather(table + trc_sobol_offset(1, dimension), (vint)(upper & mask), large);
        x ^= vu_gather(table + trc_sobol_offset(2, dimension),
                       (vint)((upper >> TRC_SOBOL_POINT_BITS) & mask), large);
    }
    return x;
}

/* Nested uniform shuffle of index within blocks of 2^bits: keeps every aligned block of 2^k
 * whole. */
TRC_INLINE vuint shuffle_index(vuint index, vuint seed, uint32_t bits) {
    const vuint low = vu_set(bits < 32 ? (1u << bits) - 1u : ~0u);
    const vuint shuffled = reverse_bits(scramble_reversed(reverse_bits(index), seed));
    return (shuffled & low) | (index & ~low);
}

/* Dimension of the table that serves a dimension, and the number of its padding group: 0 for the
 * joint sequence. Two deeper hits share a group and repeat the dimensions of the first two. */
TRC_INLINE uint32_t joint_dimension(uint32_t dimension, uint32_t *group) {
    *group = 0;
    if (dimension < TRC_JOINT_DIMENSIONS)
        return dimension;
    const uint32_t deep = dimension - TRC_DIM_BOUNCE;
    *group = deep / (2 * TRC_DIMS_PER_BOUNCE);
    return TRC_DIM_BOUNCE + deep % (2 * TRC_DIMS_PER_BOUNCE);
}

/* n numbers of consecutive dimensions; their chains of multiplications overlap. */
static void sobol_numbers(const uint32_t *table, vuint key, vuint index, uint32_t index_bits,
                          uint32_t dimension, uint32_t n, vfloat *u) {
    struct table_points points = points_of(index);
    uint32_t shuffled = 0; /* the group whose order points has */
    for (uint32_t k = 0; k < n; k++) {
        uint32_t group;
        const uint32_t joint = joint_dimension(dimension + k, &group);
        if (group != shuffled) {
            shuffled = group;
            const vuint seed = vu_hash(key ^ vu_set(group * 0x68e31da4u));
            points = points_of(shuffle_index(index, seed, index_bits));
        }
        const vuint seed = vu_hash(key + vu_set((dimension + k) * 0x9e3779b9u));
        const vuint x = sobol_reversed(table, &points, joint);
        u[k] = vu_to_unit(reverse_bits(scramble_reversed(x, seed)));
    }
}

/* ---- blue noise: one sequence for a block of 256 x 256 pixels, visited in shuffled Z-order
 * ---- */

#define BLOCK_BITS 8

/* Spreads the low 8 bits to the even places. */
TRC_INLINE vuint spread_bits(vuint x) {
    x = (x | (x << 4)) & vu_set(0x0f0fu);
    x = (x | (x << 2)) & vu_set(0x3333u);
    return (x | (x << 1)) & vu_set(0x5555u);
}

/* Order of the pixel in its block: at every level the four quadrants come in an order that a hash
 * of the levels above chooses. */
static vuint z_order(vuint x, vuint y, vuint seed) {
    const vuint mask = vu_set((1u << BLOCK_BITS) - 1u);
    const vuint z = spread_bits(x & mask) | (spread_bits(y & mask) << 1);
    vuint ordered = vu_set(0);
    for (int level = BLOCK_BITS - 1; level >= 0; level--) {
        const vuint digit = (z >> (2 * level)) & vu_set(3u);
        const vuint h = vu_hash(seed + (z >> (2 * level + 2)) * vu_set(0x9e3779b9u) +
                                vu_set((uint32_t)level * 0x85ebca6bu));
        /* Of the 24 orders, those that are affine in the two bits: 3 nonzero images of bit 0, then
         * 2 of bit 1, then 4 offsets: all 24. */
        const vuint image0 = vu_set(1u) + (((h >> 16) * vu_set(3u)) >> 16);
        const vuint other = (h & vu_set(1u)) + vu_set(1u);
        vuint image1 = image0 + other;
        image1 = vu_select(vi_lt(vi_set(3), (vint)image1), image1 - vu_set(3u), image1);
        const vuint bit0 = vu_set(0) - (digit & vu_set(1u)), bit1 = vu_set(0) - (digit >> 1);
        const vuint place = (bit0 & image0) ^ (bit1 & image1) ^ ((h >> 1) & vu_set(3u));
        ordered = (ordered << 2) | place;
    }
    return ordered;
}

static void blue_numbers(const struct trc_sampler *sampler, vuint pixel, vuint index,
                         uint32_t index_bits, uint32_t dimension, uint32_t n, vfloat *u) {
    const vuint x = pixel & vu_set(0xffffu), y = pixel >> 16;
    const vuint block = vu_hash2((x >> BLOCK_BITS) | ((y >> BLOCK_BITS) << 16),
                                 vu_set(sampler->seed ^ 0x517cc1b7u));
    /* 16 bits of place leave 14 for the samples; what is above them changes the scrambling. */
    const uint32_t bits = index_bits < 14 ? index_bits : 14;
    const vuint above = index >> bits;
    const vuint key = block ^ vu_select(vu_eq(above, vu_set(0)), vu_set(0), vu_hash(above));
    const vuint order = z_order(x, y, block);
    const vuint low = index & vu_set((1u << bits) - 1u);
    sobol_numbers(sampler->table, key, (order << bits) | low, bits + 2 * BLOCK_BITS, dimension, n,
                  u);
}

/* ---- interleaved tile ---- */

/* The tile is 8 x 8 pixels. A sample's stratum among the planned ones is common to the tile (so
 * that packets share lens, light and time cells); its 64 cells go to the 64 pixels: the upper digit
 * (of 8) by a Sudoku square, in which every row, column and 4 x 2 block has each digit once, the
 * lower digit by a second square that makes the pair of digits different for all pixels. Squares
 * over GF(8): digit a = y * g + x' is a Latin square for every g != 0, where x' renumbers x so that
 * blocks come out right; g = 2 and g = 3 are orthogonal. */
TRC_INLINE vuint gf8_double(vuint a) {
    const vuint twice = a << 1;
    return twice ^ (vu_set(0x0bu) & (vu_set(0) - (twice >> 3))); /* modulo t^3 + t + 1 */
}

static vuint sudoku_cell(vuint x, vuint y, uint32_t h) {
    /* Renumbering of rows and columns that keeps blocks (4 columns x 2 rows): bands and their rows,
     * stacks and their columns are permuted by xor with hash bits. */
    x = (x ^ vu_set(h & 7u)) & vu_set(7u);
    y = (y ^ vu_set((h >> 3) & 7u)) & vu_set(7u);
    /* In a block y differs in bit 0 and x in bits 0, 1: digits 4 * bit0(y) xor ... are all
     * different when the image of y's bit 0 is independent of x's bits 0 and 1. Doubling y twice
     * maps 1 to 4. */
    const vuint y2 = gf8_double(y), y4 = gf8_double(y2);
    const vuint upper = x ^ y4;
    const vuint lower = x ^ y2;
    const vuint digit0 = upper ^ vu_set((h >> 6) & 7u), digit1 = lower ^ vu_set((h >> 9) & 7u);
    return digit0 * vu_set(8u) + digit1;
}

static vfloat sudoku_number(const struct trc_sampler *sampler, vuint pixel, vuint index,
                            uint32_t index_bits, uint32_t dimension) {
    const vuint x = pixel & vu_set(0xffffu), y = pixel >> 16;
    const vuint tile = vu_hash2((x >> 3) | ((y >> 3) << 16), vu_set(sampler->seed ^ 0x2545f491u));
    /* The stratum: leading digits of a Sobol number that the whole tile shares. */
    vfloat shared;
    sobol_numbers(sampler->table, tile, index, index_bits, dimension, 1, &shared);
    const float strata = (float)(1u << (index_bits < 18 ? index_bits : 18));
    const vfloat stratum = vf_floor(shared * vf_set(strata));
    const vuint h = vu_hash(tile ^ vu_hash(index * vu_set(0x9e3779b9u) + vu_set(dimension)));
    vuint cell = vu_set(0);
    if (vm_all(vu_eq(h, vu_set((uint32_t)vi_get((vint)h, 0))))) {
        cell = sudoku_cell(x, y, (uint32_t)vi_get((vint)h, 0));
    } else {
        /* Lanes of several tiles: the square is linear, so the hash may as well be added
         * afterwards. */
        const vuint none = sudoku_cell(x ^ h, y ^ (h >> 3), 0);
        cell = none ^ ((h >> 3) & vu_set(0x38u)) ^ ((h >> 9) & vu_set(7u));
    }
    const vfloat jitter = vu_to_unit(vu_hash2(h, pixel));
    const vfloat u = (stratum + (vi_to_float((vint)cell) + jitter) * vf_set(1.0f / 64.0f)) *
                     vf_set(1.0f / strata);
    return vf_min(u, vf_set(TRC_BELOW_ONE));
}

/* ---- jittered and independent ---- */

/* A permutation of [0, 2^bits): steps that are bijective modulo a power of two, seeded. */
TRC_INLINE vuint permute_bits(vuint i, vuint seed, uint32_t bits) {
    const vuint mask = vu_set(bits < 32 ? (1u << bits) - 1u : ~0u);
    const uint32_t half = bits / 2 + 1;
    for (int round = 0; round < 3; round++) {
        i = (i + seed) & mask;
        i = (i * ((seed ^ vu_set(0x2c1b3c6du)) | vu_set(1u))) & mask;
        i ^= i >> half;
        seed = vu_hash(seed + vu_set(0x9e3779b9u));
    }
    return i & mask;
}

/* Partner and place in a pair of dimensions that are stratified together: -1 for lone ones. */
TRC_INLINE int pair_place(uint32_t dimension, uint32_t *pair) {
    if (dimension < TRC_DIM_TIME) {
        *pair = dimension / 2;
        return (int)(dimension & 1u);
    }
    if (dimension < TRC_DIM_BOUNCE) {
        *pair = dimension;
        return -1;
    }
    const uint32_t within = (dimension - TRC_DIM_BOUNCE) % TRC_DIMS_PER_BOUNCE;
    *pair = dimension;
    if (within == TRC_DIM_LIGHT_SELECT || within == TRC_DIM_LOBE)
        return -1;
    const bool second = within == TRC_DIM_LIGHT_Y || within == TRC_DIM_BSDF_Y;
    *pair = dimension - (second ? 1u : 0u);
    return second ? 1 : 0;
}

static vfloat jitter_number(vuint key, vuint index, uint32_t index_bits, uint32_t dimension) {
    uint32_t pair;
    const int place = pair_place(dimension, &pair);
    const vuint cell = permute_bits(index, vu_hash(key + vu_set(pair * 0x9e3779b9u)), index_bits);
    const vfloat jitter = vu_to_unit(
        vu_hash(key ^ vu_hash(index * vu_set(0x85ebca6bu) + vu_set(dimension * 0x9e3779b9u))));
    /* A pair divides its 2^bits cells into columns and rows. */
    const uint32_t columns = (index_bits + 1) / 2;
    uint32_t bits = index_bits;
    vuint stratum = cell;
    if (place == 0) {
        bits = columns;
        stratum = cell & vu_set((1u << columns) - 1u);
    } else if (place == 1) {
        bits = index_bits - columns;
        stratum = cell >> columns;
    }
    const vfloat u = (vi_to_float((vint)stratum) + jitter) * vf_set(1.0f / (float)(1u << bits));
    return vf_min(u, vf_set(TRC_BELOW_ONE));
}

/* ---- interface ---- */

vfloat trc_sample(const struct trc_sampler *sampler, vuint pixel, vuint index, uint32_t dimension) {
    vfloat u;
    trc_samples(sampler, pixel, index, dimension, 1, 0, 1, &u);
    return u;
}

void trc_samples(const struct trc_sampler *sampler, vuint pixel, vuint index, uint32_t dimension,
                 uint32_t n, uint32_t l, uint32_t count, vfloat *u) {
    /* At most 2^20 samples of 64 light samples: 26 bits. */
    const uint32_t bits = log2_ceiling(sampler->sample_count * count);
    if (count > 1)
        index = index * vu_set(count) + vu_set(l);
    if (sampler->kind == TRC_SAMPLER_BLUE_NOISE) {
        blue_numbers(sampler, pixel, index, bits, dimension, n, u);
        return;
    }
    const vuint key = vu_hash2(pixel, vu_set(sampler->seed));
    if (sampler->kind == TRC_SAMPLER_SOBOL) {
        sobol_numbers(sampler->table, key, index, bits, dimension, n, u);
        return;
    }
    for (uint32_t k = 0; k < n; k++) {
        const uint32_t d = dimension + k;
        if (sampler->kind == TRC_SAMPLER_SUDOKU)
            u[k] = sudoku_number(sampler, pixel, index, bits, d);
        else if (sampler->kind == TRC_SAMPLER_JITTER)
            u[k] = jitter_number(key, index, bits < 24 ? bits : 24, d);
        else
            u[k] = vu_to_unit(vu_hash(key ^ vu_hash(index + vu_set(d * 0x9e3779b9u))));
    }
}
