# SPDX-License-Identifier: Apache-2.0
"""Whole frames of the generated scenes, as frame_bench renders and counts them: the paper's tables and
figures, what effects cost, and how cost and memory grow.

Every group of frames is one run of the program, which takes them in turn.
"""

import os

from . import programs

# K. Boulos et al. 2007, Tables 1 and 2: frames per second and millions of rays per second on eight
# cores of 2 GHz Opteron 870, 1024x1024; Distribution with 64 samples per pixel.
PAPER = {
    "conference": {"triangles": 282_664, "fps": (8.0, 2.8, 0.02), "mrays": (16.2, 12.3, 4.5)},
    "character": {"triangles": 83_844, "fps": (16.5, 9.3, 0.13), "mrays": (33.1, 28.4, 20.2)},
    "pool_hall": {"triangles": 305_314, "fps": (12.0, 6.1, 0.07), "mrays": (24.8, 17.2, 10.8)},
}
PAPER_SAMPLES = 64
INTEGRATORS = ("raycast", "whitted", "distribution")
ASSEMBLIES = ("auto", "types", "runs", "groups", "octants", "blind", "none")
PACKET_SIZES = (4, 16, 64)
EFFECT_EDGE = 256                    # pixels
FACTORS = (0.0, 0.5, 1.0, 1.5, 2.0)  # of Figure 7
DEPTHS = tuple(range(1, 9))          # of Figure 8
REASONABLE = {"aperture": 1.0, "exposure": 1.0, "light_size": 1.0}
MIRRORS = {"surface": "mirror", "cutoff": 0.001}  # enough for those bounces
FEWEST_RAYS = 500                    # of a bounce, for a point of Figure 8
FIGURE_KINDS = ("camera", "reflection", "refraction")
# What is added to a frame of diffuse surfaces, a pinhole, a point light and nothing that moves.
EFFECTS = {
    "lens": {"aperture": 1.0}, "motion": {"exposure": 1.0}, "area light": {"light_size": 1.0},
    "4 light samples": {"light_size": 1.0, "light_samples": 4},
    "texture": {"surface": "texture"}, "mirrors": {"surface": "mirror"},
    "gloss": {"surface": "glossy"}, "glass": {"surface": "glass"},
}


def spec(**settings):
    """A line for frame_bench.

    >>> spec(scene="tiny", samples=4)
    'scene=tiny,samples=4'
    """
    return ",".join(f"{key}={value}" for key, value in settings.items())


def measure(options, scope):
    """{group: {name: rows}}."""
    groups = {
        "integrators": integrators(scope), "assemblies": assemblies(scope),
        "effects": effects(scope), "threads": threads(scope), "triangles": triangles(scope),
        "instances": instances(scope), "lights": lights(scope), "depth": depth(scope),
        "resolution": resolution(scope),
    }
    report = {name: run(options, specs, scope.frame_repeats) for name, specs in groups.items()}
    report["figure_7"] = run(options, figure_7(scope), 1)
    report["figure_8"] = run(options, figure_8(scope), 1)
    return report


def run(options, specs, repeats):
    """{name: rows of all repeats} of specs by name, in one run; equal frames are rendered once."""
    rows = programs.run_json([programs.tool(options, "frame_bench"), "--repeats", repeats,
                              *dict.fromkeys(specs.values())])
    return {name: [row for row in rows if row["spec"] == line] for name, line in specs.items()}


# Groups ------------------------------------------------------------------------------------------

def frame(scope, share=1, **settings):
    """A spec of the scope's size, or of a share of it, from the scope's places."""
    edge = max(16, scope.frame_edge // share)
    return spec(**{"width": edge, "height": edge, "eyes": scope.eyes, **settings})


def integrators(scope):
    """Tables 1 and 2: "stage integrator"."""
    made = {}
    for stage in scope.stages:
        for integrator in INTEGRATORS:
            settings = {"scene": stage, "integrator": integrator}
            if integrator == "distribution":
                settings.update(samples=scope.distribution_samples, **REASONABLE)
            made[f"{stage} {integrator}"] = frame(scope, **settings)
    return made


def assemblies(scope):
    """"stage integrator assembly" and, of ray types, "stage integrator types SIZE"."""
    made = {}
    for stage in scope.stages:
        for integrator, more in (("whitted", {}), ("distribution", {"samples": 2, **REASONABLE})):
            base = {"scene": stage, "integrator": integrator, **more}
            for assembly in ASSEMBLIES:
                made[f"{stage} {integrator} {assembly}"] = frame(scope, 2, assembly=assembly, **base)
            for size in PACKET_SIZES:
                made[f"{stage} {integrator} types {size}"] = frame(
                    scope, 2, assembly="types", packet_size=size, **base)
    return made


def effects(scope):
    """"stage raycast", "stage nothing" (distribution that has nothing to distribute), and each
    effect alone."""
    made = {}
    for stage in scope.stages:
        base = {"scene": stage, "samples": 4, "width": EFFECT_EDGE, "height": EFFECT_EDGE}
        plain = {"surface": "diffuse", **base}
        made[f"{stage} raycast"] = frame(scope, integrator="raycast", **plain)
        made[f"{stage} nothing"] = frame(scope, integrator="distribution", **plain)
        for name, settings in EFFECTS.items():
            made[f"{stage} {name}"] = frame(scope, integrator="distribution",
                                            **{**plain, **settings})
    return made


def threads(scope):
    """"stage integrator THREADS"."""
    counts = sorted({1, 2, os.cpu_count()})
    return {f"{stage} {integrator} {count}": frame(scope, scene=stage, integrator=integrator,
                                                   threads=count, eyes=1)
            for stage in scope.stages for integrator in ("raycast", "whitted") for count in counts}


def decades(low, high):
    """1, 3, 10, 30 and so on from low to high, and high itself.

    >>> decades(1000, 20000)
    [1000, 3000, 10000, 20000]
    """
    values, power = [], low
    while power <= high:
        values += [value for value in (power, 3 * power) if value <= high]
        power *= 10
    return sorted({*values, high})


def triangles(scope):
    """Balls of more and more triangles: "integrator COUNT"."""
    return {f"{integrator} {count}": frame(scope, 2, scene="balls", triangles=count, eyes=1,
                                           integrator=integrator)
            for count in decades(1024, scope.largest_triangles)
            for integrator in ("raycast", "whitted")}


def instances(scope):
    """"COUNT" instances of one ball."""
    return {str(count): frame(scope, 2, scene="balls", instances=count, eyes=1,
                              integrator="raycast") for count in decades(10, scope.largest_instances)}


def lights(scope):
    """"COUNT" point lights over the first stage, ray casting."""
    return {str(count): frame(scope, 2, scene=scope.stages[0], lights=count, eyes=1,
                              integrator="raycast") for count in decades(1, scope.largest_lights)}


def depth(scope):
    """"DEPTH": most bounces, Whitted."""
    return {str(count): frame(scope, 2, scene=scope.stages[0], max_depth=count, **MIRRORS)
            for count in (0, 1, 2, 4, 8, 16, 50)}


def resolution(scope):
    """"EDGE" of the square frame, Whitted."""
    return {str(edge): spec(scene=scope.stages[0], width=edge, height=edge, eyes=1)
            for edge in (64, 128, 256, 512, 1024, 2048) if edge <= 2 * scope.frame_edge}


def figure_7(scope):
    """"stage what FACTOR": counts against aperture, exposure time and size of the light."""
    made = {}
    for stage in scope.stages:
        for what in REASONABLE:
            for factor in FACTORS:
                settings = {**REASONABLE, what: factor}
                made[f"{stage} {what} {factor}"] = counted(scope, stage, integrator="distribution",
                                                           samples=4, **settings)
    return made


def figure_8(scope):
    """"stage ASSEMBLY LIMIT": counts with that limit of bounces. Rays of one bounce more are traced,
    for the light that they meet."""
    return {f"{stage} {assembly} {count}": counted(scope, stage, integrator="whitted",
                                                   assembly=assembly, max_depth=count,
                                                   **MIRRORS)
            for stage in scope.stages for assembly in ("runs", "types")
            for count in range(max(DEPTHS))}


def counted(scope, stage, **settings):
    """A frame that is counted."""
    return spec(scene=stage, counts=1, width=scope.counted_edge, height=scope.counted_edge,
                eyes=scope.eyes, **settings)


# Results -----------------------------------------------------------------------------------------

def rays(row):
    """All rays of a frame."""
    return sum(row["rays"].values())


def mrays_per_second(rows):
    """Of each repeat."""
    return [1e-6 * rays(row) / row["seconds"] for row in rows]


def seconds(rows):
    """Of each repeat, for one frame: the mean over the camera's places."""
    return [row["seconds"] / row["eyes"] for row in rows]


def shares(rows):
    """Parts of a frame's time with one tree built for it: build, trace, shade, film and the rest.

    Threads' times are shared out over the wall time of the render."""
    row = sorted(rows, key=lambda each: each["seconds"])[len(rows) // 2]
    work = row["seconds_trace"] + row["seconds_shade"] + row["seconds_other"]
    frame_seconds = row["seconds"] / row["eyes"]
    total = frame_seconds + row["commit_seconds"]
    parts = {"build": row["commit_seconds"] / total}
    for key in ("trace", "shade", "other"):
        parts[key] = row[f"seconds_{key}"] / work * frame_seconds / total
    return parts


def tests_per_ray(tests):
    """(boxes, triangles) that a ray of a class is tested against; a beam's test of a packet against a
    node's eight boxes counts as eight.

    >>> tests_per_ray({"rays": 2, "nodes": 1, "box_rays": 4, "single_nodes": 1, "triangle_rays": 3,
    ...                "single_triangles": 5})
    (10.0, 4.0)
    """
    if not tests["rays"]:
        return None
    boxes = tests["box_rays"] + 8 * (tests["nodes"] + tests["single_nodes"])
    triangle_tests = tests["triangle_rays"] + tests["single_triangles"]
    return boxes / tests["rays"], triangle_tests / tests["rays"]


def bounce_counts(group, stage, assembly, bounce):
    """Counts of the reflection rays of one bounce, 1 the first: what they add to the limit before."""
    counts = group[f"{stage} {assembly} {bounce - 1}"][0]["reflection"]
    if bounce == 1:
        return counts
    before = group[f"{stage} {assembly} {bounce - 2}"][0]["reflection"]
    return {key: counts[key] - before[key] for key in counts}
