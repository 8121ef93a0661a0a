# SPDX-License-Identifier: Apache-2.0
"""Scenes of tests of passes; runs inside Blender."""

import math

import scenes


def gallery(size=(96, 64)):
    """Spheres and walls at several distances; one half transparent, one a mirror, one rough metal."""
    scene = scenes.empty(size=size)
    scenes.camera(location=(0.5, -7.0, 1.0), rotation=(math.pi / 2 - 0.15, 0.0, 0.1))
    scenes.wall("Back", 14.0, 4.0, material=scenes.material(
        "Matt", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.4, 0.2)))
    scenes.sphere("Mirror", 1.0, (-1.6, 0.0, 0.0), material=scenes.material(
        "Mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.8, 0.7), Roughness=0.0))
    scenes.sphere("Metal", 0.9, (1.8, 1.0, 0.2), material=scenes.material(
        "Metal", "ShaderNodeBsdfGlossy", Color=(0.5, 0.7, 0.9), Roughness=0.6))
    scenes.wall("Veil", 1.5, -2.0, (0.3, 0.4), veil())
    return scene


def veil():
    """Diffuse and transparent, 40 to 60."""
    made = scenes.material("Veil", "ShaderNodeBsdfDiffuse", Color=(0.2, 0.8, 0.3))
    tree = made.node_tree
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    mix.inputs[0].default_value = 0.6
    tree.links.new(tree.nodes["Diffuse BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made
