# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests that run inside Blender, and the check of what is skipped.

A test may skip where expected_skips.py or its own mark, since(version, why), says so for the Blender that is
tested, and nowhere else. No Blender or no virtual display is a failure, unless VOLLEY_WITHOUT says that this
machine has none, or none that is of use: "blender", "xvfb" or both, with a comma.
"""

import os
import sys
import tempfile

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "support"))
import blender as blender_support  # noqa: E402  (found by the line above)
import expected_skips  # noqa: E402
import shared_blender  # noqa: E402

_HERE = os.path.dirname(os.path.abspath(__file__))
_IS_WITHOUT = pytest.StashKey()  # of tests that need what the user says is not there


@pytest.fixture(scope="session", autouse=True)
def _temporary_files():
    """What Blenders leave in the folder of temporary files goes when the tests end."""
    with tempfile.TemporaryDirectory(prefix="volley_") as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", folder)
        yield
        shared_blender.close()


@pytest.fixture
def blender(tmp_path, request):
    """A Blender to run functions in, one for all tests but those of the mark own_process."""
    has_own = request.node.get_closest_marker("own_process") is not None
    return (blender_support.Blender if has_own else shared_blender.SharedBlender)(str(tmp_path))


@pytest.fixture
def window(blender):
    """A Blender that can open a window."""
    return blender


@pytest.fixture(scope="module")
def blender_of_module(tmp_path_factory):
    """The same for fixtures whose results several tests look at."""
    return shared_blender.SharedBlender(str(tmp_path_factory.mktemp("blender")))


# What is missing -----------------------------------------------------------------------------------

@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Every test here needs Blender, and those in a window a display."""
    _require(item, "blender", blender_support.executable() is not None)
    if "window" in item.fixturenames:
        _require(item, "xvfb", blender_support.has_display())


def _require(item, what, is_there):
    """Fail where something is missing, or skip if the user says that it is: it may be there and of no use."""
    if what not in os.environ.get("VOLLEY_WITHOUT", "").split(","):
        if not is_there:
            pytest.fail(f"no {what} found; VOLLEY_WITHOUT={what} leaves out what needs it", pytrace=False)
        return
    item.stash[_IS_WITHOUT] = True
    pytest.skip(f"without {what}, as VOLLEY_WITHOUT says")


# Skips ---------------------------------------------------------------------------------------------

def pytest_configure(config):
    config.addinivalue_line("markers", "own_process: runs in a Blender that no other test has used")
    config.addinivalue_line("markers", "window: opens windows, and goes by the clock")
    config.addinivalue_line("markers", "since(version, why): skips in a Blender before (major, minor)")


def _name_of(item):
    return f"{item.path.name}::{item.name}"


def _expected_skip(item):
    """Why the Blender that is tested skips it, None if it must run."""
    version = blender_support.version()
    later = next((mark.args[1] for mark in item.iter_markers("since") if version < mark.args[0]), None)
    return later or expected_skips.reason(_name_of(item), version)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """Hold a test to the list of expected skips."""
    report = (yield).get_result()
    is_over = report.skipped or call.when == "call"
    if not is_over or report.failed or item.stash.get(_IS_WITHOUT, False) or call.when == "teardown":
        return
    expected = _expected_skip(item)
    if report.skipped and expected is None:
        report.outcome, report.longrepr = "failed", f"skipped, which is not expected: {report.longrepr}"
    elif not report.skipped and expected is not None:
        report.outcome, report.longrepr = "failed", f"is expected to be skipped ({expected}), but ran"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark tests in windows. Refuse an entry of the list that stands for no test, where all tests of its file were
    collected."""
    for item in items:
        if "window" in getattr(item, "fixturenames", ()):
            item.add_marker("window")
    if any("::" in str(argument) for argument in config.args):
        return
    names = [_name_of(item) for item in items if str(item.path.parent) == _HERE]
    files = {name.split("::")[0] for name in names}
    stale = [skip.pattern for skip in expected_skips.SKIPS if skip.pattern.split("::")[0] in files
             and not any(expected_skips.matches(skip, name) for name in names)]
    if stale:
        raise pytest.UsageError(f"expected_skips.py lists what is no test: {', '.join(stale)}")
