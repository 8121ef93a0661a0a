# SPDX-License-Identifier: Apache-2.0
"""Inside Blender: every node of shaders, changed in one setting or input at a time, by Volley and by Cycles.

Each case is a ball of its own that shines with an output of the node, or is made of it. Names of settings are
those of rna_walk.py.
"""

import bpy
import numpy as np

import scenes

GRID = 20     # balls along each side of a picture
BALL_PX = 10  # pixels along each side of a ball's cell
# Of a pixel, relative where the value is above 0.5: textures are steep, and samples lie 1e-2 pixels apart.
TOLERANCE = 0.02
_PER_PICTURE = GRID * GRID
_CONSTANT_BALLS = 0.48  # radius over the size of a cell

_IGNORED = {"is_active_output", "active_index"}
_KINDS = {'VALUE', 'RGBA', 'VECTOR', 'INT', 'BOOLEAN'}  # of sockets that hold a value
_COLOR, _VECTOR = (0.2, 0.5, 0.8, 1.0), (0.3, -0.4, 0.7)
_TEXTURE_SCALE = 0.3  # else their steepest places lie within a pixel
# Inputs that make a node's answer one of many.
_FED = ("Value", "Factor_Float", "Fac", "Factor", "Vector", "Color", "W", "A_Color", "A_Float", "A_Vector", "Red",
        "Image")


def _things():
    """What settings that point at something are given, by the setting's name."""
    image = bpy.data.images.new("Swept", 8, 8)
    pixels = np.random.RandomState(1).rand(8 * 8, 4).astype(np.float32)
    pixels[:, 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    web = bpy.data.texts.new("Web")
    web.write("IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 4 1 1 1 0 0 0\n1 1 1\n0 30 60 90\n0\n100 80 30 50\n")
    return {"image": image, "ies": web, "attribute_name": "Tint", "layer_name": "Tint", "uv_map": "UVMap"}


def _others(node, setting):
    """Values of a setting that differ from what it has, with the names they are walked by."""
    now, name = getattr(node, setting.identifier), setting.identifier
    if setting.type == 'ENUM':
        return [(f"{name}={item.identifier}", item.identifier) for item in setting.enum_items
                if item.identifier != now]
    if setting.type == 'BOOLEAN':
        return [(name, not now)]
    if setting.type == 'INT':
        return [(name, min(now + 1, setting.hard_max))]
    if setting.type == 'FLOAT':
        changed = tuple(0.7 * each + 0.2 for each in now) if setting.is_array else \
            min(0.6 * now + 0.11, setting.hard_max)
        return [(name, changed)]
    return []


def _other_value(socket):
    """A value that an input does not have."""
    if socket.type == 'RGBA':
        return _COLOR
    if socket.type == 'VECTOR':
        return _VECTOR[:len(socket.default_value)]
    if socket.type == 'BOOLEAN':
        return not socket.default_value
    if socket.type == 'INT':
        return socket.default_value + 1
    return 0.37 if abs(socket.default_value - 0.37) > 0.05 else 0.8


def _cases():
    """(node, name of what is changed or "", how, output) of all nodes: how sets a new node of that type up."""
    tree = bpy.data.node_groups.new("Asked", "ShaderNodeTree")
    inherited = set(bpy.types.ShaderNode.bl_rna.properties.keys())
    for kind in sorted(name for name in dir(bpy.types) if name.startswith("ShaderNode")):
        try:
            node = tree.nodes.new(kind)
        except RuntimeError:
            continue
        for output in [output.identifier for output in node.outputs]:
            yield kind, f"<{output}", None, output
        for setting in type(node).bl_rna.properties:
            name = setting.identifier
            if name in inherited or name in _IGNORED or setting.is_readonly:
                continue
            for token, value in _others(node, setting):
                other = tree.nodes.new(kind)
                try:
                    setattr(other, name, value)
                except TypeError:  # an item of other kinds of trees
                    continue
                shown = next((o.identifier for o in other.outputs if o.enabled), None)
                if shown is not None:
                    yield kind, token, (name, value), shown
        for socket in node.inputs:
            if socket.type in _KINDS and socket.enabled and node.outputs and socket.identifier != "Weight":
                yield kind, f">{socket.identifier}", (socket.identifier, None), node.outputs[0].identifier
    bpy.data.node_groups.remove(tree)


def _set_up(node, change, things):
    for name, thing in things.items():
        if hasattr(node, name):
            setattr(node, name, thing)
    if node.bl_idname == "ShaderNodeVectorMath":
        node.inputs[1].default_value = _VECTOR  # the normal of two of its operations
    if change is None:
        return
    name, value = change
    if value is not None:
        setattr(node, name, value)
    else:
        socket = next(socket for socket in node.inputs if socket.identifier == name)
        socket.default_value = _other_value(socket)


def _feed(tree, node):
    """Let the node's answer vary over the ball; inputs of shaders get one."""
    for socket in node.inputs:
        if socket.type == 'SHADER' and socket.enabled:
            tree.links.new(tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0], socket)
    if node.bl_idname.startswith("ShaderNodeBsdf"):
        return
    is_texture = node.bl_idname.startswith("ShaderNodeTex")
    for name in ("Vector",) if is_texture else ("Height", *_FED):
        socket = next((s for s in node.inputs if s.identifier == name and s.enabled and s.type != 'SHADER'), None)
        if socket is not None:
            coordinate = tree.nodes.new("ShaderNodeTexCoord")
            if not is_texture:
                tree.links.new(coordinate.outputs["Generated"], socket)
                return
            scaled = tree.nodes.new("ShaderNodeVectorMath")
            scaled.operation, scaled.inputs["Scale"].default_value = 'SCALE', _TEXTURE_SCALE
            tree.links.new(coordinate.outputs["Object"], scaled.inputs[0])
            tree.links.new(scaled.outputs[0], socket)
            return


def _material(number, case, things):
    """A case's material, None where its output is not there."""
    kind, _, change, output = case
    made = bpy.data.materials.new(f"Case {number}")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    end, node = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new(kind)
    _set_up(node, change, things)
    _feed(tree, node)
    shown = next((o for o in node.outputs if o.identifier == output and o.enabled), None)
    if shown is None:
        bpy.data.materials.remove(made)
        return None
    if shown.type == 'SHADER':
        tree.links.new(shown, end.inputs["Volume" if shown.name == "Volume" else "Surface"])
    else:
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(shown, emission.inputs["Color"])
        tree.links.new(emission.outputs[0], end.inputs["Surface"])
    return made


def _stage():
    """An orthographic view of the grid with a sharp sample in each pixel: the mesh of all balls."""
    scene = scenes.empty(size=(GRID * BALL_PX,) * 2, samples=1)
    scenes.camera(location=(0.0, -50.0, 0.0), type='ORTHO', ortho_scale=float(GRID))
    for settings in (scene.volley, scene.cycles):
        settings.pixel_filter_type, settings.filter_width = 'GAUSSIAN', 0.01
    scenes.light('POINT', location=(0.0, -40.0, 10.0), energy=1e4, shadow_soft_size=0.0)
    ball = scenes.sphere(radius=_CONSTANT_BALLS)
    tint = ball.data.color_attributes.new("Tint", 'FLOAT_COLOR', 'POINT')
    for number, item in enumerate(tint.data):
        item.color = (number % 7 / 7, number % 5 / 5, number % 3 / 3, 1.0)
    ball.data.materials.append(None)
    bpy.data.objects.remove(ball)
    return bpy.data.meshes[-1]


def _place(mesh, number, material):
    ball = scenes.link(f"Ball {number}", mesh)
    ball.material_slots[0].link = 'OBJECT'
    ball.material_slots[0].material = material
    x, z = number % GRID, number // GRID
    ball.location = (x - 0.5 * (GRID - 1), 0.0, z - 0.5 * (GRID - 1))
    ball.rotation_euler = (0.3, 0.4, 0.5)


def sweep():
    """[(node, name, whether it is a surface, warnings, mean error, share of pixels that are off)] of all cases."""
    import volley.session
    told, found = [], []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    waiting = list(_cases())
    while waiting:
        mesh, shown = _stage(), []
        things = _things()
        while waiting and len(shown) < _PER_PICTURE:
            case = waiting.pop(0)
            material = _material(len(shown), case, things)
            if material is not None:
                _place(mesh, len(shown), material)
                shown.append(case)
        told.clear()
        pictures = [picture[..., :3].astype(np.float64) for picture in scenes.by_both(1)]
        for number, (kind, token, _, output) in enumerate(shown):
            label = f"Material 'Case {number}': "
            said = [message[len(label):] for message in told if message.startswith(label)]
            x, y = number % GRID * BALL_PX, number // GRID * BALL_PX
            ours, theirs = (picture[y:y + BALL_PX, x:x + BALL_PX] for picture in pictures)
            is_surface = output in ("BSDF", "BSSRDF", "Volume", "Shader", "Emission", "Background", "Holdout")
            off = np.abs(ours - theirs) > TOLERANCE * np.maximum(np.abs(theirs), 0.5)
            found.append((kind, token, is_surface, said, float(np.nan_to_num(np.abs(ours - theirs)).mean()),
                          float(off.any(axis=-1).mean())))
    return found
