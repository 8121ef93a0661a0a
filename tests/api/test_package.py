# SPDX-License-Identifier: Apache-2.0
"""What the library asks of the system, read from the file: of the built tree, and of packages where some have
been made. (Installed packages: blender/test_packages.py, installed.sh.)"""

import importlib.util
import os
import zipfile
from pathlib import Path

import pytest

_REPOSITORY = Path(__file__).parents[2]
_BUILT = Path(os.environ.get("VOLLEY_BUILD", _REPOSITORY / "build")) / "lib/libtracer.so"
_PACKAGES = sorted((_REPOSITORY / "build/packages").glob("*-linux-*.zip"))

# Functions that have a newer version than 2.28 in the glibc of today, and what a package takes instead.
_MOVED = {"dladdr", "pthread_attr_setstacksize", "pthread_condattr_setclock", "pthread_create", "pthread_join",
          "pthread_once", "pthread_sigmask"}  # from a library of their own into libc
_INLINE = {"stat"}                            # part of each program before 2.33
_NEW_RESULTS = {"hypotf"}                     # the former one as far as 2.31 has it
_FORMER_VERSION = {"exp"}                     # .cmake/glibc_2_28.h


@pytest.fixture
def package():
    """examples/package.py"""
    spec = importlib.util.spec_from_file_location("package", _REPOSITORY / "examples/package.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_imports_are_older_than_blenders_baseline(package):
    """A function that glibc has had only since after 2.28 would be seen in a package alone."""
    imported, exported, _ = package.symbols_of(_BUILT)
    newer = {name for name, version in imported.items() if version and version > (2, 28)}
    assert newer <= _MOVED | _INLINE | _NEW_RESULTS | _FORMER_VERSION
    assert len(exported) > 50 and all(name.startswith("trc_") for name in exported)


def test_a_library_of_today_is_refused(package):
    with pytest.raises(SystemExit, match="needs .*'pthread_create': \\(2, 34\\)"):
        package.check_library(_BUILT)


@pytest.mark.parametrize("path", _PACKAGES, ids=lambda path: path.name)
def test_packages_that_were_made(package, path, tmp_path):
    with zipfile.ZipFile(path) as archive:
        package.check_library(archive.extract("lib/libtracer.so", tmp_path))
