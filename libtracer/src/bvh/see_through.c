#include "bvh/see_through.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"

#define ALL_CHILDREN 0xffu
_Static_assert(ALL_CHILDREN == (1u << TRC_NODE_WIDTH) - 1u, "a bit for each child");

static bool slot_is_see_through(const struct trc_tree *tree, uint32_t slot) {
    if (tree->is_top)
        return tree->items[slot].tree->is_see_through;
    return tree->slots->slots[slot].instance & TRC_SLOT_TRANSPARENT;
}

/* marks: of the nodes below. Of no child, all. */
static bool is_see_through(const struct trc_tree *tree, const uint8_t *marks, uint32_t ref) {
    if (ref == TRC_REF_EMPTY)
        return true;
    if (!(ref & TRC_REF_LEAF))
        return marks[ref] == ALL_CHILDREN;
    const uint32_t first = trc_leaf_first(tree, ref);
    for (uint32_t i = 0; i < trc_leaf_count(ref); i++)
        if (!slot_is_see_through(tree, first + i))
            return false;
    return true;
}

static trc_status marks_alloc(struct trc_tree *tree) {
    if (tree->node_count == 0)
        return TRC_OK;
    tree->see_through = trc_alloc(tree->node_count, 1);
    if (!tree->see_through)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree of %u nodes",
                        tree->node_count);
    tree->bytes += tree->node_count;
    return TRC_OK;
}

trc_status trc_tree_mark_see_through(struct trc_tree *tree) {
    TRC_TRY(marks_alloc(tree));
    for (uint32_t n = tree->node_count; n-- > 0;) { /* children stand behind their node */
        const uint32_t *children = trc_node_children(tree, n);
        uint32_t bits = 0;
        for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++)
            bits |= (uint32_t)is_see_through(tree, tree->see_through, children[i]) << i;
        tree->see_through[n] = (uint8_t)bits;
    }
    tree->is_see_through =
        tree->root != TRC_REF_EMPTY && is_see_through(tree, tree->see_through, tree->root);
    return TRC_OK;
}

trc_status trc_tree_copy_see_through(const struct trc_tree *from, struct trc_tree *tree) {
    tree->is_see_through = from->is_see_through;
    if (!from->see_through)
        return TRC_OK;
    TRC_TRY(marks_alloc(tree));
    memcpy(tree->see_through, from->see_through, tree->node_count);
    return TRC_OK;
}
