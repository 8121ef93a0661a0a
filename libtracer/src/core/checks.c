#include "core/checks.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "tracer/version.h"

bool trc_multiply_u64(uint64_t a, uint64_t b, uint64_t *out) {
    if (b && a > UINT64_MAX / b)
        return false;
    *out = a * b;
    return true;
}

trc_status trc_check_struct(const void *desc, size_t expected_size, const char *name) {
    TRC_TRY(trc_check_out(desc, _Alignof(uint64_t), name));
    uint32_t size;
    memcpy(&size, desc, sizeof size);
    if (size != expected_size) {
        return trc_fail(TRC_ERROR_STRUCT_SIZE,
                        "%s: struct_size is %" PRIu32 ", this library (ABI %d) has %zu", name, size,
                        TRC_ABI_VERSION, expected_size);
    }
    return TRC_OK;
}

trc_status trc_check_out(const void *out, size_t alignment, const char *name) {
    if (!out)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
    if ((uintptr_t)out % alignment) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s is not aligned to %zu bytes", name,
                        alignment);
    }
    return TRC_OK;
}

trc_status trc_check_array(const void *data, uint64_t count, uint64_t expected_count,
                           size_t element_size, size_t alignment, const char *name) {
    uint64_t bytes;
    if (!trc_multiply_u64(count, element_size, &bytes) || bytes > PTRDIFF_MAX ||
        !trc_multiply_u64(expected_count, element_size, &bytes) || bytes > PTRDIFF_MAX) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "%s: %" PRIu64 " elements exceed the address space",
                        name, count > expected_count ? count : expected_count);
    }
    if (count != expected_count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "%s: the buffer has %" PRIu64 " elements, %" PRIu64 " are needed", name,
                        count, expected_count);
    }
    if (!expected_count)
        return TRC_OK;
    return trc_check_out(data, alignment, name);
}

trc_status trc_check_count(uint64_t value, uint64_t low, uint64_t high, const char *name) {
    if (value < low) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s is %" PRIu64 ", at least %" PRIu64, name,
                        value, low);
    }
    if (value > high) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "%s is %" PRIu64 ", at most %" PRIu64, name, value,
                        high);
    }
    return TRC_OK;
}

trc_status trc_check_enum(uint32_t value, uint32_t count, const char *name) {
    if (value >= count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "%s is %" PRIu32 ", which is none of the %" PRIu32 " values it can have",
                        name, value, count);
    }
    return TRC_OK;
}

trc_status trc_check_float(float value, float low, float high, const char *name) {
    if (!(value >= low && value <= high)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s is %g, out of [%g, %g]", name,
                        (double)value, (double)low, (double)high);
    }
    return TRC_OK;
}

trc_status trc_check_finite(const float *values, size_t count, const char *name) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s: value %zu is not finite", name, i);
        }
    }
    return TRC_OK;
}

trc_status trc_check_indices(const uint32_t *indices, uint64_t count, uint64_t vertex_count) {
    for (uint64_t i = 0; i < count; i++) {
        if (indices[i] >= vertex_count) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "index %" PRIu64 " (triangle %" PRIu64 ") is %" PRIu32
                            ", but the mesh has %" PRIu64 " vertices",
                            i, i / 3, indices[i], vertex_count);
        }
    }
    return TRC_OK;
}
