/* Node lists of materials, made node by node, for tests that render. Needs no cmocka. */
#ifndef TRACER_TESTS_NODE_LIST_H
#define TRACER_TESTS_NODE_LIST_H

#include <string.h>

#include "tracer/tracer.h"

#define NODE_LIST_INLINE static inline __attribute__((unused))

#define NODE_LIST_NODES 16
#define NODE_LIST_INPUTS 128

struct node_list {
    trc_node nodes[NODE_LIST_NODES];
    trc_node_input inputs[NODE_LIST_INPUTS];
    uint32_t node_count, input_count;
};

/* Values of inputs: a number, a colour, the output of a node, what an unlinked input means. */
NODE_LIST_INLINE trc_node_input node_number(float x) {
    return (trc_node_input){.node = -1, .value = {x, x, x}};
}
NODE_LIST_INLINE trc_node_input node_color(float r, float g, float b) {
    return (trc_node_input){.node = -1, .value = {r, g, b}};
}
NODE_LIST_INLINE trc_node_input node_link(uint32_t node, uint32_t output) {
    return (trc_node_input){.node = (int32_t)node, .output = output};
}
NODE_LIST_INLINE trc_node_input node_standard(void) { return (trc_node_input){.node = -2}; }

/* Adds a node with its inputs; returns its number. NODE_ADD counts the inputs. */
NODE_LIST_INLINE uint32_t node_add(struct node_list *list, uint32_t type, uint32_t mode,
                                   uint32_t count, const trc_node_input *inputs) {
    list->nodes[list->node_count] = (trc_node){
        .type = type, .mode = mode, .first_input = list->input_count, .input_count = count};
    memcpy(list->inputs + list->input_count, inputs, count * sizeof *inputs);
    list->input_count += count;
    return list->node_count++;
}
#define NODE_ADD(list, type, mode, ...)                                              \
    node_add(list, type, mode,                                                       \
             sizeof((const trc_node_input[]){__VA_ARGS__}) / sizeof(trc_node_input), \
             (const trc_node_input[]){__VA_ARGS__})

/* The material of that surface; it points into the list. */
NODE_LIST_INLINE trc_material_desc node_list_material(const struct node_list *list,
                                                      uint32_t surface) {
    return (trc_material_desc){.struct_size = sizeof(trc_material_desc),
                               .node_count = list->node_count,
                               .nodes = list->nodes,
                               .inputs = list->inputs,
                               .input_count = list->input_count,
                               .surface = surface,
                               .flags = TRC_MATERIAL_TRANSPARENT_SHADOW};
}

#endif
