# SPDX-License-Identifier: Apache-2.0
"""Make the example scene: a rigged robot jumping on a glossy floor, wholly by script.

    blender -b --factory-startup --python examples/make_character.py -- OUT.blend [--motion]

Without options the file opens on frame 20, the top of the jump, motion blur off. With ``--motion``
it opens on frame 12, taking off, with motion blur on. Lengths are metres, angles degrees, time is
in frames; the robot faces -Y, Z is up, and ``.L`` is its own left (+X).

The scene carries its look by direct light and reflection alone, because diffuse interreflection is
not modelled; the Cycles settings stored in it switch that off too, so both engines render the same
light transport.
"""

import argparse
import math
import sys

import bpy
from mathutils import Matrix, Vector

FIRST_FRAME = 1
LAST_FRAME = 40
STILL_FRAME = 20
MOTION_FRAME = 12
MAX_DEPTH = 50


# Materials -------------------------------------------------------------------------------------

def new_material(name):
    """Return an empty node material, its tree and its output node."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


# Sockets of Principled that Blender 4.0 renamed.
RENAMED_SOCKETS = {"Specular": "Specular IOR Level", "Clearcoat": "Coat Weight",
                   "Clearcoat Roughness": "Coat Roughness", "Transmission": "Transmission Weight",
                   "Emission": "Emission Color", "Sheen": "Sheen Weight"}


def set_inputs(node, values):
    """Set a node's inputs by name; three-component colours get alpha 1."""
    for name, value in values.items():
        if isinstance(value, tuple) and len(value) == 3:
            value = (*value, 1.0)
        is_renamed = isinstance(name, str) and name not in node.inputs
        socket = node.inputs[RENAMED_SOCKETS[name] if is_renamed else name]
        socket.default_value = value
    return node


def principled(name, base_color, **values):
    """A Principled material; keyword names are socket names with underscores for spaces."""
    material, tree, output = new_material(name)
    node = set_inputs(tree.nodes.new("ShaderNodeBsdfPrincipled"),
                      {"Base Color": base_color,
                       **{key.replace("_", " "): value for key, value in values.items()}})
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def single_closure(name, node_type, **values):
    """A material of one closure node, for instance ``ShaderNodeBsdfGlass``."""
    material, tree, output = new_material(name)
    node = set_inputs(tree.nodes.new(node_type), values)
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def rubber(name, color):
    """Diffuse under a faint wide gloss, mixed by a constant."""
    material, tree, output = new_material(name)
    mix = set_inputs(tree.nodes.new("ShaderNodeMixShader"), {0: 0.06})
    diffuse = set_inputs(tree.nodes.new("ShaderNodeBsdfDiffuse"), {"Color": color})
    gloss = set_inputs(tree.nodes.new("ShaderNodeBsdfGlossy"),
                       {"Color": (1.0, 1.0, 1.0), "Roughness": 0.35})
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(gloss.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def checker_image(name, dark, light, cells=8, cell_px=32, line_px=1):
    """A packed checker image with thin darker joints; colours are sRGB triples in 0..1."""
    size = cells * cell_px
    image = bpy.data.images.new(name, size, size)
    joint = tuple(0.72 * c for c in dark)
    pixels = []
    for y in range(size):
        for x in range(size):
            on_joint = x % cell_px < line_px or y % cell_px < line_px
            even = (x // cell_px + y // cell_px) % 2 == 0
            color = joint if on_joint else (light if even else dark)
            pixels.extend((*color, 1.0))
    image.pixels.foreach_set(pixels)
    image.pack()
    return image


def floor_material():
    """Slightly rough reflecting tiles: a checker image as the base colour."""
    material, tree, output = new_material("Floor")
    shader = set_inputs(tree.nodes.new("ShaderNodeBsdfPrincipled"),
                        {"Roughness": 0.09, "Specular": 0.9})
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = checker_image("Floor tiles", (0.20, 0.25, 0.31), (0.25, 0.305, 0.37))
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def robot_materials():
    """The robot's material slots, in slot order.

    The small eyes light next to nothing: Cycles is told not to spend shadow rays on them.
    """
    glow = single_closure("Eyes", "ShaderNodeEmission", Color=(0.30, 0.86, 1.0), Strength=2.2)
    set_if_present(getattr(glow, "cycles", None), {"sample_as_light": False})
    return {
        "paint": principled("Coral paint", (0.80, 0.115, 0.045), Roughness=0.16, Specular=0.6),
        "cream": principled("Cream enamel", (0.80, 0.68, 0.50), Roughness=0.22, Specular=0.5),
        "visor": principled("Visor", (0.006, 0.009, 0.016), Roughness=0.04, Specular=0.8),
        "glow": glow,
        "rubber": rubber("Rubber", (0.045, 0.05, 0.06)),
        "steel": principled("Steel", (0.62, 0.63, 0.66), Metallic=1.0, Roughness=0.24),
    }


# Mesh building ---------------------------------------------------------------------------------

class MeshBuilder:
    """Collects the robot's control mesh: positions, polygons, slots and bone weights.

    ``weights`` arguments are either a bone name or a function from a position to
    ``{bone name: weight}``.
    """

    def __init__(self, slots):
        self.slots = list(slots)
        self.positions = []
        self.polygons = []
        self.polygon_slots = []
        self.weights = []

    def add(self, positions, polygons, slot, weights):
        """Append one closed part; polygon indices are local to the part."""
        base = len(self.positions)
        self.positions.extend(tuple(p) for p in positions)
        self.polygons.extend(tuple(base + i for i in polygon) for polygon in polygons)
        self.polygon_slots.extend([self.slots.index(slot)] * len(polygons))
        weight_of = weights if callable(weights) else lambda _p: {weights: 1.0}
        self.weights.extend(weight_of(Vector(p)) for p in positions)

    def ball(self, center, radii, slot, weights, cells=4, exponent=2.0, shape=None):
        """A ball made of a divided cube; ``exponent`` above 2 squares it off.

        ``shape`` maps a point of the unit ball to another one before scaling by ``radii``.
        """
        points, quads = cube_ball(cells, exponent)
        scale = Matrix.Diagonal(radii)
        placed = [Vector(center) + scale @ (shape(p) if shape else p) for p in points]
        self.add(placed, quads, slot, weights)

    def tube(self, path, radii, slot, weights, sides=8):
        """A closed tube around ``path`` with one radius per point."""
        rings = [ring(path, i, radius, sides) for i, radius in enumerate(radii)]
        points = [p for r in rings for p in r] + [path[0], path[-1]]
        last = (len(rings) - 1) * sides
        quads = [(i * sides + k, i * sides + (k + 1) % sides,
                  (i + 1) * sides + (k + 1) % sides, (i + 1) * sides + k)
                 for i in range(len(rings) - 1) for k in range(sides)]
        start_center, end_center = len(points) - 2, len(points) - 1
        for k in range(0, sides, 2):
            quads.append((start_center, (k + 2) % sides, k + 1, k))
            quads.append((end_center, last + k, last + k + 1, last + (k + 2) % sides))
        self.add(points, quads, slot, weights)

    def capsule(self, start, end, radius, slot, weights):
        """A tube with rounded ends from ``start`` to ``end``."""
        start, end = Vector(start), Vector(end)
        steps = (0.0, 0.15, 0.92, 1.0)
        sizes = (0.6, 0.95, 1.0, 0.6)
        path, radii = [start.lerp(end, t) for t in steps], [radius * s for s in sizes]
        self.tube(path, radii, slot, weights, sides=6)

    def to_object(self, name, materials):
        """Make the mesh object with vertex groups; all faces shaded smooth."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(self.positions, [], self.polygons)
        mesh.polygons.foreach_set("material_index", self.polygon_slots)
        mesh.polygons.foreach_set("use_smooth", [True] * len(self.polygons))
        for slot in self.slots:
            mesh.materials.append(materials[slot])
        robot = bpy.data.objects.new(name, mesh)
        for index, weights in enumerate(self.weights):
            for bone, weight in weights.items():
                group = robot.vertex_groups.get(bone) or robot.vertex_groups.new(name=bone)
                group.add([index], weight, "REPLACE")
        bpy.context.scene.collection.objects.link(robot)
        return robot


def cube_ball(cells, exponent):
    """Points on the unit ball of the ``exponent`` norm, and quads, from a divided cube."""
    index_of, points, quads = {}, [], []

    def point(i, j, k):
        key = (i, j, k)
        if key not in index_of:
            p = Vector([math.tan((2.0 * c / cells - 1.0) * math.pi / 4.0) for c in key])
            norm = sum(abs(c) ** exponent for c in p) ** (1.0 / exponent)
            index_of[key] = len(points)
            points.append(p / norm)
        return index_of[key]

    for axis in range(3):
        for side in (0, cells):
            for u in range(cells):
                for v in range(cells):
                    corners = [(u, v), (u + 1, v), (u + 1, v + 1), (u, v + 1)]
                    if side == 0:
                        corners.reverse()
                    quads.append(tuple(point(*around_axis(axis, side, c)) for c in corners))
    return points, quads


def around_axis(axis, along, across):
    """Grid coordinates with ``along`` on ``axis`` and ``across`` on the next two, cyclically."""
    coordinates = [0, 0, 0]
    coordinates[axis] = along
    coordinates[(axis + 1) % 3], coordinates[(axis + 2) % 3] = across
    return tuple(coordinates)


def ring(path, index, radius, sides):
    """A circle of points around ``path[index]``, perpendicular to the path there."""
    before, after = path[max(index - 1, 0)], path[min(index + 1, len(path) - 1)]
    tangent = (Vector(after) - Vector(before)).normalized()
    helper = Vector((0, 0, 1)) if abs(tangent.z) < 0.9 else Vector((0, 1, 0))
    x_axis = helper.cross(tangent).normalized()
    y_axis = tangent.cross(x_axis)
    angles = (math.tau * k / sides for k in range(sides))
    return [Vector(path[index]) + radius * (math.cos(a) * x_axis + math.sin(a) * y_axis)
            for a in angles]


def smooth_step(x, low, high):
    """0 below ``low``, 1 above ``high``, a smooth cubic between."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def chain_weights(coordinate, bones, joints, width):
    """Weights that pass from bone to bone at ``joints`` of ``coordinate(p)``, over ``width``."""
    def weights(p):
        x = coordinate(p)
        passed = [smooth_step(x, j - width / 2, j + width / 2) for j in joints]
        shares = [a - b for a, b in zip([1.0] + passed, passed + [0.0])]
        return {bone: share for bone, share in zip(bones, shares) if share > 0.0}
    return weights


# The robot -------------------------------------------------------------------------------------

def build_robot(materials):
    """Build the robot's mesh, in rest pose: arms level, feet on z = 0."""
    builder = MeshBuilder(materials)
    add_torso(builder)
    add_head(builder)
    for side, sign in (("L", 1.0), ("R", -1.0)):
        add_arm(builder, side, sign)
        add_leg(builder, side, sign)
    return builder.to_object("Robot", materials)


def pear(p):
    """Narrow the top of a unit ball and let its front belly out."""
    width = 1.0 - 0.20 * smooth_step(p.z, -0.5, 1.0)
    return Vector((p.x * width, p.y * width, p.z))


def add_torso(builder):
    """Pear-shaped body, belly plate, button, neck, in the spine's weights."""
    spine = chain_weights(lambda p: p.z, ("hips", "spine", "chest"), (0.55, 0.72), 0.14)
    builder.ball((0, 0, 0.68), (0.215, 0.18, 0.245), "paint", spine, 5, 2.5, pear)
    builder.ball((0, -0.075, 0.66), (0.135, 0.115, 0.165), "cream", spine, 3, 2.4)
    builder.ball((0, -0.182, 0.735), (0.026, 0.018, 0.026), "steel", spine, 2)
    builder.ball((0, -0.186, 0.665), (0.026, 0.018, 0.026), "steel", spine, 2)
    builder.tube([(0, 0, z) for z in (0.86, 0.89, 0.92, 0.95, 0.99)],
                 (0.075, 0.07, 0.062, 0.07, 0.075), "rubber",
                 chain_weights(lambda p: p.z, ("chest", "neck", "head"), (0.89, 0.96), 0.05))
    builder.tube([(0, 0, z) for z in (0.43, 0.45, 0.475, 0.49)], (0.12, 0.15, 0.165, 0.15),
                 "rubber", "hips")


def add_head(builder):
    """Squared-off head with visor, glowing face, ear caps and antenna."""
    center = Vector((0, 0, 1.19))
    builder.ball(center, (0.295, 0.235, 0.235), "paint", "head", 5, 3.0)
    for y, radii, slot in ((-0.075, (0.235, 0.178, 0.165), "visor"),
                           (-0.030, (0.258, 0.185, 0.188), "cream")):
        builder.ball(center + Vector((0, y, -0.008)), radii, slot, "head", 4, 3.2)
    for sign in (1.0, -1.0):
        builder.ball(center + Vector((0.096 * sign, -0.238, 0.020)), (0.040, 0.022, 0.056),
                     "glow", "head", 2, 2.3)
        builder.ball(center + Vector((0.300 * sign, 0.0, 0.0)), (0.045, 0.085, 0.085),
                     "steel", "head", 2, 2.8)
        builder.ball(center + Vector((0.335 * sign, 0.0, 0.0)), (0.028, 0.05, 0.05),
                     "paint", "head", 2, 2.5)
    builder.tube(smile_path(center), (0.006, 0.010, 0.011, 0.011, 0.011, 0.010, 0.006),
                 "glow", "head", 6)
    antenna = [center + Vector((0, 0.02 * t * t, 0.22 + 0.15 * t)) for t in (0, 0.3, 0.6, 1.0)]
    builder.tube(antenna, (0.022, 0.014, 0.011, 0.010), "steel", antenna_weights(antenna), 6)
    builder.ball(antenna[-1] + Vector((0, 0, 0.03)), (0.042, 0.042, 0.042), "cream", "antenna", 2)


def smile_path(center):
    """A small arc in front of the visor."""
    points = []
    for i in range(7):
        a = math.radians(-58 + 116 * i / 6)
        points.append(center + Vector((0.056 * math.sin(a), -0.252, -0.034 - 0.040 * math.cos(a))))
    return points


def antenna_weights(path):
    """From head to antenna along the stalk."""
    return chain_weights(lambda p: p.z, ("head", "antenna"), (path[0].z + 0.06,), 0.08)


def add_arm(builder, side, sign):
    """Shoulder ball, hose arm along X, cuff, palm, three fingers and a thumb."""
    def bone(name):
        return f"{name}.{side}"

    def at(x, y, z):
        return Vector((sign * x, y, z))

    shoulder, elbow, wrist = 0.235, 0.445, 0.64
    hose = chain_weights(lambda p: sign * p.x, (bone("upper_arm"), bone("forearm")), (elbow,), 0.16)
    builder.ball(at(0.205, 0, 0.80), (0.078, 0.08, 0.08), "paint", bone("upper_arm"), 2)
    steps = [shoulder + (wrist - shoulder) * i / 8 for i in range(9)]
    builder.tube([at(x, 0, 0.80) for x in steps], [0.046] * 9, "rubber", hose)
    builder.tube([at(x, 0, 0.80) for x in (0.52, 0.53, 0.58, 0.64, 0.655)],
                 (0.055, 0.064, 0.072, 0.078, 0.066), "cream", bone("forearm"))
    hand = bone("hand")
    builder.ball(at(0.710, 0, 0.80), (0.078, 0.074, 0.050), "paint", hand, 2, 2.6)
    for y, spread in ((-0.048, -0.036), (0.0, 0.0), (0.048, 0.036)):
        builder.capsule(at(0.735, y, 0.802), at(0.845, y + spread, 0.795), 0.031, "paint", hand)
    builder.capsule(at(0.680, -0.04, 0.795), at(0.735, -0.135, 0.79), 0.030, "paint", hand)


def add_leg(builder, side, sign):
    """Hose leg along Z, cuff and boot with a sole."""
    def bone(name):
        return f"{name}.{side}"

    def at(y, z):
        return Vector((sign * 0.105, y, z))

    hose = chain_weights(lambda p: -p.z, (bone("thigh"), bone("shin")), (-0.30,), 0.16)
    steps = [0.48 - (0.48 - 0.12) * i / 8 for i in range(9)]
    builder.tube([at(0, z) for z in steps], [0.056] * 9, "rubber", hose)
    builder.tube([at(0, z) for z in (0.235, 0.225, 0.185, 0.135, 0.125)],
                 (0.066, 0.076, 0.084, 0.092, 0.080), "cream", bone("shin"))
    foot = bone("foot")
    builder.ball(at(-0.045, 0.085), (0.092, 0.155, 0.085), "paint", foot, 4, 2.5, boot)
    builder.ball(at(-0.045, 0.022), (0.100, 0.163, 0.026), "cream", foot, 3, 3.0)


def boot(p):
    """Flatten the underside of a unit ball and lower its toe."""
    z = max(p.z, -0.75)
    if z > 0.0:
        z *= 1.0 - 0.35 * smooth_step(-p.y, 0.0, 1.0)
    return Vector((p.x, p.y, z))


# The rig ---------------------------------------------------------------------------------------

def bone_table():
    """Rest bones as (name, head, tail, parent), parents first."""
    bones = [
        ("root", (0, 0, 0), (0, 0.25, 0), None),
        ("hips", (0, 0, 0.48), (0, 0, 0.56), "root"),
        ("spine", (0, 0, 0.56), (0, 0, 0.72), "hips"),
        ("chest", (0, 0, 0.72), (0, 0, 0.89), "spine"),
        ("neck", (0, 0, 0.89), (0, 0, 0.97), "chest"),
        ("head", (0, 0, 0.97), (0, 0, 1.42), "neck"),
        ("antenna", (0, 0, 1.42), (0, 0, 1.60), "head"),
    ]
    for side, s in (("L", 1.0), ("R", -1.0)):
        bones += [
            (f"upper_arm.{side}", (0.205 * s, 0, 0.80), (0.445 * s, 0, 0.80), "chest"),
            (f"forearm.{side}", (0.445 * s, 0, 0.80), (0.655 * s, 0, 0.80), f"upper_arm.{side}"),
            (f"hand.{side}", (0.655 * s, 0, 0.80), (0.80 * s, 0, 0.80), f"forearm.{side}"),
            (f"thigh.{side}", (0.105 * s, 0, 0.48), (0.105 * s, 0, 0.30), "hips"),
            (f"shin.{side}", (0.105 * s, 0, 0.30), (0.105 * s, 0, 0.10), f"thigh.{side}"),
            (f"foot.{side}", (0.105 * s, 0, 0.10), (0.105 * s, -0.16, 0.10), f"shin.{side}"),
        ]
    return bones


def build_rig(robot):
    """Make the armature and bind the robot to it, then subdivide."""
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head, tail, parent in bone_table():
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = head, tail
        bone.parent = rig.data.edit_bones.get(parent) if parent else None
    bpy.ops.object.mode_set(mode="OBJECT")
    for pose_bone in rig.pose.bones:
        pose_bone.rotation_mode = "QUATERNION"
    robot.parent = rig
    robot.modifiers.new("Armature", "ARMATURE").object = rig
    subdivision = robot.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = subdivision.render_levels = 2
    return rig


# Poses: for each bone the direction its length points to, in the rig's space. A bone that is not
# listed keeps its rest orientation relative to its parent. A fourth number is a roll about that
# length, in degrees. "root" is the height of the jump, "turn" the heading about Z in degrees.
STAND = {
    "root": 0.0, "turn": 0.0,
    "upper_arm.L": (0.55, 0.0, -0.85), "forearm.L": (0.35, -0.30, -0.9),
    "hand.L": (0.2, -0.3, -0.9),
    "upper_arm.R": (-0.55, 0.0, -0.85), "forearm.R": (-0.35, -0.30, -0.9),
    "hand.R": (-0.2, -0.3, -0.9),
}
CROUCH = {
    "root": -0.111, "turn": -6.0,
    "spine": (0.0, -0.35, 0.95), "chest": (0.0, -0.5, 0.87), "head": (0.0, -0.15, 1.0),
    "antenna": (0.0, -0.5, 0.9),
    "upper_arm.L": (0.55, 0.65, -0.5), "forearm.L": (0.45, 0.55, -0.7),
    "upper_arm.R": (-0.55, 0.65, -0.5), "forearm.R": (-0.45, 0.55, -0.7),
    "thigh.L": (0.10, -0.78, -0.62), "shin.L": (0.0, 0.62, -0.78), "foot.L": (0.1, -1.0, 0.0),
    "thigh.R": (-0.10, -0.78, -0.62), "shin.R": (0.0, 0.62, -0.78), "foot.R": (-0.1, -1.0, 0.0),
}
RISE = {
    "root": 0.10, "turn": 4.0,
    "spine": (0.03, -0.05, 1.0), "chest": (0.05, -0.08, 1.0), "head": (0.03, -0.05, 1.0),
    "antenna": (0.0, 0.25, 1.0),
    "upper_arm.L": (0.9, 0.05, 0.1), "forearm.L": (0.75, -0.3, -0.3),
    "upper_arm.R": (-0.85, -0.15, 0.4), "forearm.R": (-0.6, -0.3, 0.8),
    "hand.R": (-0.5, -0.2, 0.85, 70.0),
    "thigh.L": (0.25, 0.05, -1.0), "shin.L": (0.1, 0.45, -0.9), "foot.L": (0.2, -0.5, -0.8),
    "thigh.R": (-0.15, -0.35, -0.9), "shin.R": (-0.05, 0.35, -0.9), "foot.R": (-0.1, -0.6, -0.75),
}
JUMP = {
    "root": 0.19, "turn": 12.0,
    "hips": (-0.10, 0.0, 1.0), "spine": (0.06, -0.02, 1.0), "chest": (0.22, -0.04, 1.0),
    "neck": (0.08, -0.05, 1.0), "head": (-0.16, -0.07, 1.0), "antenna": (-0.40, 0.0, 1.0),
    "upper_arm.L": (0.93, -0.10, 0.20), "forearm.L": (0.66, -0.35, 0.66),
    "hand.L": (0.70, -0.3, 0.70, -70.0),
    "upper_arm.R": (-0.78, -0.12, 0.60), "forearm.R": (-0.30, -0.14, 0.95),
    "hand.R": (-0.22, -0.05, 1.0, 70.0),
    "thigh.L": (0.52, -0.20, -0.80), "shin.L": (0.45, 0.80, -0.35), "foot.L": (0.55, -0.25, -0.80),
    "thigh.R": (-0.46, -0.80, -0.36), "shin.R": (-0.22, 0.16, -0.95),
    "foot.R": (-0.40, -0.88, 0.20),
}
FALL = {**RISE, "root": 0.10, "turn": 6.0, "antenna": (0.0, -0.1, 1.0),
        "upper_arm.R": (-0.75, -0.05, 0.66), "forearm.R": (-0.5, -0.1, 0.85),
        "hand.R": (-0.75, 0.0, 0.65, 70.0)}

ACTION = ((1, STAND), (9, CROUCH), (14, RISE), (20, JUMP), (26, FALL), (30, CROUCH), (40, STAND))


def inherited_matrix(bone, posed):
    """The bone's matrix, in the rig's space, before a turn of its own; ``posed`` holds parents."""
    if bone.parent is None:
        return bone.matrix_local.copy()
    return posed[bone.parent.name] @ bone.parent.matrix_local.inverted() @ bone.matrix_local


def turned_to(matrix, direction, roll_deg=0.0):
    """``matrix`` turned about its origin the shortest way to ``direction`` along Y; then rolled."""
    turn = matrix.col[1].to_3d().rotation_difference(direction).to_matrix().to_4x4()
    origin = Matrix.Translation(matrix.translation)
    roll = Matrix.Rotation(math.radians(roll_deg), 4, "Y")
    return origin @ turn @ origin.inverted() @ matrix @ roll


def apply_pose(rig, pose):
    """Set every pose bone's basis so that listed bones point along their directions."""
    heading = Matrix.Rotation(math.radians(pose["turn"]), 4, "Z")
    posed = {}
    for bone in rig.data.bones:
        inherited = inherited_matrix(bone, posed)
        if bone.parent is None:
            posed[bone.name] = Matrix.Translation((0, 0, pose["root"])) @ heading @ inherited
        elif bone.name in pose:
            x, y, z, *roll = pose[bone.name]
            posed[bone.name] = turned_to(inherited, heading.to_3x3() @ Vector((x, y, z)), *roll)
        else:
            posed[bone.name] = inherited
        rig.pose.bones[bone.name].matrix_basis = inherited.inverted() @ posed[bone.name]


def build_action(rig):
    """Key the poses of ``ACTION``; rotations take the short way round."""
    previous = {}
    for frame, pose in ACTION:
        apply_pose(rig, pose)
        for pose_bone in rig.pose.bones:
            rotation = pose_bone.rotation_quaternion.copy()
            if pose_bone.name in previous:
                rotation.make_compatible(previous[pose_bone.name])
                pose_bone.rotation_quaternion = rotation
            previous[pose_bone.name] = rotation
            pose_bone.keyframe_insert("rotation_quaternion", frame=frame)
        rig.pose.bones["root"].keyframe_insert("location", frame=frame)
    rig.animation_data.action.name = "Jump and wave"


# The set ---------------------------------------------------------------------------------------

def add_mesh(name, positions, polygons, material, subdivisions=0):
    """Link a smooth-shaded mesh object with one material."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(p) for p in positions], [], polygons)
    mesh.polygons.foreach_set("use_smooth", [True] * len(polygons))
    mesh.materials.append(material)
    added = bpy.data.objects.new(name, mesh)
    if subdivisions:
        modifier = added.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = subdivisions
    bpy.context.scene.collection.objects.link(added)
    return added


def build_floor():
    """A tiled floor of 14 x 8.5 metres, one texture repeat (8 tiles) per 2 metres."""
    corners = ((-7, -4.5, 0), (7, -4.5, 0), (7, 4, 0), (-7, 4, 0))
    floor = add_mesh("Floor", corners, [(0, 1, 2, 3)], floor_material())
    uv_layer = floor.data.uv_layers.new(name="UVMap")
    for loop, (x, y, _z) in zip(uv_layer.data, corners):
        angle = math.radians(24.0)
        loop.uv = (0.5 * (x * math.cos(angle) - y * math.sin(angle)),
                   0.5 * (x * math.sin(angle) + y * math.cos(angle)))


def build_backdrop():
    """A wall behind the floor that curves up from it."""
    profile = [(2.6, 0.0)]
    profile += [(2.6 + 1.4 * math.sin(a), 1.4 - 1.4 * math.cos(a))
                for a in (math.radians(7.5 * i) for i in range(13))]
    profile += [(4.0, 5.0)]
    positions = [(x, y, z + 0.002) for y, z in profile for x in (-7, 7)]
    polygons = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    add_mesh("Backdrop", positions, polygons,
             single_closure("Backdrop", "ShaderNodeBsdfDiffuse", Color=(0.10, 0.24, 0.34)))


def build_props():
    """A clear glass ball, a small one, and a rounded block of rough copper."""
    glass = single_closure("Glass", "ShaderNodeBsdfGlass", Color=(0.97, 0.99, 1.0),
                           Roughness=0.0, IOR=1.45)
    copper = principled("Rough copper", (0.95, 0.60, 0.36), Metallic=1.0, Roughness=0.30)
    points, quads = cube_ball(5, 2.0)
    ball = add_mesh("Glass ball", points, quads, glass, 2)
    ball.scale, ball.location = (0.25, 0.25, 0.25), (-0.74, -0.34, 0.25)
    points, quads = cube_ball(4, 7.0)
    block = add_mesh("Copper block", points, quads, copper, 2)
    block.scale, block.location = (0.18, 0.18, 0.18), (0.72, 0.22, 0.18)
    block.rotation_euler.z = math.radians(28.0)


def add_area_light(name, location, target, size, power, color):
    """A rectangular light; ``size`` in metres (x, y), ``power`` in watts."""
    data = bpy.data.lights.new(name, "AREA")
    data.shape = "RECTANGLE"
    data.size, data.size_y = size
    data.energy, data.color = power, color
    light = bpy.data.objects.new(name, data)
    light.location = location
    light.rotation_euler = look_at(location, target)
    bpy.context.scene.collection.objects.link(light)
    return light


def look_at(location, target):
    """Euler angles that turn -Z from ``location`` to ``target`` with Y up."""
    return (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()


def build_lights():
    """A warm key, a cool rim from behind, a broad dim fill, and a faint world."""
    add_area_light("Key", (-2.3, -2.4, 3.1), (0, 0, 0.9), (1.7, 1.7), 210.0, (1.0, 0.93, 0.84))
    add_area_light("Rim", (2.3, 1.9, 2.3), (0, 0, 1.0), (0.7, 2.0), 190.0, (0.62, 0.80, 1.0))
    add_area_light("Fill", (3.2, -2.8, 1.6), (0, 0, 0.8), (2.6, 2.6), 60.0, (0.86, 0.92, 1.0))
    world = bpy.data.worlds.new("World")
    world.use_nodes = True
    set_inputs(world.node_tree.nodes["Background"],
               {"Color": (0.55, 0.72, 1.0), "Strength": 0.10})
    bpy.context.scene.world = world


def build_camera(rig):
    """A 50 mm camera at chest height, focused on an empty that rides on the face."""
    focus = bpy.data.objects.new("Focus", None)
    focus.empty_display_size = 0.1
    focus.parent, focus.parent_type, focus.parent_bone = rig, "BONE", "head"
    # A bone's child starts at the bone's tail: from there back to the visor.
    focus.location = (0.0, -0.23, 0.25)
    bpy.context.scene.collection.objects.link(focus)
    data = bpy.data.cameras.new("Camera")
    data.lens = 50.0
    data.dof.use_dof = True
    data.dof.focus_object = focus
    data.dof.aperture_fstop = 0.8
    camera = bpy.data.objects.new("Camera", data)
    camera.location = (-0.55, -5.6, 1.15)
    camera.rotation_euler = look_at(camera.location, (0.0, 0.0, 0.75))
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


# Settings --------------------------------------------------------------------------------------

def set_if_present(settings, values):
    """Set those properties of ``settings`` that exist in this Blender."""
    for name, value in values.items():
        if hasattr(settings, name):
            setattr(settings, name, value)


def set_render_settings(scene, motion):
    """Output, frame range, motion blur and colour management."""
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.render.resolution_percentage = 100
    scene.render.fps = 24
    scene.frame_start, scene.frame_end = FIRST_FRAME, LAST_FRAME
    scene.render.use_motion_blur = motion
    scene.render.motion_blur_shutter = 0.5
    scene.frame_set(MOTION_FRAME if motion else STILL_FRAME)
    scene.view_settings.view_transform = "Filmic"
    scene.view_settings.exposure = 0.3
    scene.view_settings.look = "High Contrast"


def set_engine_settings(scene):
    """Volley's settings if its add-on is enabled, and the same transport in Cycles."""
    set_if_present(getattr(scene, "volley", None), {
        "integrator": "DISTRIBUTION", "samples": 64, "max_depth": MAX_DEPTH})
    set_if_present(getattr(scene, "cycles", None), {
        "samples": 64, "use_adaptive_sampling": False, "use_denoising": False,
        "max_bounces": MAX_DEPTH, "diffuse_bounces": 0, "glossy_bounces": MAX_DEPTH,
        "transmission_bounces": MAX_DEPTH, "transparent_max_bounces": MAX_DEPTH,
        "sample_clamp_direct": 0.0, "sample_clamp_indirect": 0.0, "blur_glossy": 0.0,
        "light_sampling_threshold": 0.0,
        "caustics_reflective": True, "caustics_refractive": True})
    scene.render.engine = "VOLLEY" if hasattr(scene, "volley") else "CYCLES"


def parse_arguments():
    """The arguments after ``--``."""
    arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    parser = argparse.ArgumentParser(prog="make_character.py", description=__doc__.split("\n")[0])
    parser.add_argument("output", help="the .blend file to write")
    parser.add_argument("--motion", action="store_true",
                        help="motion blur on, frame of the take-off")
    return parser.parse_args(arguments)


def main():
    """Build the scene in an empty file and save it."""
    arguments = parse_arguments()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    rig = build_rig(build_robot(robot_materials()))
    build_action(rig)
    build_floor()
    build_backdrop()
    build_props()
    build_lights()
    build_camera(rig)
    set_render_settings(bpy.context.scene, arguments.motion)
    set_engine_settings(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=arguments.output)


if __name__ == "__main__":
    main()
