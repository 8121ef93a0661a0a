/* Status codes, handles and conventions of the whole interface.
 *
 * Conventions: metres, radians, time as a fraction of the shutter interval [0, 1], scene-linear
 * Rec.709 colour, right-handed coordinates with Z up, column vectors. A transform is 12 floats, the
 * three rows of a 3x4 matrix (row-major), so that p_world = M * (p_object, 1).
 *
 * Descriptors begin with struct_size, the size of the structure that the caller was compiled with:
 * TRC_ERROR_STRUCT_SIZE if the library's is another. trc_NAME_default() fills a whole one in, with
 * values that are valid unless its comment says what is still to be set; pointers in it, if any,
 * are to memory of the library that always stays.
 *
 * Ownership: the library copies everything a descriptor points to before the call returns; nothing
 * that the caller passes is kept. What the library writes goes to memory of the caller.
 *
 * Errors: every function returns a status. On anything but TRC_OK the outputs are untouched, the
 * object is as it was before the call, and trc_last_message() says what was wrong. The library
 * never prints, exits, aborts, installs signal handlers or changes the caller's floating-point
 * state.
 *
 * Threads: functions on different scenes or renders may run at once. Functions on one scene must
 * not overlap, except trc_scene_cancel. Functions on one render may be called from any thread. */
#ifndef TRACER_BASE_H
#define TRACER_BASE_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define TRC_API __declspec(dllexport)
#else
#define TRC_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
#define TRC_BEGIN_DECLS extern "C" {
#define TRC_END_DECLS }
#else
#define TRC_BEGIN_DECLS
#define TRC_END_DECLS
#endif

TRC_BEGIN_DECLS

typedef int32_t trc_status;
enum trc_status_code {
    TRC_OK = 0,
    TRC_ERROR_INVALID_ARGUMENT = 1, /* a value is out of its documented range */
    TRC_ERROR_INVALID_HANDLE = 2,   /* null, stale, foreign or already destroyed */
    TRC_ERROR_STRUCT_SIZE = 3,      /* struct_size is not the one of this ABI version */
    TRC_ERROR_TOO_LARGE = 4,        /* a count or a size exceeds the limit or the address space */
    TRC_ERROR_OUT_OF_MEMORY = 5,
    TRC_ERROR_NO_THREAD = 6,     /* the system refused to start a thread */
    TRC_ERROR_NOT_COMMITTED = 7, /* the scene has no committed snapshot yet */
    TRC_ERROR_CANCELLED = 8,
    TRC_ERROR_UNSUPPORTED = 9, /* this build or this CPU cannot do it */
    TRC_ERROR_IMAGE = 10,      /* an image file is missing or damaged */
    TRC_ERROR_FORMAT = 11      /* an image file is in no format that can be read */
};

/* Generation-checked names of objects. 0 is never a valid one. A scene, render or reader handle is
 * unique in the process; an id is unique in its scene. */
typedef uint64_t trc_scene;
typedef uint64_t trc_render;
typedef uint64_t trc_reader;
typedef uint64_t trc_id;

/* Instruction sets the kernels are built for, in rising order. */
enum trc_isa_id {
    TRC_ISA_AUTO = 0,
    TRC_ISA_SCALAR = 1,
    TRC_ISA_SSE42 = 2,
    TRC_ISA_AVX2 = 3,
    TRC_ISA_AVX512 = 4,
    TRC_ISA_NEON = 5
};

/* The ABI version the library was built with: TRC_ABI_VERSION. Compare it before any other call. */
TRC_API uint32_t trc_abi_version(void);

/* "0.1.0"; static storage. */
TRC_API const char *trc_version_string(void);

/* The message of the last failed call on this thread, UTF-8, "" if none; valid until the next call
 * of the library on this thread. */
TRC_API const char *trc_last_message(void);

/* What the library was compiled with, so that a binding for another language can check its own
 * declarations. name: an enumerator or a numeric macro ("TRC_LIGHT_SUN", "TRC_MAX_KEYS"); a
 * structure, for its size in bytes ("trc_mesh_desc"); a field, for its offset
 * ("trc_mesh_desc.indices"). TRC_ERROR_INVALID_ARGUMENT for any other. */
TRC_API trc_status trc_abi_value(const char *name, int64_t *value_out);

/* The instruction set kernels run on: the best that CPU and operating system offer, unless the
 * environment variable TRACER_ISA (scalar, sse42, avx2, avx512, neon) named a lower one when the
 * library was first used. */
TRC_API uint32_t trc_isa(void);

/* Chooses a lower instruction set for commits, renders and queries that start afterwards, of all
 * scenes; TRC_ISA_AUTO returns to the best. Snapshots serve every set: trees have the same bits
 * whichever builds or refits them, so hits are the same, and commits go on from what another set
 * has built. A picture's bits may depend on the set that renders it, not on the one that committed
 * its scene. TRC_ERROR_UNSUPPORTED if this CPU or build lacks it. */
TRC_API trc_status trc_set_isa(uint32_t isa);

/* "avx512" etc.; "unknown" for a value that is not an ISA. */
TRC_API const char *trc_isa_name(uint32_t isa);

/* Lights, instances that emit and the world can each be in one of so many light groups, from 1 on;
 * 0 is none. */
#define TRC_MAX_LIGHT_GROUPS 32

TRC_END_DECLS

#endif
