# SPDX-License-Identifier: Apache-2.0
"""Edits one after the other: what the library then holds is what it would be told of the scene afresh."""

import pytest


def inside_random_edits(seed, count):
    import random
    import bpy
    import edits
    import numpy as np
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    edits.make_scene()
    random = random.Random(seed)
    follower = Follower()
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
        fresh = picture(fresh_sync, Changes.everything())
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
