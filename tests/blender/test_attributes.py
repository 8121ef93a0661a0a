# SPDX-License-Identifier: Apache-2.0
"""Attributes of meshes and points beside Cycles': every type on every domain, each shown by an emission, one sample
for each pixel."""

import blender as blender_support
import numpy as np

IS_OLD = blender_support.version() < (4, 1)  # Cycles reads neither small integers nor vertex groups
CELL = 32          # pixels of a case, along either side
COLUMNS = 6
TOLERANCE = 5e-3   # 0.01 of a pixel of the steepest
RIM = 5  # pixels
ROOM = 64  # attributes of a mesh
LONGEST = 255 if blender_support.version() >= (5, 0) else 62  # letters of a name
SHARE_WITHIN = 0.98  # of a case's pixels; its outline may fall on either side

NAMES = (("N", "Vector"), ("uv", "Vector"), ("uv", "Fac"), ("generated", "Vector"), ("tangent", "Vector"),
         ("UVMap.tangent", "Vector"), ("UVMap.tangent", "Fac"), ("pointiness", "Fac"), ("random_per_island", "Fac"),
         ("color", "Color"), ("color", "Alpha"), ("velocity", "Vector"), ("temperature", "Fac"),
         ("curve_length", "Fac"), ("plain", "Vector"), ("Ng", "Vector"), ("undisplaced", "Vector"),
         ("UVMap.tangent_sign", "Fac"), ("tangent_sign", "Vector"))


# Inside Blender ------------------------------------------------------------------------------------

def _grid(name):
    """A square of 3 x 3 faces that faces -Y, of 0.9 along its sides."""
    import scenes
    places = [(0.3 * x - 0.45, 0.0, 0.3 * z - 0.45) for z in range(4) for x in range(4)]
    return scenes.mesh(name, places, [(i, i + 1, i + 5, i + 4) for i in range(11) if i % 4 != 3])


def _fill(attribute, random):
    """Give an attribute values, those of rotations of unit length."""
    count, kind = len(attribute.data), attribute.data_type
    fields = {'BYTE_COLOR': ("color", 4), 'FLOAT_COLOR': ("color", 4), 'FLOAT_VECTOR': ("vector", 3),
              'FLOAT2': ("vector", 2), 'QUATERNION': ("value", 4)}
    field, width = fields.get(kind, ("value", 1))
    values = random.random((count, width))
    if kind in {'INT', 'INT8', 'BOOLEAN'}:
        values = np.floor(values * (2 if kind == 'BOOLEAN' else 4))
    if kind == 'QUATERNION':
        values /= np.linalg.norm(values, axis=1, keepdims=True)
    for item, value in zip(attribute.data, values.tolist()):
        plain = {'BOOLEAN': bool, 'INT': int, 'INT8': int}.get(kind, float)(value[0])
        setattr(item, field, plain if width == 1 else value)


def _shining(output, kind="ShaderNodeAttribute", scale=(1.0, 1.0, 1.0), **settings):
    """A material that shines with what an Attribute node, or one of another kind, gives, scaled and 0.1 added."""
    import scenes
    made = scenes.emitter((0.0, 0.0, 0.0), output)
    tree = made.node_tree
    node, shown = tree.nodes.new(kind), tree.nodes.new("ShaderNodeVectorMath")
    for name, value in settings.items():
        setattr(node, name, value)
    shown.operation, shown.inputs[1].default_value = 'MULTIPLY_ADD', scale
    shown.inputs[2].default_value = (0.1, 0.1, 0.1)
    tree.links.new(node.outputs[output], shown.inputs[0])
    tree.links.new(shown.outputs[0], scenes.shader_of(made).inputs["Color"])
    return made


def _pictures_of(owners):
    """{case: [by Volley, by Cycles]} of objects {case: object}, which are put side by side."""
    import scenes
    rows = -(-len(owners) // COLUMNS)
    scene = scenes.bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = COLUMNS * CELL, rows * CELL
    scenes.camera(location=(0.0, -6.0, 0.0), type='ORTHO', ortho_scale=float(max(COLUMNS, rows)))
    scenes.sharpen()
    for number, owner in enumerate(owners.values()):
        owner.location = (number % COLUMNS - 0.5 * (COLUMNS - 1), 0.0, number // COLUMNS - 0.5 * (rows - 1))
    pictures = scenes.by_both(1)
    return {case: [picture[number // COLUMNS * CELL:, number % COLUMNS * CELL:][:CELL, :CELL, :3]
                   for picture in pictures] for number, case in enumerate(owners)}


def inside_types():
    """Pictures of every type on every domain."""
    return _types_in(lambda: _shining("Color", attribute_name="at"))


def inside_maps():
    """The same by the first two coordinates of a UV Map node."""
    return _types_in(lambda: _shining("UV", "ShaderNodeUVMap", (1.0, 1.0, 0.0), uv_map="at"))


def _types_in(make_material):
    """Pictures of attributes of every type on every domain, each in a material."""
    import bpy
    import scenes
    scenes.empty()
    random, owners, material = np.random.default_rng(7), {}, make_material()
    known = {item.identifier for item in bpy.types.Attribute.bl_rna.properties["data_type"].enum_items}
    for kind in ('FLOAT', 'INT', 'INT8', 'BOOLEAN', 'FLOAT_VECTOR', 'FLOAT2', 'FLOAT_COLOR', 'BYTE_COLOR',
                 'QUATERNION'):
        for domain in ('POINT', 'EDGE', 'FACE', 'CORNER') if kind in known else ():
            made = _grid(f"{kind} {domain}")
            _fill(made.data.attributes.new("at", kind, domain), random)
            made.data.materials.append(material)
            owners[made.name] = made
    return _pictures_of(owners)


def _store_random(store, kind, domain):
    """Let a Store Named Attribute node give what is of a domain random values of a type, as "at"."""
    store.data_type, store.domain, store.inputs["Name"].default_value = kind, domain, "at"
    random = store.id_data.nodes.new("FunctionNodeRandomValue")
    random.data_type = {'FLOAT_COLOR': 'FLOAT_VECTOR'}.get(kind, kind)
    value = next(socket for socket in random.outputs if socket.enabled)
    store.id_data.links.new(value, next(each for each in store.inputs if each.name == "Value" and each.enabled))


def inside_points():
    """Pictures of numbers and switches of a cloud's points."""
    import scenes
    scenes.empty()
    owners = {}
    for kind in ('FLOAT', 'BOOLEAN'):
        made = owners[f"points' {kind}"] = _grid(kind)
        points, store, assign = scenes.geometry_nodes(made, "GeometryNodeMeshToPoints",
                                                      "GeometryNodeStoreNamedAttribute", "GeometryNodeSetMaterial")
        points.inputs["Radius"].default_value = 0.12
        _store_random(store, kind, 'POINT')
        assign.inputs["Material"].default_value = _shining("Color", attribute_name="at")
    return _pictures_of(owners)


def inside_long_names():
    """Pictures of two attributes of a mesh whose names are as long as this Blender lets them be and differ at the
    end."""
    import scenes
    scenes.empty()
    random, owners = np.random.default_rng(7), {}
    for letter in "ab":
        made = _grid(letter)
        for name in ("a", "b"):
            _fill(made.data.attributes.new("n" * (LONGEST - 1) + name, 'FLOAT_COLOR', 'POINT'), random)
        made.data.materials.append(_shining("Color", attribute_name="n" * (LONGEST - 1) + letter))
        owners[letter] = made
    return _pictures_of(owners)


def inside_groups():
    """Pictures of vertex groups, of meshes and of what modifiers make of them."""
    import scenes
    scenes.empty()
    owners = {}
    material = _shining("Color", attribute_name="at")
    for number, name in enumerate(("of a mesh", "subdivided", "solid")):
        made = owners[name] = _grid(name)
        made.vertex_groups.new(name="other").add(range(16), 0.9, 'REPLACE')
        group = made.vertex_groups.new(name="at")
        for vertex in (0, 5, 6, 10, 11, 13):
            group.add((vertex,), 0.1 * (number + 1) + 0.05 * vertex, 'REPLACE')
        made.data.materials.append(material)
    owners["subdivided"].modifiers.new("Subdivision", 'SUBSURF')
    owners["solid"].modifiers.new("Solidify", 'SOLIDIFY').thickness = 0.1
    return _pictures_of(owners)


def inside_instances():
    """Pictures of what nodes gave instances, and instances of those, the warnings, and whether this Blender lets
    anyone read them."""
    import bpy
    import scenes
    import volley.session
    scenes.empty()
    told, owners = [], {}
    volley.session.report_warning = lambda _engine, message: told.append(message)
    for kind, depth, shares_ids in (('FLOAT_COLOR', 1, False), ('FLOAT', 1, False), ('BOOLEAN', 1, False),
                                    ('FLOAT', 2, False), ('FLOAT', 1, True), ('FLOAT', 2, True)):
        case = f"{kind} {depth}{' shared' * shares_ids}"
        made = owners[case] = _grid(case)
        if shares_ids:  # one by a few points, which Blender tells apart by other numbers
            for number, item in enumerate(made.data.attributes.new("id", 'INT', 'POINT').data):
                item.value = number // 3
        *inner, outer, store = scenes.geometry_nodes(
            made, *("GeometryNodeInstanceOnPoints",) * depth, "GeometryNodeStoreNamedAttribute")
        group = outer.id_data
        cube, assign = group.nodes.new("GeometryNodeMeshCube"), group.nodes.new("GeometryNodeSetMaterial")
        cube.inputs["Size"].default_value = (0.2 / depth,) * 3
        assign.inputs["Material"].default_value = _shining("Color", attribute_name="at", attribute_type='INSTANCER')
        group.links.new(cube.outputs["Mesh"], assign.inputs["Geometry"])
        shown = assign.outputs["Geometry"]
        for node in inner:  # a line of two on each point
            line = group.nodes.new("GeometryNodeMeshLine")
            line.inputs["Count"].default_value, line.inputs["Offset"].default_value = 2, (0.0, 0.0, 0.12)
            group.links.new(line.outputs["Mesh"], node.inputs["Points"])
            group.links.new(shown, node.inputs["Instance"])
            shown = node.outputs["Instances"]
        group.links.new(next(n for n in group.nodes if n.type == 'GROUP_INPUT').outputs[0], outer.inputs["Points"])
        group.links.new(shown, outer.inputs["Instance"])
        _store_random(store, kind, 'INSTANCE')
    return _pictures_of(owners), told, hasattr(bpy.types.Object, "evaluated_geometry")


def inside_many():
    """The warnings of renders of meshes and clouds whose materials read as many attributes as there is room for, and
    two more."""
    import scenes
    import volley.session
    told = {}
    for count in (ROOM, ROOM + 2):
        for kind in ("mesh", "cloud"):
            scenes.empty()
            scenes.camera(location=(0.0, -6.0, 0.0))
            made, lines = _grid("Grid"), told.setdefault(f"{kind}, {count}", [])
            volley.session.report_warning = lambda _engine, message, lines=lines: lines.append(message)
            material = scenes.emitter((1.0, 1.0, 1.0))
            tree, shown = material.node_tree, scenes.shader_of(material).inputs["Color"]
            for number in range(count):
                made.data.attributes.new(f"at{number}", 'FLOAT', 'POINT')
                node, add = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeVectorMath")
                node.attribute_name = f"at{number}"
                tree.links.new(node.outputs["Color"], add.inputs[0])
                tree.links.new(add.outputs[0], shown)
                shown = add.inputs[1]
            made.data.materials.append(material)
            if kind == "cloud":
                _, assign = scenes.geometry_nodes(made, "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial")
                assign.inputs["Material"].default_value = material
            scenes.render()
    return told


# What Attribute nodes show: type and domain of the attribute, its name in the node, output.
OUTPUTS = (
    ('FLOAT2', 'POINT', "at", "Fac"), ('FLOAT2', 'EDGE', "at", "Fac"), ('FLOAT_VECTOR', 'FACE', "at", "Fac"),
    ('FLOAT_COLOR', 'CORNER', "at", "Fac"), ('FLOAT', 'FACE', "UVMap", "Fac"), ('FLOAT', 'FACE', "UVMap", "Alpha"),
    ('FLOAT_COLOR', 'POINT', "at", "Alpha"), ('BYTE_COLOR', 'FACE', "at", "Alpha"),
    ('BYTE_COLOR', 'EDGE', "at", "Alpha"), ('FLOAT', 'POINT', "at", "Alpha"), ('FLOAT', 'POINT', "nowhere", "Alpha"),
    ('FLOAT', 'POINT', "nowhere", "Color"), ('FLOAT', 'POINT', "", "Color"), ('FLOAT', 'POINT', "", "Vector"),
    ('FLOAT', 'POINT', "", "Fac"), ('FLOAT', 'POINT', "", "Alpha"))


def inside_outputs():
    """Pictures of what the outputs of Attribute nodes give, and the warnings."""
    import scenes
    import volley.session
    scenes.empty()
    told = []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    random, owners = np.random.default_rng(11), {}
    for kind, domain, name, output in OUTPUTS:
        case = f"{kind} {domain} '{name}' {output}"
        made = owners[case] = _grid(case)
        _fill(made.data.attributes.new("at", kind, domain), random)
        for item in made.data.uv_layers.new(name="UVMap").data:
            item.uv = random.random(2)
        made.data.materials.append(_shining(output, attribute_name=name))
    for kind in ('OBJECT', 'INSTANCER', 'VIEW_LAYER'):
        made = owners[f"{kind} ''"] = _grid(kind)
        made.data.materials.append(_shining("Color", attribute_name="", attribute_type=kind))
    return _pictures_of(owners), told


def inside_names(names):
    """Pictures of the names that Cycles keeps for itself: of a mesh without such attributes, and of one that has
    them; the warnings."""
    import scenes
    import volley.session
    scenes.empty()
    told, owners = [], {}
    volley.session.report_warning = lambda _engine, message: told.append(message)
    for name, output in names:
        for is_own in (False, True):
            made = owners[f"{name} {output}{' own' * is_own}"] = scenes.sphere(radius=0.4)
            made.scale, made.rotation_euler = (1.0, 1.0, 0.8), (0.3, 0.2, 0.5)
            if is_own:
                for item in made.data.attributes.new(name, 'FLOAT_COLOR', 'POINT').data:
                    item.color = 0.7, 0.4, 0.2, 0.5
            made.data.materials.append(_shining(output, attribute_name=name))
    layer = owners["layer"] = scenes.sphere(radius=0.4)
    _fill(layer.data.attributes.new("color", 'FLOAT_COLOR', 'POINT'), np.random.default_rng(3))
    material = scenes.emitter((0.0, 0.0, 0.0), "Layer")
    node = material.node_tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "color"
    material.node_tree.links.new(node.outputs["Color"], scenes.shader_of(material).inputs["Color"])
    layer.data.materials.append(material)
    return _pictures_of(owners), told


def _scatter(name, size, shown=None):
    """An object that sets cubes, or instances of an object, on the corners of a grid, each with a colour unless it is
    an object's."""
    import scenes
    made = _grid(name)
    kinds = ("GeometryNodeInstanceOnPoints",) + ("GeometryNodeStoreNamedAttribute",) * (shown is None)
    outer, *stores = scenes.geometry_nodes(made, *kinds)
    group = outer.id_data
    if shown is not None:
        info = group.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = shown, True
        group.links.new(info.outputs["Geometry"], outer.inputs["Instance"])
        return made
    cube, assign = group.nodes.new("GeometryNodeMeshCube"), group.nodes.new("GeometryNodeSetMaterial")
    cube.inputs["Size"].default_value = (size,) * 3
    assign.inputs["Material"].default_value = _shining("Color", attribute_name="at", attribute_type='INSTANCER')
    group.links.new(cube.outputs["Mesh"], assign.inputs["Geometry"])
    group.links.new(assign.outputs["Geometry"], outer.inputs["Instance"])
    _store_random(stores[0], 'FLOAT_COLOR', 'INSTANCE')
    return made


def _collected(name, *members):
    """An empty that shows a collection of members, which the scene lets go of."""
    import bpy
    import scenes
    collection = bpy.data.collections.new(name)
    for each in members:
        collection.objects.link(each)
        bpy.context.scene.collection.objects.unlink(each)
    made = scenes.link(name, None)
    made.instance_type, made.instance_collection = 'COLLECTION', collection
    return made


def inside_collected():
    """As inside_instances, of objects that nodes make instances on, which are instanced themselves: in a collection,
    after another object, in a collection in one, and by other nodes."""
    import bpy
    import mathutils
    import scenes
    import volley.session
    scenes.empty()
    told = []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    owners = {"collection": _collected("One", scenes.link("First", None), _scatter("Second", 0.2)),
              "nested": _collected("Outer", _collected("Inner", _scatter("Third", 0.2)))}
    small = _scatter("Fourth", 0.05)
    small.data.transform(mathutils.Matrix.Scale(0.25, 4))
    _collected("Hidden", small).hide_render = True
    owners["object"] = _scatter("Fifth", 0.0, small)
    return _pictures_of(owners), told, hasattr(bpy.types.Object, "evaluated_geometry")


# Comparison ----------------------------------------------------------------------------------------

def _compare(pictures, shows_nothing=()):
    """Hold each case to Cycles; all but some are more than one colour there."""
    lines = []
    for case, (ours, theirs) in pictures.items():
        beyond = (np.abs(ours - theirs) > TOLERANCE).any(axis=-1).mean()
        lines.append(f"{case:24} {ours.mean():.4f} {theirs.mean():.4f} {beyond:.2%}")
    print("\n".join(lines))
    for line, (case, (_, theirs)) in zip(lines, pictures.items()):
        inner = theirs[CELL // 4:-CELL // 4, CELL // 4:-CELL // 4]
        assert case in shows_nothing or inner.std() > 0.01, f"shows nothing: {line}"
        assert float(line.split()[-1][:-1]) <= 100.0 * (1.0 - SHARE_WITHIN), line


def test_types(blender):
    pictures = blender.run(inside_types)
    assert len(pictures) >= 32
    _compare(pictures, [case for case in pictures if IS_OLD and case.startswith("INT8")])


def test_maps(blender):
    """Attributes that are no UV maps were black in UV Map nodes."""
    pictures = blender.run(inside_maps)
    _compare(pictures, [case for case in pictures if IS_OLD and case.startswith("INT8")])


def test_long_names(blender):
    """In Blender 5 such meshes were left out, as the library takes names of 63 letters."""
    _compare(blender.run(inside_long_names))


def test_points(blender):
    _compare(blender.run(inside_points))


def test_vertex_groups(blender):
    pictures = blender.run(inside_groups)
    _compare(pictures, pictures if IS_OLD else ())


def test_outputs(blender):
    pictures, told = blender.run(inside_outputs)
    of_one_colour = [case for case in pictures if "''" in case or "nowhere" in case
                     or case.startswith("FLOAT ") and case.endswith("Alpha")]
    _compare(pictures, of_one_colour)
    assert told == []


def test_those_without_room_are_named(blender):
    told = blender.run(inside_many)
    for kind in ("mesh", "cloud"):
        assert not any("attributes" in line for line in told[f"{kind}, {ROOM}"]), told
        assert [line for line in told[f"{kind}, {ROOM + 2}"] if "attributes" in line] == [
            f"Object 'Grid': has more than {ROOM} attributes that materials read, without 'at8', 'at9'"], told


def test_instances_of_nodes(blender):
    """All but the first instance of an id were black."""
    pictures, told, can_read = blender.run(inside_instances)
    if can_read:  # without the rim, where cubes of neighbours lie in one place
        _compare({case: [np.pad(each[RIM:-RIM, RIM:-RIM], ((RIM, RIM), (RIM, RIM), (0, 0))) for each in pair]
                  for case, pair in pictures.items()})
    assert any("attributes that nodes give instances" in line for line in told) != can_read, told


def test_instances_of_nodes_that_are_instanced(blender):
    """They were black, without a warning where they cannot be read."""
    pictures, told, can_read = blender.run(inside_collected)
    if can_read:
        _compare({case: [np.pad(each[RIM:-RIM, RIM:-RIM], ((RIM, RIM), (RIM, RIM), (0, 0))) for each in pair]
                  for case, pair in pictures.items()})
    lines = [line for line in told if "attributes that nodes give instances" in line]
    assert {line.split("'")[1] for line in lines} == (set() if can_read else {"One", "Outer", "Fifth"}), told


def test_names_that_cycles_keeps(blender):
    """Without them, meshes without an attribute of that name are black, and those with one show it. Signs of tangents
    were 0 beside Cycles 5.2."""
    pictures, told = blender.run(inside_names, NAMES)
    assert told == []
    _compare(pictures, pictures)
    shown = [case for case, (_, theirs) in pictures.items() if theirs[8:-8, 8:-8].std() > 0.03]
    assert {"N Vector", "uv Fac own", "tangent Vector", "UVMap.tangent Vector", "plain Vector own"} <= set(shown)
