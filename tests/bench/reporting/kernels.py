# SPDX-License-Identifier: Apache-2.0
"""Rays per second and accuracy of the kernels beside Embree, on the same rays in the same run: what
tracer_bench measures."""

from . import programs


# Builds use all threads, and whether rays do as well shows in one kind of them.
ALL_THREADS = ("--threads", "all", "--kinds", "primary", "--order", "auto", "--motion", "still")


def measure(options, scope):
    """Rows of tracer_bench: "build" and "rays", on one thread and, some of them, on all, and
    "accuracy"."""
    scenes = [word for name in scope.kernel_scenes for word in ("--scene", name)]
    program = programs.tool(options, "tracer_bench")
    one = programs.run_json([program, *scenes, "--threads", 1, *scope.kernel_arguments])
    rows = one + programs.run_json([program, *scenes, *scope.kernel_arguments, *ALL_THREADS])
    return rows + programs.run_json([program, "--accuracy"]) if scope.accuracy else rows


def races(rows):
    """The rows of rays that Embree raced on, losing cases first."""
    raced = [row for row in rows if row["row"] == "rays" and "embree_default" in row]
    return sorted(raced, key=lambda row: row["embree_default"]["ratio"])


def label(row):
    """What a row of rays is of."""
    motion = "moving" if row["motion"] else "still"
    order = "" if row["order"] == "auto" else f", {row['order']} order"
    return f"{row['scene']} {motion}, {row['kind']}{order}".replace("_", " ")


def builds(rows):
    """The rows of builds and refits."""
    return [row for row in rows if row["row"] == "build"]


def accuracy(rows):
    """{(mesh, instruction set, tracer): its rows}, one of each mode."""
    groups = {}
    for row in rows:
        if row["row"] == "accuracy":
            groups.setdefault((row["mesh"], row["isa"], row["tracer"]), []).append(row)
    return groups


def error_shares(row, use):
    """Of a row: rays that only one of the two hits, and distances that differ, per million."""
    peer = row[f"embree_{use}"]
    scale = 1e6 / row["rays"]
    return {"only_volley": peer["only_volley_hits"] * scale,
            "only_embree": peer["only_embree_hits"] * scale,
            "distances": peer["other_distances"] * scale}
