"""Plots of dots beside codes: the true one, and those that are a little wrong."""

from itertools import islice

import pytest
import torch
from torch.nn.functional import interpolate

from fractal_exp import codes, suite
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.grain import grain, noise_ratio_of_dots
from fractal_exp.cameras.kinds import kind_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.points import counted
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.known import Known
from fractal_exp.images.levels import meaning_of
from fractal_exp.images.reading import ReadImage
from fractal_exp.likeness import Likeness
from fractal_exp.verdict import Verdict

SIDE, SMALL = 362, 256      # of the plot, and of the image that is read
DOT = (SMALL / SIDE)**2     # pixels², the area of a dot
HALF = Known(-1, -1, 0.1, 1)


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
    """The code with a map that is moved by two pixels, without a map, and with shares less alike."""
    offset, shares = code.offset.clone(), code.sampling_probabilities()
    offset[int(shares.argmax()), 1] += 0.015
    yield "moved", IFS(code.linear, offset, shares)
    others = [i for i in range(len(code)) if i != int(shares.argmin())]
    yield "missing", IFS(code.linear[others], code.offset[others], shares[others] / shares[others].sum())
    yield "other shares", IFS(code.linear, code.offset, shares**1.5 / (shares**1.5).sum())


def test_the_true_code_explains_dots_to_their_noise_and_wrong_ones_do_not(code, target):
    likeness = Likeness.of(code, target)
    assert 0.7 < likeness.noise_ratio < 1.2
    assert likeness.ssim < 0.8, "a drawing without dots is not like the plot pixel by pixel"
    assert likeness.ssim_chance == pytest.approx(likeness.ssim, abs=.08), "but neither is another plot"
    assert Verdict.of(likeness, len(code), target).words == "recovered: the picture is explained to its noise"
    for what, other in wrong(code):
        likeness = Likeness.of(other, target)
        assert likeness.noise_ratio > 1.25, what
        assert likeness.ssim_chance > likeness.ssim + .1, f"{what}: a picture that is no plot of the code has no dots"
        assert Verdict.of(likeness, len(other), target).kind != "recovered", what


def bernoulli(density, seed):
    return torch.bernoulli(density, generator=torch.Generator().manual_seed(seed))


def test_the_grain_is_the_area_of_independent_dots():
    density = torch.linspace(.1, .9, SIDE).expand(SIDE, SIDE)
    dots = bernoulli(density, 2)
    assert grain(dots, density, 3) == pytest.approx(1, rel=.03)
    assert grain(dots, density, 8) == pytest.approx(1, rel=.08)
    small, shrunk = (interpolate(each[None, None], size=(SMALL, SMALL), mode="area")[0, 0] for each in (dots, density))
    assert grain(small, shrunk, 8) == pytest.approx(DOT, rel=.15)


def test_independent_dots_are_explained_at_any_exposure():
    density = torch.linspace(.1, .7, SMALL).expand(SMALL, SMALL)
    dots = bernoulli(density, 3)
    assert 0.7 < noise_ratio_of_dots(dots, density) < 1.2
    assert 0.7 < noise_ratio_of_dots(dots, 1 - (1 - density).sqrt()) < 1.2
    assert 0.7 < noise_ratio_of_dots(dots.flip(0, 1), density.flip(0, 1)) < 1.2
    assert noise_ratio_of_dots(dots, density.sqrt()) > 1.4, "another tone is another density"


@pytest.mark.parametrize("where", [slice(100, 124), slice(SMALL - 24, SMALL)])
def test_dots_that_are_missing_in_one_place_are_seen(where):
    density = torch.full((SMALL, SMALL), .3)
    dots = bernoulli(density, 4)
    dots[where, where] = 0
    assert noise_ratio_of_dots(dots, density) > 1.5


def test_a_density_that_is_wrong_over_the_whole_plot_is_seen():
    density = torch.full((SMALL, SMALL), .3)
    wave = density * (1 + .2 * torch.linspace(0, 6.28, SMALL).sin())
    assert noise_ratio_of_dots(bernoulli(wave, 6), density) > 1.2 > noise_ratio_of_dots(bernoulli(wave, 6), wave)


@pytest.mark.parametrize("grey", [0.0, 0.5, 1.0])
def test_an_even_image_is_explained_by_an_even_density_alone(grey):
    image, slope = torch.full((SMALL, SMALL), grey), torch.linspace(.2, .8, SMALL).expand(SMALL, SMALL)
    assert noise_ratio_of_dots(image, slope) > 1.2
    assert noise_ratio_of_dots(torch.full_like(image, .5), torch.full_like(image, .5)) < 1.2


@pytest.mark.parametrize("side", [3, 8])
def test_large_dots_are_not_taken_for_the_noise_of_small_ones(side):
    density = torch.full((SMALL, SMALL), .3)
    blocks = bernoulli(torch.full((-(-SMALL // side),) * 2, .3), 5)
    blocks = blocks.repeat_interleave(side, 0).repeat_interleave(side, 1)[:SMALL, :SMALL]
    assert noise_ratio_of_dots(blocks, density) > 1.2


def test_the_finest_texture_has_less_noise_than_dots():
    checks = (torch.arange(SMALL)[:, None] + torch.arange(SMALL)) % 2
    assert noise_ratio_of_dots(checks.float(), torch.full((SMALL, SMALL), .5)) < 1.2, "its mean is right everywhere"


def test_a_filled_set_of_dots_is_seen_as_dots():
    code = attractor.normalize(codes.known("heighway_dragon"))
    dots = (counted(code, SIDE, 30_000, seed=5) > 0).float()
    image = interpolate(dots[None, None], size=(SMALL, SMALL), mode="area")[0, 0]
    target = ReadImage.of_drawing(image, meaning_of(image))
    likeness = Likeness.of(code, target)
    assert likeness.noise_ratio < 1.2
    assert Verdict.of(likeness, len(code), target).kind == "recovered"


def levels_of(kind, image):
    values = {"dots": {"gain": .5, "blur": 0.0}, "tonemapped": {"gain": .5, "gamma": 2.2, "blur": 0.0},
              "coverage": {"tile": 0.0, "pen": .004, "blur": 0.0}}
    return kind_of(kind)(CameraParams(), image, Camera(kind, **values[kind]))


@pytest.mark.parametrize(("kind", "has_grain"), [("dots", True), ("tonemapped", False), ("coverage", False)])
def test_only_dots_are_plotted_with_their_grain(plot, code, kind, has_grain):
    levels = levels_of(kind, plot)
    drawn = levels.render(code, SMALL, 1)
    again = levels.plotted(code, SMALL, 2)
    assert float(again.mean()) == pytest.approx(float(drawn.mean()), rel=.03)
    assert (grain(again, drawn) > .5 * grain(plot, drawn)) == has_grain


def test_a_part_of_a_plot_has_the_grain_of_the_whole(plot, code):
    levels = levels_of("dots", plot)
    part = levels_of("dots", plot * HALF.mask(SMALL)).within(HALF)
    drawn = levels.render(code, SMALL, 1)
    whole, again = (each.plotted(code, SMALL, 2) for each in (levels, part))
    assert float(again.mean()) == pytest.approx(float(whole.mean()), rel=.03)
    assert grain(again, drawn) == pytest.approx(grain(whole, drawn), rel=.3)


def test_the_dots_of_another_size_are_not_known(plot, code):
    levels = levels_of("dots", plot)
    assert torch.equal(levels.plotted(code, SMALL // 2, 2), levels.render(code, SMALL // 2, 2))
