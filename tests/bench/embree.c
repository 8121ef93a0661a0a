#include "embree.h"

#include <math.h>
#include <pmmintrin.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "buffers.h"
#include "core/core.h"

struct embree_device {
    RTCDevice device;
    uint32_t width; /* of the packets that the instruction set has natively */
    atomic_llong bytes;
};

struct embree_scene {
    struct embree_device *device;
    RTCScene scene;
    RTCGeometry geometry;
    const struct mesh *mesh;
    double build_seconds;
    uint64_t build_bytes;
};

static void check(const struct embree_device *d) {
    const enum RTCError error = rtcGetDeviceError(d->device);
    if (error == RTC_ERROR_NONE)
        return;
    fprintf(stderr, "tracer_bench: Embree failed with error %d\n", (int)error);
    exit(EXIT_FAILURE);
}

/* ---- device and scene ---- */

static bool count_memory(void *context, ssize_t bytes, bool post) {
    struct embree_device *d = context;
    (void)post;
    atomic_fetch_add(&d->bytes, bytes);
    return true;
}

struct embree_device *embree_open(uint32_t isa, uint32_t threads) {
    static const struct {
        const char *name;
        uint32_t width;
    } targets[] = {[TRC_ISA_SSE42] = {"sse4.2", 4},
                   [TRC_ISA_AVX2] = {"avx2", 8},
                   [TRC_ISA_AVX512] = {"avx512", 16}};
    char config[64];
    if (isa >= sizeof targets / sizeof *targets || !targets[isa].name)
        return NULL;
    struct embree_device *d = buffer_alloc(1, sizeof *d);
    snprintf(config, sizeof config, "isa=%s,threads=%u", targets[isa].name, threads);
    d->width = targets[isa].width;
    d->device = rtcNewDevice(config);
    if (!d->device) {
        free(d);
        return NULL;
    }
    rtcSetDeviceMemoryMonitorFunction(d->device, count_memory, d);
    check(d);
    return d;
}

void embree_close(struct embree_device *device) {
    if (!device)
        return;
    rtcReleaseDevice(device->device);
    free(device);
}

/* Embree's own buffers: it reads 16 bytes of the last vertex. */
static void copy_positions(struct embree_scene *s, const float *positions) {
    const size_t per_key = 3 * (size_t)s->mesh->vertex_count;
    for (uint32_t key = 0; key < s->mesh->key_count; key++) {
        void *to = rtcGetGeometryBufferData(s->geometry, RTC_BUFFER_TYPE_VERTEX, key);
        memcpy(to, positions + per_key * key, per_key * sizeof(float));
        rtcUpdateGeometryBuffer(s->geometry, RTC_BUFFER_TYPE_VERTEX, key);
    }
}

static void copy_mesh(struct embree_scene *s) {
    const struct mesh *mesh = s->mesh;
    const size_t triangle_bytes = 3 * sizeof(uint32_t), vertex_bytes = 3 * sizeof(float);
    rtcSetGeometryTimeStepCount(s->geometry, mesh->key_count);
    void *indices = rtcSetNewGeometryBuffer(s->geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            triangle_bytes, mesh->triangle_count);
    bool done = indices != NULL;
    for (uint32_t key = 0; key < mesh->key_count; key++)
        done = done && rtcSetNewGeometryBuffer(s->geometry, RTC_BUFFER_TYPE_VERTEX, key,
                                               RTC_FORMAT_FLOAT3, vertex_bytes, mesh->vertex_count);
    check(s->device);
    if (!done)
        return;
    memcpy(indices, mesh->indices, triangle_bytes * mesh->triangle_count);
    copy_positions(s, mesh->positions);
}

/* Of the geometry, which is attached to the scene. */
static void build(struct embree_scene *s) {
    rtcAttachGeometry(s->scene, s->geometry);
    const long long before = atomic_load(&s->device->bytes);
    const double start = trc_seconds();
    rtcCommitGeometry(s->geometry);
    rtcCommitScene(s->scene);
    s->build_seconds = trc_seconds() - start;
    s->build_bytes = (uint64_t)(atomic_load(&s->device->bytes) - before);
    check(s->device);
}

struct embree_scene *embree_scene_create(struct embree_device *device, const struct mesh *mesh,
                                         enum embree_use use) {
    struct embree_scene *s = buffer_alloc(1, sizeof *s);
    s->device = device;
    s->mesh = mesh;
    s->scene = rtcNewScene(device->device);
    s->geometry = rtcNewGeometry(device->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSceneFlags(s->scene, use == EMBREE_ROBUST  ? RTC_SCENE_FLAG_ROBUST
                               : use == EMBREE_POSED ? RTC_SCENE_FLAG_DYNAMIC
                                                     : RTC_SCENE_FLAG_NONE);
    if (use == EMBREE_POSED) { /* only scenes of low quality have a tree for each geometry */
        rtcSetSceneBuildQuality(s->scene, RTC_BUILD_QUALITY_LOW);
        rtcSetGeometryBuildQuality(s->geometry, RTC_BUILD_QUALITY_REFIT);
    }
    copy_mesh(s);
    build(s);
    return s;
}

/* ---- curves ---- */

static const struct {
    enum RTCGeometryType type;
    bool is_spline, has_flags;
} curve_types[] = {
    [EMBREE_ROUND_LINEAR] = {RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE, false, true},
    [EMBREE_FLAT_LINEAR] = {RTC_GEOMETRY_TYPE_FLAT_LINEAR_CURVE, false, false},
    [EMBREE_ROUND_CATMULL_ROM] = {RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE, true, false},
    [EMBREE_FLAT_CATMULL_ROM] = {RTC_GEOMETRY_TYPE_FLAT_CATMULL_ROM_CURVE, true, false}};

/* Strands one after the other, each with extra copies of its first and its last point, and the
 * first vertex of each segment with its neighbours' flags (NULL: none). */
static void copy_strands(const float *points, uint32_t strand_count, uint32_t point_count,
                         uint32_t extra, float *vertices, uint32_t *segments, uint8_t *flags) {
    const size_t point_bytes = 4 * sizeof(float);
    const uint32_t stride = point_count + 2 * extra, last = point_count - 1;
    for (uint32_t strand = 0; strand < strand_count; strand++) {
        const float *from = points + (size_t)4 * strand * point_count;
        float *to = vertices + (size_t)4 * strand * stride;
        for (uint32_t i = 0; i < extra; i++) {
            memcpy(to + 4 * i, from, point_bytes);
            memcpy(to + 4 * (extra + point_count + i), from + 4 * last, point_bytes);
        }
        memcpy(to + 4 * extra, from, point_bytes * point_count);
        for (uint32_t i = 0; i < last; i++) {
            segments[strand * last + i] = strand * stride + i;
            if (flags)
                flags[strand * last + i] =
                    (uint8_t)((i > 0 ? RTC_CURVE_FLAG_NEIGHBOR_LEFT : 0) |
                              (i + 1 < last ? RTC_CURVE_FLAG_NEIGHBOR_RIGHT : 0));
        }
    }
}

struct embree_scene *embree_curves_create(struct embree_device *device, enum embree_curve curve,
                                          const float *points, uint32_t strand_count,
                                          uint32_t point_count, uint32_t pieces) {
    const uint32_t extra = curve_types[curve].is_spline, segments = point_count - 1;
    struct embree_scene *s = buffer_alloc(1, sizeof *s);
    s->device = device;
    s->scene = rtcNewScene(device->device);
    s->geometry = rtcNewGeometry(device->device, curve_types[curve].type);
    if (curve == EMBREE_FLAT_CATMULL_ROM)
        rtcSetGeometryTessellationRate(s->geometry, (float)pieces);
    float *vertices = rtcSetNewGeometryBuffer(s->geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                              RTC_FORMAT_FLOAT4, 4 * sizeof(float),
                                              (size_t)strand_count * (point_count + 2 * extra));
    uint32_t *indices =
        rtcSetNewGeometryBuffer(s->geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT,
                                sizeof(uint32_t), (size_t)strand_count * segments);
    uint8_t *flags = NULL;
    if (curve_types[curve].has_flags)
        flags = rtcSetNewGeometryBuffer(s->geometry, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UCHAR, 1,
                                        (size_t)strand_count * segments);
    check(device);
    copy_strands(points, strand_count, point_count, extra, vertices, indices, flags);
    build(s);
    return s;
}

void embree_scene_destroy(struct embree_scene *scene) {
    if (!scene)
        return;
    rtcReleaseGeometry(scene->geometry);
    rtcReleaseScene(scene->scene);
    free(scene);
}

double embree_build_seconds(const struct embree_scene *scene) { return scene->build_seconds; }
uint64_t embree_build_bytes(const struct embree_scene *scene) { return scene->build_bytes; }

double embree_pose(struct embree_scene *scene, const float *positions) {
    copy_positions(scene, positions);
    const double start = trc_seconds();
    rtcCommitGeometry(scene->geometry);
    rtcCommitScene(scene->scene);
    const double seconds = trc_seconds() - start;
    check(scene->device);
    return seconds;
}

/* ---- rays ---- */

/* Structures of any width are arrays of 32-bit words in one order: word * width + lane. */
enum ray_word {
    WORD_ORIGIN = 0,
    WORD_TNEAR = 3,
    WORD_DIRECTION = 4,
    WORD_TIME = 7,
    WORD_TFAR = 8,
    WORD_MASK = 9,
    RAY_WORDS = 12,
    WORD_NORMAL = 12,
    WORD_U = 15,
    WORD_V = 16,
    WORD_TRIANGLE = 17,
    WORD_GEOMETRY = 18,
    WORD_INSTANCE = 19,
    RAY_HIT_WORDS = EMBREE_MAJOR >= 4 ? 21 : 20, /* with the instance's primitive */
    SINGLE_HIT_WORDS = (RAY_HIT_WORDS + 3) / 4 * 4
};
_Static_assert(sizeof(struct RTCRay) == 4 * RAY_WORDS, "RTCRay");
_Static_assert(sizeof(struct RTCRayHit) == 4 * SINGLE_HIT_WORDS, "RTCRayHit");
_Static_assert(sizeof(struct RTCRayHit4) == 16 * RAY_HIT_WORDS, "RTCRayHit4");
_Static_assert(sizeof(struct RTCRayHit8) == 32 * RAY_HIT_WORDS, "RTCRayHit8");
_Static_assert(sizeof(struct RTCRayHit16) == 64 * RAY_HIT_WORDS, "RTCRayHit16");

union word {
    float f;
    uint32_t u;
};

static size_t words_of(const struct contestant *c, const struct ray_list *list) {
    return list->any ? RAY_WORDS : c->width == 1 ? SINGLE_HIT_WORDS : RAY_HIT_WORDS;
}

static size_t batch_bytes(const struct contestant *c, const struct ray_list *list) {
    uint32_t most = 0;
    for (uint32_t i = 0; i < list->batch_count; i++)
        most = batch_rays(list, i) > most ? batch_rays(list, i) : most;
    const size_t blocks = (most + c->width - 1) / c->width;
    return (blocks * c->width * words_of(c, list) * sizeof(union word) + 63) / 64 * 64;
}

static void load(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                 void *memory) {
    const struct ray_set *rays = &list->rays;
    const uint32_t begin = list->batch_begin[batch], count = batch_rays(list, batch), w = c->width;
    for (uint32_t i = 0; i < count; i++) {
        union word *block = (union word *)memory + i / w * w * words_of(c, list) + i % w;
        for (uint32_t k = 0; k < 3; k++) {
            block[(WORD_ORIGIN + k) * w].f = rays->origin[k][begin + i];
            block[(WORD_DIRECTION + k) * w].f = rays->direction[k][begin + i];
        }
        block[WORD_TNEAR * w].f = rays->tmin[begin + i];
        block[WORD_TFAR * w].f = rays->tmax[begin + i];
        block[WORD_TIME * w].f = rays->time[begin + i];
        block[WORD_MASK * w].u = UINT32_MAX;
        if (list->any)
            continue;
        block[WORD_GEOMETRY * w].u = RTC_INVALID_GEOMETRY_ID;
        block[WORD_INSTANCE * w].u = RTC_INVALID_GEOMETRY_ID;
    }
}

static void store(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  const void *memory, struct hit_set *hits) {
    const uint32_t begin = list->batch_begin[batch], count = batch_rays(list, batch), w = c->width;
    for (uint32_t i = 0; i < count; i++) {
        const union word *block =
            (const union word *)memory + i / w * w * words_of(c, list) + i % w;
        hits->occluded[begin + i] = list->any && block[WORD_TFAR * w].f == -INFINITY;
        if (list->any)
            continue;
        const bool hit = block[WORD_GEOMETRY * w].u != RTC_INVALID_GEOMETRY_ID;
        hits->instance[begin + i] = hit ? 0 : TRC_NO_HIT;
        hits->triangle[begin + i] = block[WORD_TRIANGLE * w].u;
        hits->distance[begin + i] = block[WORD_TFAR * w].f;
        hits->u[begin + i] = block[WORD_U * w].f;
        hits->v[begin + i] = block[WORD_V * w].f;
        for (uint32_t k = 0; k < 3; k++)
            hits->normal[k][begin + i] = block[(WORD_NORMAL + k) * w].f;
    }
}

/* ---- modes ---- */

/* What goes with a query: a context in version 3, arguments for each kind of query in version 4. */
#if EMBREE_MAJOR >= 4
struct query {
    struct RTCIntersectArguments closest;
    struct RTCOccludedArguments any;
};

static void query_init(const struct contestant *c, struct query *q) {
    rtcInitIntersectArguments(&q->closest);
    rtcInitOccludedArguments(&q->any);
    q->closest.flags = q->any.flags =
        c->coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
}

#define CLOSEST_1(scene, query, hit) rtcIntersect1(scene, hit, &(query)->closest)
#define ANY_1(scene, query, ray) rtcOccluded1(scene, ray, &(query)->any)
#define CLOSEST_W(W, valid, scene, query, hit) rtcIntersect##W(valid, scene, hit, &(query)->closest)
#define ANY_W(W, valid, scene, query, ray) rtcOccluded##W(valid, scene, ray, &(query)->any)
#else
struct query {
    struct RTCIntersectContext context;
};

static void query_init(const struct contestant *c, struct query *q) {
    rtcInitIntersectContext(&q->context);
    q->context.flags =
        c->coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
}

#define CLOSEST_1(scene, query, hit) rtcIntersect1(scene, &(query)->context, hit)
#define ANY_1(scene, query, ray) rtcOccluded1(scene, &(query)->context, ray)
#define CLOSEST_W(W, valid, scene, query, hit) rtcIntersect##W(valid, scene, &(query)->context, hit)
#define ANY_W(W, valid, scene, query, ray) rtcOccluded##W(valid, scene, &(query)->context, ray)
#endif

/* What Embree's manual asks for. Returns the former state. */
static unsigned denormals_off(void) {
    const unsigned former = _mm_getcsr();
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    return former;
}

static void trace_single(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                         void *memory) {
    const struct embree_scene *s = c->tracer;
    const uint32_t count = batch_rays(list, batch);
    const unsigned former = denormals_off();
    struct query query;
    query_init(c, &query);
    if (list->any)
        for (uint32_t i = 0; i < count; i++)
            ANY_1(s->scene, &query, (struct RTCRay *)memory + i);
    else
        for (uint32_t i = 0; i < count; i++)
            CLOSEST_1(s->scene, &query, (struct RTCRayHit *)memory + i);
    _mm_setcsr(former);
}

#if EMBREE_MAJOR < 4 /* which has no streams */
static void trace_stream(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                         void *memory) {
    const struct embree_scene *s = c->tracer;
    const uint32_t count = batch_rays(list, batch);
    const unsigned former = denormals_off();
    struct query query;
    query_init(c, &query);
    if (list->any)
        rtcOccluded1M(s->scene, &query.context, memory, count, sizeof(struct RTCRay));
    else
        rtcIntersect1M(s->scene, &query.context, memory, count, sizeof(struct RTCRayHit));
    _mm_setcsr(former);
}

static bool has_streams(const struct embree_scene *s) {
    return rtcGetDeviceProperty(s->device->device, RTC_DEVICE_PROPERTY_RAY_STREAM_SUPPORTED);
}
#endif

/* trace_packet_W: the last packet may have fewer rays. */
#define DEFINE_TRACE_PACKET(W)                                                                \
    static void trace_packet_##W(const struct contestant *c, const struct ray_list *list,     \
                                 uint32_t batch, void *memory) {                              \
        const struct embree_scene *s = c->tracer;                                             \
        const uint32_t count = batch_rays(list, batch);                                       \
        int valid[W] __attribute__((aligned(64)));                                            \
        const unsigned former = denormals_off();                                              \
        struct query query;                                                                   \
        query_init(c, &query);                                                                \
        memset(valid, 0xff, sizeof valid);                                                    \
        for (uint32_t i = 0; i < count; i += W) {                                             \
            for (uint32_t lane = count - i; lane < W; lane++)                                 \
                valid[lane] = 0;                                                              \
            if (list->any)                                                                    \
                ANY_W(W, valid, s->scene, &query, (struct RTCRay##W *)memory + i / W);        \
            else                                                                              \
                CLOSEST_W(W, valid, s->scene, &query, (struct RTCRayHit##W *)memory + i / W); \
        }                                                                                     \
        _mm_setcsr(former);                                                                   \
    }
DEFINE_TRACE_PACKET(4)
DEFINE_TRACE_PACKET(8)
DEFINE_TRACE_PACKET(16)

uint32_t embree_contestants(const struct embree_scene *scene, struct contestant out[EMBREE_MODES]) {
    static const struct contestant_calls single = {batch_bytes, load, trace_single, store};
    static const struct contestant_calls packet4 = {batch_bytes, load, trace_packet_4, store};
    static const struct contestant_calls packet8 = {batch_bytes, load, trace_packet_8, store};
    static const struct contestant_calls packet16 = {batch_bytes, load, trace_packet_16, store};
    const uint32_t w = scene->device->width;
    const struct contestant_calls *packet = w == 16 ? &packet16 : w == 8 ? &packet8 : &packet4;
    uint32_t count = 0;
    out[count++] = (struct contestant){&single, "single", scene, 1, false};
    for (int coherent = 0; coherent < 2; coherent++) {
        const char *suffix = coherent ? "_coherent" : "";
        out[count] = (struct contestant){packet, "", scene, w, coherent};
        snprintf(out[count].name, sizeof out[count].name, "packet%u%s", w, suffix);
        count++;
    }
#if EMBREE_MAJOR < 4
    static const struct contestant_calls stream = {batch_bytes, load, trace_stream, store};
    for (int coherent = 0; coherent < 2 && has_streams(scene); coherent++) {
        const char *suffix = coherent ? "_coherent" : "";
        out[count] = (struct contestant){&stream, "", scene, 1, coherent};
        snprintf(out[count].name, sizeof out[count].name, "stream%s", suffix);
        count++;
    }
#endif
    return count;
}
