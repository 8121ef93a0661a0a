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
    # Blender leaves out what outputs for one engine alone have; then the nodes in question are warned of.
    if inlined is None or not _has_output(inlined.node_tree) and _has_output(data.node_tree):
        yield data.node_tree, False
    else:
        yield inlined.node_tree, True


def _has_output(tree):
    return tree.get_output_node('CYCLES') is not None


def _is_unrolled(tree, seen):
    """Whether a tree or a group in it has nodes that stand in no tree of shaders before Blender 5; those of add-ons,
    or of an engine that is no more, are not unrolled."""
    if tree is None or tree.as_pointer() in seen:
        return False
    seen.add(tree.as_pointer())
    for node in tree.nodes:
        if node.type == 'GROUP':
            if _is_unrolled(node.node_tree, seen):
                return True
        elif (not node.bl_idname.startswith("ShaderNode") and node.bl_idname not in _OF_ALL_TREES
              and node.type != 'CUSTOM'):
            return True
    return False
