/* The public call on values of the interface. */
#include <stdlib.h>
#include <string.h>

#include "api/abi_table.h"
#include "core/checks.h"
#include "core/core.h"
#include "tracer/tracer.h"

static int compare_names(const void *name, const void *entry) {
    return strcmp(name, ((const struct trc_abi_entry *)entry)->name);
}

trc_status trc_abi_value(const char *name, int64_t *value_out) {
    TRC_TRY(trc_check_out(name, 1, "name"));
    TRC_TRY(trc_check_out(value_out, sizeof *value_out, "value_out"));
    const struct trc_abi_entry *entry =
        bsearch(name, trc_abi_entries, trc_abi_entry_count, sizeof *trc_abi_entries, compare_names);
    if (!entry)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "this version has no %s", name);
    *value_out = entry->value;
    return TRC_OK;
}
