/* Binary trees over small ranges, and the wide nodes that stand for them at the least cost.
 *
 * Henri Ylitie, Tero Karras, Samuli Laine, "Efficient Incoherent Ray Traversal on GPUs Through
 * Compressed Wide BVHs", 2017, section 3.1: which inner nodes of a binary tree stay is chosen by
 * what they cost, from the leaves up. Here leaves are given, so that all there is to add up are the
 * areas of the nodes that stay. */
#ifndef TRACER_BVH_BINARY_H
#define TRACER_BVH_BINARY_H

#include "bvh/tree.h"

struct trc_binary_node {
    uint32_t ref;         /* of a leaf; TRC_REF_EMPTY: an inner node */
    uint32_t left, right; /* of an inner node */
    /* Least sum of areas of this node and those below, if they are to be no more than i + 1
     * children of a node. Of one child: with its own area. */
    float cost[TRC_NODE_WIDTH - 1];
    /* Of i + 2 children, how many are left's; 0: no better than with one fewer. */
    uint8_t left_count[TRC_NODE_WIDTH - 1];
};

/* Children come before their parents. */
struct trc_binary {
    struct trc_binary_node *nodes;
    uint32_t count;
};

/* Adds a leaf, or a node of half that surface over two that were added; there must be memory.
 * Returns its index. */
uint32_t trc_binary_add_leaf(struct trc_binary *tree, uint32_t ref);
uint32_t trc_binary_add_node(struct trc_binary *tree, uint32_t left, uint32_t right, float area);

/* The children of the wide node that stands for an inner node: their indices, 2 to TRC_NODE_WIDTH.
 * Returns their number. */
int trc_binary_children(const struct trc_binary *tree, uint32_t node,
                        uint32_t children_out[TRC_NODE_WIDTH]);

#endif
