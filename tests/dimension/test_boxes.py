"""Box counting and lacunarity against counts by hand, known values, and pictures that the reader reads."""

import numpy as np
import pytest
from PIL import Image, ImageDraw

from fractal_exp import InputError, codes, render, suite
from fractal_exp.dimension.samples import OFFSETS, count_boxes, lacunarity
from fractal_exp.ifs import attractor
from fractal_exp.images.pixels import write_image
from fractal_exp.images.reading import read_lit

SIDE = 512
VALUES = {"koch_curve": 1.26186, "sierpinski_carpet": 1.89279, "sierpinski_triangle": 1.58496, "cantor_dust": 1.26186,
          "vicsek": 1.46497, "pentaflake": 1.86172, "rauzy": 2}


@pytest.mark.parametrize("name", VALUES)
def test_the_interval_of_a_drawing_holds_the_known_value(name):
    lit = render(attractor.normalize(codes.known(name)), resolution=SIDE, supersample=1).numpy() > 0
    found = count_boxes(lit)
    assert (found.kind, found.standing) == ("boxes", "estimate") and found.low <= VALUES[name] <= found.high
    assert abs(found.value - VALUES[name]) < 0.17 and "from 2 to 96 px, standard error 0.0" in found.condition


def test_a_line_and_a_filled_square():
    line, square = np.zeros((64, 512), bool), np.ones((512, 512), bool)
    line[3] = True
    assert count_boxes(line).value == pytest.approx(1, abs=0.05) and count_boxes(line).high > 1
    assert count_boxes(square).value == pytest.approx(2, abs=0.1) and count_boxes(square).high == 2
    assert set(lacunarity(square).values()) == {1.0}


def by_hand(lit: np.ndarray, size: int) -> float:
    """The mean number of boxes that hold a lit pixel, over offsets of the lattice."""
    rows, columns = np.nonzero(lit)
    return float(np.mean([len({((y + i) // size, (x + j) // size) for y, x in zip(rows, columns, strict=True)})
                          for i in range(size) for j in range(size)]))


def test_boxes_are_counted_and_their_slope_is_that_of_least_squares(monkeypatch):
    lit = np.random.default_rng(0).random((40, 64)) < 0.03
    lit[[0, -1], [0, -1]] = True
    counted = []
    monkeypatch.setattr("fractal_exp.dimension.samples.slope", lambda x, y: counted.append((x, y)) or (1.5, .01, .02))
    found = count_boxes(np.pad(lit, 9))                     # what is dark around it does not matter
    [(x, y)] = counted
    sizes = np.exp(-x).round().astype(int)
    assert sizes[0] == 2 and sizes[-1] == 16
    for size, count in zip(sizes, np.exp(y), strict=True):
        if size <= OFFSETS:                                 # all offsets
            assert count == pytest.approx(by_hand(lit, size))
    assert (found.value, found.low, found.high) == pytest.approx((1.5, 1.44, 1.56))


def test_lacunarity_is_that_of_gliding_boxes():
    rng = np.random.default_rng(1)
    lit = rng.random((30, 40)) < 0.3
    lit[[0, -1], [0, -1]] = True
    found = lacunarity(lit)
    for size in (2, 5):
        masses = np.array([lit[y:y + size, x:x + size].sum() for y in range(31 - size) for x in range(41 - size)])
        assert found[size] == pytest.approx((masses**2).mean() / masses.mean() ** 2)
    many = lacunarity(rng.random((1500, 1500)) < 0.2)       # of pixels lit at random: 1 + (1 - p) / (p size²)
    assert all(value == pytest.approx(1 + 0.8 / (0.2 * size**2), rel=0.02) for size, value in many.items() if size < 99)


def test_a_shape_of_a_few_pixels_is_refused():
    for lit in (np.zeros((50, 50), bool), np.pad(np.ones((15, 4), bool), 20)):
        with pytest.raises(InputError, match="at least 16 px a side, got"):
            count_boxes(lit)


def test_a_picture_is_measured_in_its_own_pixels_without_what_stands_beside_its_shape(tmp_path):
    shape = suite.target(codes.known("sierpinski_triangle"), 300, "binary").numpy() > 0
    page = Image.fromarray(np.where(np.pad(shape, ((0, 60), (0, 0))), 0, 255).astype(np.uint8))
    ImageDraw.Draw(page).text((20, 330), "Fig. 1. The gasket of Sierpinski", fill=0)
    page.save(tmp_path / "page.png")
    lit = read_lit(tmp_path / "page.png")
    assert lit.dtype == bool and lit.shape == (360, 300) and (lit[:300] == shape).all() and not lit[300:].any()
    assert read_lit(tmp_path / "page.png", threshold=.5)[300:].any()        # counts what stands anywhere
    grey = np.linspace(0, 1, 64)[None].repeat(64, 0)
    write_image(tmp_path / "ramp.png", grey)
    assert read_lit(tmp_path / "ramp.png", threshold=.5, invert=False).sum() == 64 * 32
    with pytest.raises(InputError, match="threshold"):
        read_lit(tmp_path / "page.png", threshold=2)
