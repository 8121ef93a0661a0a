#!/usr/bin/env bash
# Makes the packages that users install from a file, in build/packages:
#
#   bash examples/package.sh [PLATFORM]...        linux-x64 if none is named
#
#   volley-VERSION-PLATFORM.zip                 the extension, for Blender 4.2 and later
#   index.json                                  lists the extensions: the folder is a repository for Blender
#   legacy/volley-VERSION-PLATFORM-legacy.zip   the add-on, for Blender 3.4 to 4.1
#   volley-VERSION-PLATFORM.cdx.json            bill of materials (CycloneDX)
#   SHA256SUMS
#
# A library for Linux loads with glibc 2.28 and later: today's compiler builds it against the headers and libraries
# of Debian 11, which are fetched once into $XDG_CACHE_HOME/volley. Needs Debian, and root or sudo where
# packages are missing. A checkout with changes is packed as it is, and its version says so.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tests/debian.sh

OLD_SUITE=bullseye
out=build/packages

# Blender's name of a platform, Debian's of its architecture where Debian 11's C library is needed ("-":
# it is not), and the package of the compiler. What the compiler is told is in .cmake/package.cmake.
platforms() {
    cat <<'END'
linux-x64 amd64 gcc
linux-arm64 arm64 gcc-aarch64-linux-gnu
windows-x64 - gcc-mingw-w64-x86-64
END
}

die() { printf 'package: %s\n' "$*" >&2; exit 1; }

# Headers and libraries of Debian 11 for an architecture, unpacked into a folder: nothing is installed.
make_sysroot() {
    local architecture=$1 root=$2 part=$2.part apt=$2.apt deb link
    [ ! -d "$root" ] || return 0
    say "Debian 11's C library for $architecture into $root"
    rm -rf "$part" "$apt"
    mkdir -p "$part" "$apt/lists/partial" "$apt/cache/archives/partial"
    : >"$apt/status"
    printf 'deb %s %s main\n' "$(mirror)" "$OLD_SUITE" >"$apt/sources.list"
    apt=$(realpath "$apt")
    local options=(-q -o "APT::Architecture=$architecture" -o "APT::Architectures::=$architecture"
        -o "Dir::State=$apt" -o "Dir::State::status=$apt/status"
        -o "Dir::Etc::sourcelist=$apt/sources.list" -o Dir::Etc::sourceparts=-
        -o "Dir::Cache=$apt/cache" -o Acquire::Languages=none)
    apt-get "${options[@]}" update >"$apt/log" 2>&1 </dev/null || die "no $OLD_SUITE: see $apt/log"
    (cd "$apt" && apt-get "${options[@]}" download \
        libc6:"$architecture" libc6-dev:"$architecture" linux-libc-dev:"$architecture") \
        >>"$apt/log" 2>&1 </dev/null || die "$OLD_SUITE has no C library for $architecture: see $apt/log"
    for deb in "$apt"/*.deb; do
        dpkg-deb -x "$deb" "$part"
    done
    # Links to absolute paths would lead into this system.
    find "$part" -type l -lname '/*' | while read -r link; do
        ln -sfnr "$part$(readlink "$link")" "$link"
    done
    mv "$part" "$root"
}

# No library but the system's own, and none exported but the interface.
check_windows_library() {
    local library=$1/tracer.dll objdump=x86_64-w64-mingw32-objdump foreign
    foreign=$("$objdump" -p "$library" | sed -n 's/.*DLL Name: //p' | grep -vixE 'kernel32.dll|msvcrt.dll' || true)
    [ -z "$foreign" ] || die "$library needs $foreign"
    foreign=$("$objdump" -p "$library" | sed -n '/^\[Ordinal\/Name Pointer\]/,/^$/p' |
        sed -n 's/^\t\[ *[0-9]*\] //p' | grep -v '^trc_' || true)
    [ -z "$foreign" ] || die "$library exports $foreign"
    say "Needs KERNEL32.dll and msvcrt.dll of Windows 10"
}

build() {
    local platform=$1 sysroot=$2 dir=$3
    say "Building for $platform"
    mkdir -p "$dir"
    cmake -G Ninja --toolchain .cmake/package.cmake -DTRACER_TARGET="$platform" \
        -DTRACER_SYSROOT="$sysroot" -DTRACER_WERROR=ON -S . -B "$dir" >"$dir/configure.log" 2>&1 </dev/null ||
        { cat "$dir/configure.log" >&2; die "cmake could not configure $dir"; }
    cmake --build "$dir" --target blender_scripts >"$dir/build.log" </dev/null ||
        { tail -n 40 "$dir/build.log" >&2; die "the build in $dir failed"; }
}

package() {
    local platform=$1 architecture=$2 compiler=$3
    local sysroot="" dir=build/package-$platform
    local stage=$dir/blender/addons/volley
    install_here cmake ninja-build python3 binutils "$compiler"
    if [ "$architecture" != - ]; then
        sysroot=$CACHE/$OLD_SUITE-$architecture
        mkdir -p "$CACHE"
        make_sysroot "$architecture" "$sysroot"
    fi
    build "$platform" "$sysroot" "$dir"
    case $platform in
        linux-*) python3 examples/package.py check --library "$stage/lib/libtracer.so" ;;
        windows-*) check_windows_library "$stage/lib" ;;
    esac
    python3 examples/package.py pack --stage "$stage" --platform "$platform" --out "$out"
}

[ $# -gt 0 ] || set -- linux-x64
for platform in "$@"; do
    platforms | grep -q "^$platform " ||
        die "unknown platform: $platform; there are $(platforms | cut -d ' ' -f 1 | xargs)"
done
rm -rf "$out"
for platform in "$@"; do
    package $(platforms | grep "^$platform ")
done
python3 examples/package.py index --out "$out"
(cd "$out" && sha256sum -- *.zip legacy/*.zip *.json >SHA256SUMS)
say "Packages in $out:"
cat "$out/SHA256SUMS"
