"""The sets of pictures from elsewhere: names, seeds, roles, and that every truth lies where its picture is."""

import numpy as np
import pytest
from scipy import ndimage

from benchmarks.pictures import textbook
from benchmarks.pictures.figures import FIGURES, Truth
from fractal_exp import render
from fractal_exp.images.reading import read_target

DEEPEST = {p.family: p for p in reversed(textbook.pictures().values()) if p.deepest and not p.jpeg}


def lit(truth: Truth, resolution: int = 256) -> np.ndarray:
    """Where the truth's attractors are, and the corners of its solids."""
    mask = np.any([(render(code, resolution=resolution, points_in_view=2_000_000) > 0).numpy() for code in truth.codes],
                  axis=0)
    return mask


def grown(mask: np.ndarray) -> np.ndarray:
    return ndimage.binary_dilation(mask, np.ones((3, 3)))


def test_families_are_for_tuning_or_for_reporting():
    families = {picture.family for picture in textbook.pictures().values()}
    assert families == {*textbook.TUNING, *textbook.REPORTING} and not {*textbook.TUNING} & {*textbook.REPORTING}
    assert all(name == picture.name for name, picture in textbook.pictures().items())


@pytest.mark.parametrize("name", ["koch_curve-4-red", "fern_dots-green-jpeg", "carpet-3-green"])
def test_name_and_seed_make_the_picture(name):
    picture = textbook.pictures()[name]
    assert (picture.draw(3).pixels == picture.draw(3).pixels).all()
    other = picture.draw(4).pixels
    assert other.shape != picture.draw(3).pixels.shape or (other != picture.draw(3).pixels).any()


def test_jpeg_is_its_twin_with_little_loss():
    plain, jpeg = (textbook.pictures()[name].draw().pixels.astype(float) for name in
                   ("fern_dots-green", "fern_dots-green-jpeg"))
    assert 0 < np.abs(plain - jpeg).mean() < 8


@pytest.mark.parametrize("family", sorted(DEEPEST))
def test_the_true_code_lies_on_its_picture(family):
    drawn = DEEPEST[family].draw()
    target = read_target(drawn.pixels, 256)
    truth, image = drawn.truth_on(target.placement), target.image.numpy()
    seen, true = image > 0.25 * image.max(), lit(truth)
    assert (true & grown(seen)).sum() >= 0.95 * true.sum()
    if truth.solids is None:
        assert (seen & grown(true)).sum() >= 0.97 * seen.sum()


def test_only_outline_and_pythagoras_tree_have_no_code():
    assert {name for name, figure in FIGURES.items() if figure.truth().code is None} == {"koch_outline", "pythagoras"}
