# SPDX-License-Identifier: Apache-2.0
"""Inside Blender: the names of all settings that Cycles may read, by type.

Of a type: "setting", of an enumeration "setting=ITEM" for each item; of nodes also ">input" and "<output" by
identifier. What a type has from its base, such as the users of data blocks, is not repeated.
"""

import bpy

# Types whose settings are walked, beside all nodes of shaders and Cycles' own property groups.
TYPES = (
    "Light", "PointLight", "SpotLight", "SunLight", "AreaLight", "Camera", "CameraDOFSettings", "CameraStereoData",
    "World", "WorldLighting", "WorldMistSettings", "Material", "Image", "ImageUser", "UDIMTile",
    "ColorManagedInputColorspaceSettings", "TexMapping", "ColorRamp", "CurveMapping", "Object",
    "ObjectLightLinking", "CollectionLightLinking", "LayerCollection", "ViewLayer", "Lightgroup", "AOV",
    "RenderSettings", "View3DShading", "Mesh", "Curves", "PointCloud", "Volume", "ParticleSettings")


def _names(kind, base):
    """The settings of a class that its base does not have."""
    inherited = set(base.bl_rna.properties.keys()) if base is not None else {"rna_type"}
    for setting in kind.bl_rna.properties:
        if setting.identifier in inherited:
            continue
        items = [item.identifier for item in getattr(setting, "enum_items_static", ())]
        yield from (f"{setting.identifier}={item}" for item in items)
        if not items:
            yield setting.identifier


def _groups():
    """The property groups that Cycles' add-on registers."""
    return {kind.__name__: kind for kind in bpy.types.PropertyGroup.__subclasses__()
            if kind.__name__.startswith("Cycles") and kind.is_registered}


def _nodes():
    """{type: an instance} of all nodes that a shader's tree takes."""
    tree = bpy.data.node_groups.new("Walked", "ShaderNodeTree")
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        if not (isinstance(kind, type) and issubclass(kind, bpy.types.Node)):
            continue
        try:
            yield name, tree.nodes.new(name)
        except RuntimeError:  # not of shaders
            continue


def walk():
    """{type: sorted names} of everything in this Blender."""
    found = {}
    for name in TYPES:
        kind = getattr(bpy.types, name, None)
        if kind is not None:
            found[name] = _names(kind, kind.__mro__[1] if hasattr(kind.__mro__[1], "bl_rna") else None)
    for name, kind in _groups().items():
        found[name] = _names(kind, bpy.types.PropertyGroup)
    base = bpy.types.ShaderNode
    for name, node in _nodes():
        found[name] = [*_names(type(node), base), *(f">{socket.identifier}" for socket in node.inputs),
                       *(f"<{socket.identifier}" for socket in node.outputs)]
    return {name: sorted(set(names)) for name, names in found.items()}
