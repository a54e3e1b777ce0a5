"""Plots of dots beside codes: the true one, and those that are a little wrong."""

from itertools import islice

import pytest
import torch
from torch.nn.functional import interpolate

from fractal_exp import suite
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.grain import grain, misfit
from fractal_exp.cameras.kinds import kind_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.points import counted
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import meaning_of
from fractal_exp.images.reading import ReadImage
from fractal_exp.likeness import Likeness
from fractal_exp.verdict import Verdict

SIDE, SMALL = 362, 256      # of the plot, and of the image that is read
DOT = (SMALL / SIDE)**2     # pixels², the area of a dot


@pytest.fixture(scope="module")
def code():
    return attractor.normalize(next(islice(suite.random_suite(), 24, None)))


@pytest.fixture(scope="module")
def plot(code):
    """Dots of one pixel of the plot, shrunk."""
    dots = (counted(code, SIDE, 60_000, seed=5) > 0).float()
    return interpolate(dots[None, None], size=(SMALL, SMALL), mode="area")[0, 0]


@pytest.fixture(scope="module")
def target(plot):
    return ReadImage.of_drawing(plot, meaning_of(plot))


def wrong(code):
    """The code with a map that is moved by two pixels, without a map, and with other shares."""
    offset, shares = code.offset.clone(), code.sampling_probabilities()
    offset[0, 1] += 0.015
    yield "moved", IFS(code.linear, offset, shares)
    most = [i for i in range(len(code)) if i != int(shares.argmax())]
    yield "missing", IFS(code.linear[most], code.offset[most], shares[most] / shares[most].sum())
    other = shares * torch.linspace(.6, 1.4, len(code))
    yield "other shares", IFS(code.linear, code.offset, other / other.sum())


def test_the_true_code_explains_dots_to_their_noise_and_wrong_ones_do_not(code, target):
    likeness = Likeness.of(code, target)
    assert 0.7 < likeness.noise_ratio < 1.2
    assert likeness.ssim < 0.8, "a drawing without dots is not like the plot pixel by pixel"
    assert likeness.ssim_chance == pytest.approx(likeness.ssim, abs=.08), "but neither is another plot"
    assert Verdict.of(likeness, len(code), target).words == "recovered: the picture is explained to its noise"
    for what, other in wrong(code):
        likeness = Likeness.of(other, target)
        assert likeness.noise_ratio > 1.3, what
        assert Verdict.of(likeness, len(other), target).kind != "recovered", what


def test_the_grain_is_the_area_of_independent_dots():
    density = torch.linspace(.1, .9, SIDE).expand(SIDE, SIDE)
    dots = torch.bernoulli(density, generator=torch.Generator().manual_seed(2))
    assert grain(dots, density, 2) == pytest.approx(1, rel=.03)
    assert grain(dots, density, 8) == pytest.approx(1, rel=.08)
    assert grain(dots, (density / 2).sqrt(), 2) == pytest.approx(1, rel=.03), "whatever the tone"
    small, shrunk = (interpolate(each[None, None], size=(SMALL, SMALL), mode="area")[0, 0] for each in (dots, density))
    assert grain(small, shrunk, 8) == pytest.approx(DOT, rel=.15)


def test_dots_that_are_missing_in_one_place_are_seen():
    density = torch.full((SMALL, SMALL), .3)
    dots = torch.bernoulli(density, generator=torch.Generator().manual_seed(4))
    assert 0.7 < misfit(dots, density) < 1.3
    dots[100:124, 60:84] = 0
    assert misfit(dots, density) > 1.7


def test_large_dots_are_not_taken_for_the_noise_of_small_ones():
    large = torch.bernoulli(torch.full((32, 32), .3), generator=torch.Generator().manual_seed(5))
    blocks = large.repeat_interleave(8, 0).repeat_interleave(8, 1)
    assert misfit(blocks, torch.full((SMALL, SMALL), .3)) > 2


def levels_of(kind, image):
    values = {"dots": {"gain": .5, "blur": 0.0}, "tonemapped": {"gain": .5, "gamma": 2.2, "blur": 0.0},
              "coverage": {"tile": 0.0, "pen": .004, "blur": 0.0}}
    return kind_of(kind)(CameraParams(), image, Camera(kind, **values[kind]))


@pytest.mark.parametrize(("kind", "has_grain"), [("dots", True), ("tonemapped", False), ("coverage", False)])
def test_only_dots_are_plotted_with_their_grain(plot, code, kind, has_grain):
    levels = levels_of(kind, plot)
    drawn = levels.render(code, SMALL, 1)
    again = levels.plotted(code, drawn, 2)
    assert float(again.mean()) == pytest.approx(float(drawn.mean()), rel=.15)
    assert (grain(again, drawn) > .5 * grain(plot, drawn)) == has_grain


def test_the_dots_of_another_size_are_not_known(plot, code):
    levels = levels_of("dots", plot)
    small = levels.render(code, SMALL // 2, 1)
    assert grain(levels.plotted(code, small, 2), small) < .05
