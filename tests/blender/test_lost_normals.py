# SPDX-License-Identifier: Apache-2.0
"""Shaders whose Normal is linked to a vector of no length, as attributes are that a mesh does not have: Cycles shades
them by the geometric normal, from Blender 4 on by the shading normal. They were up to 75 % darker, gloss twice as
bright."""

import blender as blender_support
import compare
import pytest

SAMPLES = 256
OFF = 0.01  # of the mean, in a tile
OLD_TRANSLUCENT_OFF = 0.025  # of smooth ones in 3.4, whose geometric normals are not those that light is sampled by
KINDS = ("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfTranslucent")


# Inside Blender ------------------------------------------------------------------------------------

def inside_balls():
    """{(shader, whether the ball is smooth): pictures by both engines}"""
    import scenes
    found = {}
    for kind in KINDS:
        for is_smooth in (False, True):
            scenes.empty(size=(24, 24))
            scenes.camera(type='ORTHO', ortho_scale=1.0)
            scenes.light_world((0.3, 0.4, 0.5))
            scenes.light('SUN', rotation=(0.9, 0.3, 0.2), energy=3.0, angle=0.2)
            material = scenes.material("Shown", kind)
            scenes.sphere(radius=0.45, material=material, smooth=is_smooth)
            attribute = material.node_tree.nodes.new("ShaderNodeAttribute")
            attribute.attribute_name = "nowhere"
            material.node_tree.links.new(attribute.outputs["Vector"], scenes.shader_of(material).inputs["Normal"])
            found[kind, is_smooth] = [pictures[..., :3] for pictures in scenes.seeds_by_both(SAMPLES)]
    return found


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def pictures(blender_of_module):
    return blender_of_module.run(inside_balls)


@pytest.mark.parametrize("is_smooth", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_against_cycles(pictures, kind, is_smooth):
    ours, theirs = pictures[kind, is_smooth]
    mean, tile = compare.unexplained(ours, theirs)
    print(f"{mean / theirs.mean():.4f} of the mean, {tile / theirs.mean():.4f} in a tile")
    is_old_translucent = blender_support.version() < (4, 0) and kind.endswith("Translucent") and is_smooth
    assert tile < (OLD_TRANSLUCENT_OFF if is_old_translucent else OFF) * theirs.mean()
