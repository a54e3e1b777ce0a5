"""Drawings as people bring them, by Pillow and matplotlib: shapes, and what stands beside them."""

import io
import math
import struct
import zlib

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import binary_dilation

FERN = ((0.01, 0, 0, 0, 0.16, 0, 0), (0.85, 0.85, 0.04, -0.04, 0.85, 0, 1.6), (0.07, 0.2, -0.26, 0.23, 0.22, 0, 1.6),
        (0.07, -0.15, 0.28, 0.26, 0.24, 0, 0.44))  # probability a b c d e f


def fern_points(count=8000):
    rng, point, points = np.random.default_rng(0), np.zeros(2), np.empty((count, 2))
    for number, chosen in enumerate(rng.choice(4, count, p=[row[0] for row in FERN])):
        _, a, b, c, d, e, f = FERN[chosen]
        point = np.array([a * point[0] + b * point[1] + e, c * point[0] + d * point[1] + f])
        points[number] = point
    return points


def fern_plot(*, axes=True, grid=False, box=True):
    """A scatter plot (H,W,3) uint8, green on white."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, plot = plt.subplots(figsize=(4, 4), dpi=100)
    plot.scatter(*fern_points().T, s=0.6, c="green", linewidths=0)
    plot.set_title("Barnsley's fern")
    plot.set_xlabel("x")
    plot.grid(grid)
    if not box:
        plot.spines[["top", "right"]].set_visible(False)
    if not axes:
        plot.axis("off")
        plot.set_title("")
    file = io.BytesIO()
    figure.savefig(file, format="png")
    plt.close(figure)
    return np.asarray(Image.open(file).convert("RGB"))


def koch(depth=4, size=(600, 400), pen="black", paper="white", width=3):
    """The Koch curve as a line: a Pillow image."""
    picture = Image.new("RGB", size, paper)

    def corners(a, b, left):
        if not left:
            return [a]
        step = (b - a) / 3
        peak = a + step + step * complex(0.5, -math.sqrt(3) / 2)
        places = [a, a + step, peak, a + 2 * step, b]
        return [corner for one, two in zip(places, places[1:], strict=False) for corner in corners(one, two, left - 1)]

    points = [*corners(complex(50, 260), complex(550, 260), depth), complex(550, 260)]
    ImageDraw.Draw(picture).line([(point.real, point.imag) for point in points], fill=pen, width=width)
    return picture


def write(picture, text, x, y, size=18):
    """The picture with a text about (x, y)."""
    from matplotlib import font_manager

    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size)
    ImageDraw.Draw(picture).text((x, y), text, "black", font, anchor="mm")
    return picture


def star(picture, x, y, radius, colour, fine=1):
    """The picture with a rounded star of five arms."""
    angles = np.linspace(0, 2 * np.pi, 400)
    radii = radius * (1 + 0.3 * np.sin(5 * angles) + 0.1 * np.cos(11 * angles))
    ImageDraw.Draw(picture).polygon([(fine * (x + a), fine * (y + b)) for a, b in
                                     zip(radii * np.cos(angles), 0.8 * radii * np.sin(angles), strict=True)], colour)
    return picture


def leaf(colour, paper="white", fine=4):
    """A star with smooth edges: a Pillow image of 300²."""
    large = star(Image.new("RGB", (300 * fine, 300 * fine), paper), 150, 150, 80, colour, fine)
    return large.resize((300, 300), Image.Resampling.BOX)


def lopsided():
    """A grey shape without symmetries (60,80), white on black."""
    picture = np.zeros((60, 80))
    picture[9:47, 11:52] = 1
    picture[20:30, 20:30] = 0.5
    picture[9:12, 11:30] = 0
    return picture


def declared(side, rows, colour=6):
    """A PNG that declares side² pixels of a colour type and holds some rows of them, all black, or transparent."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    palette = chunk(b"PLTE", bytes(6)) + chunk(b"tRNS", b"\0") if colour == 3 else b""
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, colour, 0, 0, 0)) + palette
            + chunk(b"IDAT", zlib.compress(bytes(rows * (1 + channels * side)))) + chunk(b"IEND", b""))


def alike(found, expected, lit=0.25):
    """F1 within a pixel of what is brighter than a level in two images (R,R), by SciPy."""
    found, expected = (image.numpy() > lit for image in (found, expected))
    precise, complete = ((one & binary_dilation(other, np.ones((3, 3)))).sum() / one.sum()
                         for one, other in ((found, expected), (expected, found)))
    return 2 * precise * complete / (precise + complete)
