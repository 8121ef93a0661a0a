# SPDX-License-Identifier: Apache-2.0
"""Panoramas, spherical stereo and rolling shutters beside Cycles."""

import numpy as np
import pytest


def _room():
    """A camera in a room whose walls and balls show where they are, behind a world."""
    import math
    import bpy
    import scenes
    scene = scenes.empty(size=(96, 64))
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.1, 0.4, 0.9, 1.0)
    made = scenes.camera(location=(0.3, -0.2, 0.1), rotation=(math.pi / 2 + 0.2, 0.1, 0.3))
    made.data.clip_start, made.data.clip_end = 0.05, 50.0
    shown = scenes.material("Place", "ShaderNodeEmission", Strength=0.1)
    tree = shown.node_tree
    where = tree.nodes.new("ShaderNodeVectorMath")
    where.inputs[1].default_value = (5.0, 5.0, 5.0)
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"], where.inputs[0])
    tree.links.new(where.outputs[0], tree.nodes["Emission"].inputs["Color"])
    corners = [(4.5 * x, 4.5 * y, 4.5 * z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    walls = [(0, 1, 3, 2), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4)]  # open to the right and above
    scenes.mesh("Room", corners, walls, shown)
    for number in range(14):
        angle, height = 2.4 * number, 1.7 * (number + 0.5) / 7.0 - 1.7
        reach = math.sqrt(max(4.0 - height * height, 0.1))
        scenes.sphere(f"Ball {number}", 0.35, (reach * math.cos(angle), reach * math.sin(angle), height),
                      shown)
    return scene, made


def _set_panorama(data, **settings):
    """Settings of a panorama, wherever this Blender has them."""
    data.type = 'PANO'
    place = data if hasattr(data, "panorama_type") else data.cycles
    for name, value in settings.items():
        setattr(place, name, value)


CASES = {
    "equirectangular": {"panorama_type": 'EQUIRECTANGULAR'},
    "ranges": {"panorama_type": 'EQUIRECTANGULAR', "longitude_min": -1.0, "longitude_max": 2.2,
               "latitude_min": -0.4, "latitude_max": 1.2},
    "cube map face": {"panorama_type": 'EQUIANGULAR_CUBEMAP_FACE'},
    "mirror ball": {"panorama_type": 'MIRRORBALL'},
    "equidistant": {"panorama_type": 'FISHEYE_EQUIDISTANT', "fisheye_fov": 4.0},
    "equisolid": {"panorama_type": 'FISHEYE_EQUISOLID', "fisheye_lens": 8.0, "fisheye_fov": 3.5},
    "polynomial": {"panorama_type": 'FISHEYE_LENS_POLYNOMIAL', "fisheye_fov": 3.0,
                   "fisheye_polynomial_k1": -0.08, "fisheye_polynomial_k2": -3e-4},
    "cylindrical": {"panorama_type": 'CENTRAL_CYLINDRICAL', "central_cylindrical_range_u_min": -2.0,
                    "central_cylindrical_range_u_max": 2.5, "central_cylindrical_range_v_min": -1.5,
                    "central_cylindrical_range_v_max": 2.0, "central_cylindrical_radius": 1.4},
}


def _takes(data, settings):
    place = data if hasattr(data, "panorama_type") else data.cycles
    kinds = place.bl_rna.properties["panorama_type"].enum_items.keys()
    return settings["panorama_type"] in kinds


def inside_projections():
    """Both engines' pictures of each projection, of one sample in the middle of each pixel."""
    import bpy
    import scenes
    scene, made = _room()
    scenes.sharpen()
    data, found = made.data, {}
    data.shift_x, data.shift_y = 0.07, -0.04
    for fit, size in (('AUTO', (96, 64)), ('VERTICAL', (60, 80))):
        data.sensor_fit, (scene.render.resolution_x, scene.render.resolution_y) = fit, size
        scene.render.pixel_aspect_x = 1.0 if fit == 'AUTO' else 1.3
        for name, settings in CASES.items():
            if not _takes(data, settings):
                continue
            _set_panorama(data, **settings)
            found[f"{name}, {fit.lower()}"] = scenes.by_both(1)
    scene.render.use_border = True
    (scene.render.border_min_x, scene.render.border_max_x) = 0.3, 0.8
    found["border"] = scenes.by_both(1)
    return found


def _even(picture, reach=0.03):
    """Whether a picture is about the same all over the pixels next to each."""
    even = np.ones(picture.shape[:2], bool)
    for axis in (0, 1):
        steps = np.abs(np.diff(picture, axis=axis)).max(axis=-1) < reach
        for place in (np.s_[:-1], np.s_[1:]):
            index = [np.s_[:], np.s_[:]]
            index[axis] = place
            even[tuple(index)] &= steps
    return even


def _compare(name, ours, theirs, allowed):
    """Pixels away from edges within allowed; samples lie up to a hundredth of a pixel apart."""
    even = _even(theirs)
    error = np.abs(ours - theirs).max(axis=-1)
    print(f"{name}: {even.mean():.2f} even, off by {error[even].max():.2g}, "
          f"of all {np.mean(error > allowed):.4f} by more, means {ours.mean():.5f} {theirs.mean():.5f}")
    assert even.mean() > 0.2, name
    assert error[even].max() < allowed, name
    assert np.mean(error > allowed) < 0.01, name


def test_projections_are_those_of_cycles(blender):
    found = blender.run(inside_projections)
    assert len(found) >= 15
    for name, (ours, theirs) in found.items():
        _compare(name, ours, theirs, 1e-3)


def inside_stereo():
    """Left and right pictures of both engines, for panoramas and a perspective camera."""
    import os
    import tempfile
    import bpy
    import compare
    import scenes
    scene, made = _room()
    scenes.sharpen()
    render, stereo, found = scene.render, made.data.stereo, {}
    render.use_multiview, render.views_format = True, 'STEREO_3D'
    render.image_settings.views_format = 'INDIVIDUAL'
    stereo.interocular_distance, stereo.convergence_distance = 0.4, 1.5
    stereo.pole_merge_angle_from, stereo.pole_merge_angle_to = 0.6, 1.0

    def look(name):
        for engine in ('VOLLEY', 'CYCLES'):
            scenes.set_engine(engine, 1)
            folder = tempfile.mkdtemp(prefix="volley_")
            render.filepath = os.path.join(folder, "picture.exr")
            bpy.ops.render.render(write_still=True)
            for file in sorted(os.listdir(folder)):
                side = os.path.splitext(file)[0][-2:]
                picture = compare.read_rgb(os.path.join(folder, file))  # Blender sees layers in it
                found.setdefault(name + side, []).append(picture)

    for mode in ('OFFAXIS', 'PARALLEL', 'TOE'):
        stereo.convergence_mode = mode
        for kind in ("plane", "spherical plane", "equirectangular"):
            made.data.type = 'PERSP'
            if kind == "equirectangular":
                _set_panorama(made.data, **CASES[kind])
            stereo.use_spherical_stereo = kind != "plane"
            for merges in (False, True):
                stereo.use_pole_merge = merges
                if kind != "plane" or not merges:
                    look(f"{mode} {kind}{' merging' if merges else ''}")
    # Views with cameras of their own.
    render.views_format = 'MULTIVIEW'
    for name, offset in (("Camera_L", -0.5), ("Camera_R", 0.7)):
        other = made.copy()
        other.data = made.data.copy()
        other.name = name
        other.location.x += offset
        other.data.type = 'PERSP'
        scene.collection.objects.link(other)
    scene.camera = bpy.data.objects["Camera_L"]
    look("own cameras")
    return found


def test_stereo_is_that_of_cycles(blender):
    found = blender.run(inside_stereo)
    assert len(found) == 2 * (3 * 5 + 1)
    for name, (ours, theirs) in found.items():
        _compare(name, ours, theirs, 2e-3)
    for name in found:
        if name.endswith("_L"):
            assert np.abs(found[name][0] - found[name[:-1] + "R"][0]).mean() > 1e-3


def inside_blur(samples):
    """Pictures whose lens, motion and rolling shutter blur, and passes of a moving panorama."""
    import bpy
    import scenes
    scene, made = _room()
    data, found = made.data, {}
    dof = data.dof
    dof.aperture_fstop, dof.aperture_blades, dof.focus_distance = 0.1, 3, 5.0
    dof.aperture_rotation, dof.aperture_ratio = 0.3, 1.6
    for name in ("equirectangular", "equisolid", "mirror ball"):
        _set_panorama(data, **CASES[name])
        dof.use_dof = True
        found[f"lens of {name}"] = scenes.by_both(samples)
        dof.use_dof = False
    for frame, sign in ((0, -1.0), (4, 1.0)):
        made.rotation_euler.z, made.location.x = 0.3 + 0.4 * sign, 0.3 + 0.3 * sign
        made.keyframe_insert("rotation_euler", frame=frame)
        made.keyframe_insert("location", frame=frame)
    scene.frame_set(2)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.5
    for name in ("equirectangular", "equidistant"):
        _set_panorama(data, **CASES[name])
        found[f"motion of {name}"] = scenes.by_both(samples)
    data.type = 'PERSP'
    for duration in (0.0, 0.1, 0.6):
        scene.cycles.rolling_shutter_type, scene.cycles.rolling_shutter_duration = 'TOP', duration
        found[f"rows of {duration}"] = scenes.by_both(samples)
    scene.cycles.rolling_shutter_type = 'NONE'
    scene.render.use_motion_blur = False
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_mist = layer.use_pass_vector = True
    layer.cycles.denoising_store_passes = layer.volley.denoising_store_passes = True
    scene.world.mist_settings.start, scene.world.mist_settings.depth = 1.0, 8.0
    scenes.sharpen()
    # Dark enough to show no noise, and yet a surface with a normal for denoisers.
    tree = bpy.data.materials["Place"].node_tree
    both, matt = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    matt.inputs["Color"].default_value = (1e-4, 1e-4, 1e-4, 1.0)
    tree.links.new(tree.nodes["Emission"].outputs[0], both.inputs[0])
    tree.links.new(matt.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    names = ["Combined", "Depth", "Mist", "Vector", "Denoising Normal"]
    passes = {}
    for name in ("equirectangular", "equisolid", "mirror ball"):
        _set_panorama(data, **CASES[name])
        for engine in ('VOLLEY', 'CYCLES'):
            scenes.set_engine(engine, 4)
            passes.setdefault(name, []).append(scenes.render_passes(names))
    return found, passes, bpy.app.version


def test_blur_and_passes_are_those_of_cycles(blender):
    found, passes, version = blender.run(inside_blur, 256, timeout=300)
    for name, (ours, theirs) in found.items():
        size = 8
        blocks = [picture.reshape(8, size, 12, size, 4).mean(axis=(1, 3)) for picture in (ours, theirs)]
        off = np.abs(blocks[0] - blocks[1]).max()
        print(f"{name}: blocks off by {off:.2g}, means {ours.mean():.5f} {theirs.mean():.5f}")
        assert off < 0.01, name
        assert ours[..., :3].mean() == pytest.approx(theirs[..., :3].mean(), rel=2e-3), name
    for name, (ours, theirs) in passes.items():
        even = _even(theirs["Combined"]) & _even(theirs["Mist"]) & _even(ours["Mist"])
        for each, allowed in (("Depth", 5e-3), ("Mist", 5e-3), ("Vector", 0.1), ("Denoising Normal", 0.05)):
            a, b = ours[each], theirs[each]
            seen = even & (np.abs(theirs["Depth"]).max(axis=-1) < 1e9)
            if each == "Denoising Normal":  # not where balls meet what is behind them in one colour
                seen &= _even(b, 0.4) & _even(a, 0.4)
            if each == "Vector":  # not across the seam
                seen &= np.maximum(np.abs(a), np.abs(b)).max(axis=-1) < 8.0
                if name == "equisolid" and version < (4, 0, 0):
                    a = a * (-1.0, 1.0, -1.0, 1.0)  # Cycles' fisheyes are the wrong way round there
            error = np.abs(a - b).max(axis=-1)[seen]
            if each == "Vector":  # pixels move by several where a hundredth of one is much
                error /= 1.0 + 2.0 * np.abs(b).max(axis=-1)[seen]
            # Near poles and rims a hundredth of a pixel is much.
            print(f"{name} {each}: off by {np.percentile(error, 95):.2g} of {np.abs(b[seen]).max():.3g}")
            assert np.percentile(error, 95) < allowed, (name, each)
