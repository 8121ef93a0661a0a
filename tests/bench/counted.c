/* The kernels of an instruction set of their own, as wide as the scalar one. */
#undef TRC_ISA
#define TRC_ISA counted

#include "counted.h"

#include <stdlib.h>

#include "buffers.h"
#include "volley.h"

#define TRC_COUNT(what, amount) (counted_steps.what += (uint64_t)(amount))
#include "kernels/trace/trace.c"

struct trace_counts counted_steps;

struct trace_counts counted_trace(const struct trc_snapshot *snapshot,
                                  const struct ray_list *list) {
    static const struct packet_kernels kernels = {trc_trace_closest_counted,
                                                  trc_trace_occluded_counted};
    const struct volley volley = {snapshot, &kernels};
    const struct contestant c = volley_contestant(&volley);
    void *memory = buffer_alloc(1, c.calls->batch_bytes(&c, list));
    counted_steps = (struct trace_counts){0};
    for (uint32_t batch = 0; batch < list->batch_count; batch++) {
        c.calls->load(&c, list, batch, memory);
        c.calls->trace(&c, list, batch, memory);
    }
    free(memory);
    return counted_steps;
}
