#!/usr/bin/env python3
"""Prints the table of src/model/sobol.c: the order in which each group of dimensions takes its points.

A pair of dimensions is Sobol's first two, a (0, 2)-sequence: every box of area 2^-m has one of 2^m points. An
order that is linear over GF(2) and keeps blocks of 2^k points (H. Faure and S. Tezuka, "Another Random
Scrambling of Digital (t,s)-Sequences", 2002) leaves it one; what it changes is how pairs stand to each other.
Such an order is a triangular matrix, found here column by column: the column of bit b decides on the points
from 2^b on alone, and which of the 2^b choices is best is seen by trying all of them (or CHOICES), group by
group in turn, from several starts.

The measure is what is left of the variance of random points, for integrands whose part of resolution 2^-k in
each dimension falls like that of an edge (or faster, for smooth ones), over all sets of dimensions of two
groups: J. Dick and F. Pillichshammer, "Multivariate integration in weighted Sobolev spaces based on digital
nets" (2005), with their weights; ours say how much the groups have to do with each other in a picture.

    generate_sample_orders.py [--seed N] [--kept N] [--starts N]      takes 4 minutes
"""

import argparse

import numpy as np

GROUPS = (("pixel", 2), ("lens", 2), ("time", 1), ("light", 1), ("place", 2), ("lobe", 1), ("direction", 2),
          ("light, 2", 1), ("place, 2", 2), ("lobe, 2", 1), ("direction, 2", 2))
PIXEL, LENS, TIME, LIGHT, PLACE, LOBE, DIRECTION, LIGHT_2, PLACE_2, LOBE_2, DIRECTION_2 = range(len(GROUPS))
COLUMNS = 12
CHOICES = 512
WIDE_COLUMNS = 9  # from here on a fourth of what is kept and started
DECAYS = (2.0, 3.0)  # of a Walsh coefficient's square, by the digits of its index: an edge's, a smooth one's
OF_THREE, OF_FOUR = 0.7, 0.5  # weights of sets of dimensions over that of two
LEAST_WEIGHT = 0.15
WEIGHTS = {
    (PIXEL, LENS): 2.0, (PIXEL, TIME): 1.0, (LENS, TIME): 0.5,
    (PIXEL, LIGHT): 1.0, (PIXEL, PLACE): 1.0, (LENS, LIGHT): 0.5, (LENS, PLACE): 0.5, (TIME, LIGHT): 0.5,
    (TIME, PLACE): 0.5, (LIGHT, PLACE): 1.0,
    (PIXEL, LOBE): 0.7, (PIXEL, DIRECTION): 0.7, (LENS, LOBE): 0.4, (LENS, DIRECTION): 0.4, (TIME, LOBE): 0.4,
    (TIME, DIRECTION): 0.4, (LOBE, DIRECTION): 0.7, (LIGHT, LOBE): 0.3, (LIGHT, DIRECTION): 0.3,
    (PLACE, LOBE): 0.3, (PLACE, DIRECTION): 0.3,
    **{(PIXEL, second): 0.3 for second in (LIGHT_2, PLACE_2, LOBE_2, DIRECTION_2)},
    **{(DIRECTION, second): 0.4 for second in (LIGHT_2, PLACE_2, LOBE_2, DIRECTION_2)},
    (LIGHT_2, PLACE_2): 0.5, (LOBE_2, DIRECTION_2): 0.3,
}


def weight(a, b):
    """How much two groups have to do with each other."""
    return WEIGHTS.get((min(a, b), max(a, b)), LEAST_WEIGHT)


def plain_directions():
    """uint32[2][COLUMNS]: what each bit of the index contributes to Sobol's first two dimensions."""
    first = [1 << 31 - b for b in range(COLUMNS)]
    second = [1 << 31]
    while len(second) < COLUMNS:
        second.append(second[-1] ^ second[-1] >> 1)
    return np.array([first, second], np.uint32)


PLAIN = plain_directions()


def directions(columns, d):
    """The same for dimension d of a group with these columns."""
    return [np.bitwise_xor.reduce([PLAIN[d][i] for i in range(b + 1) if column >> i & 1])
            for b, column in enumerate(columns)]


def numbers(vectors):
    """The first 2^len(vectors) numbers of a dimension."""
    x = np.zeros(1, np.uint32)
    for vector in vectors:
        x = np.concatenate([x, x ^ vector])
    return x


def kernels(x):
    """float32 [len(DECAYS)][...]: the sum of all Walsh functions but 1 at x, by their weights, over that at 0."""
    digit = 32.0 - np.floor(np.log2(np.maximum(x, 1).astype(np.float64)))  # the first that is 1
    result = []
    for decay in DECAYS:
        ratio = 2.0 ** (1.0 - decay)
        whole = 0.5 * ratio / (1.0 - ratio)
        sums = 0.5 * ratio * (1.0 - ratio ** (digit - 1.0)) / (1.0 - ratio) - 0.5 * ratio ** digit
        result.append(np.where(x == 0, 1.0, sums / whole).astype(np.float32))
    return np.stack(result)


def sum_and_product(values):
    """Of the kernels of a group's dimensions; the product of one is 0."""
    return (values[0] + values[1], values[0] * values[1]) if len(values) == 2 else (values[0], 0.0 * values[0])


def factors(group, values):
    """What the sum and the product of a group's kernels at each point are multiplied by."""
    of_sum = of_product = 0.0
    for other in range(len(GROUPS)):
        if other != group:
            both, product = sum_and_product(values[other])
            w = weight(group, other)
            of_sum = of_sum + w * (both + OF_THREE * product)
            of_product = of_product + w * (OF_THREE * both + OF_FOUR * product)
    return of_sum, of_product


def measure(values):
    """Of all groups, each decay's sum over the points."""
    total = 0.0
    for group in range(len(GROUPS)):
        of_sum, of_product = factors(group, values)
        both, product = sum_and_product(values[group])
        total = total + (both * of_sum + product * of_product).sum(axis=1, dtype=np.float64) / 2.0
    return total


def values_of(columns):
    return [[kernels(numbers(directions(columns[group], d))) for d in range(size)]
            for group, (_, size) in enumerate(GROUPS)]


def extended(columns, random, scale):
    """(measure over scale, columns with one more): the groups choose in turn until none gains."""
    b = len(columns[0])
    half = 1 << b
    columns = [[*own, half | int(random.integers(half))] for own in columns]
    columns[PIXEL][b] = half
    lower = [[numbers(directions(columns[group][:b], d)) for d in range(size)]
             for group, (_, size) in enumerate(GROUPS)]
    values = values_of(columns)
    has_changed = True
    while has_changed:
        has_changed = False
        for group in random.permutation(np.arange(1, len(GROUPS))):
            choices = np.arange(half) if half <= CHOICES else random.integers(0, half, CHOICES)
            choices = np.append(choices, columns[group][b] & half - 1)
            upper = []
            for d in range(GROUPS[group][1]):
                vector = np.full(len(choices), PLAIN[d][b], np.uint32)
                for i in range(b):
                    vector ^= np.where(choices >> i & 1, PLAIN[d][i], 0).astype(np.uint32)
                upper.append(kernels(lower[group][d][None, :] ^ vector[:, None]))
            of_sum, of_product = (f[:, None, half:] for f in factors(group, values))
            both, product = sum_and_product(upper)
            costs = ((both * of_sum + product * of_product).sum(axis=2) / scale[:, None]).sum(axis=0)
            best = int(np.argmin(costs))
            if costs[best] < costs[-1] * (1.0 - 1e-6 * np.sign(costs[-1])):
                has_changed = True
                columns[group][b] = half | int(choices[best])
                values[group] = [np.concatenate([values[group][d][:, :half], upper[d][:, best]], axis=1)
                                 for d in range(len(upper))]
    return float((measure(values) / scale).sum()), columns


def search(random, kept, starts):
    """The best columns found."""
    states = [(0.0, [[1]] * len(GROUPS))]
    for b in range(1, COLUMNS):
        scale = None
        found = {}
        share = 4 if b >= WIDE_COLUMNS else 1
        for total, columns in states:
            for _ in range(max(1, starts // share)):
                if scale is None:  # any measure of this length will do, so that each counts alike
                    scale = np.abs(measure(values_of([[*own, 1 << b | int(random.integers(1 << b))]
                                                      for own in columns])))
                cost, longer = extended(columns, random, scale)
                found[str(longer)] = (total + cost, longer)
        states = sorted(found.values(), key=lambda state: state[0])[:max(1, kept // share)]
        print(f"{1 << b + 1} points: {states[0][0] / b:.4f}", flush=True)
    return states[0][1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kept", type=int, default=7, help="of the best beginnings")
    parser.add_argument("--starts", type=int, default=8, help="from each of them")
    options = parser.parse_args()
    columns = search(np.random.default_rng(options.seed), options.kept, options.starts)
    for (name, _), own in zip(GROUPS, columns):
        print("    {" + ", ".join(f"0x{column:x}" for column in own) + "}, /* " + name + " */")


if __name__ == "__main__":
    main()
