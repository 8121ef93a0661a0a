/* Trees that refits have made bad, built anew in a thread of their own while poses go on: a commit
 * that finds one ready refits from it. One at a time for each scene; final scenes build at once, so
 * that nothing depends on when a thread is done. */
#ifndef TRACER_SCENE_REBUILD_H
#define TRACER_SCENE_REBUILD_H

#include <stdbool.h>
#include <stdint.h>

#include "bvh/bvh.h"
#include "scene/store.h"

struct trc_rebuild;

/* Starts on the tree of a mesh in the store that has grown in bvh, the first of them. NULL if there
 * is none, or no memory or thread for it: then the next commit tries again. */
struct trc_rebuild *trc_rebuild_start(const struct trc_store *meshes, const struct trc_bvh *bvh);

/* Stops it, waits, frees. NULL is fine. */
void trc_rebuild_destroy(struct trc_rebuild *rebuild);

/* Whether it has ended, well or not. False for NULL. */
bool trc_rebuild_is_done(const struct trc_rebuild *rebuild);

/* Puts the tree of one that is done at its mesh's place in the array, one for each mesh of the
 * snapshot under construction, if the mesh is still there. The rebuild goes on holding it. */
void trc_rebuild_offer(const struct trc_rebuild *rebuild, const struct trc_store *meshes,
                       struct trc_blas **blas_of_meshes);

#endif
