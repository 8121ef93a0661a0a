#!/usr/bin/env bash
# The add-on in a newer Blender: a Debian with it in a folder of its own, where the library is built and
# tested as a user of that Debian would.
#
#   bash tests/blender_next.sh [--suite SUITE] [--fast] [--report XML] [--results DIR] [PYTEST ARGUMENT]...
#   bash tests/blender_next.sh [--suite SUITE] [--fast] [--scenes FOLDER] --measure PART DIR [--only SCENE...]
#   bash tests/blender_next.sh [--suite SUITE] --install
#
# SUITE is trixie (Debian 13, Blender 4.3; the default) or sid (Debian unstable, Blender 5.2). Runs all
# Blender tests if no argument says which; --fast runs what a change of Blender's version touches most (see
# CHANGED) and builds kernels for this processor alone;
# --report writes JUnit XML, --results what tests measured, the tables of build/results. --measure measures a
# part of tests/bench/report.sh there instead, curves, denoise, hair, files or kernels (beside Embree), and leaves
# its JSON in DIR; --scenes and --only are report.sh's; with --fast what report.sh --quick measures. --install makes
# the folder with its packages and ends.
# Needs root, a Debian mirror and 2.5 GB; the folder is $XDG_CACHE_HOME/volley/SUITE and stays, so that the
# next run takes only the build and the tests. Nothing stays mounted: /proc is there in a name space of its
# own, where there may be one. Exit code 77: it cannot be set up here, with the reason as the last line;
# else pytest's.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tests/debian.sh

PACKAGES=(
    blender gcc g++ cmake ninja-build libc6-dev libopenimageio-dev openimageio-tools
    python3-numpy python3-openimageio python3-pytest python3-pytest-xdist xvfb xauth libgl1-mesa-dri
)
LEFT_OUT=test_shadow_catcher
SKIPPED=77

skip() { printf 'Blender of %s: %s\n' "$NAME" "$*"; exit "$SKIPPED"; }
die() { printf 'blender_next: %s\n' "$*" >&2; exit 1; }

# What the suite is called, where its folder is, what its Blender needs besides, and which quick tests it leaves to
# the other Blenders.
choose_suite() {
    SUITE=$1 ROOT=$CACHE/$1
    case $SUITE in
        trixie)
            NAME="Debian 13"
            LEFT_OUT+=" or (test_shaders and hair)" # as in 5.2
            ;;
        sid)
            NAME="Debian unstable"
            PACKAGES+=(python3-cattr python3-requests) # which its blender imports and does not ask for
            ;;
        *) die "unknown suite: $SUITE" ;;
    esac
}

# The sources as they are here, next to the build that stays. Times are kept for ninja, unless the build is
# of another working tree: its objects may be younger than sources that differ.
copy_sources() {
    local target=$ROOT/volley sources=(CMakeLists.txt LICENSE .cmake addon libtracer tests examples) times=()
    mkdir -p "$target"
    (cd "$target" && rm -rf "${sources[@]}")
    [ "$(cat "$target/working_tree" 2>/dev/null)" = "$PWD" ] || times=(--touch)
    tar -c --exclude=__pycache__ "${sources[@]}" | tar -x "${times[@]}" -C "$target"
    printf '%s' "$PWD" >"$target/working_tree"
}

# The widest kernels that this processor runs, nothing for others than x86-64.
widest_isa() {
    local kind
    for kind in avx512vl:avx512 avx2:avx2 sse4_2:sse42; do
        if grep -qw "${kind%:*}" /proc/cpuinfo; then
            printf '%s' "${kind#*:}"
            return
        fi
    done
}

build() {
    local isas=$1 bench=${2:-OFF} log=$CACHE/$SUITE.build.log
    say "Building with the compiler and OpenImageIO of $NAME"
    inside sh -c 'cd /volley && cmake -G Ninja -C .cmake/ci.cmake -B build -DTRACER_BUILD_TESTS=OFF \
        -DTRACER_BUILD_BENCH="$2" -DTRACER_BUILD_ISAS="$1" && cmake --build build' build "$isas" "$bench" \
        >"$log" 2>&1 ||
        { tail -n 40 "$log" >&2; die "the build failed"; }
}

run_tests() {
    say "Tests in $(inside blender --version 2>/dev/null | head -n 1)"
    inside env VOLLEY_BUILD=/volley/build \
        BLENDER_USER_SCRIPTS=/volley/build/blender PYTHONPATH=/volley/tests/support \
        bash /volley/tests/run_pytest.sh python3 build/pytest.xml --junit-prefix "next_$SUITE" "$@"
}

# Measures a part: its name, the folder for its JSON, report.sh's scope and folder of scenes ("" for none), and
# report.sh's other arguments.
measure() {
    local part=$1 out=$2 scope=$3 scenes=$4 arguments=("${@:5}")
    if [ -n "$scenes" ]; then
        rm -rf "$ROOT/volley/scenes"
        cp -r "$scenes" "$ROOT/volley/scenes"
        arguments+=(--scenes /volley/scenes)
    fi
    say "$part with $(inside blender --version 2>/dev/null | head -n 1)"
    rm -rf "$ROOT/volley/build/report"
    inside env -C /volley python3 tests/bench/report.py "$scope" --measure --parts "$part" --out build/report \
        "${arguments[@]}"
    mkdir -p "$out"
    cp "$ROOT"/volley/build/report/data/*.json "$out"
}

# In what newer Blenders differ most from 3.4.
CHANGED="test_sky or test_working_space or test_textures or test_shaders or test_thin_film or test_bump \
or test_color_spaces or test_warnings or test_node_menus or test_registration or test_panels or test_passes \
or test_follows_edits or test_view_through or test_ray_nodes or test_displacement or test_thin_wall \
or test_no_material or test_tilted or test_scaled_normals or test_pane_in or test_generated or clear_holes \
or test_shading_offsets or test_tracing_nodes or test_strands or test_settings or test_persistent or test_links \
or (test_movies and test_window)"

main() {
    local report="" results="" part="" out="" suite=trixie isas="" is_fast="" scope=--next scenes="" status=0
    local arguments=()
    local is_only_installed=""
    while [ $# -gt 0 ]; do
        case $1 in
            --suite) suite=${2:?--suite needs a name}; shift 2 ;;
            --fast) is_fast=1 isas=$(widest_isa) scope=--quick; shift ;;
            --report) report=${2:?--report needs a file}; shift 2 ;;
            --results) results=${2:?--results needs a folder}; shift 2 ;;
            --install) is_only_installed=1; shift ;;
            --scenes) scenes=${2:?--scenes needs a folder}; shift 2 ;;
            --measure) part=${2:?--measure needs a part} out=${3:?--measure needs a folder}; shift 3 ;;
            *) break ;;
        esac
    done
    [ -n "$part" ] || [ $# -gt 0 ] || set -- tests/blender
    choose_suite "$suite"
    [ "$part" != kernels ] || PACKAGES+=(libembree-dev)
    [ -z "$is_fast" ] || arguments+=(-k "($CHANGED) and not ($LEFT_OUT)")
    make_root
    install_packages
    [ -z "$is_only_installed" ] || exit 0
    copy_sources
    if [ -n "$part" ]; then
        if [ "$part" = kernels ]; then
            build "" ON # tracer_bench has the kernels of all
        else
            build "$isas"
        fi
        measure "$part" "$out" "$scope" "$scenes" "$@"
        exit
    fi
    build "$isas"
    rm -rf "$ROOT/volley/build/pytest.xml" "$ROOT/volley/build/results"
    mkdir "$ROOT/volley/build/results"
    run_tests "${arguments[@]}" "$@" || status=$?
    [ -z "$report" ] || cp "$ROOT/volley/build/pytest.xml" "$report" || true
    if [ -n "$results" ]; then
        mkdir -p "$results"
        cp "$ROOT"/volley/build/results/* "$results" || true
    fi
    exit "$status"
}

main "$@"
