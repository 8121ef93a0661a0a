# SPDX-License-Identifier: GPL-3.0-or-later
"""A commit of the library's scene on a thread of its own, so that Blender goes on meanwhile."""

import threading

POLL_SECONDS = 0.004  # between two requests to stop


class Commit:
    """Starts at once. ``revision`` is the scene's when it began."""

    def __init__(self, scene):
        self._scene = scene
        self._failure = None
        self.revision = scene.revision
        self._thread = threading.Thread(target=self._work, name="volley commit")
        self._thread.start()

    def _work(self):
        try:
            self._scene.commit()
        except BaseException as error:  # raised again where the commit is waited for
            self._failure = error

    def is_done(self, seconds):
        """Whether it has ended, after waiting for it that long."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def cancel(self):
        """Stop it where it has not ended, and wait; the library looks often."""
        while not self.is_done(POLL_SECONDS):
            self._scene.cancel()

    def check(self):
        """Raise what the commit raised, once it has ended."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
