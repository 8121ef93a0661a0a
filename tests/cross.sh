#!/usr/bin/env bash
# Unit, kernel and watertight tests of another platform, by hand: an hour on two processors.
#
#   bash tests/cross.sh windows-x64|linux-arm64 [TESTS]
#
# Builds with Debian's cross compiler in build/cross-PLATFORM and runs the programs under wine or qemu-user;
# TESTS is a regular expression of CTest names (all). Then tracer_bench compares hits with brute force and, where
# build/ has it, with this machine's own (NEON's with those of SSE4.2), bit by bit, and measures, for the record:
# emulated speeds say nothing of a machine's. Needs Debian, and root or sudo where
# packages are missing; cmocka is built from Debian's source of it. Its last line is
# "N passed, N failed, N skipped"; the logs are ctest.log, check.log and bench.log in the folder.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tests/debian.sh

die() { printf 'cross: %s\n' "$*" >&2; exit 1; }

platform=${1:-}
tests=${2:-.}
left_out='^$'
case $platform in
    windows-x64)
        packages=(gcc-mingw-w64-x86-64 wine64 wine)
        isas=sse42,avx2,avx512
        own=$isas
        run=(wine)
        ;;
    linux-arm64)
        packages=(gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user)
        isas=neon
        own=sse42
        run=(qemu-aarch64 -L /usr/aarch64-linux-gnu)
        # Programs that they start are not emulated, and limits of memory are the emulator's.
        left_out='^unit\.(memory|reader|image_(files|colors)_python)$'
        ;;
    *) die "the platform is windows-x64 or linux-arm64" ;;
esac
dir=$PWD/build/cross-$platform
cmocka=$dir/cmocka

configure() {
    cmake -G Ninja --toolchain "$PWD/.cmake/package.cmake" -DTRACER_TARGET="$platform" "$@" </dev/null
}

# Debian has it for neither platform. Its source comes from the mirrors of the system, whose lists are read
# apart: most systems have none of sources.
build_cmocka() {
    local source=$dir/source list
    [ ! -e "$cmocka/lib/libcmocka-static.a" ] || return 0
    say "cmocka for $platform"
    rm -rf "$source"
    mkdir -p "$source/lists/partial"
    list=$source/sources.list
    printf 'deb-src %s %s main\n' \
        "$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -m 1 '/debian/*$')" \
        "$(. /etc/os-release && echo "$VERSION_CODENAME")" >"$list"
    local options=(-q -o "Dir::Etc::sourcelist=$list" -o Dir::Etc::sourceparts=-
        -o "Dir::State::lists=$source/lists")
    apt-get "${options[@]}" update >"$source/log" 2>&1 </dev/null || die "no sources: see $source/log"
    (cd "$source" && apt-get "${options[@]}" source cmocka >>log 2>&1 </dev/null) ||
        die "no source of cmocka: see $source/log"
    { configure -DWITH_STATIC_LIB=ON -DWITH_EXAMPLES=OFF -DCMAKE_INSTALL_PREFIX="$cmocka" \
        -S "$(echo "$source"/cmocka-*/)" -B "$source/build" &&
        cmake --build "$source/build" --target install; } >>"$source/log" 2>&1 ||
        die "cmocka cannot be built: see $source/log"
}

build() {
    say "Building for $platform"
    configure -DTRACER_WERROR=ON -DTRACER_BUILD_TESTS=ON -DTRACER_BUILD_BENCH=ON -DTRACER_TEST_SECONDS=7200 \
        -DCMOCKA_INCLUDE_DIR="$cmocka/include" -DCMOCKA_LIBRARY="$cmocka/lib/libcmocka-static.a" \
        -S . -B "$dir" >"$dir/configure.log" 2>&1 || { cat "$dir/configure.log" >&2; die "cmake failed"; }
    cmake --build "$dir" >"$dir/build.log" </dev/null ||
        { tail -n 40 "$dir/build.log" >&2; die "the build in $dir failed"; }
}

# wine has no folder for passing files of its own, and talks much.
export WINEPREFIX=$dir/wine WINEDEBUG=-all TMPDIR=/tmp

mkdir -p "$dir"
install_here cmake ninja-build dpkg-dev "${packages[@]}"
build_cmocka
build
say "Tests"
status=0
ctest --test-dir "$dir" -R "$tests" -E "$left_out" -j "$(nproc)" </dev/null >"$dir/ctest.log" 2>&1 || status=1
grep -E '\*\*\*(Failed|Timeout|Exception)|Not Run' "$dir/ctest.log" || true
say "tracer_bench"
bench=$(echo "$dir"/bin/tracer_bench*)
check=(--check --scene tiny --turn 30 --size 16 --samples 1 --tiles 1 --order auto --isa)
"${run[@]}" "$bench" "${check[@]}" "$isas" </dev/null | tr -d '\r' >"$dir/check.log" || status=1
if [ -x build/bin/tracer_bench ]; then
    differing=$(build/bin/tracer_bench "${check[@]}" "$own" | sed 's/ sse42 / neon  /' |
        diff - <(sed 's/ sse42 / neon  /' "$dir/check.log") | grep -c '^>' || true)
    say "Kinds of rays of $(wc -l <"$dir/check.log") whose hits are not this machine's own: $differing"
fi
"${run[@]}" "$bench" --isa "$isas" --threads 1 --size 256 --samples 4 --tiles 4 --repeats 3 --motion still \
    --kinds primary,point_shadow,glossy --order auto --no-builds </dev/null 2>&1 | tr -d '\r' | tee "$dir/bench.log"
passed=$(grep -c ' Passed ' "$dir/ctest.log" || true)
skipped=$(grep -c '\*\*\*Skipped' "$dir/ctest.log" || true)
total=$(grep -cE '^ *[0-9]+/[0-9]+ Test ' "$dir/ctest.log" || true)
printf '%d passed, %d failed, %d skipped\n' "$passed" $((total - passed - skipped)) "$skipped"
exit $status
