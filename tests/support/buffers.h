/* Memory of tests and the benchmark: the program ends when there is none. */
#ifndef TRACER_TESTS_BUFFERS_H
#define TRACER_TESTS_BUFFERS_H

#include <stddef.h>

/* count * size zeroed bytes, aligned to 64; for free(). */
void *buffer_alloc(size_t count, size_t size);

/* A larger copy of a block from buffer_alloc (or NULL) of used bytes; frees the old one. */
void *buffer_grow(void *block, size_t used_bytes, size_t count, size_t size);

#endif
