#include "volley.h"

#include <string.h>

#include "core/fpstate.h"

struct packet_slot {
    struct trc_packet packet;
    struct trc_packet_hits hits;
    uint64_t occluded;
} __attribute__((aligned(64)));

static uint32_t packets_of(const struct ray_list *list, uint32_t batch) {
    return list->batch_packet[batch + 1] - list->batch_packet[batch];
}

static size_t batch_bytes(const struct contestant *c, const struct ray_list *list) {
    uint32_t most = 0;
    (void)c;
    for (uint32_t i = 0; i < list->batch_count; i++)
        most = packets_of(list, i) > most ? packets_of(list, i) : most;
    return most * sizeof(struct packet_slot);
}

static void load(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                 void *memory) {
    struct packet_slot *slot = memory;
    const struct ray_set *rays = &list->rays;
    (void)c;
    for (uint32_t i = list->batch_packet[batch]; i < list->batch_packet[batch + 1]; i++, slot++) {
        struct trc_packet *p = &slot->packet;
        const uint32_t begin = list->packet_begin[i], count = list->packet_begin[i + 1] - begin;
        const size_t bytes = count * sizeof(float);
        for (int k = 0; k < 3; k++) {
            memcpy(p->o[k], rays->origin[k] + begin, bytes);
            memcpy(p->d[k], rays->direction[k] + begin, bytes);
        }
        memcpy(p->tmin, rays->tmin + begin, bytes);
        memcpy(p->t, rays->tmax + begin, bytes);
        memcpy(p->time, rays->time + begin, bytes);
        p->active = count < TRC_PACKET_SIZE ? (1ull << count) - 1 : ~0ull;
        p->visibility = TRC_VISIBLE_ALL;
        p->common_origin = list->common_origin;
        p->skip_transparent = false;
        memset(slot->hits.instance, 0xff, sizeof slot->hits.instance);
    }
}

static void trace(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  void *memory) {
    const struct volley *v = c->tracer;
    struct packet_slot *slot = memory;
    const uint32_t count = packets_of(list, batch);
    const uint64_t fp_state = trc_fp_enter();
    if (list->any)
        for (uint32_t i = 0; i < count; i++)
            slot[i].occluded = v->kernels->occluded(v->snapshot, &slot[i].packet);
    else
        for (uint32_t i = 0; i < count; i++)
            v->kernels->closest(v->snapshot, &slot[i].packet, &slot[i].hits);
    trc_fp_leave(fp_state);
}

static void store(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  const void *memory, struct hit_set *hits) {
    const struct packet_slot *slot = memory;
    (void)c;
    for (uint32_t i = list->batch_packet[batch]; i < list->batch_packet[batch + 1]; i++, slot++) {
        const uint32_t begin = list->packet_begin[i], count = list->packet_begin[i + 1] - begin;
        for (uint32_t k = 0; k < count; k++) {
            hits->occluded[begin + k] = list->any && (slot->occluded >> k & 1u);
            hits->instance[begin + k] = slot->hits.instance[k];
            hits->triangle[begin + k] = slot->hits.triangle[k];
            hits->distance[begin + k] = slot->packet.t[k];
            hits->u[begin + k] = slot->hits.u[k];
            hits->v[begin + k] = slot->hits.v[k];
        }
    }
}

struct contestant volley_contestant(const struct volley *volley) {
    static const struct contestant_calls calls = {batch_bytes, load, trace, store};
    return (struct contestant){.calls = &calls, .name = "volley", .tracer = volley};
}
