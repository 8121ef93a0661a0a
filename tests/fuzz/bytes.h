/* What a fuzzer's input is read as: bytes, numbers, small counts. Reads beyond its end give 0, so
 * that any input is a whole one. */
#ifndef TRACER_TESTS_FUZZ_BYTES_H
#define TRACER_TESTS_FUZZ_BYTES_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct bytes {
    const uint8_t *at;
    size_t left;
};

static inline void bytes_read(struct bytes *b, void *out, size_t size) {
    const size_t n = size < b->left ? size : b->left;
    memset(out, 0, size);
    if (n)
        memcpy(out, b->at, n);
    b->at += n;
    b->left -= n;
}
static inline uint8_t bytes_byte(struct bytes *b) {
    uint8_t x;
    bytes_read(b, &x, sizeof x);
    return x;
}
/* In [0, limit). */
static inline uint32_t bytes_below(struct bytes *b, uint32_t limit) {
    return bytes_byte(b) % limit;
}
/* Mostly an ordinary number in [-4, 4], sometimes any bit pattern. */
static inline float bytes_float(struct bytes *b) {
    const uint8_t kind = bytes_byte(b);
    if (kind >= 16)
        return (float)((int)kind - 136) / 30.0f;
    float x;
    bytes_read(b, &x, sizeof x);
    return x;
}
static inline void bytes_floats(struct bytes *b, float *out, size_t count) {
    for (size_t i = 0; i < count; i++)
        out[i] = bytes_float(b);
}

#endif
