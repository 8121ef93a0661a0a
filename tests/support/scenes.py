# SPDX-License-Identifier: Apache-2.0
"""Small scenes for tests, built inside Blender, and renders read back as arrays.

Lengths are metres. Pictures are (height, width, 4) float32, scene-linear, bottom row first.
"""

import math
import os
import tempfile

import bmesh
import bpy
import numpy as np


SEEDS = (1, 2, 3, 4)  # of pictures whose noise is measured

# Sockets of Principled that 4.0 renamed.
_RENAMED_SOCKETS = {"Specular": "Specular IOR Level", "Sheen": "Sheen Weight", "Transmission": "Transmission Weight"}


def empty(engine='VOLLEY', size=(64, 48), samples=4):
    """A scene with nothing in it but a black world, for both engines with the same settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if engine == 'VOLLEY':
        bpy.ops.preferences.addon_enable(module="volley")
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    world_color(scene.world, (0.0, 0.0, 0.0))
    render = scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.image_settings.file_format = 'OPEN_EXR'
    render.image_settings.color_depth = '32'
    render.image_settings.color_mode = 'RGBA'
    scene.view_settings.view_transform = 'Raw'
    set_engine(engine, samples)
    return scene


def set_shutter(scene, position='CENTER', length=0.5):
    """Motion blur of a shutter (frames), of which that part is the current frame."""
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, length
    owner = scene.render if hasattr(scene.render, "motion_blur_position") else scene.cycles
    owner.motion_blur_position = position


def set_engine(engine, samples):
    """Choose the engine; Cycles is held to the same light transport."""
    scene = bpy.context.scene
    scene.render.engine = engine
    if engine == 'VOLLEY':
        scene.volley.samples = samples
    elif engine == 'CYCLES':
        cycles = scene.cycles
        cycles.samples = samples
        cycles.use_denoising = cycles.use_adaptive_sampling = False
        cycles.max_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 50
        cycles.diffuse_bounces = 0
        cycles.caustics_reflective = cycles.caustics_refractive = True
        cycles.device = 'CPU'
        # 4.2 has blue noise for its default, which samples time and film less evenly in one pixel.
        if cycles.sampling_pattern == 'AUTOMATIC':
            cycles.sampling_pattern = 'TABULATED_SOBOL'


def socket(sockets, name):
    """A node's socket of that name or identifier: 5.0 gave some other names."""
    return sockets[name] if name in sockets else next(s for s in sockets if s.identifier == name)


def world_color(world, color):
    """Light a world evenly: since 5.0 its nodes do that, which it always has."""
    world.color = color
    if world.use_nodes:
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (*color, 1.0)


_MEDIA_TYPES = {'FFMPEG': 'VIDEO', 'AVI_JPEG': 'VIDEO', 'OPEN_EXR_MULTILAYER': 'MULTI_LAYER_IMAGE'}


def set_file_format(settings, file_format):
    """Choose a format of files, which are of three kinds since 5.0."""
    if hasattr(settings, "media_type"):
        settings.media_type = _MEDIA_TYPES.get(file_format, 'IMAGE')
    settings.file_format = file_format


def curves(owner):
    """The animation curves of what is animated; since 4.4 they lie in layers."""
    action, slot = owner.animation_data.action, getattr(owner.animation_data, "action_slot", None)
    if hasattr(action, "fcurves"):
        return action.fcurves
    return action.layers[0].strips[0].channelbag(slot).fcurves


def compositor():
    """The scene's empty compositing tree, and the input that takes its picture."""
    scene = bpy.context.scene
    if hasattr(scene, "compositing_node_group"):  # since 5.0
        tree = bpy.data.node_groups.new("Compositor", 'CompositorNodeTree')
        tree.interface.new_socket("Image", in_out='OUTPUT', socket_type='NodeSocketColor')
        scene.compositing_node_group = tree
        return tree, tree.nodes.new("NodeGroupOutput").inputs[0]
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree, scene.node_tree.nodes.new("CompositorNodeComposite").inputs[0]


def file_output(tree, folder, names):
    """A compositing node that writes EXR files whose names begin so: its inputs, by name."""
    output = tree.nodes.new("CompositorNodeOutputFile")
    if hasattr(output, "file_output_items"):  # since 5.0
        output.format.media_type, output.directory, output.file_name = 'IMAGE', folder, ""
    else:
        output.base_path = folder
        output.file_slots.clear()
    output.format.file_format, output.format.color_depth = 'OPEN_EXR', '32'
    output.format.color_mode = 'RGBA'
    for name in names:
        if hasattr(output, "file_output_items"):
            output.file_output_items.new('RGBA', name)
        else:
            output.file_slots.new(name)
    return dict(zip(names, output.inputs))


def link(name, data):
    """A new object of that data in the scene's collection."""
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def independent_seeds():
    """Have Cycles choose samples whose errors are others with every seed: those of its tables are alike."""
    cycles = bpy.context.scene.cycles
    if 'SOBOL_BURLEY' in cycles.bl_rna.properties["sampling_pattern"].enum_items:
        cycles.sampling_pattern = 'SOBOL_BURLEY'


def light_world(color):
    """A world of one colour, by nodes: those of Blender 5 have no colour without."""
    world = bpy.context.scene.world
    world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*color, 1.0)


def camera(location=(0.0, -6.0, 0.0), rotation=(math.pi / 2, 0.0, 0.0), **settings):
    """The scene's camera; by default it looks along +Y from 6 m before the origin."""
    made = link("Camera", bpy.data.cameras.new("Camera"))
    made.location, made.rotation_euler = location, rotation
    for name, value in settings.items():
        setattr(made.data, name, value)
    bpy.context.scene.camera = made
    return made


def mesh(name, vertices, faces, material=None, smooth=False):
    """An object of a mesh given by vertices and faces."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    for polygon in data.polygons:
        polygon.use_smooth = smooth
    data.update()
    made = link(name, data)
    if material is not None:
        data.materials.append(material)
    return made


def wall(name="Wall", size=2.0, y=0.0, center=(0.0, 0.0), material=None):
    """A square that faces the default camera (-Y), with UVs from 0 to 1."""
    h, (x, z) = 0.5 * size, center
    corners = [(x - h, y, z - h), (x + h, y, z - h), (x + h, y, z + h), (x - h, y, z + h)]
    made = mesh(name, corners, [(0, 1, 2, 3)], material)
    layer = made.data.uv_layers.new(name="UVMap")
    for loop, uv in zip(layer.data, ((0, 0), (1, 0), (1, 1), (0, 1))):
        loop.uv = uv
    return made


def uv_sphere(segments, rings, **settings):
    """A UV sphere; settings are those of Blender's operator. Its faces are put in the order of their vertices:
    the operator leaves them in another one in each run, and with them what hair and particles stand on."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=rings, **settings)
    made = bpy.context.view_layer.objects.active
    edited = bmesh.new()
    edited.from_mesh(made.data)
    ranked = sorted(edited.faces, key=lambda face: sorted(vertex.index for vertex in face.verts))
    for rank, face in enumerate(ranked):
        face.index = rank
    edited.faces.sort()
    edited.to_mesh(made.data)
    edited.free()
    return made


def sphere(name="Sphere", radius=1.0, location=(0.0, 0.0, 0.0), material=None, smooth=True):
    """A UV sphere of 32 by 16 faces."""
    made = uv_sphere(32, 16, radius=radius, location=location)
    made.name = name
    for polygon in made.data.polygons:
        polygon.use_smooth = smooth
    if material is not None:
        made.data.materials.append(material)
    return made


def light(kind='AREA', location=(0.0, -4.0, 4.0), rotation=(math.pi / 4, 0.0, 0.0), **settings):
    """A light; settings are those of its data."""
    made = link("Light", bpy.data.lights.new("Light", kind))
    made.location, made.rotation_euler = location, rotation
    for name, value in settings.items():
        setattr(made.data, name, value)
    return made


def has_node(node_type, inputs=(), settings=None):
    """Whether this Blender makes such a shader node, be it under the name of another that took its place,
    with inputs of these names and settings that take these values."""
    tree = bpy.data.node_groups.new("Asked", "ShaderNodeTree")
    try:
        node = tree.nodes.new(node_type)
        settings = settings or {}
        if not all(_takes(node.bl_rna.properties.get(name), value) for name, value in settings.items()):
            return False
        for name, value in settings.items():
            setattr(node, name, value)  # which may hide inputs
        return all(name in node.inputs for name in inputs)
    except RuntimeError:  # no such type
        return False
    finally:
        bpy.data.node_groups.remove(tree)


def _takes(setting, value):
    """Whether a property is there and takes the value."""
    return setting is not None and (setting.type != 'ENUM' or value in setting.enum_items.keys())


def material(name, node_type, settings=None, **inputs):
    """A material of one shader node of those settings; keywords are its inputs with underscores for spaces."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    node = tree.nodes.new(node_type)
    for key, value in (settings or {}).items():
        setattr(node, key, value)
    for key, value in inputs.items():
        name = key.replace("_", " ")
        socket = node.inputs[name if name in node.inputs else _RENAMED_SOCKETS[name]]
        is_color = hasattr(socket.default_value, "__len__") and len(socket.default_value) == 4
        socket.default_value = (*value, 1.0) if is_color and len(value) == 3 else value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return made


def shader_of(made):
    """The node that a material's surface is linked to."""
    return made.node_tree.nodes["Material Output"].inputs["Surface"].links[0].from_node


def emitter(color, name="Emitter", strength=1.0):
    """A material that shines with a colour: its pixels are known without any lighting."""
    return material(name, "ShaderNodeEmission", Color=color, Strength=strength)


def geometry_nodes(owner, *kinds):
    """A new modifier of nodes that follow each other: the nodes."""
    group = bpy.data.node_groups.new("Nodes", 'GeometryNodeTree')
    if hasattr(group, "interface"):
        group.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
        group.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    else:
        group.inputs.new('NodeSocketGeometry', "Geometry")
        group.outputs.new('NodeSocketGeometry', "Geometry")
    nodes = [group.nodes.new(kind) for kind in ("NodeGroupInput", *kinds, "NodeGroupOutput")]
    for a, b in zip(nodes, nodes[1:]):
        group.links.new(a.outputs[0], b.inputs[0])
    owner.modifiers.new("Nodes", 'NODES').node_group = group
    return nodes[1:-1]


def render(scene=None):
    """Render the scene, or one that the window does not show, as F12 does; its Combined picture."""
    scene = scene or bpy.context.scene
    scene.render.filepath = path = os.path.join(tempfile.mkdtemp(prefix="volley_"), "picture.exr")
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return load(path)


def by_both(samples):
    """The scene as it is by Volley and by Cycles: two pictures."""
    pictures = []
    for engine in ('VOLLEY', 'CYCLES'):
        set_engine(engine, samples)
        pictures.append(render())
    return pictures


def each_seed(engine, samples, seeds=SEEDS, cycles=None):
    """Set the scene up for an engine and one seed after the other; of so many samples altogether.
    cycles: {name: value} of settings of Cycles' that are not as set_engine has them."""
    set_engine(engine, samples // len(seeds))
    # A few seeds tell the noise of a pixel only if it has as many samples with each.
    bpy.context.scene.volley.extra_samples = 0.0
    if engine == 'CYCLES':
        independent_seeds()
        for name, value in (cycles or {}).items():
            setattr(bpy.context.scene.cycles, name, value)
    for seed in seeds:
        getattr(bpy.context.scene, engine.lower()).seed = seed
        yield seed


def seeds_by(engine, samples, seeds=SEEDS):
    """The scene as it is by an engine, of so many samples, shared out among seeds: an array (seeds, height,
    width, 4), whose spread is its noise (see compare.unexplained)."""
    return np.array([render() for _ in each_seed(engine, samples, seeds)])


def seeds_by_both(samples, seeds=SEEDS):
    """As seeds_by, by Volley and by Cycles."""
    return [seeds_by(engine, samples, seeds) for engine in ('VOLLEY', 'CYCLES')]


def sharpen():
    """Let every sample of both engines fall into the middle of its pixel."""
    for settings in (bpy.context.scene.volley, bpy.context.scene.cycles):
        settings.pixel_filter_type, settings.filter_width = 'BOX', 0.01


def load(path):
    """A picture file's pixels."""
    image = bpy.data.images.load(path, check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)


def render_passes(names):
    """Render once; {pass name: picture} of the active view layer, through the compositor. The names are
    those before 5.0."""
    from volley import passes
    shown_names = {entry.names[0]: passes.name_of(entry) for entry in passes.PASSES}
    shown_names["Combined"] = "Image"
    folder = tempfile.mkdtemp(prefix="volley_")
    tree, shown = compositor()
    layers = tree.nodes.new("CompositorNodeRLayers")
    files = [f"pass{number:02d}_" for number in range(len(names))]
    for name, written in zip(names, file_output(tree, folder, files).values()):
        tree.links.new(layers.outputs[shown_names.get(name, name)], written)
    tree.links.new(layers.outputs["Image"], shown)
    bpy.ops.render.render()
    files = sorted(os.listdir(folder))
    assert len(files) == len(names), f"{files} for passes {names}"
    return {name: load(os.path.join(folder, file)) for name, file in zip(names, files)}


def show_light(layer):
    """Ask a view layer for the passes of compare.LIGHT_PASSES."""
    for kind in ("diffuse", "glossy", "transmission"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{kind}_{part}", True)
    layer.use_pass_emit = layer.use_pass_environment = True


def passes_by_both(names, samples, seeds=SEEDS, cycles=None):
    """{pass name: as seeds_by_both} of the active view layer; cycles: see each_seed."""
    sides = [[render_passes(names) for _ in each_seed(engine, samples, seeds, cycles)]
             for engine in ('VOLLEY', 'CYCLES')]
    return {name: [np.array([picture[name] for picture in side]) for side in sides] for name in names}


def channel_means(picture):
    """Mean of each channel, a list."""
    return [float(value) for value in picture.reshape(-1, 4).mean(axis=0)]
