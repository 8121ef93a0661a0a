# SPDX-License-Identifier: Apache-2.0
"""What materials are told of meshes as a whole and of what made an instance, against Cycles: particles, the
coordinates of the places that instances stand at, islands, pointiness."""

import numpy as np
import pytest

SIZE = (64, 48)
PARTICLE_OUTPUTS = {"Index": 0.03, "Random": 1.0, "Age": 0.1, "Lifetime": 0.02, "Size": 2.0,
                    "Location": 0.5, "Velocity": 0.2, "Angular Velocity": 0.2}  # and what they are scaled by


def _stage():
    """One sharp sample a pixel, seen from the front."""
    import scenes
    scene = scenes.empty(size=SIZE, samples=1)
    scenes.camera(location=(0.0, -7.0, 0.0))
    scenes.sharpen()
    return scene


def _both():
    import scenes
    return [picture[..., :3] for picture in scenes.by_both(1)]


def _show(material, node, output, scale):
    """Let a material shine with the size of a node's output."""
    tree = material.node_tree
    emission = next(n for n in tree.nodes if n.type == 'EMISSION')
    size = tree.nodes.get("Vector Math") or tree.nodes.new("ShaderNodeVectorMath")
    size.operation = 'ABSOLUTE'
    tree.links.new(node.outputs[output], size.inputs[0])
    tree.links.new(size.outputs[0], emission.inputs["Color"])
    emission.inputs["Strength"].default_value = scale


def _emitter(grid):
    """A wall of faces that throws 30 balls from frame 1 to 10."""
    import scenes
    ball = scenes.sphere("Ball", 0.4, location=(9.0, 9.0, 9.0), material=scenes.emitter((1.0, 1.0, 1.0)))
    grid.modifiers.new("Balls", 'PARTICLE_SYSTEM')
    balls = grid.particle_systems[0].settings
    balls.count, balls.frame_start, balls.frame_end, balls.lifetime = 30, 1, 10, 40
    balls.lifetime_random, balls.size_random = 0.5, 0.5
    balls.normal_factor, balls.factor_random = 0.5, 0.8
    balls.use_rotations, balls.angular_velocity_factor = True, 2.0
    balls.render_type, balls.instance_object, balls.particle_size = 'OBJECT', ball, 0.6
    balls.effector_weights.gravity = 0.1
    return ball


def inside_particles():
    """{output: [by Volley, by Cycles]}"""
    import scenes
    scene = _stage()
    ball = _emitter(scenes.wall("Wall", 4.0, 2.0, material=scenes.emitter((0.0, 0.0, 0.0), "Black")))
    for frame in range(1, 13):
        scene.frame_set(frame)
    material = ball.data.materials[0]
    info = material.node_tree.nodes.new("ShaderNodeParticleInfo")
    pictures = {}
    for output, scale in PARTICLE_OUTPUTS.items():
        _show(material, info, output, scale)
        pictures[output] = _both()
    return pictures


def inside_places():
    """{(node, output): [by Volley, by Cycles]} of balls on the faces of a wall, and beside it."""
    import bpy
    import scenes
    _stage()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=3, size=4.0,
                                    rotation=(np.pi / 2, 0.0, 0.0))
    grid = bpy.context.object
    grid.instance_type, grid.show_instancer_for_render = 'FACES', False
    ball = scenes.sphere("Ball", 0.3, material=scenes.emitter((1.0, 1.0, 1.0)))
    ball.parent = grid
    scenes.sphere("Alone", 0.3, location=(2.5, 0.0, 1.5), material=ball.data.materials[0])
    pictures = {}
    for name, outputs in (("ShaderNodeTexCoord", ("Generated", "UV")),
                          ("ShaderNodeUVMap", ("UV",))):
        node = ball.data.materials[0].node_tree.nodes.new(name)
        node.from_instancer = True
        for output in outputs:
            _show(ball.data.materials[0], node, output, 1.0)
            pictures[f"{name} {output}"] = _both()
    return pictures


def inside_meshes():
    """{output: [by Volley, by Cycles]} of a bent grid and of parts in one mesh."""
    import bpy
    import scenes
    _stage()
    bpy.ops.mesh.primitive_monkey_add(size=2.5, location=(-1.0, 0.0, 0.0))
    monkey = bpy.context.object
    material = scenes.emitter((1.0, 1.0, 1.0))
    monkey.data.materials.append(material)
    balls = [scenes.sphere(f"Ball{i}", 0.3, location=(1.2 + 0.4 * (i % 3), 0.3 * i - 1.0, 0.7 * (i // 3) - 1.0),
                           material=material) for i in range(9)]
    with bpy.context.temp_override(active_object=balls[0], selected_editable_objects=balls, object=balls[0]):
        bpy.ops.object.join()
    node = material.node_tree.nodes.new("ShaderNodeNewGeometry")
    pictures = {}
    for output in ("Pointiness", "Random Per Island"):
        _show(material, node, output, 1.0)
        pictures[output] = _both()
    monkey.modifiers.new("Bevel", 'BEVEL')
    pictures["Random Per Island, bevelled"] = _both()
    _show(material, node, "Pointiness", 1.0)
    pictures["Pointiness, bevelled"] = _both()
    return pictures


@pytest.mark.parametrize("inside", [inside_particles, inside_places, inside_meshes])
def test_instancer(blender, inside):
    pictures = blender.run(inside)
    assert len(pictures) >= 3
    for name, (ours, theirs) in pictures.items():
        assert theirs.std() > 0.02, name
        wrong = (np.abs(ours - theirs) > 1e-3).any(axis=-1).mean()
        assert wrong <= 0.005, f"{name}: {wrong}"
    assert "not supported" not in blender.output
