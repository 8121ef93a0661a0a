# SPDX-License-Identifier: Apache-2.0
"""Final renders with persistent data read again what changed alone."""

FRESH_EVERY = 10  # renders, of which the last is compared with one that keeps nothing


def _checking_reads(found):
    """Note of each mesh that a render keeps, whether reading it would give the same; undo()."""
    from volley.sync import mesh, walk
    read_mesh = walk.Walk.read_mesh

    def checked(self, item, each, pointer):
        meshes, names = self._sync._meshes, self._names_of(pointer)
        is_kept = not self._source.changes.geometry_of(item.owner) and meshes.reuse(item.key, pointer, names)
        if not is_kept:
            found["read"] += 1
            return read_mesh(self, item, each, pointer)
        with mesh.shown_mesh(each.object) as shape:
            data, _ = self._extract(item, each, shape, names)
        normals = None if data.normals is None else data.normals[None]
        entry = meshes._entries[item.key]
        if (entry.topology, entry.shape) != meshes._signatures(data, data.positions[None], normals):
            found["stale"].append(item.owner)
        found["kept"] += 1
        return True

    walk.Walk.read_mesh = checked

    def undo():
        walk.Walk.read_mesh = read_mesh
    return undo


def _scene():
    """The scene of the edits with one view layer and without motion blur, which has every mesh read."""
    import edits
    scene = edits.make_scene()
    scene.render.use_persistent_data = True
    scene.render.use_motion_blur = False
    for layer in scene.view_layers[1:]:
        layer.use = False
    scene.volley.samples = 1
    return scene


def inside_random_edits(seed, count):
    import random
    import edits
    import scenes
    scene = _scene()
    random = random.Random(seed)
    found = {"read": 0, "kept": 0, "stale": [], "renders": 0, "differ": []}
    scenes.render()
    undo = _checking_reads(found)
    for _ in range(count):
        edit = random.choice(edits.ALL)
        edit(random)
        if random.random() < 0.3:  # several edits until the next render
            continue
        before = len(found["stale"])
        kept = scenes.render()
        found["stale"][before:] = [(name, edit.__name__) for name in found["stale"][before:]]
        found["renders"] += 1
        if found["renders"] % FRESH_EVERY == 0:
            scene.render.use_persistent_data = False
            found["differ"] += [edit.__name__] * bool(abs(scenes.render() - kept).max())
            scene.render.use_persistent_data = True
            scenes.render()
    undo()
    return found


def test_meshes_that_are_kept_are_as_they_would_be_read(blender):
    found = blender.run(inside_random_edits, 1, 150)
    assert found["stale"] == [] and found["differ"] == []
    assert found["read"] > 50 and found["kept"] > found["read"]


def inside_unchanged():
    import scenes
    _scene()
    found = {"read": 0, "kept": 0, "stale": []}
    undo = _checking_reads(found)
    pictures = [scenes.render() for _ in range(2)]
    undo()
    return found, float(abs(pictures[1] - pictures[0]).max())


def test_nothing_is_read_again_where_nothing_changed(blender):
    found, difference = blender.run(inside_unchanged)
    assert found["stale"] == [] and found["kept"] == found["read"] > 3
    assert difference == 0.0


def inside_collections():
    """Whether Python collects within a sync and after it, where it did before and where it did not."""
    import gc
    import scenes
    from volley.sync import walk
    _scene()
    run, seen = walk.Walk.run, []

    def watched(self):
        seen.append(gc.isenabled())
        run(self)

    walk.Walk.run = watched
    try:
        for collects in (True, False):
            (gc.enable if collects else gc.disable)()
            scenes.render()
            seen.append(gc.isenabled())
    finally:
        gc.enable()
        walk.Walk.run = run
    return seen


def test_python_does_not_collect_within_a_sync(blender):
    assert blender.run(inside_collections) == [False, True, False, False]
