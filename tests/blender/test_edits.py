# SPDX-License-Identifier: Apache-2.0
"""Edits one after the other: what the library then holds is what it would be told of the scene afresh."""

import pytest


class _Follower:
    """Follows the scene as a viewport does, by the depsgraph's updates."""

    def __init__(self):
        import bpy
        from volley.sync import SceneSync
        from volley.sync.changes import Changes
        self._sync = SceneSync(is_final=False, thread_count=0, will_resync=True)
        self._changes = Changes.everything()
        bpy.app.handlers.depsgraph_update_post.append(self._mark)
        bpy.app.handlers.frame_change_post.append(self._mark)

    def _mark(self, _scene, depsgraph):
        from volley.sync.changes import Changes
        self._changes.merge(Changes.of_depsgraph(depsgraph))

    def picture(self):
        from volley.sync.changes import Changes
        changes, self._changes = self._changes, Changes()
        return _picture(self._sync, changes)


def _picture(sync, changes):
    """Bring a sync up to date and render what it holds."""
    import bpy
    from volley import passes
    from volley.session import render_fields
    from volley.sync import Source, camera
    from volley.sync.matrix import rows12
    depsgraph = bpy.context.evaluated_depsgraph_get()
    if changes.any():
        sync.update(Source(depsgraph, changes))
    scene = depsgraph.scene_eval
    frame = camera.frame_of(scene.render)
    lens = camera.lens_of(scene.camera, sync.warnings)
    sync.set_camera(camera.CameraKeys(lens, [rows12(scene.camera.matrix_world)],
                                      [camera.window(lens, frame)]))
    sync.scene.commit()
    crop = (0, 0, frame.width, frame.height)
    fields = render_fields(scene, frame, crop, [passes.COMBINED])
    fields.update(sample_count=8)
    render = sync.scene.start_render(**fields)
    render.wait(-1.0)
    pixels = passes.read_combined(render)
    render.destroy()
    return pixels


def inside_random_edits(seed, count):
    import random
    import bpy
    import edits
    import numpy as np
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    edits.make_scene()
    random = random.Random(seed)
    follower = _Follower()
    follower.picture()
    worst, former, changed_count = [], None, 0
    for number in range(count):
        edit = random.choice(edits.ALL)
        edit(random)
        bpy.context.view_layer.update()
        if random.random() < 0.3:  # several edits until the next draw
            continue
        followed = follower.picture()
        fresh_sync = SceneSync(is_final=False, thread_count=0, will_resync=False)
        fresh = _picture(fresh_sync, Changes.everything())
        fresh_sync.destroy()
        changed_count += former is None or not np.array_equal(former, fresh)
        former = fresh
        worst.append((float(np.abs(followed - fresh).mean()), edit.__name__, number))
    return sorted(worst, reverse=True)[:8], changed_count / len(worst)


@pytest.mark.parametrize("seed", [1, 2])
def test_random_edits_end_in_the_scene_as_it_is(blender, seed):
    worst, changed_share = blender.run(inside_random_edits, seed, 200)
    assert worst[0][0] == 0.0, worst
    assert changed_share > 0.5  # the edits are seen at all
