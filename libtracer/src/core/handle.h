/* The registry of scenes, renders and readers: the one mutable state of the process besides the
 * instruction set and the memory counters. A handle is a slot and a generation, so stale and
 * foreign values are told apart from living ones. An object that is in use is pinned; removing
 * waits for the pins. */
#ifndef TRACER_CORE_HANDLE_H
#define TRACER_CORE_HANDLE_H

#include <stdint.h>

#include "tracer/base.h"

enum trc_handle_kind { TRC_HANDLE_SCENE = 1, TRC_HANDLE_RENDER = 2, TRC_HANDLE_READER = 3 };

/* Makes object known. On failure (OUT_OF_MEMORY) handle_out is untouched. */
trc_status trc_handle_create(enum trc_handle_kind kind, void *object, uint64_t *handle_out);

/* Pins the object of a handle: it stays until trc_handle_release. INVALID_HANDLE, with a message,
 * for a null, stale or foreign handle. */
trc_status trc_handle_acquire(uint64_t handle, enum trc_handle_kind kind, void **object_out);
void trc_handle_release(uint64_t handle);

/* Makes the handle stale, so that nobody can pin the object any more, and waits until all pins but
 * the caller's (who must hold one) are gone: then the object is the caller's alone and the pin is
 * gone too. INVALID_HANDLE if another thread was first: the caller's pin is released then. Whatever
 * keeps another thread in the object must have been asked to stop before. */
trc_status trc_handle_remove(uint64_t handle);

/* A number no other call has returned: seeds the generations of ids of a scene. */
uint32_t trc_handle_serial(void);

#endif
