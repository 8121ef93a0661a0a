# SPDX-License-Identifier: Apache-2.0
"""Esc in final renders inside Blender, pressed by a test. An engine's test_break is Blender's own function,
which nothing set on the class replaces: so the session is given the engine behind a proxy."""


class _Proxy:
    """An engine as the session sees it."""

    def __init__(self, engine, is_pressed):
        self._engine, self._is_pressed = engine, is_pressed

    def __getattr__(self, name):
        return getattr(self._engine, name)

    def test_break(self):
        return self._is_pressed() or self._engine.test_break()


def watch(is_pressed):
    """From now on, ask is_pressed wherever a render asks for Esc."""
    from volley.session import Session
    render = Session.render

    def render_behind_proxy(self, engine, *arguments):
        return render(self, _Proxy(engine, is_pressed), *arguments)

    Session.render = render_behind_proxy
