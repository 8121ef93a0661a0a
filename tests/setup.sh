#!/usr/bin/env bash
# Installs what is missing (Debian) and builds into ./build.
#
#   bash tests/setup.sh [--ci] [--report] [packages|build]...     both steps if none is named
#
# Installs as root, or through sudo. --ci adds the packages that .ci/run needs, --report those of
# tests/bench/report.sh. Quick when nothing is missing and nothing changed. BUILD_DIR names another
# folder than build.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

packages=(
    blender gcc g++ cmake ninja-build libc6-dev
    libopenimageio-dev openimageio-tools libembree-dev libcmocka-dev
    python3 python3-numpy python3-pytest python3-pytest-xdist python3-openimageio
    xvfb xauth libgl1-mesa-dri
)
ci_packages=(clang-14 libclang-rt-14-dev clang-format-14 binutils)
report_packages=(povray povray-includes python3-matplotlib)

say() { printf '== %(%T)T %s\n' -1 "$*"; }
die() { printf 'setup: %s\n' "$*" >&2; exit 1; }

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        die "need root or sudo for: $*"
    fi
}

is_installed() {
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

install_packages() {
    local package missing=()
    if ! command -v apt-get >/dev/null; then
        say "No apt-get here; these Debian packages, or what they hold, must be present: ${packages[*]}"
        return
    fi
    for package in "${packages[@]}"; do
        is_installed "$package" || missing+=("$package")
    done
    if [ ${#missing[@]} -eq 0 ]; then
        say "Packages: nothing is missing"
        return
    fi
    say "Installing: ${missing[*]}"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get update -q </dev/null ||
        die "apt-get update failed"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends \
        "${missing[@]}" </dev/null || die "apt-get could not install: ${missing[*]}"
}

build() {
    local dir=${BUILD_DIR:-build}
    local log=$dir/configure.log
    mkdir -p "$dir"
    say "Configuring $dir"
    if ! cmake -G Ninja -C .cmake/ci.cmake -S . -B "$dir" >"$log" 2>&1 </dev/null; then
        cat "$log" >&2
        die "cmake could not configure $dir"
    fi
    say "Building $dir"
    cmake --build "$dir" </dev/null || die "the build in $dir failed"
}

main() {
    local argument steps=()
    for argument in "$@"; do
        case $argument in
            --ci) packages+=("${ci_packages[@]}") ;;
            --report) packages+=("${report_packages[@]}") ;;
            packages | build) steps+=("$argument") ;;
            *) die "unknown argument: $argument" ;;
        esac
    done
    [ ${#steps[@]} -gt 0 ] || steps=(packages build)
    for argument in "${steps[@]}"; do
        case $argument in
            packages) install_packages ;;
            build) build ;;
        esac
    done
}

main "$@"
