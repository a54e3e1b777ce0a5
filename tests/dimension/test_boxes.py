"""Box counting and lacunarity against counts by hand, known values, and pictures that the reader reads."""

import numpy as np
import pytest
from PIL import Image, ImageDraw

from fractal_exp import InputError, codes, render, suite
from fractal_exp.dimension.samples import OFFSETS, count_boxes, lacunarity, slope
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
    """The mean number of boxes that hold a lit pixel, over offsets of the lattice, at most `OFFSETS` each way."""
    rows, columns = np.nonzero(lit)
    tried = min(size, OFFSETS)
    offsets = [size * (k + 1) // tried - 1 for k in range(tried)]
    return float(np.mean([len({((y + i) // size, (x + j) // size) for y, x in zip(rows, columns, strict=True)})
                          for i in offsets for j in offsets]))


def test_boxes_are_counted_and_their_slope_is_that_of_least_squares():
    lit = np.random.default_rng(0).random((40, 64)) < 0.2
    lit[[0, -1], [0, -1]] = True
    found = count_boxes(np.pad(lit, 9))                     # what is dark around it does not matter
    sizes = 2, 3, 4, 5, 6, 8, 9, 11, 13, 16
    assert f"{len(sizes)} sizes from 2 to 16 px" in found.condition
    x, y = -np.log(sizes), np.log([by_hand(lit, size) for size in sizes])
    value, error, change = slope(x, y)
    assert value == pytest.approx(np.polyfit(x, y, 1)[0])
    margin = 2 * error + 2 * change
    assert (found.value, found.low, found.high) == pytest.approx((value, value - margin, value + margin))
    assert 0 < found.low and found.high < 2


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
