/* The versions of the library and of its interface. */
#include "tracer/tracer.h"

#define TEXT_(x) #x
#define TEXT(x) TEXT_(x)

uint32_t trc_abi_version(void) { return TRC_ABI_VERSION; }

const char *trc_version_string(void) {
    return TEXT(TRC_VERSION_MAJOR) "." TEXT(TRC_VERSION_MINOR) "." TEXT(TRC_VERSION_PATCH);
}
