# SPDX-License-Identifier: Apache-2.0
"""Sections about whole frames: the paper's tables and figures, effects, growth, Blender."""

from . import estimates, frames
from .tables import digits, median_with_spread, ratio, table, words

ARROW = " / "


def fps(rows, samples=1, wanted_samples=1):
    """Frames per second of each repeat, as if with another number of samples."""
    return [samples / wanted_samples / seconds for seconds in frames.seconds(rows)]


def papers_tables(groups):
    """Tables 1 and 2 with the paper's own numbers, and the claims that go with them."""
    speed, rates, claims = [], [], []
    for stage in stages(groups["integrators"]):
        rows = {name: groups["integrators"][f"{stage} {name}"] for name in frames.INTEGRATORS}
        paper = frames.PAPER[stage]
        samples = rows["distribution"][0]["rays"]["camera"] / rows["raycast"][0]["rays"]["camera"]
        frame_rates = [estimates.spread(fps(rows[name], *((samples, frames.PAPER_SAMPLES)
                                                          if name == "distribution" else (1, 1))))
                       for name in frames.INTEGRATORS]
        mrays = [estimates.spread(frames.mrays_per_second(rows[name])) for name in frames.INTEGRATORS]
        size = f"{words(stage)}, {rows['raycast'][0]['triangles']:,} ({paper['triangles']:,})"
        speed.append([size, *(f"{median_with_spread(made)}{ARROW}{theirs}"
                              for made, theirs in zip(frame_rates, paper["fps"]))])
        rates.append([size, *(f"{median_with_spread(made)}{ARROW}{theirs}"
                              for made, theirs in zip(mrays, paper["mrays"]))])
        claims.append([words(stage), *claim_cells(mrays, paper["mrays"], rows)])
    return "\n\n".join([
        "## The paper's tables",
        "Boulos et al. 2007 on scenes made by rule, near theirs in triangles and rays per pixel. Ours "
        "first, then the paper's own figure (eight cores of 2 GHz Opteron 870; machines two decades "
        "apart: only ratios within a column compare). Distribution has lens, motion and area light at "
        "once; its frames per second are those of 64 samples, from fewer in proportion.",
        "Table 1, frames per second at the report's frame size (the paper: 1024×1024):",
        table(["scene, triangles (paper's)", "ray casting", "Whitted", "distribution, 64 spp"], speed),
        "Table 2, millions of rays per second:",
        table(["scene, triangles (paper's)", "ray casting", "Whitted", "distribution"], rates),
        "Rays per second over ray casting's; the aims are 0.9 and 0.7. Rays per pixel tell how much "
        "there is to trace:",
        table(["scene", "Whitted (paper)", "distribution (paper)", "rays per pixel: Whitted",
               "distribution, per sample"], claims)])


def claim_cells(mrays, paper, rows):
    """Whitted and distribution over ray casting, and rays per sample."""
    cells = []
    for index, aim in ((1, 0.9), (2, 0.7)):
        made = mrays[index]["median"] / mrays[0]["median"]
        text = f"{made:.2f}" if made >= aim else f"**{made:.2f}**"
        cells.append(f"{text} ({paper[index] / paper[0]:.2f})")
    for name in ("whitted", "distribution"):
        row = rows[name][0]
        cells.append(digits(frames.rays(row) / row["rays"]["camera"]))
    return cells


def papers_figures():
    """Figures 7 and 8, drawn."""
    return ("## The paper's figures\n\n"
            "Figure 7: tests per ray as one of aperture, exposure time and size of the light grows, "
            "the other two being reasonable. A beam's test of a packet against the eight boxes of a "
            "node counts as eight.\n\n![Figure 7](plots/figure-7.svg)\n\n"
            "Figure 8: tests per reflection ray against its bounce, between mirrors, for packets by "
            "runs and by ray types.\n\n![Figure 8](plots/figure-8.svg)")


def stages(group):
    """Scenes that a group's names begin with."""
    return list(dict.fromkeys(name.split()[0] for name in group))


def assemblies(group):
    """Rays per second of each assembly and packet size."""
    rows = []
    for stage in stages(group):
        for integrator in ("whitted", "distribution"):
            rates = {name.split(" ", 2)[2]: frames.mrays_per_second(each)
                     for name, each in group.items() if name.startswith(f"{stage} {integrator} ")}
            gain = estimates.ratio_with_interval(rates["types"], rates["runs"])
            middles = {name: estimates.spread(values)["median"] for name, values in rates.items()}
            rows.append([words(stage), integrator,
                         *(digits(middles[name]) for name in frames.ASSEMBLIES),
                         *(digits(middles[f"types {size}"]) for size in frames.PACKET_SIZES),
                         ratio(gain),
                         f"{middles['types'] / middles['none']:.2f}"])
    return ("## Packet assemblies\n\nMillions of rays per second, all of the frame with its shading. "
            "The paper found ray types 10 to 20 % over runs and 2 to 3 times over none.\n\n"
            + table(["scene", "integrator", *frames.ASSEMBLIES,
                     *(f"types, {size} rays" for size in frames.PACKET_SIZES), "types over runs",
                     "types over none"], rows))


def effects(groups):
    """What an unused effect costs, and each that is used."""
    group = groups["effects"]
    names = ["raycast", *frames.EFFECTS]
    rows = []
    for stage in stages(group):
        nothing = frames.seconds(group[f"{stage} nothing"])
        cells = []
        for name in names:
            made = estimates.ratio_with_interval(frames.seconds(group[f"{stage} {name}"]), nothing)
            more_rays = (frames.rays(group[f"{stage} {name}"][0])
                         / frames.rays(group[f"{stage} nothing"][0]))
            cells.append(f"{ratio(made).replace('*', '')}, {more_rays:.2f}× rays")
        rows.append([words(stage), *cells])
    shares = []
    for name, each in groups["integrators"].items():
        made = frames.shares(each)
        shares.append([words(name), *(f"{100.0 * value:.0f} %" for value in made.values())])
    return "\n\n".join([
        "## What effects cost",
        "Time of a frame over that of the distribution integrator with nothing to distribute "
        "(diffuse surfaces, pinhole, point light, nothing moves), and how many times its rays there are. "
        "*Ray casting* traces the same rays, "
        "so 1 over its column is what the unused machinery costs: the paper pays 12 %.",
        "![Effects](plots/effects.svg)",
        table(["scene", *names], rows),
        "Shares of a frame whose tree is built anew; *other* is camera rays, film and threads' start:",
        "![Shares](plots/shares.svg)",
        table(["frame", "build", "trace", "shade", "other"], shares)])


def growth(groups):
    """Threads, and the plot of all that grows."""
    rows = []
    names = groups["threads"]
    counts = sorted({int(name.split()[2]) for name in names})
    for stage in stages(names):
        for integrator in ("raycast", "whitted"):
            one = frames.seconds(names[f"{stage} {integrator} 1"])
            cells = []
            for count in counts[1:]:
                made = estimates.ratio_with_interval(
                    one, frames.seconds(names[f"{stage} {integrator} {count}"]))
                cells.append(ratio(made))
            rows.append([words(stage), integrator, *cells])
    return "\n\n".join([
        "## How costs grow",
        "Balls in a cube for triangles and instances; the other plots are of the first scene. Memory "
        "is that of the whole BVH.",
        "![Growth](plots/growth.svg)",
        cliff(groups["triangles"]),
        "Frames per second over one thread's:",
        table(["scene", "integrator", *(f"{count} threads" for count in counts[1:])], rows)])


def cliff(group):
    """The largest fall of rays per second from one number of triangles to the next."""
    points = [(int(name.split()[1]), estimates.spread(frames.mrays_per_second(rows))["median"])
              for name, rows in group.items() if name.startswith("raycast")]
    falls = [(later / earlier, low, high)
             for (low, earlier), (high, later) in zip(points, points[1:])]
    worst, low, high = min(falls)
    return (f"Ray casting goes from {digits(points[0][1])} Mrays/s at {points[0][0]:,} triangles to "
            f"{digits(points[-1][1])} at {points[-1][0]:,}; the steepest step is to {worst:.2f} of the "
            f"rate, from {low:,} to {high:,}.")


def blender(result):
    """Start-up and edits."""
    start = [[case, median_with_spread(estimates.spread(values))]
             for case, values in result["start"].items()]
    edits = [[words(row["edit"]), *(digits(row[f"{what}_ms"]) for what in
                                    ("sync", "commit", "tree", "first", "picture"))]
             for row in result["edits"]]
    return "\n\n".join([
        "## Inside Blender",
        "Seconds from the start of `blender -b` to its end:",
        table(["", "seconds"], start),
        "Milliseconds from an edit to the first picture of one sample at 960×540, beyond Blender's own "
        "evaluation: 1,000 objects of 200 triangles each, then (from the second *first sync*) a "
        "skinned character of 60,000 triangles. *Trees* is a part of *commit*; *first* is the first "
        "picture in the viewport, of larger pixels where a *full* one would be late.",
        table(["edit", "sync", "commit", "trees", "first", "full"], edits),
        *_final_edits(result["final_edits"])])


def _final_edits(rows):
    """Paragraphs of final renders after edits, where there are any."""
    if not rows:
        return []
    lines = [[f"{row['objects']:,}", words(row["edit"]),
              *(digits(row[f"{what}_ms"]) for what in ("sync", "commit", "whole", "cycles")),
              f"{row['cycles_ms'] / row['whole_ms']:.2f}"] for row in rows]
    return ["Milliseconds of F12 with persistent data after an edit, 96×54 and one sample: objects of 200 triangles, "
            "each of a mesh of its own. *Whole* is all that Blender does, *Cycles* the same by it; of the objects, "
            "one moves in time: it is elsewhere on the next *frame*. *Transforms* moves all of them, *select* selects "
            "one.",
            table(["objects", "edit", "sync", "commit", "whole", "Cycles", "Cycles / Volley"], lines)]
