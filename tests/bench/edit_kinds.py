# SPDX-License-Identifier: Apache-2.0
"""Edits of the field of objects of viewport_scenes.py, inside Blender: each takes the number of the step."""

import bpy

import scenes
import viewport_scenes


def transform(step):
    bpy.data.objects["Object500"].location.z = 0.1 * (step + 1)


def transforms(step):
    for each in bpy.data.objects:
        if each.name.startswith("Object"):
            each.location.z = 0.01 * (step + 1)


def select(step):
    bpy.data.objects["Object500"].select_set(not step % 2)


def material(step):
    tree = bpy.data.materials["Material1"].node_tree
    tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0.1 * (step % 9), 0.5, 0.5, 1.0)


def node_link(_step):
    tree = bpy.data.materials["Material1"].node_tree
    color = tree.nodes["Diffuse BSDF"].inputs["Color"]
    if color.is_linked:
        tree.links.remove(color.links[0])
        return
    value = tree.nodes.get("RGB") or tree.nodes.new("ShaderNodeRGB")
    tree.links.new(value.outputs[0], color)


def light(step):
    bpy.data.objects["Light"].data.energy = 1000.0 + step


def world(step):
    tree = bpy.context.scene.world.node_tree
    tree.nodes["Background"].inputs["Strength"].default_value = 0.1 * (step + 1)


def ray_visibility(step):
    bpy.data.objects["Object500"].visible_shadow = bool(step % 2)


def mesh_edit(step):
    data = bpy.data.objects["Object500"].data
    data.vertices[0].co.z = 0.1 * (step + 1)
    data.update()


def duplicate(step):
    copy = scenes.link("Copy", bpy.data.objects["Object500"].data)
    copy.location.z = 1.0 + step


def delete(_step):
    bpy.data.objects.remove(next(o for o in bpy.data.objects if o.name.startswith("Copy")))


def hide(_step):
    each = bpy.data.objects["Object500"]
    each.hide_viewport = each.hide_render = not each.hide_viewport


def settings(step):
    bpy.context.scene.volley.film_exposure = 1.0 + 0.1 * (step + 1)


ALL = (viewport_scenes.pose, transform, transforms, select, material, node_link, light, world, ray_visibility,
       mesh_edit, duplicate, delete, hide, settings)
