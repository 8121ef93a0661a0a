# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene of the library was handed, in a form in which parts can be compared: scripts may have changed what
the file says.

Numbers of geometry and places may differ in the last digit between two starts of Blender (it evaluates some
modifiers with several threads), so of those there is a weighted sum and how far rounding can take it; all else is a
digest. Neither depends on the order in which things came, nor on what was there in frames before.
"""

import hashlib
import inspect
import os
import zlib

import numpy as np

from .. import native

# Of the length of what is summed: a hundred times the rounding of floats, as far as that is not of one sign.
_TOLERANCE = 1e-5
_BLOCK = 1 << 20            # numbers weighted at once
_HASH_FACTOR = 2654435761   # Knuth's multiplicative hash
_WORD = 1 << 32
_PLACES = {"transforms", "transform", "positions", "normals", "generated", "attributes", "values", "windows"}
_KINDS = ("mesh", "instance", "light", "material", "image")


class NotedScene(native.Scene):
    """A scene that notes what it is handed."""

    def __init__(self, *arguments, **values):
        super().__init__(*arguments, **values)
        self._noted = {kind: {} for kind in _KINDS}
        self._single = {}   # camera and world
        self._told = None   # what was said of all but the camera, until it changes

    def set_camera(self, *arguments, **values):
        super().set_camera(*arguments, **values)
        self._single["camera"] = _kept(_named(native.Scene.set_camera, (self, *arguments), values))

    def set_world(self, **values):
        super().set_world(**values)
        self._single["world"], self._told = values, None

    def move_instances(self, instances, transforms):
        super().move_instances(instances, transforms)
        self._told = None
        for key, places in zip(instances, transforms):
            self._noted["instance"][key].update(_kept({"transforms": places}))

    def content(self):
        """{what: digest} and {what: [sum, how far two of them may be apart]}."""
        if self._told is None:
            self._told = self._described()
        camera = _described([self._single.get("camera", {})])
        return tuple({**of_scene, "camera": of_camera} for of_scene, of_camera in zip(self._told, camera))

    def _described(self):
        """The same without the camera, which is sent anew for each render."""
        images = {key: _digest(_of_image(note)) for key, note in self._noted["image"].items()}
        materials = {key: _digest(_of_material(note, images)) for key, note in self._noted["material"].items()}
        meshes = {key: _digest(_plain(note)) for key, note in self._noted["mesh"].items()}
        users = {"instances": [{**note, "mesh": meshes[note["mesh"]],
                                "materials": [materials.get(key, "") for key in note["materials"]]}
                               for note in self._noted["instance"].values()],
                 "lights": [_with_material(note, materials) for note in self._noted["light"].values()],
                 "world": [_with_material(self._single.get("world", {}), materials)],
                 "meshes": list(self._noted["mesh"].values())}
        described = {kind: _described(notes) for kind, notes in users.items()}
        digests, places = ({kind: pair[index] for kind, pair in described.items()} for index in (0, 1))
        return {**digests, "materials": _digest(sorted(materials.values()))}, places


def _define(kind):
    """The methods of one kind of things."""
    create, update, destroy = (getattr(native.Scene, f"{verb}_{kind}", None)
                               for verb in ("create", "update", "destroy"))

    def note_created(self, *arguments, **values):
        key = create(self, *arguments, **values)
        self._told = None
        self._noted[kind][key] = _kept(_named(create, (self, *arguments), values))
        return key

    def note_updated(self, key, *arguments, **values):
        update(self, key, *arguments, **values)
        self._told = None
        changed = _kept(_named(update, (self, key, *arguments), values))
        self._noted[kind][key].update((name, value) for name, value in changed.items() if value is not None)

    def note_destroyed(self, key):
        destroy(self, key)
        self._told = None
        self._noted[kind].pop(key, None)

    setattr(NotedScene, create.__name__, note_created)
    if update is not None:
        setattr(NotedScene, update.__name__, note_updated)
    setattr(NotedScene, destroy.__name__, note_destroyed)


def _named(method, arguments, values):
    """Arguments of a call by name; the first ones, the scene and an id, are not among them."""
    signature = inspect.signature(method)
    found = signature.bind(*arguments, **values).arguments
    skipped = 2 if method.__name__.startswith("update") else 1
    named = {}
    for name, value in list(found.items())[skipped:]:
        if signature.parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
            named.update(value)
        else:
            named[name] = value
    return named


# What is kept of arrays: they are Blender's or the caller's ---------------------------------------

def _kept(note):
    """A note with sums and digests in place of arrays."""
    return {name: _kept_value(name, value) for name, value in note.items()}


def _kept_value(name, value):
    if name in _PLACES and value is not None:
        return _Places(value)
    if isinstance(value, np.ndarray):
        return hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    return value


class _Places:
    """A weighted sum of numbers, its length, and of which shape they are. What is not finite counts as 0."""

    def __init__(self, value):
        arrays = [(name, array) for name, array in value] if _is_named(value) else [("", value)]
        arrays = [(name, np.asarray(array, np.float32)) for name, array in arrays]
        self.shape = [[name, list(array.shape)] for name, array in arrays]
        self.sum = self.square = 0.0
        for _name, array in arrays:
            numbers = array.reshape(-1)
            for begin in range(0, numbers.size, _BLOCK):
                block = np.nan_to_num(numbers[begin:begin + _BLOCK].astype(np.float64), posinf=0.0, neginf=0.0)
                block *= _weights(begin, block.size)
                self.sum += float(block.sum())
                self.square += float(block @ block)


def _is_named(value):
    """Whether it is the attributes of a mesh."""
    return isinstance(value, (list, tuple)) and bool(value) and isinstance(value[0], tuple) \
        and isinstance(value[0][0], str)


def _weights(begin, count):
    """Of numbers by their place, 0.5 to 1.5."""
    places = np.arange(begin, begin + count, dtype=np.uint64)
    return 0.5 + (places * np.uint64(_HASH_FACTOR) % np.uint64(_WORD)).astype(np.float64) / _WORD


def _described(notes):
    """Of things in any order: their digest, and [sum, tolerance] of their places, weighted by what else they
    are."""
    keys, total, square = [], 0.0, 0.0
    for note in notes:
        key = _digest(_plain(note))
        keys.append(key)
        for name, value in note.items():
            if isinstance(value, _Places):
                weight = 0.5 + zlib.crc32(f"{name} {key}".encode()) / _WORD
                total += weight * value.sum
                square += weight * weight * value.square
    return _digest(sorted(keys)), [total, _TOLERANCE * square ** 0.5]


# What is plain -----------------------------------------------------------------------------------

def _plain(value):
    """Anything as lists of texts and numbers, without the sums of places."""
    if isinstance(value, dict):
        return [[name, _plain(each)] for name, each in sorted(value.items())]
    if isinstance(value, _Places):
        return value.shape
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, int):
        return int(value)  # enumerators, too
    return value if value is None or isinstance(value, (float, str)) else [_plain(each) for each in value]


def _digest(value):
    return hashlib.sha256(repr(value).encode()).hexdigest()


def _of_image(note):
    """Where nodes have it and which OpenColorIO they read is of the machine."""
    return _plain({**note, "path": note.get("path") and os.path.basename(note["path"]),
                   "color_space": (note.get("color_space") or (None, None))[1]})


def _of_material(note, images):
    nodes = [[node.type, node.mode, node.inputs, images.get(node.image, ""), node.name, node.table]
             for node in note["nodes"]]
    return _plain({**note, "nodes": nodes})


def _with_material(note, materials):
    return {**note, "material": materials.get(note["material"], "")} if "material" in note else note


for _kind in _KINDS:
    _define(_kind)
