# SPDX-License-Identifier: Apache-2.0
"""Draws menus and panels inside Blender without a window: what they would show is noted."""


class Layout:
    """Stands for a layout: notes nodes that are offered, properties, operators and sockets of nodes that are shown,
    takes every other call. Layouts made of it share its notes."""

    def __init__(self, notes=None):
        self.nodes, self.properties, self.operators, self.sockets = notes or ([], {}, [], [])
        self.operator_context = 'INVOKE_DEFAULT'
        self.use_property_split = self.use_property_decorate = False

    def operator(self, name, **_):
        button = _Button()
        self.operators.append(name)
        if name == "node.add_node":
            self.nodes.append(button)
        return button

    def prop(self, _data, name, **options):
        self.properties[name] = {"is_split": self.use_property_split, "has_dot": self.use_property_decorate,
                                 **options}

    def template_node_view(self, _tree, _node, socket):
        self.sockets.append(socket)

    def __getattr__(self, name):
        return self._part

    def _part(self, *_, **__):
        """A row, column or the like, which has its parent's style."""
        part = Layout((self.nodes, self.properties, self.operators, self.sockets))
        part.use_property_split, part.use_property_decorate = self.use_property_split, self.use_property_decorate
        return part


class _Button:
    """An operator's properties."""

    type = ""

    def __init__(self):
        self.settings = self

    def add(self):
        return _Button()


class Context:
    """Blender's context, but for what is given here."""

    def __init__(self, **values):
        self.__dict__.update(values)

    def __getattr__(self, name):
        import bpy
        return getattr(bpy.context, name)


class Instance:
    """An instance of a menu's or panel's class, which only Blender can make."""

    def __init__(self, cls):
        self._cls, self.layout = cls, Layout()

    def __getattr__(self, name):
        return getattr(self._cls, name)


def draw(cls, context):
    """The layout after the class has drawn."""
    shown = Instance(cls)
    cls.draw(shown, context)
    return shown.layout
