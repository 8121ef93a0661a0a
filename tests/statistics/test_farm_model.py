# SPDX-License-Identifier: Apache-2.0
"""The simulated farm against what can be said without a simulation."""

import dataclasses
import doctest
import math
import pathlib
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "bench"))
from reporting import farm_model  # noqa: E402  (the folder is on the path only now)
from reporting.farm_model import Costs, Farm, Work, alone, simulate, speed_up  # noqa: E402

COSTS = Costs(start=1.5, frame=0.4, sample=0.05, merge=1.2, merge_part=0.03, file_bytes=1e6, part_bytes=4e6,
              picture_bytes=2e6)
# Nothing but nodes takes time, and they are alike.
IDEAL = Farm(bytes_per_second=math.inf, starts_per_second=math.inf, spread=0.0, losses_per_hour=0.0)


def test_examples_in_comments():
    result = doctest.testmod(farm_model)
    assert result.attempted and not result.failed


@pytest.mark.parametrize("nodes", [1, 7, 100, 1000, 10_000])
def test_frames_on_an_ideal_farm_take_whole_rounds(nodes):
    task = 1.5 + 0.4 + 64 * 0.05
    assert simulate(COSTS, IDEAL, Work(1000, 64), nodes) == pytest.approx(math.ceil(1000 / nodes) * task, rel=1e-9)


@pytest.mark.parametrize("tasks", [2, 10, 300])
def test_a_frame_in_parts_takes_its_share_and_the_merge(tasks):
    wanted = 1.5 + 0.4 + 4096 * 0.05 / tasks + 1.2 + 0.03 * tasks
    assert simulate(COSTS, IDEAL, Work(1, 4096, tasks), tasks) == pytest.approx(wanted, rel=1e-9)


def test_no_other_number_of_tasks_is_better():
    best = farm_model.best_task_count(COSTS, Work(1, 4096))
    seconds = {tasks: simulate(COSTS, IDEAL, Work(1, 4096, tasks), tasks) for tasks in range(2, 4 * best)}
    assert min(seconds.values()) == pytest.approx(seconds[best], rel=1e-3)


def test_server_and_scheduler_are_limits():
    slow = dataclasses.replace(IDEAL, bytes_per_second=1e6)  # a second for each file
    seconds = simulate(COSTS, slow, Work(1000, 64), 10_000)
    assert 3000.0 <= seconds <= 3000.0 + 10.0  # 1 MB in and 2 MB out of each
    slow = dataclasses.replace(IDEAL, starts_per_second=0.5)
    assert 2000.0 <= simulate(COSTS, slow, Work(1000, 64), 10_000) <= 2000.0 + 10.0


def test_a_seed_is_one_farm_and_others_are_like_it():
    farm, work = Farm(), Work(2000, 64)
    seconds = simulate(COSTS, farm, work, 100)
    assert seconds == simulate(COSTS, farm, work, 100)
    other = simulate(COSTS, dataclasses.replace(farm, seed=2), work, 100)
    assert other != seconds and other == pytest.approx(seconds, rel=0.05)


def test_times_of_tasks_have_the_mean_that_is_asked_for():
    # A node alone takes the sum of 20,000 tasks, the mean of which is 5.1 s with a standard deviation of 0.05 %.
    noisy = dataclasses.replace(IDEAL, spread=0.2)
    assert simulate(COSTS, noisy, Work(20_000, 64), 1) == pytest.approx(20_000 * 5.1, rel=0.006)


def test_lost_nodes_cost_time_and_no_frames():
    losing = dataclasses.replace(IDEAL, losses_per_hour=60.0, seconds_to_notice=20.0)
    # Of tasks of 5.1 s one in 12 is lost: on the average 1 / (1 - p) tries, of which those lost cost 20 s more.
    share = 1.0 - math.exp(-5.1 / 60.0)
    lost_after = 60.0 - 5.1 * (1.0 - share) / share
    wanted = 4000 / 10 * (5.1 + share / (1.0 - share) * (lost_after + 20.0))
    assert simulate(COSTS, losing, Work(4000, 64), 10) == pytest.approx(wanted, rel=0.06)


def test_no_farm_is_faster_than_its_nodes_together():
    for nodes in (1, 2, 10, 100):
        assert speed_up(COSTS, IDEAL, Work(1000, 64), nodes) <= nodes
    assert alone(COSTS, Work(1000, 64)) == pytest.approx(1.5 + 1000 * (0.4 + 3.2))
