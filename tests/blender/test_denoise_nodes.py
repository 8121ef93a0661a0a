# SPDX-License-Identifier: Apache-2.0
"""The compositor's Denoise node, set up with Volley's passes."""

import numpy as np

NODE = "CompositorNodeDenoise"
SIZE = (64, 48)


def _scene():
    """A ball under a large lamp, few samples."""
    import scenes
    scene = scenes.empty(size=SIZE)
    scenes.camera(location=(0.0, -5.0, 1.0), rotation=(np.pi / 2 - 0.2, 0.0, 0.0))
    scenes.wall("Back", 8.0, 3.0)
    scenes.sphere("Ball", 1.0, (0.0, 0.0, 0.0))
    scenes.light(energy=200.0, size=4.0)
    scene.render.engine = 'VOLLEY'
    scene.volley.samples, scene.volley.use_denoising = 4, True
    return scene


def _tree(scene):
    return scene.compositing_node_group if hasattr(scene, "compositing_node_group") else scene.node_tree


def inside_graph():
    """What is set up twice: sources of the node's sockets, where it goes; new nodes; what else is changed."""
    import bpy
    from volley import denoise_nodes
    scene = _scene()
    second = scene.view_layers.new("Second")
    counts = [denoise_nodes.set_up(scene)]
    tree = _tree(scene)
    layer = tree.nodes.new("CompositorNodeRLayers")
    layer.layer = second.name
    counts += [denoise_nodes.set_up(scene), denoise_nodes.set_up(scene)]
    nodes = [node for node in tree.nodes if node.bl_idname == NODE]
    sources = [{link.to_socket.name: (link.from_node.layer, link.from_socket.name)
                for link in tree.links if link.to_node == node} for node in nodes]
    targets = [[link.to_node.bl_idname for link in node.outputs["Image"].links] for node in nodes]
    operator = bpy.ops.volley.set_up_denoise_nodes
    return {"counts": counts, "sources": sources, "targets": targets, "own": scene.volley.use_denoising,
            "stored": [view_layer.volley.denoising_store_passes for view_layer in scene.view_layers],
            "poll": (operator.poll(), denoise_nodes.is_available())}


def test_nodes_are_set_up_once(blender):
    found = blender.run(inside_graph)
    assert found["counts"] == [1, 1, 0]
    inputs = {"Image": "Noisy Image", "Normal": "Denoising Normal", "Albedo": "Denoising Albedo"}
    names = [next(iter(source.values()))[0] for source in found["sources"]]
    assert len(set(names)) == 2
    for name, sources in zip(names, found["sources"]):
        assert sources == {socket: (name, output) for socket, output in inputs.items()}
    assert sorted(map(len, found["targets"])) == [0, 1]  # the picture has one
    assert not found["own"] and all(found["stored"])
    assert found["poll"][0] == found["poll"][1]


def inside_pictures():
    """The composited picture, the one without the compositor, and that with many samples."""
    import scenes
    from volley import denoise_nodes
    scene = _scene()
    denoise_nodes.set_up(scene)
    pictures = []
    for is_used, samples in ((True, 4), (False, 4), (False, 1024)):
        scene.render.use_compositing, scene.volley.samples = is_used, samples
        pictures.append(scenes.render()[..., :3])
    return pictures, denoise_nodes.is_available()


def test_picture_comes_from_the_node(blender):
    (made, plain, exact), is_available = blender.run(inside_pictures)
    assert made.mean() > 0.0
    errors = [((picture - exact) ** 2).mean() for picture in (made, plain)]
    # Without the library the node hands on what it gets.
    assert errors[0] < 0.8 * errors[1] if is_available else np.abs(made - plain).max() < 1e-3
