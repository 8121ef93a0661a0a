# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of shaders without what Blender 5 unrolls by itself: repeat zones, closures, bundles and menus."""

from contextlib import contextmanager

_OF_ALL_TREES = {"NodeFrame", "NodeReroute", "NodeGroupInput", "NodeGroupOutput"}


@contextmanager
def shader_tree(data):
    """The tree to read of an evaluated material, world or light, and whether it is one of Blender's making,
    which goes with the context."""
    has_inlined = hasattr(data, "inline_shader_nodes")
    inlined = data.inline_shader_nodes() if has_inlined and _is_unrolled(data.node_tree, set()) else None
    yield (data.node_tree, False) if inlined is None else (inlined.node_tree, True)


def _is_unrolled(tree, seen):
    """Whether a tree or a group in it has nodes that stand in no tree of shaders before Blender 5."""
    if tree is None or tree.as_pointer() in seen:
        return False
    seen.add(tree.as_pointer())
    for node in tree.nodes:
        if node.type == 'GROUP':
            if _is_unrolled(node.node_tree, seen):
                return True
        elif not node.bl_idname.startswith("ShaderNode") and node.bl_idname not in _OF_ALL_TREES:
            return True
    return False
