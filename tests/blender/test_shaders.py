# SPDX-License-Identifier: Apache-2.0
"""Every shader over a grid of its parameters beside Cycles with diffuse bounces 0: balls side by side under an
area light and an even world. A ball's mean, and that of each of its parts, is off by half a percent of the
ball's at most, beyond what noise explains. The table of all goes to results/shaders.txt of the build."""

import itertools

import blender as blender_support
import compare
import numpy as np
import pytest

GRID = 6           # balls along each side of a picture
DEPTH = 2.0        # m between neighbours along the view, which is orthographic
CELL_PX = 24       # pixels along each side of a ball's cell
TILE_PX = 8        # parts of a cell that are tested for bias
NOISE = 0.02               # of means, at most
SEEDS = (11, 12, 13, 14, 15, 16)
SAMPLES = 64       # of each seed
TOLERANCE = 0.005          # beyond noise, relative to the mean of the ball
STRANDS_TILE = 0.015       # of a part of a ball of strands, of which they cover a third

STRANDS = "strands of "        # names of cases that begin so have them in the place of a ball

# name: (node, inputs, settings)
CASES = {}

# What is known to differ more: (largest error of the mean, of a part, why).
_MULTIPLE = "light that scatters more than once comes from a table here, from random walks in Cycles 3.4"
_SHEEN = "Cycles' fit, at the outline"
_COAT = "Cycles 3.4 samples its coat by GGX but weighs the samples as GTR1; by lamps alone both agree"
_TILT = "Cycles 3.4 tilts samples and what weighs them by angles that are not each other's"
_FADE = "Cycles 3.4 samples what fades as if it did not, and has gloss of lamps beyond its cone"
KNOWN = {
    "glossy roughness 0.8 distribution ASHIKHMIN_SHIRLEY":
        (0.02, 0.025, "Cycles keeps rays that go below the faces at the outline; inside it both agree"),
    "glossy roughness 0.8 distribution MULTI_GGX": (0.01, 0.01, _MULTIPLE),
    "glass roughness 0.5 ior 1.45": (0.02, 0.03, _MULTIPLE),
    "glass roughness 0.5 ior 2.2 distribution BECKMANN":
        (0.01, 0.01, "not understood: light that is caught inside for long"),
    "sheen roughness 0.5": (0.005, 0.02, _SHEEN),
    "metallic roughness 0.9 anisotropy 0.6 distribution BECKMANN": (0.005, 0.01, "not understood"),
    "principled clearcoat roughness 0.03": (0.015, 0.02, _COAT),
    **{f"rough principled hair coat {coat} offset {offset} parametrization COLOR":
       (0.01, 0.02, "Cycles samples a coat by the roughness without it")
       for coat in (0.4, 0.9) for offset in (0.0, 0.8)},
}
# Those of Blender 3.
KNOWN_BEFORE_4 = {
    **{f"{what}principled hair coat {coat} ior {ior} parametrization COLOR": (0.015, 0.035, _TILT)
       for what in ("", "strands of ") for coat in (0.0, 0.8) for ior in (1.2, 1.8)},
    # By the place on the stage up to twice as much.
    **{f"rough principled hair coat {coat} offset 0.8 parametrization COLOR": (0.2, 0.4, _TILT)
       for coat in (0.4, 0.9)},
    # These have the node's own Offset, two degrees.
    **{f"{what}principled hair melanin redness {redness} random color {color} random roughness {roughness} "
       "parametrization MELANIN": (0.01, STRANDS_TILE, _TILT)
       for what in ("", "strands of ") for redness in (0.2, 1.0) for color in (0.0, 0.9)
       for roughness in (0.0, 0.8)},
    **{f"toon size {size} smooth {smooth} component {component}": (0.12, 0.24, _FADE)
       for size in (0.3, 0.8) for smooth in (0.2, 0.8) for component in ('DIFFUSE', 'GLOSSY')},
}


def _add(kind, node, inputs=None, settings=None, **varied):
    """A case for each combination of the values; capitals are inputs, the rest settings of the node."""
    for values in itertools.product(*varied.values()):
        own = dict(zip(varied, values))
        name = " ".join([kind] + [f"{key.replace('_', ' ').lower()} {value}" for key, value in own.items()])
        CASES[name] = (
            node,
            {**(inputs or {}), **{key.replace("_", " "): value for key, value in own.items() if key[0].isupper()}},
            {**(settings or {}), **{key: value for key, value in own.items() if not key[0].isupper()}})


_GOLD, _PALE = (0.9, 0.7, 0.5), (0.9, 0.95, 1.0)
_PRINCIPLED = "ShaderNodeBsdfPrincipled"
_add("diffuse", "ShaderNodeBsdfDiffuse", {"Color": _GOLD}, Roughness=(0.0, 0.3, 1.0))
_add("glossy", "ShaderNodeBsdfGlossy", {"Color": _GOLD}, Roughness=(0.1, 0.35, 0.8),
     distribution=('GGX', 'BECKMANN', 'ASHIKHMIN_SHIRLEY', 'MULTI_GGX'))
_add("mirror", "ShaderNodeBsdfGlossy", {"Color": _GOLD}, {"distribution": 'SHARP'})
# A node of its own before 4.0, which has its sockets on Glossy.
_add("glossy brushed", "ShaderNodeBsdfAnisotropic", {"Color": _GOLD, "Roughness": 0.4},
     {"distribution": 'GGX'}, Anisotropy=(-0.6, 0.7), Rotation=(0.0, 0.2))
_add("glass", "ShaderNodeBsdfGlass", {"Color": _PALE}, Roughness=(0.0, 0.15, 0.5), IOR=(1.1, 1.45, 2.2),
     distribution=('GGX', 'BECKMANN'))
_add("glass", "ShaderNodeBsdfGlass", {"Color": _PALE}, {"distribution": 'MULTI_GGX'}, Roughness=(0.15, 0.5),
     IOR=(1.45,))
_add("refraction", "ShaderNodeBsdfRefraction", {"Color": _PALE}, Roughness=(0.0, 0.3), IOR=(0.8, 1.45),
     distribution=('GGX', 'BECKMANN'))
_add("transparent", "ShaderNodeBsdfTransparent", Color=((0.0, 0.0, 0.0), (0.5, 0.7, 0.9)))
_add("translucent", "ShaderNodeBsdfTranslucent", Color=((0.5, 0.7, 0.9),))
_add("velvet", "ShaderNodeBsdfVelvet", {"Color": _GOLD}, Sigma=(0.1, 0.4, 1.0))
_add("sheen", "ShaderNodeBsdfSheen", {"Color": _GOLD}, Roughness=(0.1, 0.5, 1.0))
_add("toon", "ShaderNodeBsdfToon", {"Color": _GOLD, "Smooth": 0.0}, Size=(0.2, 0.5, 0.9),
     component=('DIFFUSE', 'GLOSSY'))
_add("emission", "ShaderNodeEmission", {"Color": _GOLD}, Strength=(0.1, 2.0))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD}, Metallic=(0.0, 0.5, 1.0), Roughness=(0.1, 0.5, 1.0))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Roughness": 0.3}, Specular=(0.0, 1.0),
     Specular_Tint=(0.0, 1.0))
_add("principled brushed", _PRINCIPLED, {"Base Color": _GOLD, "Roughness": 0.4, "Metallic": 1.0},
     Anisotropic=(0.4, 0.9), Anisotropic_Rotation=(0.0, 0.3))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Sheen": 1.0}, Sheen_Tint=(0.0, 1.0))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Clearcoat": 1.0}, Clearcoat_Roughness=(0.03, 0.5))
_add("principled", _PRINCIPLED, {"Base Color": _PALE, "Roughness": 0.2}, Transmission=(0.5, 1.0),
     IOR=(1.2, 1.6))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD}, Alpha=(0.0, 0.4))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Emission": (0.2, 0.5, 0.9)}, Emission_Strength=(0.5,))
# From 4.0 on.
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Emission Color": (0.2, 0.5, 0.9)},
     Emission_Strength=(0.25,))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Roughness": 0.3}, Specular_IOR_Level=(0.0, 1.0),
     Specular_Tint=((1.0, 1.0, 1.0), (1.0, 0.4, 0.2)), IOR=(1.2, 2.0))
# An index as glTF importers have it: above 2 + sqrt(3) less is reflected before the edge than head-on. A factor that
# went below F0 there was up to 23 % of a ball off.
_add("principled", _PRINCIPLED, {"Base Color": _GOLD}, Specular_IOR_Level=(0.5,), Specular_Tint=((1.0, 0.4, 0.2),),
     IOR=(8.0, 1000.0), Roughness=(0.0, 0.5))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Sheen Weight": 1.0}, Sheen_Roughness=(0.2, 0.8))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD, "Coat Weight": 1.0}, Coat_Roughness=(0.03, 0.5),
     Coat_Tint=((1.0, 1.0, 1.0), (0.3, 0.8, 0.9)), Coat_IOR=(1.3, 2.0))
_add("principled", _PRINCIPLED, {"Base Color": _PALE}, Transmission_Weight=(0.5, 1.0), IOR=(1.2, 1.6),
     Roughness=(0.0, 0.3))
_add("principled", _PRINCIPLED, {"Base Color": _GOLD}, Diffuse_Roughness=(0.3, 1.0))
# Fibres on the faces of balls, and on strands around small ones.
_PRINCIPLED_HAIR, _HAIR = "ShaderNodeBsdfHairPrincipled", "ShaderNodeBsdfHair"
for _what in ("", STRANDS):
    _add(_what + "hair", _HAIR, {"Color": _GOLD}, {"component": 'Reflection'}, RoughnessU=(0.1, 0.4),
         RoughnessV=(0.2, 1.0), Offset=(0.0, 0.3))
    _add(_what + "hair", _HAIR, {"Color": _GOLD}, {"component": 'Transmission'}, RoughnessU=(0.1, 0.4),
         RoughnessV=(0.2, 1.0))
    _add(_what + "principled hair", _PRINCIPLED_HAIR, {"Color": _GOLD, "Coat": 0.0, "Offset": 0.0},
         None, Roughness=(0.1, 0.4), Radial_Roughness=(0.2, 0.7), parametrization=('COLOR',))
    _add(_what + "principled hair", _PRINCIPLED_HAIR, {"Color": _GOLD, "Offset": 0.2},
         None, Coat=(0.0, 0.8), IOR=(1.2, 1.8), parametrization=('COLOR',))
    _add(_what + "rough principled hair", _PRINCIPLED_HAIR, {"Color": _GOLD, "Roughness": 0.6},
         None, Coat=(0.4, 0.9), Offset=(0.0, 0.8), parametrization=('COLOR',))
    _add(_what + "principled hair", _PRINCIPLED_HAIR, {"Melanin": 0.6, "Tint": _PALE},
         None, Melanin_Redness=(0.2, 1.0), Random_Color=(0.0, 0.9), Random_Roughness=(0.0, 0.8),
         parametrization=('MELANIN',))
    _add(_what + "principled hair", _PRINCIPLED_HAIR, {"Offset": 0.0},
         None, Absorption_Coefficient=((0.0, 0.0, 0.0), (0.3, 0.6, 1.5)), parametrization=('ABSORPTION',))
    _HUANG = {"model": 'HUANG', "parametrization": 'ABSORPTION'}
    _RED = {"Absorption Coefficient": (0.1, 0.3, 0.6)}
    _add(_what + "huang hair", _PRINCIPLED_HAIR, {**_RED, "Offset": 0.1}, _HUANG, Roughness=(0.1, 0.3, 0.8),
         Aspect_Ratio=(0.4, 1.0, 1.6))
    _add(_what + "huang hair", _PRINCIPLED_HAIR, {**_RED, "Roughness": 0.3}, _HUANG, Offset=(-0.2, 0.2),
         IOR=(1.3, 1.8))
    _add(_what + "huang hair", _PRINCIPLED_HAIR, {**_RED, "Roughness": 0.3}, _HUANG, Reflection=(0.0, 0.5),
         Transmission=(0.0, 0.5), Secondary_Reflection=(0.2, 0.5))
    _add(_what + "huang hair", _PRINCIPLED_HAIR, {}, {"model": 'HUANG', "parametrization": 'COLOR'},
         Color=(_GOLD, (0.1, 0.3, 0.6)))
    _add(_what + "huang hair", _PRINCIPLED_HAIR, {"Tint": _PALE}, {"model": 'HUANG', "parametrization": 'MELANIN'},
         Random_Color=(0.0, 0.9), Random_Roughness=(0.0, 0.8))
_add("metallic", "ShaderNodeBsdfMetallic", {"Base Color": _GOLD, "Edge Tint": (0.5, 0.7, 0.9)},
     {"fresnel_type": 'F82'}, Roughness=(0.1, 0.4, 0.9), Anisotropy=(0.0, 0.6),
     distribution=('MULTI_GGX', 'BECKMANN'))
_add("conductor", "ShaderNodeBsdfMetallic", {"IOR": (0.18, 0.42, 1.37), "Extinction": (3.42, 2.35, 1.77)},
     {"fresnel_type": 'PHYSICAL_CONDUCTOR'}, Roughness=(0.1, 0.4, 0.9),
     distribution=('GGX', 'MULTI_GGX', 'BECKMANN'))
_add("conductor", "ShaderNodeBsdfMetallic", {}, {"fresnel_type": 'PHYSICAL_CONDUCTOR'},
     IOR=((2.76, 2.51, 2.23), (1.1, 1.3, 0.9)), Extinction=((3.87, 3.4, 3.01), (0.3, 0.0, 0.6)))
_add("toon", "ShaderNodeBsdfToon", {"Color": _GOLD}, Size=(0.3, 0.8), Smooth=(0.2, 0.8),
     component=('DIFFUSE', 'GLOSSY'))
# What only links give.
_add("glossy", "ShaderNodeBsdfGlossy", {"Color": _GOLD}, Roughness=(-0.35,))
_add("glass", "ShaderNodeBsdfGlass", {"Color": _PALE, "IOR": 1.45}, Roughness=(-0.15,))
_add("refraction", "ShaderNodeBsdfRefraction", {"Color": _PALE, "IOR": 1.45}, Roughness=(-0.3,))

REFLECTING_HAIR = [name for name, (node, _inputs, settings) in CASES.items()
                   if node == _HAIR and settings["component"] == 'Reflection']


# Inside Blender ------------------------------------------------------------------------------------

def _stage():
    import bpy
    import scenes
    side = GRID * CELL_PX
    scene = scenes.empty(size=(side, side))
    scenes.camera(location=(0.0, -20.0, 0.0), type='ORTHO', ortho_scale=float(GRID))
    scenes.light('AREA', location=(-6.0, -9.0, 8.0), rotation=(0.9, 0.0, -0.6), energy=1500.0, size=4.0)
    scenes.world_color(scene.world, (0.35, 0.4, 0.5))
    scenes.independent_seeds()
    bpy.context.scene.volley.clamp_indirect = 0.0
    bpy.context.scene.cycles.sample_clamp_indirect = 0.0


def _ball(number, name, case):
    """A ball of that shader in its cell; False where this Blender lacks it or one of its settings."""
    import scenes
    node_type, inputs, settings = case
    if not scenes.has_node(node_type, inputs, settings):
        return False
    material = scenes.material(name, node_type, settings,
                               **{key.replace(" ", "_"): value for key, value in inputs.items()})
    x, z = number % GRID, number // GRID
    away = DEPTH * ((3 * x + 5 * z) % GRID)  # from its neighbours, which it would show
    place = (x - 0.5 * (GRID - 1), away, z - 0.5 * (GRID - 1))
    if not name.startswith(STRANDS):
        scenes.sphere(name, 0.42, place, material)
        return True
    ball = scenes.sphere(name, 0.1, place, material)
    ball.show_instancer_for_render = False
    ball.modifiers.new("Hair", 'PARTICLE_SYSTEM')
    hair = ball.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length, hair.render_step = 'HAIR', 40, 0.3, 2
    hair.root_radius, hair.tip_radius, hair.radius_scale = 1.0, 0.6, 0.08
    return True


def _cells(shown):
    """{case: [pictures by Volley, pictures by Cycles]}, one for each seed, of the balls on the stage."""
    import bpy
    import scenes
    pictures, cells = {}, {}
    for engine in ('VOLLEY', 'CYCLES'):
        scenes.set_engine(engine, SAMPLES)
        for seed in SEEDS:
            bpy.context.scene.volley.seed = bpy.context.scene.cycles.seed = seed
            pictures.setdefault(engine, []).append(scenes.render()[..., :3])
    for number, name in enumerate(shown):
        x, y = number % GRID * CELL_PX, number // GRID * CELL_PX
        cells[name] = [np.array([picture[y:y + CELL_PX, x:x + CELL_PX] for picture in pictures[engine]])
                       for engine in ('VOLLEY', 'CYCLES')]
    return cells


def inside_balls(names):
    """The cells of the cases that this Blender has."""
    waiting, cells = [(name, CASES[name]) for name in names], {}
    while waiting:
        _stage()
        shown = []
        while waiting and len(shown) < GRID * GRID:
            name, case = waiting.pop(0)
            if _ball(len(shown), name, case):
                shown.append(name)
        cells.update(_cells(shown))
    return cells


def _stage_hair():
    _stage()
    for number, name in enumerate(REFLECTING_HAIR):
        _ball(number, name, CASES[name])


def inside_light_tree():
    """[cells of REFLECTING_HAIR with the light tree, cells without it]."""
    import bpy
    _stage_hair()
    found = []
    for is_on in (True, False):
        bpy.context.scene.cycles.use_light_tree = is_on
        found.append(_cells(REFLECTING_HAIR))
    return found


def inside_light_tree_edits():
    """Of each change of Light Tree, the mean difference of what is followed from a fresh picture and of that from
    the one before."""
    import bpy
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    _stage_hair()
    follower, found = Follower(), []
    former = follower.picture()
    for is_on in (False, True):
        bpy.context.scene.cycles.use_light_tree = is_on
        bpy.context.scene.update_tag()  # as the panels do
        bpy.context.view_layer.update()
        followed = follower.picture()
        fresh_sync = SceneSync(is_final=False, thread_count=0, will_resync=False)
        fresh = picture(fresh_sync, Changes.everything())
        fresh_sync.destroy()
        found.append([float(np.abs(each - fresh).mean()) for each in (followed, former)])
        former = fresh
    return found


def _known(name):
    """The limits of a case, largest mean and tile, and why they are not the usual ones."""
    of_version = KNOWN_BEFORE_4 if blender_support.version() < (4, 0) else {}
    usual = (TOLERANCE, STRANDS_TILE if name.startswith(STRANDS) else TOLERANCE, "")
    return of_version.get(name) or KNOWN.get(name, usual)


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def errors(blender_of_module, request):
    """The errors of the cases that were asked for, from one Blender, and their table."""
    names = [item.callspec.params["name"] for item in request.session.items
             if item.getparent(pytest.Module) is request.node and hasattr(item, "callspec")]
    pictures = blender_of_module.run(inside_balls, names, timeout=900)
    found = {name: compare.agreed_errors(*pair, TILE_PX) for name, pair in pictures.items()}
    lines = [f"{'shader':75} {'mean error':>10} {'biased':>8} {'biased tile':>11}"]
    lines += [f"{name:75} {mean:10.3%} {biased:8.3%} {tile:11.3%}  {_known(name)[-1]}".rstrip()
              for name, (mean, biased, tile) in found.items()]
    blender_support.write_result("shaders", lines, compare.largest_errors(found))
    return found


@pytest.mark.parametrize("name", CASES)
def test_against_cycles(errors, name):
    if name not in errors:
        pytest.skip("this Blender has no such shader")
    _check(name, *errors[name])


def _check(name, mean, biased, tile):
    largest_mean, largest_tile, _why = _known(name)
    assert biased < largest_mean and mean < largest_mean + NOISE, name
    assert tile < largest_tile, name


SINCE = (3, 5), "Cycles has its light tree from 3.5 on"


@pytest.mark.since(*SINCE)
def test_light_tree(blender):
    """Hair that reflects below the surface has another share of what lies there without a light tree."""
    if blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    with_tree, without = blender.run(inside_light_tree, timeout=600)
    for cells in (with_tree, without):
        for name, pair in cells.items():
            _check(name, *compare.agreed_errors(*pair, TILE_PX))
    changes = [without[name][1].mean() / with_tree[name][1].mean() - 1.0 for name in REFLECTING_HAIR]
    assert max(map(abs, changes)) > 0.02, changes


@pytest.mark.since(*SINCE)
def test_viewport_follows_light_tree(blender):
    if blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    found = blender.run(inside_light_tree_edits)
    assert all(error == 0.0 and change > 1e-5 for error, change in found), found
