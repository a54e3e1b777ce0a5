"""Targets are read by bands: the same as from whole arrays and dense weights, in memory that does not grow."""

import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from PIL import Image

from fractal_exp.images.reading import read_target

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def dense_weights(start, side, resolution, count):
    """The share that each of `count` pixels has in each target pixel, as a full matrix."""
    step = side / resolution
    edges = start + step * np.arange(resolution + 1)[:, None]
    pixels = np.arange(count)
    if step >= 1:
        return ((np.minimum(edges[1:], pixels + 1) - np.maximum(edges[:-1], pixels)).clip(0) / step).astype(np.float32)
    centers = (edges[1:] + edges[:-1]) / 2
    return (1 - np.abs(centers - (pixels + 0.5))).clip(0).astype(np.float32)


def reference(pixels, resolution, invert="auto", threshold=None, padding=0.25, frame="fit"):
    """The target of a grey, RGB or RGBA array of uint8, from the whole picture at once."""
    levels = (pixels.astype(np.float32) / 255).clip(0, 1)
    grey = levels
    if pixels.ndim == 3:
        grey = sum(weight * levels[..., i] for i, weight in enumerate(LUMINANCE)).clip(0, 1)
    if pixels.shape[2:] == (4,):
        alpha = levels[..., 3]
        visible = grey[alpha >= alpha.max() / 2]
        backdrop = float(visible.mean() < 0.5) if invert == "auto" else float(invert)
        grey = alpha if np.ptp(visible) < 0.04 else alpha * grey + (1 - alpha) * np.float32(backdrop)
    border = np.concatenate([grey[0], grey[-1], grey[1:-1, 0], grey[1:-1, -1]])
    level = float(np.median(border))
    energy = np.square(grey - level, dtype=np.float64)
    brighter = float(energy[grey > level].sum() / energy.sum())
    if brighter < 0.5 if invert == "auto" else invert:
        grey, border, level, brighter = 1 - grey, 1 - border, 1 - level, 1 - brighter
    if brighter < 0.5:
        level = float(grey.min())
    if threshold is not None:
        grey, border, level = (grey >= threshold).astype(np.float32), (border >= threshold).astype(np.float32), 0.0
    x, y, side = 0.0, 0.0, float(grey.shape[1])
    if frame == "fit":
        contrast = float(grey.max()) - level
        away = np.abs(border - level) / contrast
        noise = float(np.sqrt(np.square(away[away < 0.25]).mean())) if (away < 0.25).any() else 0.0
        ends = []
        for axis in (0, 1):
            share = ((grey.max(axis) - level) / contrast).clip(0)
            first, last = np.flatnonzero(share > min(max(0.1, 6 * noise), 0.5))[[0, -1]]
            ends.append((first + 1 - share[max(first - 1, 0):first + 1].sum(), last + share[last:last + 2].sum()))
        (x0, x1), (y0, y1) = ends
        side = float(max(x1 - x0, y1 - y0) / (1 - padding))
        x, y = float(x0 + x1 - side) / 2, float(y0 + y1 - side) / 2
    rows = dense_weights(y, side, resolution, grey.shape[0])
    columns = dense_weights(x, side, resolution, grey.shape[1])
    beyond = 1 - np.outer(rows.sum(1), columns.sum(1))
    return (rows @ grey @ columns.T + np.float32(level) * beyond).clip(0, 1)


@cache
def photograph(shape, seed, channels=None):
    """A blurred lopsided shape with noise, as uint8."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:shape[0], :shape[1]]
    across, down = x / shape[1], y / shape[0]
    grey = 1 / (1 + np.exp(40 * (np.hypot(across - 0.45, (down - 0.55) * 1.7) - 0.25 - 0.08 * np.sin(17 * across))))
    if channels is None:
        return np.rint(255 * (0.9 * grey + 0.05 * rng.random(shape))).astype(np.uint8)
    colours = rng.uniform(0.6, 1, channels)
    picture = grey[..., None] * colours + 0.02 * rng.random((*shape, channels))
    if channels == 4:
        picture[..., 3] = np.where(down < 0.3, 0.0, 1 - 0.3 * across)
    return np.rint(255 * picture.clip(0, 1)).astype(np.uint8)


OPTIONS = [{}, {"invert": True}, {"threshold": 0.4}, {"padding": 0.0}, {"invert": False, "padding": 0.6}]


@pytest.mark.parametrize(("channels", "options"), [
    pytest.param(channels, options, marks=() if channels is None or options in OPTIONS[:2] else pytest.mark.slow)
    for channels in (None, 3, 4) for options in OPTIONS], ids=str)
def test_bands_give_what_the_whole_picture_gives(tmp_path, channels, options):
    """The first picture has a band and a part of another."""
    for shape, resolution in (((1111, 1003), 64), ((64, 48), 128), ((300, 300), 300)):
        pixels = photograph(shape, sum(shape), channels)
        expected = reference(pixels, resolution, **options)
        Image.fromarray(pixels).save(tmp_path / "picture.png", compress_level=1)
        for source in (pixels, tmp_path / "picture.png"):
            read = read_target(source, resolution, **options, clean=False)
            seen = 1 if read.known is None else read.known.mask(resolution).numpy()  # nothing is drawn beyond
            np.testing.assert_allclose(read.image, expected * seen, atol=1e-6, rtol=0)


MEASURE = """
import resource, sys
from fractal_exp.errors import InputError
from fractal_exp.images import read_target
from scipy.sparse import csr_array
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before = peak()
for path in sys.argv[1:]:
    try:
        print(*read_target(path, 256).image.shape, peak() - before)
    except InputError as error:
        print(error, peak() - before)
"""
CRAFTED = (((20_001, 20_000), "1"), ((65_000, 16), "1"), ((16, 65_000), "RGBA"), ((1_000_000, 17), "L"),
           ((17, 1_000_000), "L"), ((6000, 6000), "L"))


@pytest.mark.slow
def test_small_files_of_many_pixels_take_little_memory(tmp_path):
    """The most that reading them one after another adds to a process: some bands and what Pillow holds, 36 MB at most;
    the first has too many pixels, and is refused at once."""
    paths = []
    for i, (size, mode) in enumerate(CRAFTED):
        paths.append(str(tmp_path / f"{i}.png"))
        picture = Image.new(mode, size)
        picture.paste(Image.new(mode, (size[0] // 2, size[1] // 2), "white"), (size[0] // 4, size[1] // 4))
        picture.save(paths[-1])
    done = subprocess.run([sys.executable, "-c", MEASURE, *paths], capture_output=True, text=True, check=True)
    answers = [line.rsplit(" ", 1) for line in done.stdout.splitlines()]
    refused, *read = [answer for answer, _ in answers]
    assert "more than 400000000 pixels, the maximum that is read; shrink the picture first" in refused
    assert read == ["256 256"] * 5
    more = [float(mib) for _, mib in answers]
    assert more[0] < 20 and max(more) < 300, more
