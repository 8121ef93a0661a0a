# SPDX-License-Identifier: Apache-2.0
"""Numbers and tables as Markdown."""


def table(head, rows):
    """A Markdown table; numbers are set to the right.

    >>> print(table(["a", "b"], [["x", "1.0"]]))
    | a | b |
    |---|---|
    | x | 1.0 |
    """
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines)


def digits(value, count=3):
    """So many significant digits without an exponent where that is readable.

    >>> digits(0.012345), digits(1234.5), digits(1.5e-7), digits(None)
    ('0.0123', '1234', '1.5e-07', '–')
    """
    if value is None:
        return "–"
    if value and abs(value) < 1e-4:
        return f"{value:.{count - 1}g}"
    if abs(value) >= 10 ** (count - 1):
        return f"{value:.0f}"
    return f"{value:#.{count}g}".rstrip(".")


def ratio(made):
    """A ratio with its interval, in bold where even the interval is below 1.

    >>> ratio({"ratio": 0.5, "interval": [0.4, 0.6]}), ratio(None)
    ('**0.50** (0.40–0.60)', '–')
    """
    if made is None:
        return "–"
    low, high = made["interval"]
    text = f"{made['ratio']:.2f}"
    if high < 1.0:
        text = f"**{text}**"
    return f"{text} ({low:.2f}–{high:.2f})"


def median_with_spread(made, count=3):
    """
    >>> median_with_spread({"median": 2.0, "least": 1.0, "most": 3.0})
    '2.00 (1.00–3.00)'
    """
    return (f"{digits(made['median'], count)} ({digits(made['least'], count)}–"
            f"{digits(made['most'], count)})")


def words(name):
    """A scene's or an edit's name for a reader."""
    return name.replace("_", " ")
