#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes tests/settings.md, the table of what Volley makes of Cycles' settings."""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "support"))
import cycles_settings  # noqa: E402  (found by the line above)

if __name__ == "__main__":
    with open(os.path.join(HERE, "settings.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(cycles_settings.table()))
