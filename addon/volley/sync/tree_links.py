# SPDX-License-Identifier: GPL-3.0-or-later
"""What is linked to what in node trees and in the groups in them. A path is the tuple of group nodes that were entered
on the way to a socket."""

MAX_GROUPS = 120  # in each other


class TreeLinks:
    """The links of trees, for as long as nothing changes them. Blender looks through all links of a tree for those
    of one socket."""

    def __init__(self):
        self._outputs = {}  # pointer of a tree -> {pointer of an input: the output that is linked to it}

    def source(self, socket):
        """The output socket that feeds an input, None without a link that counts. Sockets that a node's settings
        hide keep their links."""
        if not socket.is_linked or socket.is_unavailable:
            return None
        tree = socket.id_data
        pointer = tree.as_pointer()
        if pointer not in self._outputs:
            self._outputs[pointer] = _outputs_of(tree)
        return self._outputs[pointer].get(socket.as_pointer())

    def sources(self, socket, path):
        """(output, path) of all that an output may be made of, one link away."""
        node = socket.node
        if node.mute:
            inputs = [muted_input(node, socket)]
        elif node.type == 'GROUP':
            tree = node.node_tree
            active = None if tree is None or is_too_deep(tree, path) else active_output(tree)
            inputs, path = [active and same(active.inputs, socket)], path + (node,)
        elif node.type == 'GROUP_INPUT':
            inputs, path = [same(path[-1].inputs, socket) if path else None], path[:-1]
        else:
            inputs = node.inputs
        found = [self.source(each) for each in inputs if each is not None]
        return [(each, path) for each in found if each is not None]


def _outputs_of(tree):
    """{pointer of an input: the first output whose link to it counts}"""
    found = {}
    for link in tree.links:
        if link.is_valid and not link.is_muted and not link.from_socket.is_unavailable:
            found.setdefault(link.to_socket.as_pointer(), link.from_socket)
    return found


def names(path):
    """Equal for the same groups."""
    return tuple(group.name for group in path)


def passes_on(node):
    """Whether a node's outputs have what comes to it or to a socket in its group."""
    return node.mute or node.type in {'REROUTE', 'GROUP', 'GROUP_INPUT'}


def key_of(socket, path):
    """Equal for outputs that are walked at once: those of one node, but of one that passes values on."""
    return names(path), socket.node.name, socket.identifier if passes_on(socket.node) else ""


def muted_input(node, socket):
    """The input that a muted node passes on at an output, None for none."""
    return next((link.from_socket for link in node.internal_links if link.to_socket == socket), None)


def active_output(tree):
    """The node with the outputs of a group, None without one."""
    outputs = [node for node in tree.nodes if node.type == 'GROUP_OUTPUT']
    return next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)


def is_too_deep(tree, path):
    """Whether a group is not entered again."""
    return len(path) >= MAX_GROUPS or any(entered.node_tree == tree for entered in path)


def same(sockets, socket):
    """The one of sockets that stands for a socket inside or outside a group, None for none."""
    return next((each for each in sockets if each.identifier == socket.identifier), None)
