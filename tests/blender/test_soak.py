# SPDX-License-Identifier: Apache-2.0
"""A short soak: renders started, cancelled and freed beside a viewport. A long one is soak.py."""

import soak

CYCLES = 6


def test_cycles_end_and_leave_no_errors(window):
    rows, cancelled = window.run_in_window(soak.inside_soak, CYCLES, size=soak.WINDOW)
    assert len(rows) == CYCLES and cancelled > 0
    assert "Traceback" not in window.output
