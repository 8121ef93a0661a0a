/* For the C++ of the library alone: no exception leaves it. */
#ifndef TRACER_IMAGE_GUARDED_H
#define TRACER_IMAGE_GUARDED_H

#include <exception>
#include <new>

extern "C" {
#include "core/core.h"
}

/* Runs a function and turns what it throws into a status. task and object are for the message:
 * "cannot read the image" and a path. */
template <typename Function>
trc_status guarded(const char *task, const char *object, Function function) {
    try {
        return function();
    } catch (const std::bad_alloc &) {
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "%s %s: no memory", task, object);
    } catch (const std::exception &error) {
        return trc_fail(TRC_ERROR_IMAGE, "%s %s: %s", task, object, error.what());
    } catch (...) {
        return trc_fail(TRC_ERROR_IMAGE, "%s %s", task, object);
    }
}

#endif
