# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor's Denoise node with the passes of this engine, for Blenders built with OpenImageDenoise."""

import bpy
from bpy.types import Operator

_LAYER, _DENOISE, _OUTPUT = "CompositorNodeRLayers", "CompositorNodeDenoise", "CompositorNodeComposite"
_INPUTS = {"Image": "Noisy Image", "Normal": "Denoising Normal", "Albedo": "Denoising Albedo"}
_GAP = 40.0  # between nodes


def is_available():
    """Whether the node does anything in this Blender; it is built with the same library as Cycles."""
    try:
        import _cycles
    except ImportError:  # built without Cycles, which tells nothing of the library
        return True
    return getattr(_cycles, "with_openimagedenoise", True)


def set_up(scene):
    """Denoise each Render Layers node of the scene's compositor that shows this engine; how many are new."""
    tree = _compositor(scene)
    nodes = [node for node in tree.nodes if node.bl_idname == _LAYER] or [_add_layer(tree, scene)]
    return sum(_denoise(tree, node) for node in nodes if node.scene and node.scene.render.engine == 'VOLLEY')


def _compositor(scene):
    """The scene's tree of nodes, which is in use then."""
    scene.render.use_compositing = True
    if not hasattr(scene, "compositing_node_group"):  # up to 4.5
        scene.use_nodes = True
        return scene.node_tree
    if scene.compositing_node_group is None:
        scene.compositing_node_group = bpy.data.node_groups.new("Compositing Nodes", "CompositorNodeTree")
    return scene.compositing_node_group


def _add_layer(tree, scene):
    node = tree.nodes.new(_LAYER)
    node.scene = scene
    return node


def _denoise(tree, node):
    """Put a Denoise node behind a Render Layers node, unless there is one; whether it was put there."""
    layer = node.scene.view_layers[node.layer]
    layer.volley.denoising_store_passes = True
    layer.update_render_passes()
    # Two filters in a row blur, and cost twice.
    node.scene.volley.use_denoising = False
    if any(link.to_node.bl_idname == _DENOISE for link in node.outputs[_INPUTS["Image"]].links):
        return False
    targets = [link.to_socket for link in node.outputs["Image"].links] or _free_outputs(tree)
    denoise = tree.nodes.new(_DENOISE)
    denoise.location = node.location.x + node.width + _GAP, node.location.y
    for name, source in _INPUTS.items():
        tree.links.new(node.outputs[source], denoise.inputs[name])
    for target in targets:
        tree.links.new(denoise.outputs["Image"], target)
    return True


def _free_outputs(tree):
    """The socket of the picture, where nothing goes into it; made where there is none."""
    output_type = _OUTPUT if hasattr(bpy.types, _OUTPUT) else "NodeGroupOutput"
    node = next((node for node in tree.nodes if node.bl_idname == output_type), None)
    if node is None:
        if output_type != _OUTPUT and not tree.interface.items_tree:
            tree.interface.new_socket("Image", in_out='OUTPUT', socket_type="NodeSocketColor")
        node = tree.nodes.new(output_type)
    return [socket for socket in node.inputs[:1] if not socket.is_linked]


class VOLLEY_OT_set_up_denoise_nodes(Operator):
    """Put OpenImageDenoise behind the render layers in the compositor, with the denoising data of their passes,
    in place of Denoise"""

    bl_idname = "volley.set_up_denoise_nodes"
    bl_label = "Denoise in Compositor"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        if not is_available():
            cls.poll_message_set("This Blender is built without OpenImageDenoise")
            return False
        return context.scene is not None

    def execute(self, context):
        count = set_up(context.scene)
        self.report({'INFO'}, f"{count} render layers are denoised in the compositor" if count != 1
                    else "The render layer is denoised in the compositor")
        return {'FINISHED'}


def register():
    bpy.utils.register_class(VOLLEY_OT_set_up_denoise_nodes)


def unregister():
    bpy.utils.unregister_class(VOLLEY_OT_set_up_denoise_nodes)
