/* What trc_abi_value looks up: abi_table.c is written by libtracer/tools/generate_abi.py. */
#ifndef TRACER_API_ABI_TABLE_H
#define TRACER_API_ABI_TABLE_H

#include <stddef.h>
#include <stdint.h>

struct trc_abi_entry {
    const char *name;
    int64_t value;
};

/* In the order of strcmp on the names. */
extern const struct trc_abi_entry trc_abi_entries[];
extern const size_t trc_abi_entry_count;

#endif
