# SPDX-License-Identifier: Apache-2.0
"""Tests of the report's estimates, its gate and its headline; no renders, no times."""

import argparse
import doctest
import importlib
import pathlib
import re
import sys

import numpy as np
import pytest

TESTS = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "bench")]
import flip  # noqa: E402  (the folders are on the path only now)
import report  # noqa: E402
from reporting import (curves, denoise, denoise_section, document, error_sections, estimates, files, frames,  # noqa: E402
                       gate, hair, machine, readme, repeated, scope, whole_renders)


@pytest.mark.parametrize("module", ["flip", "error_time", "report", "stability", "reporting.estimates", "reporting.frames",
                                    "reporting.gate", "reporting.readme", "reporting.repeated",
                                    "reporting.tables"])
def test_examples_in_comments(module):
    result = doctest.testmod(importlib.import_module(module))
    assert result.attempted and not result.failed


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    """Enough to tell, and quick."""
    monkeypatch.setattr(estimates, "RESAMPLES", 100)


# Estimates ---------------------------------------------------------------------------------------

def test_interval_of_the_mean_covers_it_as_often_as_it_says():
    generator = np.random.default_rng(3)
    covered = 0
    for _trial in range(200):
        low, high = estimates.mean_with_interval(generator.normal(5.0, 1.0, 30), 200)["interval"]
        covered += low <= 5.0 <= high
    # 95 % of 200 with four standard deviations of the binomial, less what percentile intervals of 30
    # values are known to be short of.
    assert 170 <= covered <= 200


def test_intervals_are_the_same_in_every_run():
    values = [1.0, 2.0, 4.0, 8.0]
    assert estimates.mean_with_interval(values) == estimates.mean_with_interval(values)


def test_affine_seconds_finds_the_line_through_noise():
    generator = np.random.default_rng(5)
    samples = [1, 4, 16, 64]
    seconds = [(0.2 + 0.01 * count) * generator.uniform(0.98, 1.02) for count in samples]
    fixed, each = estimates.affine_seconds(samples, seconds)
    assert fixed == pytest.approx(0.2, rel=0.05) and each == pytest.approx(0.01, rel=0.05)


def test_affine_seconds_are_never_negative():
    fixed, each = estimates.affine_seconds([1, 4, 16], [0.001, 0.1, 3.0])
    assert fixed >= 0.0 and each > 0.0
    fixed, each = estimates.affine_seconds([1, 4, 16], [3.0, 2.0, 1.0])
    assert fixed > 0.0 and each >= 0.0


def test_cost_outside_a_curve_is_unknown():
    assert estimates.cost_at([1.0, 2.0], [1.0, 0.5], 2.0) is None
    assert estimates.cost_at([1.0, 2.0], [1.0, 0.5], 0.1) is None
    assert estimates.cost_at([1.0, 2.0], [0.5, 1.0], 0.7) is None
    assert estimates.cost_ratio(([1.0], [9.0]), ([1.0, 2.0], [1.0, 0.5])) is None


# Curves ------------------------------------------------------------------------------------------

def made_scene(speed, noise, seeds=6, bias=0.0):
    """A scene as JSON holds it: Volley is ``speed`` times as fast, its MSE ``noise`` times Cycles'."""
    generator = np.random.default_rng(11)
    scene = {"curves": {}, "times": {}, "bias": {"volley sobol l1": {"tests": 3, "failed": 0}},
             "width": 128, "height": 72, "times_scale": 6}
    for name, cost, scale in (("cycles", 1.0, 1.0), ("volley sobol l1", 1.0 / speed, noise)):
        points, times = {}, {}
        for samples in (1, 4, 16, 64, 256):
            mse = [scale / samples * value + bias for value in generator.uniform(0.95, 1.05, seeds)]
            points[samples] = {"seeds": {measure: mse for measure in curves.MEASURES},
                               "mse": np.mean(mse), "bias_squared": bias,
                               "variance": scale / samples, "mean_ratios": [1.0]}
            if samples <= 64:
                times[samples] = {"runs": [cost * samples * value
                                           for value in generator.uniform(0.95, 1.05, 3)]}
        scene["curves"][name], scene["times"][name] = points, times
    return scene


def test_time_at_equal_error_joins_speed_and_noise():
    scene = made_scene(speed=3.0, noise=0.5)
    made = curves.time_ratio(scene, "volley sobol l1", "mse")
    assert made["ratio"] == pytest.approx(6.0, rel=0.08)
    assert made["interval"][0] < made["ratio"] < made["interval"][1]
    assert made["interval"][1] / made["interval"][0] < 1.3


def test_curves_that_do_not_meet_have_no_ratio():
    assert curves.time_ratio(made_scene(1.0, 1e6), "volley sobol l1", "mse") is None


def test_slope_and_its_interval():
    made = curves.slope(made_scene(1.0, 1.0), "cycles")
    assert made["slope"] == pytest.approx(-1.0, abs=0.02)
    assert made["interval"][0] <= made["slope"] <= made["interval"][1]


def test_headline_puts_the_worst_scene_first():
    scenes = {"fast": made_scene(4.0, 1.0), "slow": made_scene(0.5, 1.0)}
    for scene in scenes.values():
        scene["comparison"] = curves.compare_configurations(scene)
    assert [name for name, _ratios in curves.headline_rows(scenes)] == ["slow", "fast"]


def test_newer_blenders_have_their_own_figures():
    results = {}
    for name, speed in (("now", 4.0), ("next", 0.5)):
        scene = made_scene(speed, 1.0)
        scene["comparison"] = curves.compare_configurations(scene)
        results[name] = {"ball": scene}
    results = {"curves": results["now"],
               "curves_sid": {"system": "Debian 19", "blender": "Blender 9.9", "embree": "", "made": results["next"]}}
    first, second = error_sections.headline_lines(results)
    assert first.startswith("Cycles takes 4") and second.startswith("Cycles of Blender 9.9 takes 0.5")
    assert "Cycles of Blender 9.9 over Volley's" in error_sections.losing_cases(results)
    found = repeated.spreads(results)
    assert found["time at equal error"]["ball, volley sobol l1"][0] == pytest.approx(4.0, rel=0.08)
    assert found["time at equal error, Blender 9.9"]["ball, volley sobol l1"][0] == pytest.approx(
        0.5, rel=0.08)
    section = error_sections.equal_error_elsewhere(results["curves_sid"])
    assert "| ball |" in section and "timed at 768×432." in section


def test_what_denoise_makes_worse_is_a_loss():
    scene = made_scene(3.0, 1.0)
    plain = scene["curves"][denoise.PLAIN]
    scene["curves"][denoise.DENOISED] = {
        count: {**point, "rel_mse": 0.5 * point["mse"], "flip": (1.2 if count == 16 else 0.9) * point["mse"],
                "mse": 0.5 * point["mse"]} for count, point in plain.items()}
    scene["curves"][denoise.PLAIN] = {count: {**point, "rel_mse": point["mse"], "flip": point["mse"]}
                                      for count, point in plain.items()}
    made = {"scenes": {"ball": scene}, "worst_tiles": {"ball": {1: 1.6, 16: 1.4}, "cube": {1: 1.4, 16: 0.3}},
            "flicker": {"ball": {"with": 2.0, "without": 4.0}, "cube": {"with": 0.9, "without": 4.0}}}
    found = denoise_section.losses({"denoise": made})
    assert len(found) == 3
    assert found[0].startswith("ball, 16 samples: FLIP") and found[0].endswith("**1.20**")
    assert found[1].startswith("ball, 1 samples: relMSE of the worst tile") and found[2].startswith("ball: flicker")
    beside = {"system": "Debian 19", "blender": "Blender 9.9", "embree": "", "made": made}
    assert denoise_section.losses({"denoise_sid": beside}) == [f"Blender 9.9, {line}" for line in found]
    assert denoise_section.losses({}) == []


def test_headline_of_denoise_has_times_of_both():
    scene = made_scene(3.0, 1.0)
    scene["curves"][denoise.DENOISED] = {
        count: {"seeds": {measure: [0.5 * error for error in errors] for measure, errors in point["seeds"].items()}}
        for count, point in scene["curves"][denoise.PLAIN].items()}
    scene["times"][denoise.DENOISED] = scene["times"][denoise.PLAIN]
    scene["curves"] = {name: {str(count): point for count, point in points.items()}
                       for name, points in scene["curves"].items()}
    line, = error_sections.headline_lines({"denoise": {"scenes": {"ball": scene}}})
    found = [float(value) for value in re.findall(r"\d+\.\d+", line)]
    assert found == pytest.approx([6.0, 6.0, 6.0, 3.0] * 2, rel=0.08)


def test_hair_that_cycles_renders_sooner_is_a_loss():
    def engine(seconds, large_seconds, mse):
        return {"seconds": [seconds] * 3, "large_seconds": [large_seconds] * 2, "mse": mse, "rel_mse": mse,
                "mean_ratios": [1.0]}
    results = {"hair": {"fast": {"CYCLES": engine(6.0, 60.0, 2.0), "VOLLEY": engine(2.0, 15.0, 1.0)},
                        "slow": {"CYCLES": engine(1.0, 9.0, 1.0), "VOLLEY": engine(2.0, 10.0, 3.0)}}}
    line, = error_sections.headline_lines(results)
    assert "0.50 to 3.0 times as long at 240×180, 0.90 to 4.0 times as long at 768×432." in line
    assert hair.losses(results) == ["slow: F12 of Cycles over Volley's **0.50** (0.50–0.50)",
                                    "slow: MSE over Cycles' at equal samples **3.00**",
                                    "slow, 768×432: F12 of Cycles over Volley's **0.90** (0.90–0.90)"]
    rows = [line for line in hair.section(results).splitlines() if line.startswith(("| slow", "| fast"))]
    assert [row.split(" | ")[0] for row in rows] == ["| slow", "| fast"] * 2
    assert "3.00 (3.00–3.00) | 0.500 | 0.500" in rows[1]
    assert "60.0 | 15.0 | 4.00 (4.00–4.00)" in rows[3]
    assert hair.losses({}) == []


def test_hair_in_newer_blenders_is_beside_their_cycles():
    scene = {engine: {"seconds": [seconds] * 3, "mse": 1.0, "rel_mse": 1.0, "mean_ratios": [1.0]}
             for engine, seconds in (("CYCLES", 6.0), ("VOLLEY", 8.0))}
    results = {"hair_sid": {"system": "Debian 19", "blender": "Blender 9.9", "embree": "", "made": {"head": scene}}}
    line, = error_sections.headline_lines(results)
    assert "takes Cycles of Blender 9.9 0.75 times as long at 240×180." in line
    assert hair.losses(results) == ["head: F12 of Cycles of Blender 9.9 over Volley's **0.75** (0.75–0.75)"]
    assert "Cycles of Blender 9.9:\n\n| scene |" in hair.section(results)


# Accuracy ----------------------------------------------------------------------------------------

def accuracy_rows(**misses):
    """Rows of tracer_bench of one mesh: {tracer: misses of each of its modes}."""
    distances = {"volley": 90.0, "embree_default": 5.0, "embree_robust": 6.0}
    return [{"row": "accuracy", "mesh": "ball", "isa": "avx2", "tracer": tracer.replace("_", " "),
             "mode": str(mode), "rays": 1_000_000, "misses": count,
             "distance_most_ulps": distances[tracer], "distance_mean_ulps": 0.5,
             "normal_most_half_ulps": 1.0}
            for tracer, counts in misses.items() for mode, count in enumerate(counts)]


def test_headline_tells_lost_rays():
    rows = accuracy_rows(volley=[0, 0], embree_default=[1500, 20000], embree_robust=[0, 7])
    assert error_sections.accuracy_line(rows) == (
        "Of a million rays at vertices and edges of closed meshes are lost: Volley 0, "
        "Embree default 1,500 to 20,000, Embree robust 0 to 7.")
    rows[0]["misses"] = 3
    assert "Volley 0 to 3," in error_sections.accuracy_line(rows)
    assert error_sections.accuracy_line([]) == ""


def test_less_exact_distances_are_a_loss():
    rows = accuracy_rows(volley=[0], embree_robust=[0])
    (line,) = error_sections.losing_distances(rows)
    assert "**90.0** ulps" in line and "6.00" in line
    rows[0]["distance_most_ulps"] = 8.0
    assert not error_sections.losing_distances(rows)


def test_parts_keep_what_they_were_measured_with(tmp_path):
    path = tmp_path / "machine.json"
    assert machine.read_parts(path) == {}
    path.write_text('{"parts": {"frames": {"date": "then", "commit": "a"}}}', encoding="utf-8")
    assert machine.read_parts(path)["frames"]["commit"] == "a"


def test_parts_of_two_machines_are_told_apart():
    old = machine.of_part({"date": "2026-01-01", "commit": "a", "cpu": "One", "processors": 2, "isa": "avx2"})
    new = machine.of_part({"date": "2026-01-02", "commit": "b", "cpu": "Two", "processors": 4, "isa": "neon"})
    assert machine.names({"parts": {"frames": old, "blender": old, "kernels": new}}) == [
        "Two, 4 logical processors, neon", "One, 2 logical processors, avx2"]
    assert document.period({"frames": old, "blender": old}) == "a" and not document.versions({"frames": old})
    parts = {"frames": old, "blender": old, "kernels": new}
    assert "2 commits of 2026-01-01 to 2026-01-02" in document.period(parts)
    latest, former = document.versions(parts).splitlines()[-2:]
    assert "b | Two" in latest and "| kernels |" in latest
    assert "a | One" in former and "| frames; blender |" in former


# FLIP --------------------------------------------------------------------------------------------

def test_flip_grows_with_noise_and_is_symmetric_in_nothing_changed():
    picture = np.random.default_rng(2).random((24, 32, 3))
    noise = np.random.default_rng(4).normal(0.0, 1.0, picture.shape)
    errors = [flip.mean_flip(picture + size * noise, picture) for size in (0.0, 0.02, 0.1, 0.4)]
    assert errors[0] == 0.0 and errors == sorted(errors) and errors[-1] < 1.0


def test_flip_of_flat_colours_is_their_colour_difference():
    # Without edges only the colour pipeline counts, and filters keep a flat picture as it is.
    grey, lighter = (np.full((40, 40, 3), value) for value in (0.2, 0.25))
    lightness = [116.0 * np.cbrt(value) - 16.0 for value in (0.2, 0.25)]
    green, blue = flip.hunt_lab(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    knee = 0.4 * flip.hyab(green, blue) ** 0.7
    expected = 0.95 / knee * (lightness[1] - lightness[0]) ** 0.7
    assert flip.flip_map(grey, lighter) == pytest.approx(np.full((40, 40), expected), rel=1e-6)


def test_flip_tells_an_edge_from_a_soft_step():
    x = np.linspace(0.0, 1.0, 64)[None, :, None] * np.ones((32, 1, 3))
    hard = (x > 0.5).astype(float)
    assert flip.mean_flip(hard, x) > flip.mean_flip(0.5 * hard + 0.5 * x, x)


# Frames and the gate -----------------------------------------------------------------------------

def test_figures_have_the_paper_own_points():
    scope = type("Scope", (), {"stages": ("tiny",), "counted_edge": 16, "eyes": 1})
    assert len(frames.figure_7(scope)) == 15 and len(frames.figure_8(scope)) == 16


def test_gate_is_silent_until_a_loss_is_large_and_repeated(monkeypatch, tmp_path, capsys):
    baseline = tmp_path / "baseline.json"
    baseline.write_text('{"kernels a": 1.0, "kernels b": 2.0}')
    monkeypatch.setattr(gate, "BASELINE", baseline)
    options = None

    def run(*ratios):
        later = iter(ratios)
        monkeypatch.setattr(gate, "ratios", lambda _results: next(later))
        monkeypatch.setattr(gate, "measure_again", lambda *_arguments: {})
        return gate.check({}, options)

    assert run({"kernels a": 0.7, "kernels b": 1.9, "kernels new": 0.1}) == 0
    assert run({"kernels a": 0.5}, {"kernels a": 0.9}) == 0
    assert run({"kernels a": 0.5}, {"kernels a": 0.5}, {"kernels a": 0.8}) == 0
    assert run({"kernels a": 0.5}, {"kernels a": 0.5}, {"kernels a": 0.5}) == 1
    assert "LOST kernels a: 0.50, baseline 1.00" in capsys.readouterr().out


def test_readme_holds_the_committed_report():
    assert readme.agrees()


@pytest.mark.parametrize("name", ["report", "stability"])
def test_readme_that_differs_is_found(tmp_path, name):
    begin = readme.BEGIN.format(name)
    text = (readme.PROJECT / "README.md").read_text(encoding="utf-8")
    changed = tmp_path / "README.md"
    changed.write_text(text.replace(begin, begin + "\nTen times faster."), encoding="utf-8")
    assert not readme.agrees(changed)
    readme.write(changed)
    assert readme.agrees(changed)


def test_files_say_size_time_and_error():
    def engine(seconds, mse, rel_mse):
        return {"seconds": [seconds] * 3, "mse": mse, "rel_mse": rel_mse, "p999": mse, "flip": mse, "mean_ratios": [1.0]}
    results = {"files": {"one": {"CYCLES": engine(6.0, 2.0, 2.0), "VOLLEY": engine(2.0, 1.0, 2.5)},
                         "two": {"CYCLES": engine(8.0, 4.0, 1.0), "VOLLEY": engine(2.0, 1.0, 1.0)}}}
    line, = files.headlines(results)
    assert "at 640×480 and 64 samples" in line and "3.0 to 4.0 times" in line and "0.25 to 0.50 of" in line
    assert files.losses(results) == ["one: relMSE over Cycles' at equal samples **1.25**"]


def test_large_pictures_are_shrunk():
    picture = np.arange(2 * 1000 * 3.0).reshape(2, 1000, 3)
    shrunk = whole_renders.shrunk(np.repeat(picture, 3, axis=0))
    assert shrunk.shape == (2, 333, 3)
    np.testing.assert_allclose(shrunk[:, :, 1], picture[:, 1:999:3, 1])
    assert whole_renders.shrunk(picture[:, :639]).shape == (2, 639, 3)


def test_pictures_of_the_folder_of_scenes_stay_out_of_the_report():
    options = argparse.Namespace(scenes=None, build=pathlib.Path("build"))
    pictures = pathlib.Path("report/pictures")
    assert scope.picture_folders(("ours",), ("theirs",), options, pictures) == {"ours": pictures}
    options.scenes = pathlib.Path("scenes")
    assert scope.picture_folders(("ours",), ("theirs",), options, pictures) == {
        "ours": pictures, "theirs": pathlib.Path("build/pictures")}


def test_scenes_are_measured_alone_where_results_are_by_scene(monkeypatch):
    options = report.parse_arguments(["--parts", "files", "--only", "theirs"])
    monkeypatch.setattr(whole_renders, "measure_scene", lambda name, *_others: name)
    assert whole_renders.measure({"ours": "a", "theirs": "b"}, (2, 1), options, None) == {"theirs": "theirs"}
    with pytest.raises(SystemExit):
        report.parse_arguments(["--parts", "files", "frames", "--only", "theirs"])
