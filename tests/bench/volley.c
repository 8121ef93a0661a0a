#include "volley.h"

#include <string.h>

#include "core/fpstate.h"

/* A batch's packets, their hits, and what of them is occluded. */
struct batch {
    struct trc_packet *packets;
    struct trc_packet_hits *hits;
    uint64_t *occluded;
};

static uint32_t packets_of(const struct ray_list *list, uint32_t batch) {
    return list->batch_packet[batch + 1] - list->batch_packet[batch];
}

static struct batch batch_in(void *memory, uint32_t packet_count) {
    struct batch b = {.packets = memory};
    b.hits = (struct trc_packet_hits *)(b.packets + packet_count);
    b.occluded = (uint64_t *)(b.hits + packet_count);
    return b;
}

static size_t batch_bytes(const struct contestant *c, const struct ray_list *list) {
    uint32_t most = 0;
    (void)c;
    for (uint32_t i = 0; i < list->batch_count; i++)
        most = packets_of(list, i) > most ? packets_of(list, i) : most;
    const size_t bytes =
        sizeof(struct trc_packet) + sizeof(struct trc_packet_hits) + sizeof(uint64_t);
    return (most * bytes + 63) & ~(size_t)63;
}

static void load(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                 void *memory) {
    const struct batch b = batch_in(memory, packets_of(list, batch));
    const struct ray_set *rays = &list->rays;
    (void)c;
    for (uint32_t k = 0; k < packets_of(list, batch); k++) {
        const uint32_t i = list->batch_packet[batch] + k;
        struct trc_packet *p = &b.packets[k];
        const uint32_t begin = list->packet_begin[i], count = list->packet_begin[i + 1] - begin;
        const size_t bytes = count * sizeof(float);
        for (int axis = 0; axis < 3; axis++) {
            memcpy(p->o[axis], rays->origin[axis] + begin, bytes);
            memcpy(p->d[axis], rays->direction[axis] + begin, bytes);
        }
        memcpy(p->tmin, rays->tmin + begin, bytes);
        memcpy(p->t, rays->tmax + begin, bytes);
        memcpy(p->time, rays->time + begin, bytes);
        p->active = count < TRC_PACKET_SIZE ? (1ull << count) - 1 : ~0ull;
        p->visibility = TRC_VISIBLE_ALL;
        p->common_origin = list->common_origin;
        p->skip_transparent = false;
        p->left = NULL;
        memset(b.hits[k].instance, 0xff, sizeof b.hits[k].instance);
    }
}

/* How many of the packets from there on go together. */
static uint32_t bundle_at(const struct ray_list *list, uint32_t packet, uint32_t left) {
    uint32_t n = 1;
    while (n < left && n < list->bundle && list->packet_key[packet + n] == list->packet_key[packet])
        n++;
    return n;
}

static void trace(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  void *memory) {
    const struct volley *v = c->tracer;
    const uint32_t count = packets_of(list, batch);
    const struct batch b = batch_in(memory, count);
    const uint64_t fp_state = trc_fp_enter();
    for (uint32_t i = 0; i < count;) {
        const uint32_t n = bundle_at(list, list->batch_packet[batch] + i, count - i);
        if (list->any)
            v->kernels->occluded(v->snapshot, &b.packets[i], n, &b.occluded[i]);
        else
            v->kernels->closest(v->snapshot, &b.packets[i], &b.hits[i], n);
        i += n;
    }
    trc_fp_leave(fp_state);
}

static void store(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  const void *memory, struct hit_set *hits) {
    const struct batch b = batch_in((void *)memory, packets_of(list, batch));
    (void)c;
    for (uint32_t i = 0; i < packets_of(list, batch); i++) {
        const uint32_t packet = list->batch_packet[batch] + i, begin = list->packet_begin[packet];
        const uint32_t count = list->packet_begin[packet + 1] - begin;
        for (uint32_t k = 0; k < count; k++) {
            hits->occluded[begin + k] = list->any && (b.occluded[i] >> k & 1u);
            hits->instance[begin + k] = b.hits[i].instance[k];
            hits->triangle[begin + k] = b.hits[i].triangle[k];
            hits->distance[begin + k] = b.packets[i].t[k];
            hits->u[begin + k] = b.hits[i].u[k];
            hits->v[begin + k] = b.hits[i].v[k];
        }
    }
}

struct contestant volley_contestant(const struct volley *volley) {
    static const struct contestant_calls calls = {batch_bytes, load, trace, store};
    return (struct contestant){.calls = &calls, .name = "volley", .tracer = volley};
}
