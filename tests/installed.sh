#!/usr/bin/env bash
# The packages of build/packages as a user has them: each installed into a Debian that holds Blender alone (and
# NumPy, which the one of blender.org brings), no compiler, no OpenImageIO for Python and nothing of the
# sources, where the example is rendered.
#
#   bash tests/installed.sh [SUITE]...
#
# SUITE is bookworm (Debian 12, Blender 3.4), trixie (Debian 13, 4.3) or sid (Debian unstable, 5.2); all three if
# none is named. Then the same Blender renders with the add-on of the built tree (build/blender): all pixels
# have to be equal. Pictures are left in build/installed. Needs root, a Debian mirror, 2 GB for each suite, and
# what examples/package.sh and tests/setup.sh leave. The folders are $XDG_CACHE_HOME/volley/user-SUITE and stay.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tests/debian.sh

out=build/installed
# In the Debian: files that are opened and made, the built tree, preferences.
FILES=/opt/volley TREE=/opt/tree PREFERENCES=/root/.config

die() { printf 'installed: %s\n' "$*" >&2; exit 1; }
skip() { die "$NAME: $*"; }

choose_suite() {
    SUITE=$1 ROOT=$CACHE/user-$1 PACKAGES=(blender python3-numpy)
    case $SUITE in
        bookworm) NAME="Debian 12" ;;
        trixie) NAME="Debian 13" ;;
        sid)
            NAME="Debian unstable"
            PACKAGES+=(python3-cattr python3-requests) # which its blender imports and does not ask for
            ;;
        *) die "unknown suite: $SUITE" ;;
    esac
}

# Blender there, which has to end well and to leave no trace of an error.
blender_there() {
    local log=$out/$SUITE.log
    inside blender -b "$@" >"$log" 2>&1 && ! grep -qE '^Traceback|^Error:' "$log" ||
        { tail -n 40 "$log" >&2; die "$NAME: blender $*"; }
}

check_is_bare() {
    local program
    for program in cc gcc clang cmake; do
        ! inside sh -c 'command -v "$0"' "$program" >/dev/null || die "$NAME has $program"
    done
    ! inside python3 -c 'import OpenImageIO' 2>/dev/null || die "$NAME has OpenImageIO for Python"
}

# Installs the package that is right for this Blender: as a user would, or by the operators that a click calls.
install_addon() {
    if [ "$SUITE" = bookworm ]; then
        cp build/packages/legacy/*-linux-x64-legacy.zip "$ROOT$FILES/package.zip"
        blender_there --python-exit-code 1 --python-expr "import bpy
bpy.ops.preferences.addon_install(filepath='$FILES/package.zip')
bpy.ops.preferences.addon_enable(module='volley')
bpy.ops.wm.save_userpref()"
        MODULE=volley
    else
        cp build/packages/*-linux-x64.zip "$ROOT$FILES/package.zip"
        inside blender --command extension validate "$FILES/package.zip"
        inside blender --command extension install-file --repo user_default --enable "$FILES/package.zip"
        MODULE=bl_ext.user_default.volley
    fi
}

# The example as PICTURE, by the add-on MODULE of what is installed. With several threads Blender's own modifiers
# differ in a last digit between two starts.
render() {
    local module=$1 picture=$2
    blender_there -t 1 --python-exit-code 1 --addons "$module" "$FILES/character.blend" -E VOLLEY \
        -o "$FILES/$picture" -F OPEN_EXR -f 1
    [ -s "$ROOT$FILES/${picture}0001.exr" ] || die "$NAME: no picture"
}

render_with_tree() {
    mkdir -p "$ROOT$TREE"
    cp -r build/blender/. "$ROOT$TREE"
    (
        inside() {
            in_private chroot "$ROOT" env -i PATH=/usr/bin:/bin HOME="$PREFERENCES/tree" LC_ALL=C.UTF-8 \
                BLENDER_USER_SCRIPTS="$TREE" "$@" </dev/null
        }
        render volley tree_
    )
}

compare() {
    blender_there --factory-startup --python-exit-code 1 --python-expr "import bpy
pictures = []
for name in 'package_0001', 'tree_0001':
    image = bpy.data.images.load(f'$FILES/{name}.exr')
    pictures.append(image.pixels[:])
    image.save_render(f'$FILES/{name}.png')
package, tree = pictures
different = sum(a != b for a, b in zip(package, tree, strict=True))
print('values', len(tree), 'mean', sum(tree) / len(tree), 'different', different)
assert min(tree) < max(tree) and not different"
    grep '^values' "$out/$SUITE.log"
}

try() {
    local folder
    choose_suite "$1"
    make_root
    install_packages
    for folder in "$FILES" "$TREE" "$PREFERENCES"; do
        rm -rf "${ROOT:?}$folder"
    done
    mkdir -p "$ROOT$FILES"
    check_is_bare
    say "$NAME: $(inside blender --version 2>/dev/null | head -n 1), without compilers or OpenImageIO for Python"
    cp build/examples/character.blend "$ROOT$FILES"
    install_addon
    render "$MODULE" package_
    render_with_tree
    compare
    cp "$ROOT$FILES/package_0001.png" "$out/$SUITE.png"
    say "$NAME: the same picture from the package and the built tree, $out/$SUITE.png"
}

[ $# -gt 0 ] || set -- bookworm trixie sid
[ -f build/packages/SHA256SUMS ] || die "no packages: bash examples/package.sh"
(cd build/packages && sha256sum --check --quiet SHA256SUMS) || die "packages differ from their checksums"
mkdir -p "$out" build/examples
blender -b --factory-startup --python-exit-code 1 --python examples/make_character.py -- \
    "$PWD/build/examples/character.blend" >"$out/scene.log" 2>&1 </dev/null || die "no scene: see $out/scene.log"
for suite in "$@"; do
    try "$suite"
done
