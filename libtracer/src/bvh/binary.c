/* Binary trees: see binary.h. */
#include "bvh/binary.h"

/* Leaves stay in any case. */
static const float *costs_of(const struct trc_binary *tree, uint32_t node) {
    static const float nothing[TRC_NODE_WIDTH - 1];
    return node & TRC_REF_LEAF ? nothing : tree->costs[node].children;
}

void trc_binary_join(const struct trc_binary *tree, uint32_t node, uint32_t left, uint32_t right,
                     float area) {
    struct trc_binary_node n = {.left = left, .right = right};
    struct trc_binary_cost cost;
    const float *l = costs_of(tree, left), *r = costs_of(tree, right);
    float apart[TRC_NODE_WIDTH - 1]; /* as i + 2 children, some of either side */
    for (int i = 0; i < TRC_NODE_WIDTH - 1; i++) {
        int best = 0; /* left's, less one */
        for (int k = 1; k <= i; k++)
            if (l[k] + r[i - k] < l[best] + r[i - best])
                best = k;
        apart[i] = l[best] + r[i - best];
        n.left_count[i] = (uint8_t)(best + 1);
    }
    cost.children[0] = area + apart[TRC_NODE_WIDTH - 2];
    cost.unused = 0.0f;
    for (int i = 1; i < TRC_NODE_WIDTH - 1; i++) {
        const bool fewer = cost.children[i - 1] < apart[i - 1];
        cost.children[i] = fewer ? cost.children[i - 1] : apart[i - 1];
        if (fewer)
            n.left_count[i - 1] = 0;
    }
    tree->nodes[node] = n;
    tree->costs[node] = cost;
}

/* What stands for a node as no more than so many children. */
static int children_add(const struct trc_binary_node *nodes, uint32_t node, int limit,
                        uint32_t *children_out) {
    const bool is_leaf = node & TRC_REF_LEAF;
    while (limit > 1 && !is_leaf && !nodes[node].left_count[limit - 2])
        limit--;
    if (limit == 1 || is_leaf) {
        *children_out = node;
        return 1;
    }
    const struct trc_binary_node *n = &nodes[node];
    const int left = n->left_count[limit - 2];
    const int count = children_add(nodes, n->left, left, children_out);
    return count + children_add(nodes, n->right, limit - left, children_out + count);
}

int trc_binary_children(const struct trc_binary_node *nodes, uint32_t node,
                        uint32_t children_out[TRC_NODE_WIDTH]) {
    return children_add(nodes, node, TRC_NODE_WIDTH, children_out);
}
