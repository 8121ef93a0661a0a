/* Binary trees: see binary.h. */
#include "bvh/binary.h"

#include <string.h>

uint32_t trc_binary_add_leaf(struct trc_binary *tree, uint32_t ref) {
    struct trc_binary_node *n = &tree->nodes[tree->count];
    memset(n, 0, sizeof *n);
    n->ref = ref;
    return tree->count++;
}

uint32_t trc_binary_add_node(struct trc_binary *tree, uint32_t left, uint32_t right, float area) {
    struct trc_binary_node *n = &tree->nodes[tree->count];
    const float *l = tree->nodes[left].cost, *r = tree->nodes[right].cost;
    float apart[TRC_NODE_WIDTH - 1]; /* as i + 2 children */
    *n = (struct trc_binary_node){.ref = TRC_REF_EMPTY, .left = left, .right = right};
    for (int i = 0; i < TRC_NODE_WIDTH - 1; i++) {
        int best = 0; /* left's children less one */
        for (int k = 1; k <= i; k++)
            if (l[k] + r[i - k] < l[best] + r[i - best])
                best = k;
        apart[i] = l[best] + r[i - best];
        n->left_count[i] = (uint8_t)(best + 1);
    }
    n->cost[0] = area + apart[TRC_NODE_WIDTH - 2];
    for (int i = 1; i < TRC_NODE_WIDTH - 1; i++) {
        n->cost[i] = apart[i - 1];
        if (n->cost[i - 1] <= apart[i - 1]) {
            n->cost[i] = n->cost[i - 1];
            n->left_count[i - 1] = 0;
        }
    }
    return tree->count++;
}

/* Adds what stands for a node in at most so many children of another. */
static int children_add(const struct trc_binary *tree, uint32_t node, int most,
                        uint32_t *children_out) {
    const struct trc_binary_node *n = &tree->nodes[node];
    while (most > 1 && n->ref == TRC_REF_EMPTY && !n->left_count[most - 2])
        most--;
    if (most == 1 || n->ref != TRC_REF_EMPTY) {
        *children_out = node;
        return 1;
    }
    const int left = n->left_count[most - 2];
    const int count = children_add(tree, n->left, left, children_out);
    return count + children_add(tree, n->right, most - left, children_out + count);
}

int trc_binary_children(const struct trc_binary *tree, uint32_t node,
                        uint32_t children_out[TRC_NODE_WIDTH]) {
    return children_add(tree, node, TRC_NODE_WIDTH, children_out);
}
