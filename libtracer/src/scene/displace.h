/* True displacement: vertices moved by the programs of the materials of their triangles, as Cycles
 * does it. */
#ifndef TRACER_SCENE_DISPLACE_H
#define TRACER_SCENE_DISPLACE_H

#include "model/snapshot.h"

struct trc_scene_state; /* scene/scene.h */
struct trc_displacer;

/* Puts moved meshes in the place of those of the snapshot under construction whose materials ask
 * for it, and says in each scene mesh which it shows. Its instances, materials, images and camera
 * are in place. One mesh has one shape: that of its first instance, with its materials and
 * transform. What has been moved before by the same is taken as it is. OUT_OF_MEMORY, CANCELLED. */
trc_status trc_displace_meshes(struct trc_scene_state *scene, struct trc_snapshot *s);

/* Lets go of a moved mesh; NULL is fine. */
void trc_displacer_destroy(struct trc_displacer *displacer);

#endif
