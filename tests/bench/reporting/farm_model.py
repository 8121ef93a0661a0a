# SPDX-License-Identifier: Apache-2.0
"""How much sooner a farm is done than one of its nodes, by simulation: a queue, nodes, one file server.

Each node asks the scheduler for a task, starts Blender, loads the file from the server, renders and writes its
picture or part to the server; a merge job puts the parts of a frame together. The scheduler and the server each
do one thing after the other, in the order in which they are asked.
"""

import collections
import dataclasses
import heapq
import math
import random


@dataclasses.dataclass(frozen=True)
class Costs:
    """Of the steps: seconds of a node, and bytes that the server moves."""

    start: float          # of Blender with the add-on and the file
    frame: float          # of each render besides its samples: evaluation, sync, build, writing
    sample: float         # of one sample of all pixels
    merge: float          # of a merge besides its parts: Blender's start, writing
    merge_part: float     # of each part
    file_bytes: float
    part_bytes: float
    picture_bytes: float

    def of_pixels(self, factor):
        """With so many times the pixels: what is counted by pixels grows, starting and building do not."""
        return dataclasses.replace(self, sample=factor * self.sample, merge_part=factor * self.merge_part,
                                   part_bytes=factor * self.part_bytes, picture_bytes=factor * self.picture_bytes)


@dataclasses.dataclass(frozen=True)
class Farm:
    """What a farm is like; figures of a usual one, not measured."""

    bytes_per_second: float = 1.25e9     # of the server: 10 Gbit/s
    starts_per_second: float = 100.0     # of the scheduler
    spread: float = 0.2                  # standard deviation of the logarithm of a task's time
    losses_per_hour: float = 1e-3        # of a node
    seconds_to_notice: float = 300.0     # a loss; Slurm's own SlurmdTimeout
    seed: int = 1


@dataclasses.dataclass(frozen=True)
class Work:
    """Frames of so many samples, each in so many tasks; more than one task: as parts, which are merged."""

    frames: int
    samples: int
    tasks: int = 1


def alone(costs, work):
    """Seconds of one node that loads the file once and renders all frames.

    >>> alone(Costs(1.0, 0.5, 0.25, 0, 0, 0, 0, 0), Work(10, 8))
    26.0
    """
    return costs.start + work.frames * (costs.frame + work.samples * costs.sample)


def best_task_count(costs, work):
    """Tasks of a frame with which it is done soonest where nothing but its nodes takes time: a merge costs as much
    for each task as the tasks' share of the samples saves.

    >>> best_task_count(Costs(1.0, 0.5, 0.25, 1.0, 0.5, 0, 0, 0), Work(1, 800))
    20
    """
    return max(1, round(math.sqrt(work.samples * costs.sample / costs.merge_part)))


def speed_up(costs, farm, work, nodes):
    """How many times as soon as one node alone."""
    return alone(costs, work) / simulate(costs, farm, work, nodes)


def simulate(costs, farm, work, nodes):
    """Seconds until all is there."""
    seconds = _Simulation(costs, farm, work, nodes).run()
    if work.tasks > 1:
        moved = work.tasks * costs.part_bytes + costs.picture_bytes
        each = costs.merge_part * work.tasks + moved / farm.bytes_per_second
        seconds += 1.0 / farm.starts_per_second + costs.merge + work.frames * each
    return seconds


class _Server:
    """Does one thing after the other."""

    def __init__(self):
        self._free_at = 0.0

    def serve(self, now, seconds):
        """When what is asked for now is done."""
        self._free_at = max(now, self._free_at) + seconds
        return self._free_at


class _Simulation:
    """Of events in the order of their times."""

    def __init__(self, costs, farm, work, nodes):
        self._costs, self._farm = costs, farm
        self._is_parted = work.tasks > 1
        self._seconds = costs.start + costs.frame + costs.sample * work.samples / work.tasks
        self._waiting_tasks = work.frames * work.tasks
        self._idle = collections.deque()
        self._scheduler, self._server = _Server(), _Server()
        self._random = random.Random(farm.seed)
        self._events, self._order, self._done_at = [], 0, 0.0
        for _node in range(min(nodes, self._waiting_tasks)):
            self._at(0.0, self._ask)

    def run(self):
        """The time at which the last task is done."""
        while self._events:
            now, _order, event = heapq.heappop(self._events)
            event(now)
        return self._done_at

    def _at(self, time, event):
        self._order += 1
        heapq.heappush(self._events, (time, self._order, event))

    def _ask(self, now):
        if self._waiting_tasks:
            self._waiting_tasks -= 1
            self._at(self._scheduler.serve(now, 1.0 / self._farm.starts_per_second), self._load)
        else:
            self._idle.append(now)

    def _load(self, now):
        begin = self._server.serve(now, self._costs.file_bytes / self._farm.bytes_per_second)
        # Log-normal with a mean of 1.
        spread = self._farm.spread
        seconds = self._seconds * math.exp(self._random.gauss(-0.5 * spread * spread, spread))
        rate = self._farm.losses_per_hour / 3600.0
        lost_after = self._random.expovariate(rate) if rate else math.inf
        if lost_after < seconds:
            self._at(begin + lost_after + self._farm.seconds_to_notice, self._give_back)
        else:
            self._at(begin + seconds, self._store)

    def _store(self, now):
        size = self._costs.part_bytes if self._is_parted else self._costs.picture_bytes
        end = self._server.serve(now, size / self._farm.bytes_per_second)
        self._done_at = max(self._done_at, end)
        self._at(end, self._ask)

    def _give_back(self, now):
        """A loss is noticed: the task goes back to the queue, and the node comes back."""
        self._waiting_tasks += 1
        if self._idle:
            self._idle.popleft()
            self._at(now, self._ask)
        self._at(now, self._ask)
