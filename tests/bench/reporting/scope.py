# SPDX-License-Identifier: Apache-2.0
"""How much is measured: quick for CI, medium by default, full by night."""

from dataclasses import dataclass, replace

EFFECTS = ("edges", "defocus", "motion", "area_light", "gloss", "glass", "environment", "texture")
JOINED = ("example_motion", "billiards", "gallery")
HAIR = ("hair_head", "hair_fur", "hair_grass")
FILES = ("example", "many_objects", "many_lights", "many_glasses", "foliage", "million_moving")
# Of the folder of scenes that others made, where there is one.
FOLDER_FILES = ("conference", "robot", "knight", "lost_empire")
FOLDER_CURVES = ("conference_motion", "robot_motion", "knight_motion")
DENOISE_FILES, FOLDER_DENOISE = ("example",), (*FOLDER_CURVES, "lost_empire")  # at rest, for Denoise besides
SAMPLERS = ("SOBOL", "SUDOKU", "JITTER", "INDEPENDENT", "BLUE_NOISE")
# Timed pictures are 768 x 432 and larger, as users render: in small ones Blender's own part of an F12 is half.
TIMES_SCALE = 6


@dataclass(frozen=True)
class Scope:
    """Numbers of scenes, samples, seeds and repeats of a mode; ``minutes`` is about what it takes on
    two quiet cores, estimated for full, and for medium where no pictures of errors are kept."""

    name: str
    minutes: int
    # Error against time.
    scenes: tuple
    sampler_scenes: tuple   # where all samplers run, not Sobol alone
    samples: tuple
    time_samples: tuple     # of those, timed; between and beyond them times are interpolated
    seeds: int
    reference_samples: int
    reference_seeds: int
    light_samples: tuple
    repeats: int
    times_scale: int        # timed pictures are so many times as wide and high
    denoise: bool           # Volley with Denoise beside it
    elsewhere: bool         # with newer Blenders and Embree too, in the scope of NEXT
    farm: bool              # commands of farms
    edited_objects: tuple   # numbers of them in scenes that are edited between final renders
    hair_scenes: tuple      # a whole F12 in a new Blender
    file_scenes: tuple      # too, without those of the folder of scenes
    whole_reference_samples: int  # of both
    # POV-Ray.
    classic_scenes: tuple
    classic_width: int
    # Kernels against Embree: arguments of tracer_bench.
    kernel_scenes: tuple
    kernel_arguments: tuple
    accuracy: bool          # of hits at vertices and edges
    # Whole frames of frame_bench.
    stages: tuple
    frame_edge: int
    eyes: int               # places of the camera that a frame's time is the mean of
    frame_repeats: int
    distribution_samples: int
    counted_edge: int
    largest_triangles: int
    largest_lights: int
    largest_instances: int


QUICK = Scope(
    name="quick", minutes=4,
    scenes=("area_light", "gallery"), sampler_scenes=(), samples=(1, 4, 16), time_samples=(1, 4, 16),
    seeds=3, reference_samples=128, reference_seeds=2, light_samples=(1, 4), repeats=3, times_scale=2,
    denoise=False, elsewhere=False, farm=False, edited_objects=(), hair_scenes=(), file_scenes=(),
    whole_reference_samples=128,
    classic_scenes=("classic",), classic_width=256,
    kernel_scenes=("character",),
    kernel_arguments=("--order", "auto", "--motion", "still", "--repeats", "3", "--tiles", "8",
                      "--size", "512"),
    accuracy=False,
    stages=("character",), frame_edge=256, eyes=2, frame_repeats=3,
    distribution_samples=4, counted_edge=64,
    largest_triangles=100_000, largest_lights=100, largest_instances=1000)

MEDIUM = Scope(
    name="medium", minutes=300,
    scenes=EFFECTS + JOINED, sampler_scenes=("gallery",), samples=(1, 4, 16, 64, 256, 1024),
    time_samples=(1, 4, 16, 64), seeds=10, reference_samples=1024, reference_seeds=4,
    light_samples=(1, 4), repeats=3, times_scale=TIMES_SCALE, denoise=True, elsewhere=True, farm=True,
    edited_objects=(1000, 10000),
    hair_scenes=HAIR, file_scenes=FILES, whole_reference_samples=128,
    classic_scenes=("classic", "classic_soft"), classic_width=320,
    kernel_scenes=("conference", "pool_hall", "character"),
    kernel_arguments=("--order", "auto", "--repeats", "3", "--tiles", "8"), accuracy=True,
    stages=("conference", "pool_hall", "character"), frame_edge=1024, eyes=2, frame_repeats=3,
    distribution_samples=8, counted_edge=128,
    largest_triangles=20_000_000, largest_lights=10_000, largest_instances=1_000_000)

FULL = Scope(
    name="full", minutes=480,
    scenes=EFFECTS + JOINED, sampler_scenes=EFFECTS + JOINED,
    samples=tuple(2 ** i for i in range(11)), time_samples=(1, 4, 16, 64, 256),
    seeds=10, reference_samples=4096, reference_seeds=8, light_samples=(1, 2, 4, 8), repeats=5,
    times_scale=TIMES_SCALE, denoise=True, elsewhere=True, farm=True, edited_objects=(1000, 10000),
    hair_scenes=HAIR, file_scenes=FILES, whole_reference_samples=1024,
    classic_scenes=("classic", "classic_soft"), classic_width=640,
    kernel_scenes=("conference", "pool_hall", "character"),
    kernel_arguments=("--repeats", "9"), accuracy=True,
    stages=("conference", "pool_hall", "character"), frame_edge=1024, eyes=4, frame_repeats=5,
    distribution_samples=64, counted_edge=512,
    largest_triangles=20_000_000, largest_lights=10_000, largest_instances=1_000_000)

# Of medium and full with newer Blenders and Embree: beside Volley as it is.
NEXT = replace(MEDIUM, name="next", samples=(1, 4, 16, 64, 256), sampler_scenes=(), light_samples=(1,),
               elsewhere=False, farm=False)

SCOPES = {scope.name: scope for scope in (QUICK, MEDIUM, FULL, NEXT)}


def picture_folders(names, folder_names, options, pictures):
    """{scene: folder of its PNGs}: those of the folder of scenes, where there is one, stay out of the report."""
    if not options.scenes:
        folder_names = ()
    return {**dict.fromkeys(names, pictures), **dict.fromkeys(folder_names, options.build / "pictures")}
