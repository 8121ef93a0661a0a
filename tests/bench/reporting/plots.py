# SPDX-License-Identifier: Apache-2.0
"""The plots of a report as SVG, drawn with matplotlib."""

import matplotlib
import matplotlib.ticker

matplotlib.use("svg")

import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen first)

from . import curves, estimates, farm_section, frames, kernels  # noqa: E402

# Okabe and Ito's colours, told apart by all eyes.
CYCLES_COLOR, VOLLEY_COLOR = "#D55E00", "#0072B2"
WIDE_RANGE = 200.0  # of a logarithmic axis
COLORS = (VOLLEY_COLOR, "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C510A", "#999999")


def draw(results, out):
    """All plots that the results have something for."""
    folder = out / "plots"
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({
        "svg.hashsalt": "volley", "svg.fonttype": "none", "font.size": 9, "axes.grid": True,
        "grid.color": "#dddddd", "axes.axisbelow": True, "figure.dpi": 100,
        "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False})
    if results.get("curves"):
        draw_ratios(results["curves"], folder / "time-to-equal-error.svg")
        for name, scene in results["curves"].items():
            draw_curves(name, scene, folder / f"curves-{name}.svg")
        draw_samplers(results["curves"], folder)
    if results.get("kernels"):
        draw_kernels(results["kernels"], folder / "kernels.svg")
    if results.get("povray"):
        draw_povray(results["povray"], folder / "povray.svg")
    if results.get("frames"):
        draw_frames(results["frames"], folder)
    if results.get("farm"):
        draw_farm(results["farm"], folder / "farm.svg")


def save(figure, path):
    """Write without the date, so that equal plots are equal files."""
    figure.savefig(path, metadata={"Date": None}, bbox_inches="tight")
    plt.close(figure)


def plain_log_ticks(axis, names):
    """Ticks as plain numbers at 1, 2, 5, 10 and so on, or at powers of ten over a wide range; call it
    when all is drawn."""
    for name in names:
        part = getattr(axis, name + "axis")
        low, high = part.get_view_interval()
        subs = (1.0, 2.0, 5.0) if high < WIDE_RANGE * low else (1.0,)
        part.set_major_locator(matplotlib.ticker.LogLocator(subs=subs))
        part.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        part.set_minor_formatter(matplotlib.ticker.NullFormatter())


# Error against time ------------------------------------------------------------------------------

def configuration_style(name, names):
    """Cycles has its own colour; Volley's light samples and samplers follow each other."""
    if name == curves.BASE:
        return {"color": CYCLES_COLOR, "marker": "s"}
    volley = [each for each in names if each != curves.BASE]
    return {"color": COLORS[volley.index(name) % len(COLORS)], "marker": "o"}


def seed_interval(point, measure):
    """How far the interval of the mean reaches below and above it. The means of equal seeds may differ
    in their last bit, and lie outside of their own interval."""
    made = estimates.mean_with_interval(point["seeds"][measure])
    return max(made["mean"] - made["interval"][0], 0.0), max(made["interval"][1] - made["mean"], 0.0)


def draw_curves(name, scene, path):
    """Each measure against seconds, log-log, with the intervals of the mean over seeds."""
    shown = [each for each in scene["curves"] if is_main(each)]
    figure, axes = plt.subplots(1, len(curves.MEASURES), figsize=(3.2 * len(curves.MEASURES), 3.0))
    for axis, measure in zip(axes, curves.MEASURES):
        for configuration in shown:
            seconds, errors = curves.curve(scene, configuration, measure)
            bars = [seed_interval(point, measure)
                    for point in scene["curves"][configuration].values()]
            axis.errorbar(seconds, errors, yerr=list(zip(*bars)), label=configuration, markersize=4,
                          linewidth=1.3, capsize=2, **configuration_style(configuration, shown))
        axis.set(xscale="log", yscale="log", xlabel="seconds", title=curves.MEASURES[measure])
        plain_log_ticks(axis, "xy")
    axes[0].legend(fontsize=7)
    figure.suptitle(name.replace("_", " "))
    figure.tight_layout()
    save(figure, path)


def is_main(configuration):
    """Cycles and Volley's default sampler: the others have a plot of their own."""
    return configuration == curves.BASE or configuration.startswith("volley sobol")


def draw_samplers(scenes, folder):
    """MSE against samples for each sampler, where several ran."""
    for name, scene in scenes.items():
        shown = [each for each in scene["curves"] if each == curves.BASE or each.endswith("l1")]
        if all(is_main(each) for each in shown):
            continue
        figure, axis = plt.subplots(figsize=(4.2, 3.4))
        for configuration in shown:
            points = scene["curves"][configuration]
            axis.plot([int(count) for count in points], [p["mse"] for p in points.values()],
                      label=configuration, markersize=4, **configuration_style(configuration, shown))
        axis.set(xscale="log", yscale="log", xlabel="samples per pixel", ylabel="MSE",
                 title=f"samplers, {name.replace('_', ' ')}")
        plain_log_ticks(axis, "xy")
        axis.legend(fontsize=7)
        save(figure, folder / f"samplers-{name}.svg")


def draw_ratios(scenes, path):
    """Time that Cycles needs over Volley's at equal error, worst scene first."""
    rows = curves.headline_rows(scenes)
    figure, axis = plt.subplots(figsize=(6.4, 1.0 + 0.34 * len(rows)))
    for y, (name, by_measure) in enumerate(reversed(rows)):
        for offset, (measure, color) in enumerate((("mse", VOLLEY_COLOR), ("rel_mse", COLORS[1]))):
            made = by_measure[measure]
            if made is None:
                continue
            low, high = made["interval"]
            place = y + 0.12 - 0.24 * offset
            axis.plot([low, high], [place, place], color=color, linewidth=2)
            axis.plot(made["ratio"], place, "o", color=color, markersize=5,
                      label=curves.MEASURES[measure] if y == 0 else None)
    axis.axvline(1.0, color=CYCLES_COLOR, linewidth=1.2)
    axis.set(xscale="log", yticks=range(len(rows)),
             yticklabels=[name.replace("_", " ") for name, _ratios in reversed(rows)],
             xlabel="time of Cycles / time of Volley at equal error (1: as fast as Cycles)")
    plain_log_ticks(axis, "x")
    axis.set_ylim(-0.6, len(rows) - 0.4)
    axis.legend(fontsize=8, ncol=2, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    save(figure, path)


# Kernels -----------------------------------------------------------------------------------------

def draw_kernels(rows, path):
    """Ratio to Embree's best mode on one thread, by kind of ray: a dot for each scene."""
    raced = [row for row in kernels.races(rows) if row["threads"] == 1 and row["order"] == "auto"]
    if not raced:
        return
    panels = sorted({(row["isa"], row["motion"]) for row in raced})
    kinds = list(dict.fromkeys(row["kind"] for row in rows if row["row"] == "rays"))
    figure, axes = plt.subplots(1, len(panels), figsize=(3.2 * len(panels) + 1.2, 3.4), sharex=True,
                                sharey=True, squeeze=False)
    scenes = list(dict.fromkeys(row["scene"] for row in raced))
    for axis, (isa, motion) in zip(axes[0], panels):
        for row in raced:
            if (row["isa"], row["motion"]) != (isa, motion):
                continue
            axis.plot(row["embree_default"]["ratio"], len(kinds) - 1 - kinds.index(row["kind"]), "o",
                      color=COLORS[scenes.index(row["scene"]) % len(COLORS)], markersize=5)
        axis.axvline(1.0, color=CYCLES_COLOR, linewidth=1.2)
        axis.set(xscale="log", title=f"{isa}, {'moving' if motion else 'static'}",
                 xlabel="Mrays/s over Embree's best mode", yticks=range(len(kinds)),
                 yticklabels=[kind.replace("_", " ") for kind in reversed(kinds)])
        plain_log_ticks(axis, "x")
    for index, scene in enumerate(scenes):
        axes[0][-1].plot([], [], "o", color=COLORS[index % len(COLORS)], label=scene)
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.tight_layout()
    save(figure, path)


# POV-Ray -----------------------------------------------------------------------------------------

def draw_povray(scenes, path):
    """Relative MSE against seconds of both programs."""
    figure, axes = plt.subplots(1, len(scenes), figsize=(3.6 * len(scenes), 3.0), squeeze=False)
    for axis, (name, scene) in zip(axes[0], scenes.items()):
        for program, color in (("povray", CYCLES_COLOR), ("volley", VOLLEY_COLOR)):
            rows = [row for row in scene["rows"] if row["program"] == program]
            axis.plot([estimates.spread(row["seconds"])["median"] for row in rows],
                      [estimates.spread(row["mse"])["median"] for row in rows], "o-", color=color,
                      label={"povray": "POV-Ray", "volley": "Volley"}[program])
        axis.set(xscale="log", yscale="log", xlabel="seconds", ylabel="MSE",
                 title=name.replace("_", " "))
        plain_log_ticks(axis, "xy")
        axis.legend(fontsize=8)
    figure.tight_layout()
    save(figure, path)


# Frames ------------------------------------------------------------------------------------------

def draw_frames(groups, folder):
    """The paper's figures and how costs grow."""
    draw_figure_7(groups["figure_7"], folder / "figure-7.svg")
    draw_figure_8(groups["figure_8"], folder / "figure-8.svg")
    draw_growth(groups, folder / "growth.svg")
    draw_effects(groups["effects"], folder / "effects.svg")
    draw_shares(groups["integrators"], folder / "shares.svg")


def stages_of(group):
    """The scenes of a group whose names begin with them."""
    return list(dict.fromkeys(name.split()[0] for name in group))


def from_zero(axis):
    """A linear axis that begins at zero and leaves room above what is drawn."""
    axis.set_ylim(0.0, 1.08 * axis.dataLim.y1)


def draw_figure_7(group, path):
    """Tests of boxes and triangles per ray against aperture, exposure and light size."""
    whats = list(frames.REASONABLE)
    stages = stages_of(group)
    figure, axes = plt.subplots(2, len(whats), figsize=(3.3 * len(whats), 5.2), sharex=True,
                                squeeze=False)
    for column, what in enumerate(whats):
        kinds = frames.FIGURE_KINDS if what != "light_size" else ("shadow",)
        for line, stage in enumerate(stages):
            for kind, style in zip(kinds, ("-", "--", ":")):
                points = [frames.tests_per_ray(group[f"{stage} {what} {factor}"][0][kind])
                          for factor in frames.FACTORS]
                if None in points:
                    continue
                for row in (0, 1):
                    axes[row][column].plot(frames.FACTORS, [point[1 - row] for point in points],
                                           style, marker=".", color=COLORS[line],
                                           label=f"{stage}, {kind}")
        axes[0][column].set_title(what.replace("_", " ")
                                  + (": shadow rays" if what == "light_size" else ""))
        axes[1][column].set_xlabel("times a reasonable one")
        for row in (0, 1):
            from_zero(axes[row][column])
    axes[0][-1].legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, loc="upper left",
                       bbox_to_anchor=(1.0, 1.0))
    axes[0][0].set_ylabel("triangle tests per ray")
    axes[1][0].set_ylabel("box tests per ray")
    figure.tight_layout()
    save(figure, path)


def draw_figure_8(group, path):
    """Triangle and box tests per reflection ray against its bounce, runs and ray types."""
    stages = stages_of(group)
    figure, axes = plt.subplots(2, len(stages), figsize=(3.2 * len(stages), 5.0), squeeze=False)
    for column, stage in enumerate(stages):
        for assembly, color in (("runs", CYCLES_COLOR), ("types", VOLLEY_COLOR)):
            depths, points = figure_8_points(group, stage, assembly)
            for row in (0, 1):
                axes[row][column].plot(depths, [point[1 - row] for point in points], "o-",
                                       color=color, markersize=3, label=assembly)
        axes[0][column].set_title(stage)
        axes[1][column].set_xlabel("bounce")
        for row in (0, 1):
            from_zero(axes[row][column])
            axes[row][column].xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(integer=True))
    axes[0][0].set_ylabel("triangle tests per reflection ray")
    axes[1][0].set_ylabel("box tests per reflection ray")
    axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    save(figure, path)


def figure_8_points(group, stage, assembly):
    """(bounces, tests per ray) of the bounces that have rays enough to tell."""
    depths, points = [], []
    for depth in frames.DEPTHS:
        added = frames.bounce_counts(group, stage, assembly, depth)
        if added["rays"] >= frames.FEWEST_RAYS:
            depths.append(depth)
            points.append(frames.tests_per_ray(added))
    return depths, points


def draw_growth(groups, path):
    """Seconds of a frame against triangles, instances, lights, depth, resolution, threads."""
    figure, axes = plt.subplots(2, 3, figsize=(9.6, 5.4))
    for integrator, color in (("raycast", VOLLEY_COLOR), ("whitted", COLORS[1])):
        points = [(int(name.split()[1]), rows) for name, rows in groups["triangles"].items()
                  if name.startswith(integrator)]
        axes[0][0].plot([count for count, _rows in points],
                        [median_rate(rows) for _count, rows in points], "o-", markersize=4,
                        color=color, label=integrator)
    axes[0][0].set(xscale="log", xlabel="triangles", ylabel="Mrays/s", ylim=(0, None))
    axes[0][0].legend(fontsize=8)
    memory = [(rows[0]["triangles"], rows[0]["bvh_bytes"] / rows[0]["triangles"])
              for name, rows in groups["triangles"].items() if name.startswith("raycast")]
    axes[0][1].plot(*zip(*memory), "o-", markersize=4, color=VOLLEY_COLOR)
    axes[0][1].set(xscale="log", xlabel="triangles", ylabel="bytes of BVH per triangle",
                   ylim=(0, None))
    for axis, group, label, log in ((axes[0][2], "instances", "instances", True),
                                    (axes[1][0], "lights", "lights", True),
                                    (axes[1][1], "depth", "most bounces", False)):
        counts = [int(name) for name in groups[group]]
        axis.plot(counts, [median_seconds(rows) for rows in groups[group].values()], "o-",
                  markersize=4, color=VOLLEY_COLOR)
        axis.set(xlabel=label, ylabel="seconds of a frame", ylim=(0, None),
                 xscale="log" if log else "linear")
    edges = [int(name) for name in groups["resolution"]]
    axes[1][2].plot([edge * edge for edge in edges],
                    [1e9 * median_seconds(rows) / int(name) ** 2
                     for name, rows in groups["resolution"].items()], "o-", markersize=4,
                    color=VOLLEY_COLOR)
    axes[1][2].set(xscale="log", xlabel="pixels", ylabel="nanoseconds per pixel", ylim=(0, None))
    figure.tight_layout()
    save(figure, path)


def median_rate(rows):
    """Millions of rays per second."""
    return estimates.spread(frames.mrays_per_second(rows))["median"]


def median_seconds(rows):
    """Of a frame."""
    return estimates.spread(frames.seconds(rows))["median"]


def draw_effects(group, path):
    """Time of each effect alone over that of distribution with nothing to distribute."""
    stages = stages_of(group)
    names = ["raycast", *frames.EFFECTS]
    figure, axis = plt.subplots(figsize=(7.0, 3.2))
    width = 0.8 / len(stages)
    for index, stage in enumerate(stages):
        nothing = median_seconds(group[f"{stage} nothing"])
        axis.bar([i + width * (index - 0.5 * (len(stages) - 1)) for i in range(len(names))],
                 [median_seconds(group[f"{stage} {name}"]) / nothing for name in names], width,
                 color=COLORS[index], label=stage)
    axis.axhline(1.0, color="black", linewidth=1)
    axis.set(xticks=range(len(names)), ylabel="time / distribution with nothing on")
    axis.set_xticklabels(names, rotation=30, ha="right")
    axis.set_yscale("log")
    plain_log_ticks(axis, "y")
    axis.legend(fontsize=8)
    save(figure, path)


def draw_shares(group, path):
    """Shares of build, trace, shade and the rest of each integrator's frame."""
    figure, axis = plt.subplots(figsize=(7.0, 0.5 + 0.33 * len(group)))
    names = list(group)
    for y, name in enumerate(reversed(names)):
        left = 0.0
        for (part, share), color in zip(frames.shares(group[name]).items(), COLORS):
            axis.barh(y, share, left=left, color=color, label=part if y == 0 else None)
            left += share
    axis.set(yticks=range(len(names)), yticklabels=[name.replace("_", " ") for name in reversed(names)],
             xlim=(0, 1), xlabel="share of a frame whose tree is built anew")
    axis.legend(fontsize=8, ncol=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    save(figure, path)


def draw_farm(result, path):
    """Speed-up against nodes, of animations and of one frame."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), sharey=True)
    for axis, (group, lines) in zip(axes, farm_section.curves(result).items()):
        for (name, speeds), color in zip(lines.items(), COLORS):
            axis.plot(farm_section.NODES, speeds, "o-", markersize=3, color=color, label=name)
        axis.plot(farm_section.NODES, farm_section.NODES, "--", linewidth=1, color="#999999", label="nodes")
        axis.set(xscale="log", yscale="log", xlabel="nodes", title=group)
        plain_log_ticks(axis, "xy")
        axis.legend(fontsize=8)
    axes[0].set_ylabel("times as soon as one node")
    figure.tight_layout()
    save(figure, path)
