# SPDX-License-Identifier: Apache-2.0
"""What a render job says, and what becomes of a commit that fails."""

import blender as blender_support


def inside_warnings():
    """An animation of two view layers with something to warn of, then a single frame."""
    import bpy
    import scenes
    scene = scenes.empty(samples=1)
    scenes.camera()
    scenes.link("Fog", bpy.data.volumes.new("Fog"))
    scene.view_layers.new("Second")
    scene.frame_end = 3
    scene.render.filepath = bpy.app.tempdir + "frame"
    bpy.ops.render.render(animation=True)
    print("-- again", flush=True)
    bpy.ops.render.render()


def test_a_job_says_a_warning_once(blender):
    blender.run(inside_warnings)
    assert blender.output.count("Volumes are not supported") == 2  # one for each job


def inside_failure():
    """A render that fails; what its caller is told."""
    import bpy
    import scenes
    from volley import native
    scenes.empty(samples=1)
    scenes.camera()

    def fail(*_, **__):
        raise native.TracerError(1, "it is broken")

    native.Scene.start_render = fail
    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        return str(error)


def test_an_error_is_said_once(blender):
    assert "Volley: it is broken" in blender.run(inside_failure)
    # Blender 4 prints what an engine's error is on its own, too.
    times = 1 if blender_support.version() < (4, 0) else 2
    assert blender.output.count("it is broken") == times


def inside_failing_commit():
    """With persistent data, the second commit fails; what the render says, and a viewport."""
    import bpy
    import scenes
    from volley import commit, native, viewport
    scene = scenes.empty(samples=1)
    scenes.camera()
    scene.render.use_persistent_data = True
    scenes.render()

    class Failing:
        revision = 1

        def commit(self):
            raise MemoryError

    native.Scene.commit = Failing.commit
    messages = []
    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        messages.append(str(error))
    view = viewport.Viewport()
    view._commit = commit.Commit(Failing())
    try:
        view._end_commit(10.0)
    except MemoryError:
        messages.append("memory")
    return messages


def test_a_commit_that_fails_in_any_way_fails_the_render(blender):
    render, view = blender.run(inside_failing_commit)
    assert "Volley: out of memory" in render and view == "memory"


def inside_viewport():
    """What a viewport says of three lists of warnings, and which scenes of the library are left when it is
    closed."""
    import scenes
    from volley import native, viewport
    from volley.sync import SceneSync
    scenes.empty()
    said, destroyed = [], []

    class Engine:
        def report(self, kind, message):
            said.append((kind, message))

    view = viewport.Viewport()
    for messages in (["no volumes", "no movies"], ["no movies"], ["no movies", "no links"]):
        view._report(Engine(), messages)
    destroy = native.Scene.destroy

    def noting_destroy(scene):
        destroyed.append(scene)
        destroy(scene)

    native.Scene.destroy = noting_destroy
    view._sync = SceneSync(is_final=False, thread_count=0, will_resync=True)
    opened = view._sync.scene
    view.free()
    view.free()
    return said, [each is opened for each in destroyed]


def test_a_viewport_warns_once_and_leaves_nothing(blender):
    said, freed = blender.run(inside_viewport)
    assert said == [({'WARNING'}, message) for message in ("no volumes", "no movies", "no links")]
    assert freed == [True]


def inside_settings_that_last():
    """Settings of the library's scenes that three renders with persistent data open, the limit of textures and
    the threads changed between them; pictures of two frames whose seed is animated or not."""
    import numpy as np
    import scenes
    from volley import session
    scene = scenes.empty(size=(16, 12), samples=1)
    scenes.camera()
    scenes.wall()
    scenes.light()
    scene.render.use_persistent_data = True
    opened, sync = [], session.SceneSync

    def count(**settings):
        opened.append((settings["image_megabytes"], settings["thread_count"]))
        return sync(**settings)

    session.SceneSync = count
    scene.render.threads_mode, scene.render.threads = 'FIXED', 1
    scene.volley.texture_memory = 64
    counts = []
    for change in ({}, {}, {"texture_memory": 32}, {}, {"threads": 2}, {}):
        for name, value in change.items():
            setattr(scene.volley if name == "texture_memory" else scene.render, name, value)
        scenes.render()
        counts.append(len(opened))
    session.SceneSync = sync
    same = []
    for scene.volley.use_animated_seed in (False, True):
        pictures = []
        for frame in (1, 2, 1):
            scene.frame_set(frame)
            pictures.append(scenes.render())
        same.append([bool(np.array_equal(pictures[0], other)) for other in pictures[1:]])
    return opened, counts, same


def test_settings_of_the_next_render_are_taken(blender):
    opened, counts, same = blender.run(inside_settings_that_last)
    assert counts == [1, 1, 2, 2, 3, 3]
    assert [tuple(each) for each in opened] == [(64, 1), (32, 1), (32, 2)]
    assert same == [[True, True], [False, True]]  # of the next frame, and of the first once more


def inside_pixels():
    """Pixels that a viewport has clipped, each with one number that half floats lack, or none."""
    import numpy as np
    from volley import viewport
    clipped = []
    for bad in (0.5, float("nan"), float("inf"), float("-inf"), 1e6, -1e6):
        pixels = np.full((2, 3, 4), 0.25, np.float32)
        pixels[1, 2, 3] = bad
        viewport.clip_to_half(pixels)
        clipped.append(pixels.reshape(-1).tolist())
    return clipped


def test_a_viewport_shows_what_half_floats_can_hold(blender):
    most = 65504.0
    for pixels, wanted in zip(blender.run(inside_pixels), (0.5, 0.0, most, -most, most, -most)):
        assert pixels == [0.25] * 23 + [wanted]
