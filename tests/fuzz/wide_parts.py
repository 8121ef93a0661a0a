# SPDX-License-Identifier: Apache-2.0
"""What random scenes have from seed FIRST on besides; older seeds stay the scenes that they are."""

FIRST = 20000
PARTS = ("inputs", "sources", "chains", "images", "emission", "normal_maps", "displacement", "slots", "mirrored",
         "offsets", "curves", "instancers", "linking", "catchers", "lamp_settings", "panorama", "limits", "fast_gi",
         "groups", "more_passes")

# What a surface's colours and numbers may come from but textures, without outputs that can be negative.
SOURCES = {"ShaderNodeObjectInfo": ("Color", "Random"), "ShaderNodeLayerWeight": ("Fresnel", "Facing"),
           "ShaderNodeNewGeometry": ("Backfacing", "Pointiness", "Random Per Island"),
           "ShaderNodeLightPath": ("Is Camera Ray", "Is Glossy Ray", "Is Transmission Ray", "Is Singular Ray"),
           "ShaderNodeHairInfo": ("Is Strand", "Intercept", "Random"), "ShaderNodePointInfo": ("Random",),
           "ShaderNodeWireframe": ("Fac",), "ShaderNodeVertexColor": ("Color",), "ShaderNodeParticleInfo": ("Random",),
           "ShaderNodeAmbientOcclusion": ("Color", "AO"), "ShaderNodeBlackbody": ("Color",)}
CHAINS = ("ShaderNodeValToRGB", "ShaderNodeGamma", "ShaderNodeInvert", "ShaderNodeHueSaturation",
          "ShaderNodeRGBCurve", "ShaderNodeMapRange", "ShaderNodeClamp", "ShaderNodeBrightContrast")
# Numbers of shaders that textures may give.
INPUTS = ("Roughness", "Metallic", "Alpha", "IOR", "Anisotropic", "Anisotropy", "Rotation", "Anisotropic Rotation",
          "Specular", "Specular IOR Level", "Transmission", "Transmission Weight", "Clearcoat", "Coat Weight", "Sheen",
          "Sheen Weight", "Strength", "Fac", "Factor")
MORE_PASSES = {"use_pass_uv": "UV", "use_pass_ambient_occlusion": "AO"}  # others are of a pixel's first sample


# Nodes -------------------------------------------------------------------------------------------

def source(scene, tree):
    """An output of a node that knows what is shaded."""
    import scenes
    rng = scene.rng("sources")
    node = tree.nodes.new(rng.choice(sorted(SOURCES)))
    if node.bl_idname == "ShaderNodeVertexColor":
        node.layer_name = "Col"
    if node.bl_idname == "ShaderNodeBlackbody":
        node.inputs[0].default_value = rng.uniform(1500.0, 9000.0)
    if node.bl_idname == "ShaderNodeAmbientOcclusion":
        node.inside, node.only_local = rng.random() < 0.3, rng.random() < 0.3
        node.inputs["Distance"].default_value = rng.uniform(0.2, 2.0)
    name = rng.choice(SOURCES[node.bl_idname])
    return scenes.socket(node.outputs, name)


def chain(scene, tree, output):
    """What a node that changes a colour or number makes of an output, without values below 0."""
    rng = scene.rng("chains")
    node = tree.nodes.new(rng.choice(CHAINS))
    names = ("Fac", "Factor") if node.bl_idname == "ShaderNodeValToRGB" else ("Color", "Value")
    tree.links.new(output, next(node.inputs[name] for name in names if name in node.inputs))
    if node.bl_idname == "ShaderNodeValToRGB":
        ramp = node.color_ramp
        ramp.interpolation = rng.choice(('LINEAR', 'CONSTANT', 'EASE', 'B_SPLINE'))
        ramp.elements.new(rng.uniform(0.2, 0.8)).color = [rng.random() for _ in range(3)] + [1.0]
    elif node.bl_idname == "ShaderNodeRGBCurve":
        node.mapping.curves[3].points.new(rng.uniform(0.2, 0.8), rng.random())
        node.mapping.update()
    elif node.bl_idname == "ShaderNodeGamma":
        node.inputs[1].default_value = rng.uniform(0.5, 2.0)
    elif node.bl_idname == "ShaderNodeHueSaturation":
        node.inputs[0].default_value, node.inputs[1].default_value = rng.random(), rng.uniform(0.0, 1.0)
    elif node.bl_idname == "ShaderNodeBrightContrast":
        node.inputs[1].default_value = rng.uniform(0.0, 0.3)
    elif node.bl_idname == "ShaderNodeMapRange":
        node.inputs["To Min"].default_value, node.inputs["To Max"].default_value = rng.random(), rng.random()
    return next(one for one in node.outputs if one.enabled)


def image_texture(scene, tree):
    """An image of coloured squares, laid on somehow; its output."""
    import bpy
    rng = scene.rng("images")
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Squares", 32, 32)
    node.image.generated_type = 'COLOR_GRID'
    node.projection = rng.choice(('FLAT', 'FLAT', 'BOX', 'SPHERE', 'TUBE'))
    node.projection_blend = rng.choice((0.0, 0.3))
    node.extension = rng.choice(('REPEAT', 'CLIP', 'EXTEND'))
    node.interpolation = rng.choice(('Linear', 'Closest', 'Cubic'))
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["UV" if node.projection == 'FLAT' else "Generated"], node.inputs["Vector"])
    return node.outputs["Color"]


def normal_map(scene, tree, textured):
    """A normal map of a texture, its output."""
    rng = scene.rng("normal_maps")
    node = tree.nodes.new("ShaderNodeNormalMap")
    node.space = rng.choice(('TANGENT', 'OBJECT', 'WORLD', 'BLENDER_OBJECT', 'BLENDER_WORLD'))
    node.inputs["Strength"].default_value = rng.uniform(0.1, 0.6)
    textured(scene, tree, node.inputs["Color"])
    return node.outputs[0]


def draw_emission(scene, node):
    """Light of a Principled surface's own."""
    rng = scene.rng("emission")
    color = node.inputs["Emission Color" if "Emission Color" in node.inputs else "Emission"]
    color.default_value = [rng.random() for _ in range(3)] + [1.0]
    node.inputs["Emission Strength"].default_value = rng.uniform(0.2, 3.0)


def add_displacement(scene, made, textured):
    """A displaced surface."""
    rng = scene.rng("displacement")
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeDisplacement")
    node.inputs["Scale"].default_value, node.space = rng.uniform(0.05, 0.3), rng.choice(('OBJECT', 'WORLD'))
    textured(scene, tree, node.inputs["Height"])
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    owner = made if hasattr(made, "displacement_method") else made.cycles
    owner.displacement_method = rng.choice(('BUMP', 'DISPLACEMENT', 'BOTH'))


# Objects -----------------------------------------------------------------------------------------

def change_object(scene, one, material):
    """Slots, colours of corners, mirrored scales, offsets of the terminator and what reflections see."""
    rng = scene.rng("change_object")
    if one.type == 'MESH':
        colors = one.data.color_attributes.new("Col", 'FLOAT_COLOR', rng.choice(('POINT', 'CORNER')))
        for each in colors.data:
            each.color = [rng.random() for _ in range(3)] + [1.0]
        if scene.has("slots", 0.3):
            one.data.materials.append(material())
            for polygon in one.data.polygons:
                polygon.material_index = int(scene.rng("slots").random() < 0.5)
    if scene.has("mirrored", 0.25):
        one.scale[scene.rng("mirrored").randrange(3)] *= -1.0
    if scene.has("offsets", 0.25):
        owner = one if hasattr(one, "shadow_terminator_geometry_offset") else one.cycles
        name = "shadow_terminator_shading_offset"
        setattr(owner, name if hasattr(owner, name) else "shadow_terminator_offset",
                scene.rng("offsets").uniform(0.0, 0.5))
        owner.shadow_terminator_geometry_offset = scene.rng("offsets").uniform(0.0, 0.4)
    if rng.random() < 0.1:
        one.visible_glossy = False


def add_curves(scene, shown):
    """Curves as new hair is, where this Blender can make them."""
    import bpy
    import scenes
    rng = scene.rng("curves")
    data = bpy.data.hair_curves.new("Curves")
    if not hasattr(data, "add_curves"):
        return
    sizes = [rng.randint(2, 7) for _ in range(rng.randint(3, 30))]
    data.add_curves(sizes)
    places, radii = [], []
    for size in sizes:
        place = [rng.uniform(-1.5, 1.5), rng.uniform(-1.0, 1.0), rng.uniform(-1.2, 0.6)]
        for _ in range(size):
            places.extend(place)
            place = [x + rng.uniform(-0.15, 0.25) for x in place]
            radii.append(rng.uniform(0.0, 0.05))
    data.position_data.foreach_set("vector", places)
    radius = data.attributes.get("radius") or data.attributes.new("radius", 'FLOAT', 'POINT')
    radius.data.foreach_set("value", radii)
    data.materials.append(shown)
    scenes.link("Curves", data)


def add_instancer(scene, skin, source_object):
    """Copies of an object by particles or by what a mesh is made of."""
    rng = scene.rng("instancers")
    kind = rng.choice(("particles", "VERTS", "FACES"))
    if kind == "particles":
        skin.modifiers.new("Copies", 'PARTICLE_SYSTEM')
        settings = skin.particle_systems[-1].settings
        settings.type, settings.count, settings.hair_length = 'HAIR', 12, 0.5
        settings.render_type, settings.instance_object = 'OBJECT', source_object
        settings.particle_size, settings.size_random = 0.3, 0.5
    else:
        source_object.parent, skin.instance_type = skin, kind
        source_object.scale = [0.15 * x for x in source_object.scale]
        skin.use_instance_faces_scale = rng.random() < 0.5


# Light, camera and render ------------------------------------------------------------------------

def change_lamp(scene, lamp, made):
    """Settings of a lamp that are seldom used."""
    import bpy
    rng, data = scene.rng("lamp_settings"), lamp.data
    if scene.has("lamp_settings", 0.5):
        kind = rng.choice(("exposure", "temperature", "normalize", "shadowless", "bounces", "negative", "sampling"))
        if kind == "exposure" and hasattr(data, "exposure"):
            data.exposure = rng.uniform(-1.0, 1.0)
        elif kind == "temperature" and hasattr(data, "use_temperature"):
            data.use_temperature, data.temperature = True, rng.uniform(2000.0, 9000.0)
        elif kind == "normalize" and hasattr(data, "normalize"):
            data.normalize = False
        elif kind == "shadowless":
            if hasattr(data.cycles, "cast_shadow"):
                data.cycles.cast_shadow = False
            else:
                data.use_shadow = False
        elif kind == "bounces":
            data.cycles.max_bounces = rng.randint(0, 2)
        elif kind == "negative":
            data.energy *= -0.05
        elif kind == "sampling":
            data.cycles.use_multiple_importance_sampling = False
    if hasattr(lamp, "light_linking") and made and scene.has("linking", 0.5):
        links = scene.rng("linking")
        for name in ("receiver_collection", "blocker_collection"):
            if links.random() < 0.6:
                chosen = bpy.data.collections.new(name)
                for one in made:
                    if links.random() < 0.5:
                        chosen.objects.link(one)
                if len(chosen.objects):
                    setattr(lamp.light_linking, name, chosen)
                    state = links.choice(('INCLUDE', 'EXCLUDE')) if name == "receiver_collection" else 'EXCLUDE'
                    for each in chosen.collection_objects:
                        each.light_linking.link_state = state


def change_camera(scene, camera):
    """A panorama."""
    rng, data = scene.rng("panorama"), camera.data
    data.type, data.dof.use_dof = 'PANO', False
    owner = data if hasattr(data, "panorama_type") else data.cycles
    owner.panorama_type = rng.choice(('EQUIRECTANGULAR', 'FISHEYE_EQUIDISTANT', 'FISHEYE_EQUISOLID', 'MIRRORBALL'))
    owner.fisheye_fov, owner.fisheye_lens = rng.uniform(2.0, 4.0), rng.uniform(6.0, 12.0)
    camera.location = (0.0, rng.uniform(-4.0, -2.5), 0.4)


def change_settings(scene):
    """Limits and Fast GI of both engines; Cycles' settings by name, for each of its renders anew. Without clamps: both
    choose lights by other chances, and clamp other samples."""
    import bpy
    # What is darker Cycles leaves out by chance: rims of lights that are lost to few samples have no shadows.
    both, limits = bpy.context.scene, {"light_sampling_threshold": 0.0} if scene.seed >= FIRST else {}
    if scene.has("limits", 0.3):
        rng = scene.rng("limits")
        for ours, theirs in (("max_depth", "max_bounces"), ("max_glossy_depth", "glossy_bounces"),
                             ("max_transmission_depth", "transmission_bounces"),
                             ("max_transparent_depth", "transparent_max_bounces")):
            if rng.random() < 0.5:
                limits[theirs] = rng.randint(0, 4)
                setattr(both.volley, ours, limits[theirs])
    if scene.has("fast_gi", 0.2):
        rng = scene.rng("fast_gi")
        both.volley.use_ambient_occlusion = both.cycles.use_fast_gi = True
        both.volley.ao_method = both.cycles.fast_gi_method = rng.choice(('ADD', 'REPLACE'))
        both.world.light_settings.ao_factor = rng.uniform(0.3, 1.0)
        both.world.light_settings.distance = rng.uniform(0.3, 3.0)
    return limits


def add_passes(scene):
    """More passes of the view layer: their names."""
    import bpy
    layer, names = bpy.context.view_layer, []
    if scene.has("more_passes", 0.4):
        for setting, name in MORE_PASSES.items():
            setattr(layer, setting, True)
            names.append(name)
    if scene.has("groups", 0.3):
        rng = scene.rng("groups")
        for name in ("Key", "Rest"):
            bpy.ops.scene.view_layer_add_lightgroup(name=name)
            names.append(f"Combined_{name}")
        for one in (*bpy.data.objects, bpy.context.scene.world):
            one.lightgroup = rng.choice(("Key", "Rest"))
    return names
