# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's only voice outside Blender's reports: one logger, and a collector that says a thing once."""

import logging

logger = logging.getLogger("volley")


class Warnings:
    """Collects messages of one sync, each once, in order."""

    def __init__(self):
        self._messages = {}

    def add(self, message):
        """Note a message; repeats are dropped."""
        self._messages.setdefault(message)

    def count(self):
        """How many there are."""
        return len(self._messages)

    def after(self, count):
        """All messages but so many of the first."""
        return list(self._messages)[count:]

    def take(self):
        """All messages since the last take."""
        messages, self._messages = list(self._messages), {}
        return messages


def register():
    """Write warnings to the console in Blender's own form, "Warning: text"."""
    if not logger.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("Volley: %(levelname)s: %(message)s"))
        logger.addHandler(handler)
        logger.propagate = False


def unregister():
    """Take the handler off again."""
    for handler in list(logger.handlers):
        logger.removeHandler(handler)
