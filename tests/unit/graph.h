/* Node lists made line by line, and what becomes of them: for the tests of the material compiler.
 * Programs are run on the scalar kernels. */
#ifndef TRACER_TESTS_UNIT_GRAPH_H
#define TRACER_TESTS_UNIT_GRAPH_H

#define TRC_WIDTH 1
#define TRC_ISA scalar

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "core/core.h"
#include "kernels/program/program.h"
#include "model/program.h"
#include "shading/compile.h"

#define GRAPH_INLINE static inline __attribute__((unused))

#define MAX_GRAPH_NODES 4096
#define MAX_INPUTS (MAX_GRAPH_NODES * 4)

static struct graph {
    trc_node nodes[MAX_GRAPH_NODES];
    trc_node_input inputs[MAX_INPUTS];
    uint32_t node_count, input_count;
    int32_t surface;
    uint32_t flags;
    int32_t pass_index;
} graph;

GRAPH_INLINE void graph_clear(void) {
    memset(&graph, 0, sizeof graph);
    graph.surface = -1;
}

GRAPH_INLINE trc_node_input value(float x) {
    return (trc_node_input){.node = -1, .value = {x, x, x}};
}
GRAPH_INLINE trc_node_input color(float r, float g, float b) {
    return (trc_node_input){.node = -1, .value = {r, g, b}};
}
GRAPH_INLINE trc_node_input standard(void) { return (trc_node_input){.node = -2}; }
GRAPH_INLINE trc_node_input link_to(int32_t node, uint32_t output) {
    return (trc_node_input){.node = node, .output = output};
}

/* Adds a node and makes it the output if it is a shader; returns its number. */
GRAPH_INLINE int32_t add(uint32_t type, uint32_t mode, uint32_t count,
                         const trc_node_input *inputs) {
    trc_node *node = &graph.nodes[graph.node_count];
    *node = (trc_node){
        .type = type, .mode = mode, .first_input = graph.input_count, .input_count = count};
    for (uint32_t i = 0; i < count; i++)
        graph.inputs[graph.input_count++] = inputs[i];
    if (type < TRC_NODE_IMAGE)
        graph.surface = (int32_t)graph.node_count;
    return (int32_t)graph.node_count++;
}
#define ADD(type, mode, ...)                                                          \
    add(type, mode, sizeof((trc_node_input[]){__VA_ARGS__}) / sizeof(trc_node_input), \
        (trc_node_input[]){__VA_ARGS__})

GRAPH_INLINE int32_t add_diffuse(trc_node_input c) {
    return ADD(TRC_NODE_DIFFUSE, 0, c, value(0), standard());
}
GRAPH_INLINE int32_t add_emission(trc_node_input c, float strength) {
    return ADD(TRC_NODE_EMISSION, 0, c, value(strength));
}
GRAPH_INLINE int32_t add_mix(trc_node_input factor, int32_t first, int32_t second) {
    return ADD(TRC_NODE_MIX_SHADER, 0, factor, link_to(first, 0), link_to(second, 0));
}

enum { PRINCIPLED_INPUTS = 22 };
GRAPH_INLINE int32_t add_principled(uint32_t mode) {
    trc_node_input in[PRINCIPLED_INPUTS] = {color(.8f, .8f, .8f),
                                            value(0),
                                            color(1, 1, 1),
                                            value(0),
                                            value(.5f),
                                            value(0),
                                            value(.5f),
                                            value(0),
                                            value(0),
                                            value(0),
                                            value(.5f),
                                            value(0),
                                            value(.03f),
                                            value(1.45f),
                                            value(0),
                                            value(0),
                                            color(0, 0, 0),
                                            value(1),
                                            value(1),
                                            standard(),
                                            standard(),
                                            standard()};
    return add(TRC_NODE_PRINCIPLED, mode, PRINCIPLED_INPUTS, in);
}
GRAPH_INLINE trc_node_input *input_of(int32_t node, uint32_t input) {
    return &graph.inputs[graph.nodes[node].first_input + input];
}

/* ---- compiling ---- */

GRAPH_INLINE uint32_t index_of_image(const void *images, trc_id image) {
    (void)images;
    return image < 100 ? (uint32_t)image : UINT32_MAX;
}

/* Of an image that is there, all but the last ten. */
GRAPH_INLINE bool has_levels(const void *images, trc_id image) {
    (void)images;
    return image < 90;
}

static struct trc_names *names;

GRAPH_INLINE trc_status compile(struct trc_material **m) {
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = graph.node_count,
                                    .nodes = graph.nodes,
                                    .inputs = graph.inputs,
                                    .input_count = graph.input_count,
                                    .surface = graph.surface,
                                    .pass_index = graph.pass_index,
                                    .flags = graph.flags};
    const struct trc_compile_context context = {names, index_of_image, has_levels, NULL};
    return trc_material_compile(&desc, &context, m);
}

GRAPH_INLINE struct trc_material *compiled(void) {
    struct trc_material *m = NULL;
    const trc_status status = compile(&m);
    if (status != TRC_OK)
        fail_msg("status %d: %s", status, trc_last_message());
    return m;
}

GRAPH_INLINE uint32_t traits(void) {
    struct trc_material *m = compiled();
    const uint32_t has = m->has;
    trc_material_release(m);
    return has;
}

/* An Image node at a UV map. */
GRAPH_INLINE int32_t add_image(trc_id image, const char *uv) {
    const int32_t map = add(TRC_NODE_UV_MAP, 0, 0, NULL);
    graph.nodes[map].name = uv;
    const int32_t node = ADD(TRC_NODE_IMAGE, TRC_IMAGE_EXTEND, link_to(map, 0), value(0));
    graph.nodes[node].image = image;
    return node;
}

GRAPH_INLINE uint32_t count_op(const struct trc_material *m, uint32_t op) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < m->instruction_count; i++)
        count += m->instructions[i].op == op;
    return count;
}

/* The graph must be refused with that status and a message with these words. */
GRAPH_INLINE void refused(trc_status expected, const char *first, const char *second) {
    struct trc_material *m = NULL;
    const uint64_t bytes = trc_memory_bytes();
    const trc_status status = compile(&m);
    if (status != expected || !strstr(trc_last_message(), first) ||
        !strstr(trc_last_message(), second)) {
        fail_msg("status %d, message: %s", status, trc_last_message());
    }
    assert_null(m);
    assert_true(trc_memory_bytes() == bytes);
}

GRAPH_INLINE int setup(void **state) {
    (void)state;
    names = trc_names_create();
    return names ? 0 : -1;
}
GRAPH_INLINE int teardown(void **state) {
    (void)state;
    trc_names_destroy(names);
    return 0;
}

#endif
