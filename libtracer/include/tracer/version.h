/* Version of the library, the add-on and their packages, and of the binary interface. */
#ifndef TRACER_VERSION_H
#define TRACER_VERSION_H

#define TRC_VERSION_MAJOR 0
#define TRC_VERSION_MINOR 1
#define TRC_VERSION_PATCH 0

/* Raised whenever a descriptor, an enumerator or a function changes incompatibly. A caller compares
 * it with trc_abi_version() before any other call. */
#define TRC_ABI_VERSION 10

#endif
