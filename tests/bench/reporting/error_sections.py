# SPDX-License-Identifier: Apache-2.0
"""Sections about Volley beside Cycles, Embree and POV-Ray."""

from . import curves, denoise_section, elsewhere, estimates, files, hair, kernels
from .tables import digits, median_with_spread, ratio, table, words


# Headline ----------------------------------------------------------------------------------------

def headline(results):
    """The few figures that README shows too."""
    return "## In short\n\n" + "\n".join(f"- {line}" for line in headline_lines(results))


def headline_lines(results):
    """One sentence for each part that was measured."""
    lines = []
    if results.get("curves"):
        lines.append(equal_error_line(results["curves"]))
    lines += [equal_error_line(run["made"], f"Cycles of {run['blender']}")
              for run in elsewhere.of_part(results, "curves")]
    lines += [denoise_section.headline(made, timed_sizes(made["scenes"]), cycles)
              for cycles, made in elsewhere.beside(results, "denoise")]
    if results.get("kernels"):
        lines.append(kernel_line(results["kernels"]))
    lines += [kernel_line(run["made"], elsewhere.embree_name(run)) for run in elsewhere.of_part(results, "kernels")]
    if results.get("kernels"):
        lines.append(accuracy_line(results["kernels"]))
    if results.get("povray"):
        lines.append(povray_line(results["povray"]))
    lines += [*hair.headlines(results), *files.headlines(results)]
    return [line for line in lines if line]


def equal_error_line(scenes, cycles="Cycles"):
    """Median, least and most of the times at equal error."""
    ratios = [entry["mse"]["ratio"] for _name, entry in curves.headline_rows(scenes) if entry["mse"]]
    if not ratios:
        return ""
    lost = sum(value < 1.0 for value in ratios)
    middle = estimates.spread(ratios)["median"]
    return (f"{cycles} takes {digits(middle, 2)} times as long as Volley for the same error (median of "
            f"{len(ratios)} scenes at {timed_sizes(scenes)}; {digits(min(ratios), 2)} to {digits(max(ratios), 2)}; "
            f"Volley is slower in {lost}).")


def kernel_line(rows, embree="Embree"):
    """Least and most ratio to Embree."""
    raced = [row for row in kernels.races(rows) if row["threads"] == 1 and row["order"] == "auto"]
    if not raced:
        return ""
    parts = []
    for motion, word in ((False, "static"), (True, "moving")):
        values = [row["embree_default"]["ratio"] for row in raced if row["motion"] == motion]
        if values:
            parts.append(f"{word} {digits(estimates.geometric_mean(values), 3)} "
                         f"({digits(min(values), 3)} to {digits(max(values), 3)})")
    return (f"Watertight rays per second over {embree}'s fastest mode, which is not watertight, on one "
            "thread, geometric mean over scenes, kinds of rays and instruction sets: "
            + "; ".join(parts) + ".")


def miss_rates(rows):
    """{tracer: misses per million of each mesh, instruction set and mode}."""
    rates = {}
    for (_mesh, _isa, tracer), modes in kernels.accuracy(rows).items():
        rates.setdefault(tracer, []).extend(1e6 * mode["misses"] / mode["rays"] for mode in modes)
    return rates


def accuracy_line(rows):
    """Rays lost at vertices and edges."""
    rates = miss_rates(rows)
    parts = [f"{tracer} {min(values):,.0f} to {max(values):,.0f}" if max(values) else f"{tracer} 0"
             for tracer, values in rates.items()]
    return ("Of a million rays at vertices and edges of closed meshes are lost: "
            + ", ".join(parts).replace("embree", "Embree").replace("volley", "Volley") + "."
            if parts else "")


def povray_line(scenes):
    """Ratios of time at about the same error."""
    made = [povray_ratio(scene) for scene in scenes.values()]
    made = [value for value in made if value]
    if not made:
        return ""
    span = " to ".join(dict.fromkeys((digits(min(made), 2), digits(max(made), 2))))
    return f"POV-Ray takes {span} times as long as Volley for the same error."


# Distances so many times farther off than the peer's are a loss.
LOST_DISTANCE = 1.5

# Losing cases ------------------------------------------------------------------------------------

def losing_cases(results):
    """Everything in which Volley is behind, the worst of each comparison first."""
    lines = losing_curves(results.get("curves", {}))
    for run in elsewhere.of_part(results, "curves"):
        lines += losing_curves(run["made"], f" of {run['blender']}")
    lines += losing_kernels(results.get("kernels", []))
    for run in elsewhere.of_part(results, "kernels"):
        lines += losing_kernels(run["made"], elsewhere.embree_name(run))
    lines = [*lines, *losing_builds(results.get("kernels", [])),
             *losing_distances(results.get("kernels", [])), *losing_povray(results.get("povray", {})),
             *denoise_section.losses(results), *hair.losses(results), *files.losses(results)]
    if not lines:
        return "## Where Volley loses\n\nNowhere in what was measured."
    return "## Where Volley loses\n\n" + "\n".join(f"- {line}" for line in lines)


def losing_curves(scenes, of_blender=""):
    """Scenes and measures in which Cycles reaches an error sooner."""
    lost = []
    for name, scene in scenes.items():
        for measure in curves.MEASURES:
            made = scene["comparison"][curves.DEFAULT].get(f"time_ratio_{measure}")
            if made and made["ratio"] < 1.0:
                lost.append((made["ratio"], f"{words(name)}: time of Cycles{of_blender} over Volley's at "
                                            f"equal {curves.MEASURES[measure]} {ratio(made)}"))
    return [line for _ratio, line in sorted(lost)]


def losing_kernels(rows, embree="Embree"):
    """Kinds of rays that Embree's best mode traces faster; robust mode beside."""
    lines = []
    for row in kernels.races(rows):
        made = row["embree_default"]["ratio"]
        if made < 1.0 and row["order"] == "auto" and row["threads"] == 1:
            robust = row["embree_robust"]["ratio"]
            lines.append(f"{kernels.label(row)}, {row['isa']}: "
                         f"**{made:.2f}** of {embree} ({robust:.2f} of its robust mode)")
    return lines


def losing_builds(rows):
    """Builds, refits and memory behind Embree's."""
    lines = []
    for row in kernels.builds(rows):
        name = f"{row['scene']} {'moving' if row['motion'] else 'static'}, {row['threads']} threads"
        for what in ("build", "refit"):
            peer = row.get(f"embree_{what}_mtri_s")
            if peer and row[f"{what}_mtri_s"]["median"] < peer["median"]:
                made = row[f"{what}_mtri_s"]["median"] / peer["median"]
                lines.append(f"{what} of {name}: **{made:.2f}** of Embree's speed")
        peer_bytes = row.get("embree_bytes_per_triangle")
        if peer_bytes and row["bytes_per_triangle"] > peer_bytes:
            lines.append(f"memory of {name}: {row['bytes_per_triangle']:.0f} bytes per triangle, "
                         f"Embree's {peer_bytes:.0f}")
    return lines


def losing_distances(rows):
    """Meshes on which Embree's robust mode has the more exact distances."""
    lines, groups = [], kernels.accuracy(rows)
    for (mesh, isa, tracer), modes in groups.items():
        robust = groups.get((mesh, isa, "embree robust"))
        if tracer != "volley" or not robust:
            continue
        own, peer = (max(mode["distance_most_ulps"] for mode in each) for each in (modes, robust))
        if own > LOST_DISTANCE * peer:
            lines.append(f"distances on {mesh}, {isa}: at most **{digits(own)}** ulps off, Embree's "
                         f"robust mode {digits(peer)}")
    return lines


def losing_povray(scenes):
    """Scenes in which POV-Ray reaches an error sooner."""
    made = {name: povray_ratio(scene) for name, scene in scenes.items()}
    return [f"{words(name)}: time of POV-Ray over Volley's at equal error **{value:.2f}**"
            for name, value in made.items() if value and value < 1.0]


# Cycles ------------------------------------------------------------------------------------------

def equal_error_table(scenes):
    """Time at equal error for every scene and configuration."""
    rows = []
    for name, _ratios in curves.headline_rows(scenes):
        for configuration, entry in scenes[name]["comparison"].items():
            if configuration == curves.BASE:
                continue
            slope = entry["slope"]
            rows.append([words(name), configuration.replace("volley ", ""),
                         *(ratio(entry[f"time_ratio_{measure}"]) for measure in curves.MEASURES),
                         digits(slope["slope"])])
    return table(["scene", "Volley", *curves.MEASURES.values(), "slope of MSE"], rows)


def equal_error(scenes):
    """What Cycles' time is divided by Volley's at equal error."""
    return ("## Time to equal error: Cycles over Volley\n\n"
            "Each figure is a geometric mean over the errors that both curves reach. `l4` has four "
            "shadow rays at each point that the camera sees. Both engines run inside Blender, times "
            f"are those of F12 with synchronising, without the file, at {timed_sizes(scenes)}.\n\n"
            "![Time to equal error](plots/time-to-equal-error.svg)\n\n" + equal_error_table(scenes))


def equal_error_elsewhere(run):
    """The same in a newer Blender."""
    return (f"### In {run['blender']}\n\n"
            f"Both engines in the Blender of {run['system']}, the library of its compiler, on the same machine, "
            f"with references by its own Cycles; timed at {timed_sizes(run['made'])}.\n\n"
            + equal_error_table(run["made"]))


def timed_sizes(scenes):
    """The least and the most pixels of the pictures that were timed."""
    sizes = sorted((scene["width"] * scene["times_scale"], scene["height"] * scene["times_scale"])
                   for scene in scenes.values())
    return " to ".join(dict.fromkeys(f"{width}×{height}" for width, height in (sizes[0], sizes[-1])))


def curves_and_bias(scenes):
    """Plots of all curves; variance, bias and the references."""
    rows = []
    for name, scene in scenes.items():
        reference = scene["reference"]
        for configuration, entry in scene["comparison"].items():
            rows.append([
                words(name), configuration, digits(entry["variance"]), digits(entry["bias_squared"]),
                " ".join(f"{value:.4f}" for value in entry["mean_ratios"]),
                "–" if entry["tiles"] is None else f"{entry['biased_tiles']} of {entry['tiles']}",
                f"{digits(reference['variance'])} ({reference['seeds']} × {reference['samples']})"])
    lines = [
        "## Curves of error against time",
        "Errors of small pictures, times of larger ones of the same scenes. relMSE is the mean of "
        "(x - r)² / (r + 0.01)². Bars are 95 % intervals over seeds. The references are Cycles' own, "
        "with other seeds; their variance is known and taken off MSE and relMSE. FLIP (Andersson et al. "
        "2020) is that of the pictures cut to [0, 1].",
        *(f"![{name}](plots/curves-{name}.svg)" for name in scenes),
        *(f"![Samplers, {name}](plots/samplers-{name}.svg)" for name, scene in scenes.items()
          if len(scene["curves"]) > 4),
        "### Bias apart from variance",
        "At the most samples: variance of a picture, squared bias (mean over pixels of the squared "
        "difference of means, less what noise adds to it, so it may be below zero), mean over the "
        "reference's for red, green and blue, 8×8 tiles whose mean differs from Cycles' (Welch's "
        "t-test, 1 % for all together), variance of the reference (seeds × samples).",
        table(["scene", "engine", "variance", "bias²", "means", "biased tiles", "reference"], rows)]
    return "\n\n".join(lines)


# Embree ------------------------------------------------------------------------------------------

def kernels_beside_embree(rows):
    """Rates with misses and differences; builds."""
    lines = [
        "## Kernels beside Embree",
        "The same rays, in cache, in turns. Volley's kernels are watertight; Embree's default mode is "
        "not, its robust mode is. *Differ* counts, per million rays, those that one of the two alone "
        "hits, and distances that differ by more than 1e-4 of them; *largest* is the largest relative "
        "difference of the others. Counts against the robust mode tell whose misses they are.",
        "![Kernels](plots/kernels.svg)",
        race_table(rows) if kernels.races(rows) else "Embree was not there.",
        "### Builds",
        table(["scene", "threads", "build, Mtri/s", "over Embree", "refit, Mtri/s", "over Embree",
               "bytes/triangle", "Embree's"], [build_row(row) for row in kernels.builds(rows)])]
    if kernels.accuracy(rows):
        lines += [
            "### Accuracy at vertices and edges",
            "Rays from inside of closed meshes at their vertices and the middles of their edges: all "
            "must hit. Distances in ulps of the exact one of the triangle that was hit, normals in "
            "half-ulps of 1, both by long arithmetic. Ranges are those of the modes: packets, single "
            "rays, Embree's streams. No miss of n rays bounds the rate of misses at 3 / n (95 %).",
            table(["mesh", "isa", "tracer", "rays of each mode", "misses per million",
                   "distance: most, ulps", "mean", "normal: most"],
                  [accuracy_row(*key, modes) for key, modes in kernels.accuracy(rows).items()])]
    return "\n\n".join(lines)


def race_table(rows):
    """Rates, misses and differences."""
    return table(["rays", "isa", "threads", "Volley, Mrays/s", "Embree's best", "ratio", "misses",
                  "differ: hits, distances", "robust: ratio", "differ: hits, distances", "largest"],
                 [kernel_row(row) for row in kernels.races(rows)])


def kernels_elsewhere(run):
    """The same rays beside a newer Embree."""
    return (f"### Beside {elsewhere.embree_name(run)}\n\n"
            f"That of {run['system']}, which has no streams, and the library of its compiler, on the same "
            "machine.\n\n" + race_table(run["made"]))


def accuracy_row(mesh, isa, tracer, modes):
    """A row of what one tracer's modes make of one mesh."""
    def span(values, text=digits):
        low, high = text(min(values)), text(max(values))
        return low if low == high else f"{low}–{high}"

    rays = modes[0]["rays"]
    misses = [1e6 * mode["misses"] / mode["rays"] for mode in modes]
    return [mesh, isa, tracer, f"{rays:,}",
            span(misses, "{:,.0f}".format) if any(misses) else f"0 (< {digits(3e6 / rays, 2)})",
            span([mode["distance_most_ulps"] for mode in modes]),
            span([mode["distance_mean_ulps"] for mode in modes]),
            span([mode["normal_most_half_ulps"] for mode in modes])]


def kernel_row(row):
    """A row of rays."""
    made = row["volley_mrays_s"]
    default, robust = row["embree_default"], row["embree_robust"]

    def differ(use):
        share = kernels.error_shares(row, use)
        hits = share["only_volley"] + share["only_embree"]
        return f"{digits(hits, 2)}, {digits(share['distances'], 2)}"

    own = default["ratio"]
    return [kernels.label(row), row["isa"], str(row["threads"]),
            f"{digits(made['median'])} ({digits(made['min'])}–{digits(made['max'])})",
            f"{digits(default[default['best']]['median'])} {default['best']}",
            f"**{own:.2f}**" if own < 1.0 else f"{own:.2f}", f"{100.0 * row['miss_share']:.1f} %",
            differ("default"), f"{robust['ratio']:.2f}", differ("robust"),
            digits(robust["largest_relative_difference"], 2)]


def build_row(row):
    """A row of builds."""
    def over(what):
        peer = row.get(f"embree_{what}_mtri_s")
        return f"{row[what + '_mtri_s']['median'] / peer['median']:.2f}" if peer else "–"

    return [f"{row['scene']} {'moving' if row['motion'] else 'static'}, {row['triangles']:,}",
            str(row["threads"]), digits(row["build_mtri_s"]["median"]), over("build"),
            digits(row["refit_mtri_s"]["median"]), over("refit"),
            digits(row["bytes_per_triangle"]), digits(row.get("embree_bytes_per_triangle"))]


# POV-Ray -----------------------------------------------------------------------------------------

def povray_ratio(scene):
    """Time of POV-Ray over Volley's at equal MSE; None where the curves do not meet."""
    sides = []
    for program in ("povray", "volley"):
        rows = [row for row in scene["rows"] if row["program"] == program]
        sides.append(([estimates.spread(row["seconds"])["median"] for row in rows],
                      [estimates.spread(row["mse"])["median"] for row in rows]))
    return estimates.cost_ratio(*sides)


def beside_povray(scenes):
    """Times and errors of both programs."""
    rows = []
    for name, scene in scenes.items():
        for row in scene["rows"]:
            rows.append([f"{words(name)}, {scene['width']}×{scene['height']}",
                         {"povray": "POV-Ray", "volley": "Volley"}[row["program"]],
                         str(row["samples"]),
                         median_with_spread(estimates.spread(row["seconds"])),
                         digits(estimates.spread(row["mse"])["median"]),
                         digits(estimates.spread(row["rel_mse"])["median"])])
    ratios = ", ".join(f"{words(name)} {digits(povray_ratio(scene))}"
                       for name, scene in scenes.items())
    references = ", ".join(digits(scene["reference_mse"], 2) for scene in scenes.values())
    return ("## Beside POV-Ray\n\nThe same triangles, mirrors and sun; pixels are supersampled by both "
            "with a box filter. POV-Ray's time is what it says of parsing and tracing, Volley's all of "
            "F12. In *classic soft* POV-Ray takes 4×4 jittered places on the sun for each of its "
            f"samples. Errors are against Cycles, whose own variance ({references}) is taken off. Time "
            f"of POV-Ray over Volley's at equal MSE: {ratios}.\n\n"
            "![Beside POV-Ray](plots/povray.svg)\n\n"
            + table(["scene", "program", "samples", "seconds", "MSE", "relMSE"], rows))
