# SPDX-License-Identifier: GPL-3.0-or-later
"""Simplify's culling: objects that the camera does not see, or that are far from it, are left out.

The tests are those of Cycles, on the corners of an object's bounds: by their place in the frame, whose
sides are 1 long, and by the distance of the box along the world's axes that holds them. An object that both
kinds of culling are on for has to fail both.
"""

import numpy as np

from ..compat import cycles


def is_on(scene):
    """Whether a scene culls anything; not where there are several views, nor without Cycles' settings."""
    return scene.render.use_simplify and not scene.render.use_multiview \
        and (_culls_by_camera(scene) or _culls_by_distance(scene))


def of(scene, keys):
    """The culling of an evaluated scene by a camera (camera.CameraKeys), None where nothing is culled."""
    if not is_on(scene) or keys.lens.panorama:
        return None
    return Culling(scene, keys)


def _culls_by_camera(scene):
    return cycles(scene, "use_camera_cull", False)


def _culls_by_distance(scene):
    return cycles(scene, "use_distance_cull", False) and cycles(scene, "distance_cull_margin", 50.0) > 0.0


class Culling:
    """What decides for each instance; no reference to Blender is kept."""

    def __init__(self, scene, keys):
        self._by_camera, self._by_distance = _culls_by_camera(scene), _culls_by_distance(scene)
        self._margin = cycles(scene, "camera_cull_margin", 0.1)
        self._distance = cycles(scene, "distance_cull_margin", 50.0)
        matrix = np.asarray(keys.transforms[len(keys.transforms) // 2], np.float64).reshape(3, 4)
        axes = matrix[:, :3] / np.linalg.norm(matrix[:, :3], axis=0)
        self._to_camera, self._place = np.linalg.inv(axes), matrix[:, 3]
        self._window, self._lens = keys.windows[len(keys.windows) // 2], keys.lens

    def hides(self, each):
        """Whether an instance of the depsgraph is left out."""
        blender_object = each.object
        by_camera = self._by_camera and cycles(blender_object, "use_camera_cull", False)
        by_distance = self._by_distance and cycles(blender_object, "use_distance_cull", False)
        if not by_camera and not by_distance:
            return False
        matrix = np.array(each.matrix_world)
        corners = np.array(blender_object.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
        return (not by_camera or self._is_outside(corners)) and (not by_distance or self._is_far(corners))

    def _is_outside(self, corners):
        """Whether corners (8, 3) are all behind the camera, or to one side of the frame and its margin."""
        at = (corners - self._place) @ self._to_camera.T
        depth, start, end = -at[:, 2], self._lens.clip_start, self._lens.clip_end
        scale = np.ones(len(at)) if self._lens.is_ortho else depth
        past_start = (depth - start) / (end - start) * (1.0 if self._lens.is_ortho else end)
        left, right, bottom, top = self._window
        with np.errstate(divide='ignore', invalid='ignore'):
            place = np.stack(((at[:, 0] / scale - left) / (right - left),
                              (at[:, 1] / scale - bottom) / (top - bottom)), axis=1)
        place = np.where(past_start[:, None] < 0.0, 1.0 - place, place)
        if (past_start < -self._margin).all():
            return True
        return bool((place.min(axis=0) >= 1.0 + self._margin).any()
                    or (place.max(axis=0) <= -self._margin).any())

    def _is_far(self, corners):
        nearest = np.clip(self._place, corners.min(axis=0), corners.max(axis=0))
        return np.linalg.norm(self._place - nearest) > self._distance
