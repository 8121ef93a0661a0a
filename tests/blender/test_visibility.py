# SPDX-License-Identifier: Apache-2.0
"""Which rays see what: the switches of objects and of what makes instances of them, holdouts, motion blur
of instances, each in a column of its own beside Cycles."""

import math

import compare
import numpy as np
import pytest

COLUMNS = 6
SPACING = 2.0   # m between columns
COLUMN_PX = 16
SAMPLES = 64
SWITCHES = ("visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission", "visible_shadow")
OFF = 1e-3  # beyond the noise that the seeds show
# Of Cycles' light, which depends on how densely each of the two samples a mesh.
MESH_PARTS = {"mesh hidden from transmission": (1.02, 1.5), "mesh hidden from diffuse": (0.2, 0.8)}
DARK_OFF = 2e-3  # where shadow rays to the world and diffuse rays may see other things


# Inside Blender ------------------------------------------------------------------------------------

def _column(number):
    return (number - 0.5 * (COLUMNS - 1)) * SPACING


def _room():
    """A mirror that shows what floats behind it over a matt floor in the sun, and a pane before the upper
    half of that: every kind of ray meets it."""
    import scenes
    scene = scenes.empty(size=(COLUMNS * COLUMN_PX, 48))
    # Aside, so that no edge runs through the middles of pixels.
    scenes.camera(location=(0.013, -10.0, 7.031), rotation=(math.radians(60), 0.0, 0.0), type='ORTHO',
                  ortho_scale=COLUMNS * SPACING)
    matt = scenes.material("Matt", "ShaderNodeBsdfDiffuse", Color=(0.7, 0.7, 0.7))
    mirror = scenes.material("Mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9), Roughness=0.0)
    glass = scenes.material("Pane", "ShaderNodeBsdfRefraction", Color=(0.7, 0.9, 0.8), Roughness=0.0, IOR=1.1)
    for name, near, far, material in (("Mirror", -3.5, -1.5, mirror), ("Floor", -1.5, 4.0, matt)):
        scenes.mesh(name, [(-7, near, 0), (7, near, 0), (7, far, 0), (-7, far, 0)], [(0, 1, 2, 3)], material)
    pane = scenes.mesh("Pane", [(-7, -1, 1.9), (7, -1, 1.9), (7, -1, 3), (-7, -1, 3)], [(0, 1, 2, 3)], glass)
    pane.visible_shadow = False
    scenes.light('SUN', energy=1.0, angle=0.0, rotation=(0.4, 0.1, 0.0))
    return scene


def _ball(number, shines=True):
    """A ball that is to float over a column."""
    import scenes
    material = scenes.emitter((1.0, 0.6, 0.3), strength=2.0) if shines else \
        scenes.material("Dull", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.6, 1.0))
    return scenes.sphere(f"Ball{number}", 0.4, (0.0, 0.0, 1.3), material)


def _lamp(kind):
    """A light that is to float over a column, seen by all rays."""
    import scenes
    made = scenes.light(kind, (0.0, 0.0, 1.3), (0.0, 0.0, 0.0), energy=60.0)
    made.data.shadow_soft_size = 0.4
    for switch in SWITCHES:
        setattr(made, switch, True)
    return made


def _instancer(number, *members):
    """An empty over a column that shows an own collection of these objects, which are nowhere else."""
    import bpy
    import scenes
    collection = bpy.data.collections.new(f"Source{number}")
    for member in members:
        bpy.context.scene.collection.objects.unlink(member)
        collection.objects.link(member)
    made = scenes.link(f"Instancer{number}", None)
    made.instance_type, made.instance_collection = 'COLLECTION', collection
    made.location.x = _column(number)
    return made


def _pictures():
    import scenes
    return scenes.seeds_by_both(SAMPLES)


def inside_switches(kind):
    """Balls or lights whose own switches, or those of their instancer, are off one after the other; the
    last column has all."""
    import scenes
    pictures = {}
    for where in ("own", "instancer"):
        _room()
        for number in range(COLUMNS):
            switch = SWITCHES[number] if number < len(SWITCHES) else ""
            # Light from within what casts no shadow has another weight in Cycles' sum of its samplings.
            member = _ball(number, switch != "visible_shadow") if kind == 'MESH' else _lamp(kind)
            instancer = _instancer(number, member)
            if switch:
                setattr(member if where == "own" else instancer, switch, False)
        pictures[where] = _pictures()
    return pictures


def inside_makers():
    """Balls that several kinds of makers show, which rays of two kinds do not see: as a maker's switches
    and as the ball's."""
    pictures = {}
    for switches in (("visible_camera", "visible_glossy"), ("visible_diffuse", "visible_shadow")):
        for where in ("own", "maker"):
            _room()
            for number, make in enumerate((_instancer, _faces, _vertices, _particles, _nodes)):
                ball = _ball(number, False)
                maker = make(number, ball)
                for switch in switches:
                    setattr(ball if where == "own" else maker, switch, False)
            pictures[f"{switches} of the {where}"] = _pictures()
    return pictures


def _triangle(number):
    """A small dark triangle over a column that makes instances of something."""
    import scenes
    made = scenes.mesh(f"Maker{number}", [(-0.2, 0.1, 1.3), (0.2, 0.1, 1.3), (0.0, 0.1, 1.7)], [(0, 1, 2)],
                       scenes.emitter((0.1, 0.1, 0.1), "Dark"))
    made.location.x = _column(number)
    return made


def _faces(number, ball):
    maker = _triangle(number)
    maker.instance_type, ball.parent, ball.location.z = 'FACES', maker, 0.0
    maker.show_instancer_for_render = False
    return maker


def _vertices(number, ball):
    maker = _triangle(number)
    maker.instance_type, ball.parent, ball.location.z = 'VERTS', maker, -0.2
    ball.scale = (0.6, 0.6, 0.6)
    return maker


def _particles(number, ball):
    maker = _triangle(number)
    maker.modifiers.new("Balls", 'PARTICLE_SYSTEM')
    settings = maker.particle_systems[0].settings
    settings.type, settings.count, settings.use_advanced_hair = 'HAIR', 2, True
    settings.render_type, settings.instance_object, settings.particle_size = 'OBJECT', ball, 0.15
    ball.location = (0.0, 0.0, -50.0)
    return maker


def _nodes(number, ball):
    import scenes
    maker = _triangle(number)
    instance, = scenes.geometry_nodes(maker, "GeometryNodeInstanceOnPoints")
    tree = maker.modifiers[0].node_group
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = ball, True
    tree.links.new(info.outputs["Geometry"], instance.inputs["Instance"])
    instance.inputs["Scale"].default_value = (0.6, 0.6, 0.6)
    ball.location = (0.0, 0.0, -50.0)
    return maker


def inside_holes():
    """Holdouts and objects that are only indirectly visible, of themselves, of their instancers and of
    collections; with and without a transparent film."""
    import bpy
    import scenes
    scene = _room()
    scene.render.film_transparent = True
    layer = bpy.context.view_layer.layer_collection

    def collected(thing, **settings):
        collection = bpy.data.collections.new("Of " + thing.name)
        scene.collection.children.link(collection)
        scene.collection.objects.unlink(thing)
        collection.objects.link(thing)
        for name, value in settings.items():
            setattr(layer.children[collection.name], name, value)

    balls = [_ball(number, False) for number in range(COLUMNS)]
    _instancer(0, balls[0])
    balls[0].is_holdout = True
    _instancer(1, balls[1]).is_holdout = True
    collected(_instancer(2, balls[2]), holdout=True)
    collected(_instancer(3, balls[3]), indirect_only=True)
    collected(_instancer(4, balls[4]), indirect_only=True, holdout=True)
    _instancer(5, balls[5])
    pictures = {"transparent film": _pictures()}
    scene.render.film_transparent = False
    pictures["film"] = _pictures()
    return pictures


def inside_clear_holes():
    """Holdouts of materials that are clear in part: by Alpha, by a texture, coloured, joined with what shines,
    of more than one slot, and of none; with and without a transparent film."""
    import scenes
    scene = _room()

    def mixed(name, *parts, node="ShaderNodeMixShader"):
        material = scenes.material(name, parts[0])
        tree = material.node_tree
        mix = tree.nodes.new(node)
        sockets = [socket for socket in mix.inputs if socket.type == 'SHADER']
        tree.links.new(scenes.shader_of(material).outputs[0], sockets[0])
        other = tree.nodes.new(parts[1])
        tree.links.new(other.outputs[0], sockets[1])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        return tree, mix, other

    balls = [_ball(number, False) for number in range(COLUMNS)]
    for number, ball in enumerate(balls):
        ball.location.x, ball.is_holdout = _column(number), True
        ball.data.materials.clear()
    balls[0].data.materials.append(scenes.material("Alpha", "ShaderNodeBsdfPrincipled", Alpha=0.4))
    tree, mix, _ = mixed("Checked", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent")
    tree.links.new(tree.nodes.new("ShaderNodeTexChecker").outputs[1], mix.inputs[0])
    _, _, clear = mixed("Coloured", "ShaderNodeBsdfGlass", "ShaderNodeBsdfTransparent")
    clear.inputs["Color"].default_value = (0.9, 0.5, 0.1, 1.0)
    mixed("Shining", "ShaderNodeEmission", "ShaderNodeBsdfTransparent", node="ShaderNodeAddShader")[2].inputs[
        "Color"].default_value = (0.3, 0.3, 0.6, 1.0)
    import bpy
    for number, name in ((1, "Checked"), (2, "Coloured"), (3, "Shining")):
        balls[number].data.materials.append(bpy.data.materials[name])
    for name in ("Alpha", "Coloured"):
        balls[4].data.materials.append(bpy.data.materials[name])
    for polygon in balls[4].data.polygons:
        polygon.material_index = polygon.index % 2
    scenes.sphere("Behind", 0.3, (0.0, 3.0, 1.0), scenes.emitter((0.2, 0.5, 0.9), "Behind"))
    pictures = {}
    for is_transparent in (True, False):
        scene.render.film_transparent = is_transparent
        pictures[f"transparent film {is_transparent}"] = _pictures()
    return pictures


def inside_hidden():
    """What is not to be rendered: a member, an instancer, their collections, a maker without itself."""
    import bpy
    _room()
    balls = [_ball(number, False) for number in range(COLUMNS)]
    balls[0].hide_render = True
    _instancer(0, balls[0])
    _instancer(1, balls[1]).hide_render = True
    _instancer(2, balls[2]).instance_collection.hide_render = True
    balls[3].hide_viewport = True
    _instancer(3, balls[3])
    _instancer(4, balls[4]).hide_viewport = True
    _vertices(5, balls[5]).show_instancer_for_render = False
    balls[5].hide_set(True)
    return {"hidden": _pictures()}


def inside_shadows():
    """Clear and half clear balls whose shadows are as clear or not, and lamps over dull ones that cast
    shadows or not."""
    import scenes
    _room()
    clear = scenes.material("Clear", "ShaderNodeBsdfTransparent", Color=(0.9, 0.6, 0.3))
    half = scenes.material("Half", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.6, 1.0))
    tree = half.node_tree
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(tree.nodes["Diffuse BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(tree.nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    for number, (material, is_clear) in enumerate(((clear, True), (clear, False), (half, False))):
        made = scenes.sphere("Clear", 0.4, (_column(number), 0.0, 1.3), material.copy()).data.materials[0]
        owner = made if hasattr(made, "use_transparent_shadow") else made.cycles
        owner.use_transparent_shadow = is_clear
    for number, kind in ((3, 'POINT'), (4, 'POINT'), (5, 'AREA')):
        _ball(number, False).location.x = _column(number)
        lamp = scenes.light(kind, (_column(number), 0.0, 2.4), (0.0, 0.0, 0.0), energy=20.0)
        lamp.data.use_shadow = number == 3
        if hasattr(lamp.data.cycles, "cast_shadow"):  # before 4.2
            lamp.data.cycles.cast_shadow = number == 3
    return {"shadows": _pictures()}


def inside_motion():
    """Moving instances whose blur is off or of other steps, by themselves or by their instancers, and
    members that deform; turning fast, so that steps are to be seen."""
    import bpy
    import scenes
    scene = scenes.empty(size=(COLUMNS * COLUMN_PX, 48))
    scenes.camera(location=(0.0, -10.0, 1.0), type='ORTHO', ortho_scale=COLUMNS * SPACING)
    pictures = {}
    for kind in ("moving", "deforming"):
        for number in range(COLUMNS):
            bar = scenes.mesh(f"Bar{number}", [(-0.8, 0, -0.1), (0.8, 0, -0.1), (0.8, 0, 0.2), (-0.8, 0, 0.2)],
                              [(0, 1, 2, 3)], scenes.emitter((1.0, 0.6, 0.3)))
            instancer = _instancer(number, bar)
            instancer.location.z = 1.0
            owner = (bar, instancer)[number % 2]
            if number // 2 == 0:
                owner.cycles.use_motion_blur = False
            elif number // 2 == 1:
                owner.cycles.use_deform_motion = False
            else:
                owner.cycles.motion_steps = 3
            moving = instancer
            if kind == "deforming":
                moving = bar.shape_key_add(name="Basis") and bar.shape_key_add(name="Up")
                for point in moving.data:
                    point.co.z += 2.0 * point.co.x
            for frame, value in ((0, -1.2), (1, 0.0), (2, 1.7)):
                if kind == "deforming":
                    moving.value = 0.5 + 0.4 * value
                    moving.keyframe_insert("value", frame=frame)
                else:
                    moving.rotation_euler.y = value
                    moving.keyframe_insert("rotation_euler", frame=frame)
        scene.frame_set(1)
        scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.5
        pictures[kind] = scenes.seeds_by_both(4 * SAMPLES)
        for thing in list(bpy.data.objects):
            if thing.type != 'CAMERA':
                bpy.data.objects.remove(thing)
    return pictures


def inside_camera():
    """A moving camera whose own blur is off, and of more steps."""
    import scenes
    scene = scenes.empty(size=(96, 48))
    made = scenes.camera()
    scenes.wall("Wall", 2.0, material=scenes.emitter((1.0, 0.6, 0.3)))
    for frame, value in ((0, -0.4), (1, 0.1), (2, 0.2)):
        made.rotation_euler = (math.pi / 2 + 0.2 * value * value, value, 0.0)
        made.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.5
    pictures = {}
    made.cycles.motion_steps = 3
    pictures["three steps"] = scenes.seeds_by_both(4 * SAMPLES)
    made.cycles.use_motion_blur = False
    pictures["off"] = scenes.seeds_by_both(SAMPLES)
    return pictures


def inside_translucent():
    """{what is hidden from which rays: pictures by both} of a translucent ball, whose rays are diffuse and
    transmitted ones: lamps and the world, and what is dark before an even world."""
    import bpy
    import scenes
    found = {}
    for what in ("lamp", "panel", "world", "dark", "mesh"):
        for switch in ("", "diffuse", "glossy", "transmission"):
            scene = scenes.empty(size=(32, 24))
            scenes.camera()
            scenes.sphere(material=scenes.material("Leaf", "ShaderNodeBsdfTranslucent", Color=(0.8, 0.7, 0.6)))
            if what == "lamp":
                hidden = scenes.light('POINT', (0.0, 2.0, 1.0), energy=200.0)
                hidden.data.shadow_soft_size = 0.9
            elif what == "panel":
                hidden = scenes.light('AREA', (0.0, 3.0, 1.0), (-1.5, 0.0, 0.0), energy=200.0)
                hidden.data.size = 2.0
            elif what == "mesh":
                hidden = scenes.sphere("Glow", 1.0, (0.0, 3.0, 1.0), scenes.emitter((1.0, 1.0, 1.0), strength=3.0))
                hidden.visible_camera = False
            else:
                scenes.world_color(scene.world, (0.5, 0.6, 0.7))
                hidden = scene.world.cycles_visibility
            if what == "dark":
                hidden = scenes.sphere("Dark", 1.0, (0.0, 1.7, 1.2), scenes.emitter((0.0, 0.0, 0.0)))
                hidden.visible_camera = hidden.visible_shadow = False
            if switch:
                setattr(hidden, switch if what == "world" else f"visible_{switch}", False)
            found[f"{what} hidden from {switch or 'nothing'}"] = scenes.seeds_by_both(4 * SAMPLES)
    return found


# Comparison ----------------------------------------------------------------------------------------

def _agree(pictures):
    for name, (ours, theirs) in pictures.items():
        assert theirs.std() > 0.05, f"{name}: the picture shows nothing"
        assert max(compare.unexplained(ours, theirs)) < OFF, name


@pytest.mark.parametrize("kind", ['MESH', 'POINT', 'AREA'])
def test_switches(blender, kind):
    _agree(blender.run(inside_switches, kind))


@pytest.mark.parametrize("inside", [inside_makers, inside_holes, inside_clear_holes, inside_hidden, inside_shadows,
                                    inside_motion, inside_camera])
def test_pictures(blender, inside):
    _agree(blender.run(inside))


def test_translucent(blender):
    for name, (ours, theirs) in blender.run(inside_translucent, timeout=300).items():
        errors = compare.unexplained(ours, theirs)
        print(f"{name}: means {ours[..., :3].mean():.5f} and {theirs[..., :3].mean():.5f}, beyond noise {errors}")
        if name in MESH_PARTS:
            low, high = MESH_PARTS[name]
            assert low < ours[..., :3].mean() / theirs[..., :3].mean() < high, name
        else:
            assert max(errors) < (DARK_OFF if name.startswith("dark") else OFF), name


# Simplify's culling ------------------------------------------------------------------------------------

CULLINGS = (
    {"use_camera_cull": True, "camera_cull_margin": 0.1},
    {"use_camera_cull": True, "camera_cull_margin": 0.6},
    {"use_distance_cull": True, "distance_cull_margin": 5.0},
    {"use_distance_cull": True, "distance_cull_margin": 0.0},
    {"use_camera_cull": True, "use_distance_cull": True, "camera_cull_margin": 0.1,
     "distance_cull_margin": 7.0},
)


def inside_culling():
    """Both engines' pictures of balls all around a camera, in a mirror before it too, and how many of them
    each setting leaves."""
    import bpy
    import scenes
    scene = scenes.empty(size=(96, 64))
    scenes.camera(location=(0.0, 0.0, 0.0))
    scenes.wall("Mirror", 30.0, 9.0, material=scenes.material(
        "Mirror", "ShaderNodeBsdfGlossy", Color=(1.0, 1.0, 1.0), Roughness=0.0))
    ball = scenes.sphere("Ball", 0.35, material=scenes.emitter((1.0, 1.0, 1.0)))
    for number in range(60):
        made = ball.copy()
        made.data = ball.data.copy()
        made.data.materials[0] = scenes.emitter(((number * 0.37) % 1.0, (number * 0.61) % 1.0, 0.2))
        made.location = (8.0 * ((number * 0.618) % 1.0 - 0.5), 18.0 * ((number * 0.755) % 1.0 - 0.5),
                         5.0 * ((number * 0.569) % 1.0 - 0.5))
        scene.collection.objects.link(made)
        made.cycles.use_camera_cull, made.cycles.use_distance_cull = number % 4 != 0, number % 5 != 0
    bpy.data.objects.remove(ball)
    scenes.sharpen()
    found = [scenes.by_both(1)]
    scene.render.use_simplify = True
    for settings in CULLINGS:
        scene.cycles.use_camera_cull = scene.cycles.use_distance_cull = False
        for name, value in settings.items():
            setattr(scene.cycles, name, value)
        found.append(scenes.by_both(1))
    return found


def test_culling_is_that_of_cycles(blender):
    found = blender.run(inside_culling)
    whole = found[0][0]
    for number, (ours, theirs) in enumerate(found):
        differ = np.abs(ours - theirs).max(axis=-1) > 1e-3
        hidden = np.abs(ours - whole).max(axis=-1) > 1e-3
        print(f"culling {number}: {differ.mean():.4f} of the pixels differ, {hidden.mean():.3f} are others")
        assert differ.mean() < 2e-3, number
        assert (hidden.mean() > 0.01) == (number not in (0, 4)), number
