#!/usr/bin/env python3
"""Writes src/model/thin_film_table.c and .h: how scene-linear colours see a film's interference.

A path that is longer by d adds cos(2 pi d / wavelength) to the light of each wavelength. What a channel
sees of that is the real part of the Fourier transform of its colour matching function, here of the
observer in src/kernels/program/table.h, over wavenumbers. The table has the transform of each channel,
turned back by a carrier's phase, so that it changes slowly enough to be interpolated. X, Y and Z
are each divided by what they have of an even spectrum, which is made Rec.709's white, as in Cycles.

    generate_thin_film.py [--check]
"""

import argparse
import cmath
import math
import re
import sys
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"
TABLE = SOURCE / "model" / "thin_film_table.c"
HEADER = SOURCE / "model" / "thin_film_table.h"
SIZE = 128
REACH = 9600.0  # nanometres; behind it less than 0.4 % is left
CARRIERS = (605.0, 548.0, 447.0)  # nanometres
XYZ_TO_REC709 = ((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560),
                 (0.0556434, -0.2040259, 1.0572252))
WHITE = (0.9504700, 1.0, 1.0888300)  # XYZ of what is 1 in all channels
STEP = 0.5  # of the integral, nanometres


def observer():
    """[(wavelength, x, y, z)] of the colour matching functions, in steps of STEP."""
    text = (SOURCE / "kernels" / "program" / "table.h").read_text()
    first = float(re.search(r"#define CIE_FIRST ([\d.]+)", text)[1])
    step = float(re.search(r"#define CIE_STEP ([\d.]+)", text)[1])
    body = text[text.index("cie_observer[CIE_COUNT][3] = {"):]
    numbers = [float(n) for n in re.findall(r"([\d.]+)f", body[:body.index("};")].split("{", 1)[1])]
    rows = list(zip(numbers[0::3], numbers[1::3], numbers[2::3]))
    count = round((len(rows) - 1) * step / STEP) + 1
    result = []
    for i in range(count):
        at = min(i * STEP / step, len(rows) - 1.000001)
        low, part = int(at), at - int(at)
        result.append((first + i * STEP, *(a + (b - a) * part for a, b in zip(rows[low], rows[low + 1]))))
    return result


def transforms():
    """[channel][entry] complex."""
    spectrum = observer()
    scale = [white / math.fsum(row[1 + k] for row in spectrum) for k, white in enumerate(WHITE)]
    for row, carrier in zip(XYZ_TO_REC709, CARRIERS):
        factors = [a * b for a, b in zip(row, scale)]
        weights = [(w, sum(a * b for a, b in zip(factors, xyz))) for w, *xyz in spectrum]
        yield [sum(value * cmath.exp(2j * math.pi * at * (1.0 / w - 1.0 / carrier)) for w, value in weights)
               for at in (REACH * i / (SIZE - 1) for i in range(SIZE))]


def header():
    carriers = "\n".join(f"#define TRC_THIN_FILM_{name} {carrier}f"
                         for name, carrier in zip(("RED", "GREEN", "BLUE"), CARRIERS))
    return f"""/* What colour channels see of interference, by the difference of paths: Fourier transforms of the
 * colour matching functions over wavenumbers, real and imaginary parts, each turned back by the
 * phase of a carrier of that wavelength. Made by tools/generate_thin_film.py. */
#ifndef TRACER_MODEL_THIN_FILM_TABLE_H
#define TRACER_MODEL_THIN_FILM_TABLE_H

#define TRC_THIN_FILM_CHANNELS {len(CARRIERS)}
#define TRC_THIN_FILM_SIZE {SIZE}
/* Difference of paths in nanometres where the table ends; little is left there. */
#define TRC_THIN_FILM_REACH {REACH}f
/* Wavelengths of the carriers, nanometres. */
{carriers}

extern const float trc_thin_film_table[TRC_THIN_FILM_CHANNELS][2][TRC_THIN_FILM_SIZE];

#endif
"""


def table():
    lines = ["/* Made by tools/generate_thin_film.py. */", '#include "model/thin_film_table.h"', "",
             "/* clang-format off */",
             "const float trc_thin_film_table[TRC_THIN_FILM_CHANNELS][2][TRC_THIN_FILM_SIZE] = {"]
    for entries in transforms():
        lines.append("    {")
        for part in (lambda c: c.real, lambda c: c.imag):
            numbers = [f"{part(entry):.6f}f" for entry in entries]
            lines.append("        {")
            lines += ["            " + ", ".join(numbers[i:i + 8]) + "," for i in range(0, SIZE, 8)]
            lines.append("        },")
        lines.append("    },")
    return "\n".join(lines + ["};", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--check", action="store_true", help="compare with what is there, write nothing")
    arguments = parser.parse_args()
    for path, made in ((TABLE, table()), (HEADER, header())):
        if not arguments.check:
            path.write_text(made)
        elif path.read_text() != made:
            sys.exit(f"{path} is not what tools/generate_thin_film.py makes")


if __name__ == "__main__":
    main()
