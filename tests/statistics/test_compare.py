# SPDX-License-Identifier: Apache-2.0
"""Tests of the comparison tools; pure numpy, no renders."""

import doctest
import pathlib
import struct
import sys
import zlib

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "support"))
import compare  # noqa: E402  (the folder is on the path only now)


def noisy_seeds(count, seed, offset=0.0, shape=(24, 40, 3)):
    """Pictures of independent exponential noise of mean 1 + offset."""
    generator = np.random.default_rng(seed)
    return [generator.exponential(1.0, shape) + offset for _ in range(count)]


def zip_exr(path, pixels, half=False):
    """Write an EXR with ZIP chunks of 16 rows, independently of compare.write_exr's layout."""
    height, width, count = pixels.shape
    dtype, code = (np.dtype("<f2"), 1) if half else (np.dtype("<f4"), 2)
    names = "BGR"[:count]
    channels = b"".join(n.encode() + b"\0" + struct.pack("<iiii", code, 0, 1, 1) for n in names)
    window = struct.pack("<4i", 5, 7, width + 4, height + 6)
    head = struct.pack("<ii", 20000630, 2)
    for name, kind, value in (("channels", "chlist", channels + b"\0"),
                              ("compression", "compression", b"\3"),
                              ("dataWindow", "box2i", window)):
        head += name.encode() + b"\0" + kind.encode() + b"\0"
        head += struct.pack("<i", len(value)) + value
    head += b"\0"
    chunks = []
    for y in range(0, height, 16):
        raw = np.frombuffer(pixels[y:y + 16].transpose(0, 2, 1).astype(dtype).tobytes(), np.uint8)
        split = np.concatenate([raw[0::2], raw[1::2]]).astype(np.int64)
        split[1:] = np.diff(split) + 128
        packed = zlib.compress(split.astype(np.uint8).tobytes())
        packed = packed if len(packed) < len(raw) else raw.tobytes()
        chunks.append(struct.pack("<ii", y + 7, len(packed)) + packed)
    starts, position = [], len(head) + 8 * len(chunks)
    for chunk in chunks:
        starts.append(position)
        position += len(chunk)
    path.write_bytes(head + struct.pack(f"<{len(starts)}Q", *starts) + b"".join(chunks))


def test_doctests():
    assert doctest.testmod(compare).failed == 0


def test_exr_round_trip(tmp_path):
    pixels = np.random.default_rng(1).normal(size=(13, 7, 4)).astype(np.float32)
    pixels[0, 0] = (np.inf, -np.inf, 0.0, 1e-40)
    compare.write_exr(tmp_path / "a.exr", pixels, ("R", "G", "B", "A"))
    read, names = compare.read_exr(tmp_path / "a.exr")
    assert names == ["A", "B", "G", "R"]
    assert np.array_equal(read[..., ::-1], pixels[..., [0, 1, 2, 3]])
    assert np.array_equal(compare.read_rgb(tmp_path / "a.exr"), pixels[..., :3])


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("noise", [False, True])
def test_exr_zip(tmp_path, half, noise):
    """Compressed chunks, and those stored raw because they would not shrink."""
    pixels = np.zeros((37, 9, 3), np.float32)
    pixels[10:20, 2:5] = (0.5, 2.0, -1.0)
    if noise:
        bits = np.random.default_rng(2).integers(0, 2 ** 16, pixels.shape, dtype=np.uint16)
        pixels = np.nan_to_num(bits.view(np.float16).astype(np.float32))
        pixels = np.clip(pixels, -60000.0, 60000.0)
    zip_exr(tmp_path / "z.exr", pixels, half)
    read, names = compare.read_exr(tmp_path / "z.exr")
    assert names == ["B", "G", "R"]
    expected = pixels.astype(np.float16).astype(np.float32) if half else pixels
    assert np.array_equal(read, expected)


def test_not_an_exr(tmp_path):
    (tmp_path / "x.exr").write_bytes(b"not a picture at all")
    with pytest.raises(ValueError):
        compare.read_exr(tmp_path / "x.exr")


def test_png_header_and_pixels(tmp_path):
    compare.write_png(tmp_path / "p.png", np.full((2, 3, 3), 1.0))
    data = (tmp_path / "p.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (3, 2)
    start = data.index(b"IDAT") + 4
    size = struct.unpack(">I", data[start - 8:start - 4])[0]
    assert zlib.decompress(data[start:start + size]) == 2 * (b"\0" + 9 * b"\xff")


def test_side_by_side_shows_the_difference():
    picture = compare.side_by_side(np.full((4, 5, 3), 0.5), np.full((4, 5, 3), 0.25), gap_px=1)
    assert picture.shape == (4, 17, 3)
    assert np.allclose(picture[:, 12:], 2.0)


@pytest.mark.parametrize("t, freedom, p", [
    (1.0, 1.0, 0.5), (2.0, 2.0, 0.18350341907227397), (12.706204736, 1.0, 0.05),
    (2.2281388520, 10.0, 0.05), (6.0, 18.0, 1.1269971e-5), (1.959963985, 1e6, 0.05)])
def test_student_table(t, freedom, p):
    assert compare.student_two_sided(t, freedom) == pytest.approx(p, rel=2e-4)


def test_welch_p_values_are_uniform():
    generator = np.random.default_rng(3)
    p = compare.welch_p_values(generator.normal(0.0, 1.0, (8, 20000)),
                               generator.normal(0.0, 3.0, (5, 20000)))
    counts, _edges = np.histogram(p, 10, (0.0, 1.0))
    assert np.all(np.abs(counts - 2000) < 200)


def test_welch_without_variance():
    same, other = np.ones((3, 2)), np.array([[1.0, 2.0]] * 3)
    assert compare.welch_p_values(same, other).tolist() == [1.0, 0.0]
    with pytest.raises(ValueError):
        compare.welch_p_values(same[:1], other)


def test_bias_test_passes_equal_and_finds_a_biased_tile():
    clean, other = noisy_seeds(12, 4), noisy_seeds(12, 5)
    report = compare.bias_test(clean, other)
    assert report["failed"] == 0 and report["tests"] == 3 * 5 * 3
    for image in other:
        image[8:16, 16:24, 1] += 0.4
    report = compare.bias_test(clean, other)
    assert report["failed"] == 1
    assert report["worst_tile_px"] == [16, 8] and report["worst_channel"] == 1


def test_measure_rejects_shapes_and_counts_non_finite():
    with pytest.raises(ValueError):
        compare.measure(np.zeros((2, 2, 3)), np.zeros((2, 3, 3)))
    broken = np.zeros((2, 2, 3))
    broken[0, 1, 2] = np.nan
    assert compare.measure(broken, np.zeros((2, 2, 3)))["non_finite_pixels"] == 1


def test_program(tmp_path, capsys):
    paths = []
    for index, image in enumerate(noisy_seeds(4, 6)):
        paths.append(str(tmp_path / f"{index}.exr"))
        compare.write_exr(paths[-1], image)
    code = compare.main(["--a", *paths[:2], "--b", *paths[2:], "--png", str(tmp_path / "d.png"),
                         "--reference", paths[0]])
    text = capsys.readouterr().out
    assert code == 0 and "bias test" in text and (tmp_path / "d.png").exists()
