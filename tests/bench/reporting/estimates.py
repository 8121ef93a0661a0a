# SPDX-License-Identifier: Apache-2.0
"""Medians, bootstrap intervals, and what an equal error costs; pure numpy.

Source: B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 7 (1979);
percentile intervals.
"""

import math
import statistics

import numpy as np

CONFIDENCE = 0.95
RESAMPLES = 500
BOOTSTRAP_SEED = 1


def spread(values):
    """Median, least and most of repeats.

    >>> spread([3.0, 1.0, 2.0])
    {'median': 2.0, 'least': 1.0, 'most': 3.0, 'repeats': 3}
    """
    return {"median": statistics.median(values), "least": min(values), "most": max(values),
            "repeats": len(values)}


def geometric_mean(values):
    """
    >>> round(geometric_mean([1.0, 4.0]), 12)
    2.0
    """
    return math.exp(statistics.mean(math.log(value) for value in values))


def interval(values, confidence=CONFIDENCE):
    """The middle share of a bootstrap's results, [low, high]; None without any.

    >>> interval(range(101), 0.5)
    [25.0, 75.0]
    """
    values = np.asarray([value for value in values if value is not None], float)
    if not len(values):
        return None
    tail = 50.0 * (1.0 - confidence)
    return [float(edge) for edge in np.percentile(values, [tail, 100.0 - tail])]


def cost_at(costs, errors, wanted):
    """What an error costs, by log-log interpolation; None outside the curve or where it rises.

    >>> round(cost_at([1.0, 4.0, 16.0], [1.0, 0.25, 0.0625], 0.125), 9)
    8.0
    """
    for i in range(len(costs) - 1):
        high, low = errors[i], errors[i + 1]
        if high > low > 0.0 and low <= wanted <= high:
            part = math.log(high / wanted) / math.log(high / low)
            return math.exp(math.log(costs[i]) + part * math.log(costs[i + 1] / costs[i]))
    return None


def cost_ratio(base, other):
    """How many times the other's cost the base needs for its own errors, geometric mean over the
    points of the base that the other's curve covers; None without any. Each curve is (costs, errors).

    >>> base, half = ([1.0, 4.0], [1.0, 0.25]), ([0.5, 2.0], [1.0, 0.25])
    >>> round(cost_ratio(base, half), 9)
    2.0
    """
    ratios = [cost / needed for cost, error in zip(*base)
              if (needed := cost_at(*other, error)) is not None]
    return geometric_mean(ratios) if ratios else None


def slope(samples, errors):
    """Exponent of samples in the error, by least squares over the logarithms; None if an error is not
    above zero.

    >>> round(slope([1, 4, 16], [1.0, 0.25, 0.0625]), 12)
    -1.0
    """
    if len(errors) < 2 or min(errors) <= 0.0:
        return None
    return float(np.polyfit(np.log(samples), np.log(errors), 1)[0])


def affine_seconds(samples, seconds):
    """(seconds at no sample, seconds for each), fitted so that relative errors are least; neither is
    below zero.

    >>> [round(value, 9) for value in affine_seconds([1, 4, 16], [1.5, 3.0, 9.0])]
    [1.0, 0.5]
    """
    samples, seconds = np.asarray(samples, float), np.asarray(seconds, float)
    columns = np.stack([np.ones_like(samples), samples], axis=1) / seconds[:, None]
    fixed, each = np.linalg.lstsq(columns, np.ones_like(seconds), rcond=None)[0]
    if fixed < 0.0:
        fixed, each = 0.0, float(np.mean(seconds / samples))
    if each < 0.0:
        fixed, each = float(np.mean(seconds)), 0.0
    return float(fixed), float(each)


class Bootstrap:
    """Draws repeats and seeds anew, always in the same way."""

    def __init__(self, resamples=None):
        self._generator = np.random.default_rng(BOOTSTRAP_SEED)
        self.resamples = resamples or RESAMPLES

    def mean(self, values):
        """The mean of values drawn with replacement."""
        values = np.asarray(values, float)
        return float(values[self._generator.integers(len(values), size=len(values))].mean())

    def median(self, values):
        """The median of values drawn with replacement."""
        values = np.asarray(values, float)
        return float(np.median(values[self._generator.integers(len(values), size=len(values))]))

    def interval(self, draw):
        """The interval of what ``draw`` returns, called once for each resample."""
        return interval([draw() for _ in range(self.resamples)])


def mean_with_interval(values, resamples=None):
    """{"mean", "interval"} of independent values.

    >>> mean_with_interval([1.0, 1.0, 1.0])
    {'mean': 1.0, 'interval': [1.0, 1.0]}
    """
    bootstrap = Bootstrap(resamples)
    return {"mean": statistics.mean(values),
            "interval": bootstrap.interval(lambda: bootstrap.mean(values))}


def ratio_with_interval(above, below, resamples=None):
    """{"ratio", "interval"} of the medians of two lists of repeats.

    >>> ratio_with_interval([2.0, 2.0], [4.0, 4.0])
    {'ratio': 0.5, 'interval': [0.5, 0.5]}
    """
    bootstrap = Bootstrap(resamples)
    return {"ratio": statistics.median(above) / statistics.median(below),
            "interval": bootstrap.interval(lambda: bootstrap.median(above) / bootstrap.median(below))}
