#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks a library for Linux, packs a staged add-on: the extension, the legacy add-on, and a bill of materials;
then lists the extensions (see package.sh).

    package.py check --library FILE
    package.py pack --stage DIR --platform linux-x64 --out DIR
    package.py index --out DIR

Archives of equal contents are equal bytes: entries are sorted and carry one date."""

import argparse
import hashlib
import json
import re
import subprocess
import tomllib
import zipfile
from pathlib import Path

_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that zip can say
_PROGRAM, _FILE, _FOLDER = 0o100755, 0o100644, 0o040755
_LEGACY = "legacy"  # a folder of their own: what is beside an index are extensions

# What a library for Linux may ask of the system: Blender's own baseline.
_GLIBC = (2, 28)
_SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2"}
_LOADER = "ld-linux"


def symbols_of(library):
    """The dynamic symbols of an ELF file: ({imported name: version of glibc or None}, exported names, names of
    needed libraries)."""
    listing = subprocess.run(["readelf", "--wide", "--dynamic", "--dyn-syms", library], check=True, text=True,
                             stdout=subprocess.PIPE, env={"PATH": "/usr/bin:/bin", "LC_ALL": "C"}).stdout
    imported, exported = {}, set()
    for index, name in re.findall(r"(?:GLOBAL|WEAK) +\w+ +(\w+) (\S+)", listing):
        name, _, version = name.partition("@")
        if index == "UND":
            found = re.fullmatch(r"@?GLIBC_([0-9.]+)", version)
            imported[name] = tuple(map(int, found[1].split("."))) if found else None
        else:
            exported.add(name)
    return imported, exported, set(re.findall(r"\(NEEDED\).*\[(.*)\]", listing))


def check_library(library):
    """Refuse a library that would not load with glibc 2.28, that needs more than the system's libraries, or that
    exports more than its interface."""
    imported, exported, needed = symbols_of(library)
    newer = {name: version for name, version in imported.items() if version and version > _GLIBC}
    foreign = {name for name in exported if not name.startswith("trc_")}
    others = {name for name in needed - _SYSTEM_LIBRARIES if not name.startswith(_LOADER)}
    if newer or foreign or others or not exported:
        raise SystemExit(f"package: {library} needs {newer or 'no newer glibc'} and {others or 'no other library'}, "
                         f"exports {foreign or 'nothing else'}")
    newest = max(filter(None, imported.values()))
    print(f"== Needs glibc {'.'.join(map(str, newest))} or later and {' '.join(sorted(needed))}")


def version_of(stage):
    """The version that the build has written into the manifest."""
    return tomllib.loads((stage / "blender_manifest.toml").read_text())["version"]


def files_of(stage):
    """{path in the package: bytes} of all that is staged."""
    return {str(path.relative_to(stage)): path.read_bytes() for path in sorted(stage.rglob("*"))
            if path.is_file() and "__pycache__" not in path.parts}


def with_platform(manifest, platform):
    """The manifest of a package for one platform."""
    return manifest.replace(b"\n\n[", f'\nplatforms = ["{platform}"]\n\n['.encode(), 1)


def pack(path, files, folder=""):
    """Write a zip of files, below a folder in it or at its top.

    The folder has an entry of its own: by that Blender finds the former one, and removes it before it unpacks
    the zip. It would write into a library that is loaded otherwise, and fall."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        if folder:
            entry = zipfile.ZipInfo(folder, _DATE)
            entry.external_attr = _FOLDER << 16
            archive.writestr(entry, b"")
        for name in sorted(files):
            entry = zipfile.ZipInfo(folder + name, _DATE)
            entry.external_attr = (_PROGRAM if name.startswith("lib/") else _FILE) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, files[name])


def bill_of_materials(version, platform, files):
    """What the package is made of, as CycloneDX 1.5: its own two parts, and no third one's."""
    def component(kind, name, licence, names):
        return {"type": kind, "name": name, "version": version, "licenses": [{"license": {"id": licence}}],
                "components": [{"type": "file", "name": path, "hashes": [
                    {"alg": "SHA-256", "content": hashlib.sha256(files[path]).hexdigest()}]}
                    for path in names]}

    library = [name for name in sorted(files) if name.startswith("lib/")]
    addon = [name for name in sorted(files) if name not in library]
    return {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
            "metadata": {"component": {"type": "application", "name": "volley", "version": version,
                                       "properties": [{"name": "platform", "value": platform}]}},
            "components": [component("library", "libtracer", "Apache-2.0", library),
                           component("application", "volley", "GPL-3.0-or-later", addon)]}


def pack_stage(stage, platform, out):
    """Both packages of a platform and their bill of materials."""
    version, files = version_of(stage), files_of(stage)
    name = f"volley-{version}-{platform}"
    (out / _LEGACY).mkdir(parents=True, exist_ok=True)
    manifest = with_platform(files["blender_manifest.toml"], platform)
    pack(out / f"{name}.zip", {**files, "blender_manifest.toml": manifest})
    legacy = {path: content for path, content in files.items() if path != "blender_manifest.toml"}
    pack(out / _LEGACY / f"{name}-legacy.zip", legacy, "volley/")
    bill = bill_of_materials(version, platform, files)
    (out / f"{name}.cdx.json").write_text(json.dumps(bill, indent=2) + "\n")


def index(out):
    """What Blender reads of a repository: of each extension its manifest, size and checksum. The same as of
    ``blender --command extension server-generate``, for machines without Blender 4.2."""
    listed = []
    for path in sorted(out.glob("*.zip")):
        with zipfile.ZipFile(path) as archive:
            manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        content = path.read_bytes()
        listed.append({**manifest, "archive_url": f"./{path.name}", "archive_size": len(content),
                       "archive_hash": f"sha256:{hashlib.sha256(content).hexdigest()}"})
    text = json.dumps({"version": "v1", "blocklist": [], "data": listed}, indent=2)
    (out / "index.json").write_text(text + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    checking = commands.add_parser("check")
    checking.set_defaults(run=check_library)
    checking.add_argument("--library", type=Path, required=True)
    packing = commands.add_parser("pack")
    packing.set_defaults(run=pack_stage)
    packing.add_argument("--stage", type=Path, required=True)
    packing.add_argument("--platform", required=True)
    listing = commands.add_parser("index")
    listing.set_defaults(run=index)
    for command in packing, listing:
        command.add_argument("--out", type=Path, required=True)
    arguments = vars(parser.parse_args())
    arguments.pop("run")(**arguments)


if __name__ == "__main__":
    main()
