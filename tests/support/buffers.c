#include "buffers.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void *buffer_alloc(size_t count, size_t size) {
    const size_t limit = SIZE_MAX / 2;
    void *block = NULL;
    if (!size || count <= limit / size) {
        const size_t bytes = (count * size + 63) / 64 * 64;
#ifdef _WIN32 /* what is aligned to more than vectors of SSE is not for free() */
        block = malloc(bytes ? bytes : 64);
#else
        block = aligned_alloc(64, bytes ? bytes : 64);
#endif
        if (block)
            memset(block, 0, bytes);
    }
    if (!block) {
        fprintf(stderr, "no memory for %zu elements of %zu bytes\n", count, size);
        exit(EXIT_FAILURE);
    }
    return block;
}

void *buffer_grow(void *block, size_t used_bytes, size_t count, size_t size) {
    void *larger = buffer_alloc(count, size);
    if (used_bytes)
        memcpy(larger, block, used_bytes);
    free(block);
    return larger;
}
