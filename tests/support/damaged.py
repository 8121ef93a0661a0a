# SPDX-License-Identifier: Apache-2.0
"""Damaged images by the hundred in the scenes of one Blender, and what they cost.

``run`` makes the files, has one Blender render them all (``inside_renders``, see blender.py) and finds what
is wrong: a picture that is lost, a valid image beside the damaged ones that is not right, an image in magenta
without a warning that names it. A picture is a grid of squares, each with an image of its own.
"""

import collections
import itertools
import os
import random
import re
import threading

import image_corpus
import processes

PLAIN_SHARE = 8    # one square of so many shows a valid image
TOLERANCE = 0.01   # of valid images: what formats of bytes round to
SAMPLE_SECONDS = 0.05

# Of those of the corpus that OpenImageIO does not read: a volume without grids has no pixels.
UNREADABLE = {"empty.vdb"}

Result = collections.namedtuple("Result", "problems seconds shown missing memory output")


# Inside Blender ------------------------------------------------------------------------------------

def inside_renders(folder, whole, meshes, count, seed, side):
    """Renders of side * side squares until count damaged files of the corpus have been shown, then one of
    files as they are (whole), and one for each file of a mesh. For each: (seconds, [(name, colour, expected
    colour or None)] of its squares, whether all of the picture is finite)."""
    dice = random.Random(seed)
    corpus = image_corpus.make(os.path.join(folder, "corpus"))
    plain = image_corpus.make_plain(os.path.join(folder, "plain"), 3 * PLAIN_SHARE, dice)
    nodes = _stage(side)
    rows = []
    damaged = _damaged_files(corpus, count, dice, folder)
    for squares in _squares(damaged, len(nodes), plain, dice):
        rows.append(_render(nodes, squares, side))
        for path, expected in squares:
            if expected is None:
                os.remove(path)
    for squares in _squares(iter(corpus + whole), len(nodes), plain, dice):
        rows.append(_render(nodes, squares, side))
    for path in meshes:
        made = _import_mesh(path, side)
        rows.append(_render(nodes, [dice.choice(plain) for _ in nodes], side))
        _remove(made)
    return rows


def _damaged_files(corpus, count, dice, folder):
    """Write damaged files one by one: every file of the corpus in every way by turns."""
    data = {}
    for path in corpus:
        with open(path, "rb") as file:
            data[path] = file.read()
    kinds = list(image_corpus.KINDS)
    for number in range(count):
        path, kind = corpus[number % len(corpus)], kinds[number // len(corpus) % len(kinds)]
        spoiled = os.path.join(folder, f"{number}_{kind}_{os.path.basename(path)}")
        with open(spoiled, "wb") as file:
            file.write(image_corpus.damage(data[path], kind, dice))
        yield spoiled


def _squares(paths, count, plain, dice):
    """For each picture [(path, colour that it must have or None)], count of them."""
    while own := list(itertools.islice(paths, count - count // PLAIN_SHARE)):
        squares = [(path, None) for path in own]
        squares += [dice.choice(plain) for _ in range(count - len(squares))]
        dice.shuffle(squares)
        yield squares


def _stage(side):
    """A grid of squares of a metre, each two pixels wide, with room around it; their image nodes."""
    import scenes
    scenes.empty(size=(3 * side, 3 * side), samples=1)
    scenes.camera(type='ORTHO', ortho_scale=1.5 * side, clip_end=1000.0)
    scenes.sharpen()
    scenes.light('SUN')
    nodes = []
    for number in range(side * side):
        row, column = divmod(number, side)
        material = scenes.emitter((1.0, 1.0, 1.0))
        scenes.wall(size=1.0, center=(column - (side - 1) / 2, row - (side - 1) / 2), material=material)
        tree = material.node_tree
        nodes.append(tree.nodes.new("ShaderNodeTexImage"))
        tree.links.new(nodes[-1].outputs["Color"], scenes.shader_of(material).inputs["Color"])
    return nodes


def _render(nodes, squares, side):
    import time
    import bpy
    import numpy as np
    import scenes
    for node, (path, expected) in zip(nodes, squares):
        # bpy.data.images.load would have Blender read the file.
        node.image = bpy.data.images.new(os.path.basename(path), 1, 1, is_data=expected is not None)
        node.image.source, node.image.filepath_raw = 'FILE', path
    begin = time.monotonic()
    picture = scenes.render()
    seconds = time.monotonic() - begin
    found = []
    for number, (node, (path, expected)) in enumerate(zip(nodes, squares)):
        row, column = divmod(number, side)
        color = picture[side // 2 + 2 * row, side // 2 + 2 * column, :3]
        found.append((node.image.name, color.tolist(), expected))
    for node in nodes:
        bpy.data.images.remove(node.image)
    return seconds, found, bool(np.isfinite(picture).all())


def _import_mesh(path, side):
    """Objects of a file beside the squares, if Blender can make any of it."""
    import bpy
    import numpy as np
    if not hasattr(np, "bool"):
        np.bool = bool  # Blender 3.4's importer of glTF asks for it
    before = set(bpy.data.objects)
    try:
        if path.endswith(".obj"):
            bpy.ops.wm.obj_import(filepath=path)
        else:
            bpy.ops.import_scene.gltf(filepath=path)
    except (RuntimeError, ValueError, KeyError, AttributeError) as error:
        print(f"{path} cannot be imported: {error}")
    bpy.context.scene.render.engine = 'VOLLEY'  # the importer of glTF chooses another
    made = set(bpy.data.objects) - before
    for each in made:
        if each.parent is None:
            each.location = (0.6 * side, 50.0, 0.0)
    return made


def _remove(objects):
    import bpy
    for each in objects:
        bpy.data.objects.remove(each)


# Outside -------------------------------------------------------------------------------------------

class Memory(threading.Thread):
    """Watches the memory of the processes that this one starts: largest resident sets in MiB, of one process
    of each name and of all readers of images at once."""

    def __init__(self):
        super().__init__(daemon=True)
        self.largest, self.readers = collections.Counter(), 0.0
        self._known, self._is_over = {os.getpid(): ""}, threading.Event()

    def run(self):
        while not self._is_over.wait(SAMPLE_SECONDS):
            self._find_children()
            self._look()

    def finish(self):
        """End; the peaks."""
        self._is_over.set()
        self.join()
        return dict(self.largest, readers=self.readers)

    def _find_children(self):
        """Descendants, by name."""
        parents = {}
        living = processes.living()
        self._known = {pid: name for pid, name in self._known.items() if pid in living}
        for pid in living - set(self._known):
            parents[pid] = processes.parent_and_name(pid) or (None, "")
        for pid in sorted(parents):
            if parents[pid][0] in self._known:
                self._known[pid] = parents[pid][1]

    def _look(self):
        readers = 0.0
        for pid, name in self._known.items():
            values = dict(re.findall(r"(VmHWM|RssAnon|RssShmem):\s+(\d+)", processes.text_of(pid, "status")))
            if pid == os.getpid() or "VmHWM" not in values:
                continue
            self.largest[name] = max(self.largest[name], int(values["VmHWM"]) / 1024)
            if name == "tracer_reader":
                readers += (int(values["RssAnon"]) + int(values["RssShmem"])) / 1024
        self.readers = max(self.readers, readers)


def run(blender, count, seed, side, whole=(), meshes=(), timeout=120):
    """Render count damaged files, then the valid ones of the corpus with files of images (whole) and of
    meshes as they are, by a blender.Blender. A Result."""
    memory = Memory()
    memory.start()
    try:
        rows = blender.run(inside_renders, blender.folder, list(whole), list(meshes), count, seed, side,
                           timeout=timeout)
    finally:
        peaks = memory.finish()
    named = collections.Counter(re.findall(r"Image '([^']+)': .*magenta is used", blender.output))
    problems, missing, shown = [], 0, 0
    for number, (_, squares, is_finite) in enumerate(rows):
        if not is_finite:
            problems.append(f"picture {number} is not finite")
        for name, color, expected in squares:
            if expected is not None:
                if max(abs(a - b) for a, b in zip(color, expected)) > TOLERANCE:
                    problems.append(f"picture {number}: {name} is {color} instead of {expected}")
                continue
            is_missing = named[name] > 0
            missing, shown = missing + is_missing, shown + (not is_missing)
            if named[name] > 1:
                problems.append(f"picture {number}: {named[name]} warnings of {name}")
            if (color == [1.0, 0.0, 1.0]) != is_missing:
                problems.append(f"picture {number}: {name} is {color} with {named[name]} warnings")
            if is_missing and not name[0].isdigit() and name not in UNREADABLE | {os.path.basename(p) for p in whole}:
                problems.append(f"{name} is valid and was not read")
    return Result(problems, [row[0] for row in rows], shown, missing, peaks, blender.output)
