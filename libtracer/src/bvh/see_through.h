/* Which children of a tree's nodes are not visited by occlusion queries that skip what is
 * transparent. */
#ifndef TRACER_BVH_SEE_THROUGH_H
#define TRACER_BVH_SEE_THROUGH_H

#include "model/tree.h"

/* Sets see_through and is_see_through of a tree that is filled, whose items' trees have theirs.
 * OUT_OF_MEMORY. */
trc_status trc_tree_mark_see_through(struct trc_tree *tree);

/* The same as in a tree of the same nodes and slots. */
trc_status trc_tree_copy_see_through(const struct trc_tree *from, struct trc_tree *tree);

#endif
