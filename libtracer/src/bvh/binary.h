/* Binary trees, and the wide nodes that stand for them at the least cost.
 *
 * Henri Ylitie, Tero Karras, Samuli Laine, "Efficient Incoherent Ray Traversal on GPUs Through
 * Compressed Wide BVHs", 2017, section 3.1: which inner nodes of a binary tree stay is chosen by
 * what they cost, from the leaves up. Here leaves are given, so that all there is to add up are the
 * areas of the nodes that stay. */
#ifndef TRACER_BVH_BINARY_H
#define TRACER_BVH_BINARY_H

#include "bvh/tree.h"

/* An inner node, in two parts that are as large as a ref each, for builders keep them where refs
 * were. Its sides, and nodes wherever they are named: indices, or references of leaves. */
struct trc_binary_node {
    uint32_t left, right;
    /* Of i + 2 children, how many are left's; 0: no better than one fewer. */
    uint8_t left_count[TRC_NODE_WIDTH - 1];
    bool is_upper; /* for builders: made after all below it, which may be tasks of their own */
    uint32_t unused[4];
};
struct trc_binary_cost {
    /* Least sum of the areas of inner nodes that stay, this one and below, if it is to be no more
     * than i + 1 children of another. */
    float children[TRC_NODE_WIDTH - 1];
    float unused;
};
struct trc_binary {
    struct trc_binary_node *nodes;
    struct trc_binary_cost *costs; /* by node */
};

/* Makes a node over two sides that are there, of half that surface. */
void trc_binary_join(const struct trc_binary *tree, uint32_t node, uint32_t left, uint32_t right,
                     float area);

/* The children of the wide node that stands for an inner one. Returns their number, 2 to
 * TRC_NODE_WIDTH. */
int trc_binary_children(const struct trc_binary_node *nodes, uint32_t node,
                        uint32_t children_out[TRC_NODE_WIDTH]);

#endif
