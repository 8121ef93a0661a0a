/* Checks of what a caller passes, shared by the entry points. Each returns TRC_OK, or an error
 * whose message names the argument. */
#ifndef TRACER_CORE_CHECKS_H
#define TRACER_CORE_CHECKS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tracer/base.h"

/* a * b without overflow; false leaves out alone. */
bool trc_multiply_u64(uint64_t a, uint64_t b, uint64_t *out);

/* A descriptor that starts with struct_size: not NULL, aligned, of this version's size. */
trc_status trc_check_struct(const void *desc, size_t expected_size, const char *name);

/* A place for one result of that alignment: not NULL, aligned. */
trc_status trc_check_out(const void *out, size_t alignment, const char *name);

/* An array of exactly expected_count elements, of which the caller says it has count: counts
 * equal, bytes within the address space, data aligned and, unless it has no elements, not NULL. */
trc_status trc_check_array(const void *data, uint64_t count, uint64_t expected_count,
                           size_t element_size, size_t alignment, const char *name);

/* low <= value <= high: INVALID_ARGUMENT below, TOO_LARGE above. */
trc_status trc_check_count(uint64_t value, uint64_t low, uint64_t high, const char *name);

/* value < count, for enumerations. */
trc_status trc_check_enum(uint32_t value, uint32_t count, const char *name);

/* low <= value <= high; NaN fails. */
trc_status trc_check_float(float value, float low, float high, const char *name);

/* Every one of count floats is finite. */
trc_status trc_check_finite(const float *values, size_t count, const char *name);

/* Every one of count indices of triangles' corners is below vertex_count. */
trc_status trc_check_indices(const uint32_t *indices, uint64_t count, uint64_t vertex_count);

/* Returns from the calling function on an error. */
#define TRC_TRY(call)                          \
    do {                                       \
        const trc_status try_status_ = (call); \
        if (try_status_ != TRC_OK)             \
            return try_status_;                \
    } while (0)

#endif
