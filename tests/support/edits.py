# SPDX-License-Identifier: Apache-2.0
"""A small scene with something of every kind, and random edits of it, inside Blender."""

import bpy

import scenes


def make_scene():
    """An empty scene, filled."""
    return fill(scenes.empty(size=(48, 36)))


def fill(scene):
    """Add a skinned tube, instances, textures, groups, lights and a second view layer."""
    scene.volley.preview_samples = 4
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.1, 0.2, 1.0)
    scenes.camera((0.0, -9.0, 0.0))
    _make_materials()
    scenes.wall("Back", 8.0, 3.0, material=bpy.data.materials["Textured"])
    scenes.sphere("Ball", 0.8, (-2.0, 0.0, 0.0), bpy.data.materials["Plain"])
    _make_tube(bpy.data.materials["Grouped"])
    scenes.light('AREA', (0.0, -4.0, 4.0), energy=300.0, size=1.0)
    scenes.light('POINT', (3.0, -3.0, 2.0), energy=100.0)
    collection = bpy.data.collections.new("Crate")
    collection.objects.link(scenes.wall("Lid", 0.5, material=bpy.data.materials["Plain"]))
    crate = scenes.link("Crates", None)
    crate.instance_type, crate.instance_collection = 'COLLECTION', collection
    crate.location = (0.0, -1.0, 1.5)
    _make_collections(collection)
    scene.view_layers.new("Second")
    ball = bpy.data.objects["Ball"]
    for frame, height in ((1, 0.0), (20, 1.0)):
        ball.location.z = height
        ball.keyframe_insert("location", index=2, frame=frame)
    return scene


def _make_materials():
    scenes.material("Plain", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.3, 0.2))
    image = bpy.data.images.new("Picture", 8, 8)
    textured = scenes.material("Textured", "ShaderNodeBsdfDiffuse")
    texture = textured.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    textured.node_tree.links.new(texture.outputs["Color"],
                                 textured.node_tree.nodes["Diffuse BSDF"].inputs["Color"])
    group = bpy.data.node_groups.new("Tint", 'ShaderNodeTree')
    if hasattr(group, "interface"):  # since 4.0
        group.interface.new_socket("Color", in_out='OUTPUT', socket_type='NodeSocketColor')
    else:
        group.outputs.new('NodeSocketColor', "Color")
    color = group.nodes.new("ShaderNodeRGB")
    color.name = "RGB"  # as it is called before 5.0
    group.links.new(color.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    grouped = scenes.material("Grouped", "ShaderNodeBsdfDiffuse")
    node = grouped.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    grouped.node_tree.links.new(node.outputs[0], grouped.node_tree.nodes["Diffuse BSDF"].inputs[0])


def _make_collections(crate):
    """A collection with a parent and its child, and one whose instance is instanced again."""
    side = bpy.data.collections.new("Side")
    bpy.context.scene.collection.children.link(side)
    handle = scenes.link("Handle", None)
    sign = scenes.wall("Sign", 0.6, -0.5, (2.5, 1.5), _attributed())
    sign.parent, sign.data["tint"], sign["shade"] = handle, 0.4, 0.9
    for each in (handle, sign):
        bpy.context.scene.collection.objects.unlink(each)
        side.objects.link(each)
    outer = bpy.data.collections.new("Outer")
    for name, shown, owner in (("Middle", crate, outer), ("Outers", outer, bpy.context.scene.collection)):
        maker = bpy.data.objects.new(name, None)
        owner.objects.link(maker)
        maker.instance_type, maker.instance_collection = 'COLLECTION', shown
    maker.location = (-2.0, -1.0, -1.5)


def _attributed():
    """A material that reads an object's property."""
    made = scenes.material("Attributed", "ShaderNodeBsdfDiffuse")
    attribute = made.node_tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_type, attribute.attribute_name = 'OBJECT', "tint"
    made.node_tree.links.new(attribute.outputs["Fac"], made.node_tree.nodes["Diffuse BSDF"].inputs["Color"])
    return made


def _make_tube(material):
    bpy.ops.mesh.primitive_cylinder_add(vertices=16, radius=0.5, depth=3.0, location=(1.5, 0.0, 0.0),
                                        end_fill_type='NOTHING')
    tube = bpy.context.object
    tube.name = "Tube"
    tube.data.materials.append(material)
    for polygon in tube.data.polygons:
        polygon.use_smooth = True
    rig = scenes.link("Rig", bpy.data.armatures.new("Rig"))
    rig.location = (1.5, 0.0, -1.5)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode='EDIT')
    rig.data.edit_bones.new("Bone").tail = (0.0, 0.0, 3.0)
    bpy.ops.object.mode_set(mode='OBJECT')
    tube.modifiers.new("Rig", 'ARMATURE').object = rig
    group = tube.vertex_groups.new(name="Bone")
    group.add([v.index for v in tube.data.vertices if v.co.z > 0.0], 1.0, 'REPLACE')


def _color(random):
    return (random.random(), random.random(), random.random(), 1.0)


def _some_mesh(random):
    names = [o.name for o in bpy.context.scene.objects if o.type == 'MESH']
    return bpy.data.objects[random.choice(sorted(names))] if names else None


def pose(random):
    bone = bpy.data.objects["Rig"].pose.bones["Bone"]
    bone.rotation_mode = 'XYZ'
    bone.rotation_euler.x = random.uniform(-1.0, 1.0)


def transform(random):
    _some_mesh(random).location.x = random.uniform(-2.0, 2.0)


def move_instancer(random):
    bpy.data.objects["Crates"].location.x = random.uniform(-2.0, 2.0)


def move_light(random):
    bpy.data.objects["Light"].location.x = random.uniform(-3.0, 3.0)


def light_energy(random):
    bpy.data.objects["Light"].data.energy = random.uniform(50.0, 500.0)


def light_kind(random):
    bpy.data.objects["Light.001"].data.type = random.choice(('POINT', 'SPOT', 'SUN'))
    bpy.data.objects["Light.001"].data.energy = 3.0


def move_middle(random):
    bpy.data.objects["Middle"].location.x = random.uniform(-1.0, 1.0)


def move_parent(random):
    _handle().location.x = random.uniform(-1.0, 0.5)


def rename_parent(random):
    _handle().name = random.choice(("Handle", "Grip"))


def _handle():
    return next(bpy.data.objects[name] for name in ("Handle", "Grip") if name in bpy.data.objects)


def parent(random):
    each = _some_mesh(random)
    if each.name != "Sign":
        each.parent = None if each.parent else _handle()


def swap_names(_random):
    ball, back = bpy.data.objects["Ball"], bpy.data.objects["Back"]
    ball.name, back.name = "Swapped", "Ball"
    ball.name = "Back"


def swap_meshes(random):
    ball, back = bpy.data.objects["Ball"], bpy.data.objects["Back"]
    ball.data, back.data = back.data, ball.data


def tint(random):
    sign = bpy.data.objects["Sign"]
    owner = random.choice((sign, sign.data))
    owner["tint"] = random.random()
    owner.update_tag()


def attribute(random):
    node = bpy.data.materials["Attributed"].node_tree.nodes["Attribute"]
    node.attribute_name = random.choice(("tint", "shade"))


def side_collection(random):
    layer = bpy.context.view_layer.layer_collection.children["Side"]
    switch = random.choice(("holdout", "indirect_only", "exclude", "hide_viewport"))
    setattr(layer, switch, not getattr(layer, switch))


def member(random):
    side, scene = bpy.data.collections["Side"], bpy.context.scene.collection
    each = _some_mesh(random)
    if each.name in scene.objects:
        scene.objects.unlink(each)
        if each.name not in side.objects:
            side.objects.link(each)
    elif each.name in side.objects and each.name != "Sign":
        side.objects.unlink(each)
        scene.objects.link(each)


def linked_light(random):
    if not hasattr(bpy.types.Object, "light_linking"):  # before 4.0
        return light_energy(random)
    linking = bpy.data.objects["Light"].light_linking
    linking.receiver_collection = None if linking.receiver_collection else bpy.data.collections["Side"]
    return None


def mesh_slot(random):
    materials = _some_mesh(random).data.materials
    if materials:
        materials[0] = bpy.data.materials[random.choice(("Plain", "Textured", "Attributed"))]


def material(random):
    tree = bpy.data.materials["Plain"].node_tree
    tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = _color(random)


def node_link(_random):
    tree = bpy.data.materials["Textured"].node_tree
    socket = tree.nodes["Diffuse BSDF"].inputs["Color"]
    if socket.is_linked:
        tree.links.remove(socket.links[0])
    else:
        tree.links.new(tree.nodes["Image Texture"].outputs["Color"], socket)


def node_group(random):
    node = bpy.data.node_groups["Tint"].nodes["RGB"]
    node.outputs[0].default_value = _color(random)


def image(random):
    picture = bpy.data.images["Picture"]
    picture.pixels.foreach_set(list(_color(random)) * 64)
    picture.update()
    picture.update_tag()


def world(random):
    tree = bpy.context.scene.world.node_tree
    tree.nodes["Background"].inputs["Color"].default_value = [0.3 * v for v in _color(random)]


def settings(random):
    bpy.context.scene.volley.film_exposure = random.choice((0.5, 1.0, 2.0))


def film_transparent(random):
    bpy.context.scene.render.film_transparent = random.random() < 0.2


def frame(random):
    bpy.context.scene.frame_set(random.randint(1, 20))


def add(random):
    scenes.wall("New", 1.0, random.uniform(-2.0, 0.0), (random.uniform(-3.0, 3.0), -1.0),
                bpy.data.materials["Plain"])


def duplicate(random):
    source = _some_mesh(random)
    copy = scenes.link("Copy", source.data)
    copy.location = (random.uniform(-2.0, 2.0), -1.0, random.uniform(-2.0, 2.0))


def delete(random):
    names = sorted(o.name for o in bpy.data.objects if o.name.startswith(("New", "Copy")))
    if names:
        bpy.data.objects.remove(bpy.data.objects[random.choice(names)])


def hide(random):
    each = _some_mesh(random)
    each.hide_viewport = not each.hide_viewport


def ray_visibility(random):
    each = _some_mesh(random)
    each.visible_shadow = not each.visible_shadow


def holdout(_random):
    ball = bpy.data.objects["Ball"]
    ball.is_holdout = not ball.is_holdout


def shadow_catcher(_random):
    ball = bpy.data.objects["Ball"]
    ball.is_shadow_catcher = not ball.is_shadow_catcher


def motion(random):
    each = _some_mesh(random)
    each.cycles.use_motion_blur, each.cycles.motion_steps = random.random() < 0.8, random.choice((1, 2))
    each.update_tag()  # which properties of add-ons do only in the window


def deform_motion(random):
    each = _some_mesh(random)
    each.cycles.use_deform_motion = not each.cycles.use_deform_motion
    each.update_tag()


def slot(random):
    each = _some_mesh(random)
    if each.material_slots:
        each.material_slots[0].material = bpy.data.materials[
            random.choice(("Plain", "Textured", "Grouped"))]


def vertices(random):
    data = bpy.data.meshes["Back"]
    data.vertices[0].co.x = random.uniform(-6.0, -2.0)
    data.update()


def shading(_random):
    data = bpy.data.objects["Ball"].data
    smooth = not data.polygons[0].use_smooth
    for polygon in data.polygons:
        polygon.use_smooth = smooth
    data.update()


def modifier(random):
    tube = bpy.data.objects["Tube"]
    if len(tube.modifiers) > 1:
        tube.modifiers.remove(tube.modifiers[1])
    elif random.random() < 0.3:
        tube.modifiers.new("Decimate", 'DECIMATE').ratio = 0.5
    else:
        tube.modifiers.new("Subdivision", 'SUBSURF')


def override(random):
    layer = bpy.context.view_layer
    layer.material_override = bpy.data.materials["Plain"] if random.random() < 0.3 else None


ALL = (pose, transform, move_instancer, move_middle, move_parent, rename_parent, parent, swap_names,
       swap_meshes, tint, attribute, side_collection, member, linked_light, mesh_slot, move_light,
       light_energy, light_kind, material, node_link, node_group, image, world, settings, film_transparent,
       frame, add, duplicate, delete, hide, ray_visibility, holdout, shadow_catcher, motion, deform_motion,
       slot, vertices, shading, modifier, override)
