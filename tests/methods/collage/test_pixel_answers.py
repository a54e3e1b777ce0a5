"""Known answers of what is told from pixels: errors of equal variance, misfits, steps, simple numbers."""


from types import SimpleNamespace

import pytest
import torch
from collage_helpers import PARAMS, measure_search, objective

from fractal_exp import codes
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.image.jacobian import FromPoints
from fractal_exp.methods.collage.image.objective import Frame, stabilize
from fractal_exp.methods.collage.simplify.loop import Price, pruned
from fractal_exp.methods.collage.simplify.simple_maps import RENDERED, Spread
from fractal_exp.methods.collage.state import Candidate
from fractal_exp.suite import target

FRAME = Frame(128)


@pytest.mark.parametrize("chance", [0.05, 0.3, 0.9])
def test_counting_errors_have_one_variance_at_every_grey_level(chance):
    counts = torch.distributions.Binomial(256, torch.tensor(chance))
    torch.manual_seed(0)
    assert float(stabilize(counts.sample((20_000,)) / 256, 256).var()) * 4 * 256 == pytest.approx(1, abs=0.1)


def test_the_misfit_of_a_moved_code_is_by_how_many_pixels_it_was_moved():
    fern = attractor.normalize(codes.known("fern"))
    for pixels in ([3.0, -2.0], [-1.0, 4.0]):
        moved = affine.from_code(fern.similar(1, (pixels[0] * 2 / 128, pixels[1] * 2 / 128)))
        misfit = FRAME.misfit(moved, fern.sampling_probabilities())  # the fern is higher than wide
        assert misfit.tolist() == pytest.approx([pixels[1], pixels[1], pixels[0]], abs=0.01)


def test_the_weights_of_a_misfit_are_the_slope_of_its_penalty():
    misfit = torch.tensor([0.3, -1.7, 6.0], dtype=torch.float64)
    _, weights = FRAME.penalty(misfit)
    for k in range(3):
        nudge = 1e-5 * torch.eye(3, dtype=torch.float64)[k]
        slope = (FRAME.penalty(misfit + nudge)[0] - FRAME.penalty(misfit - nudge)[0]) / 2e-5
        assert slope == pytest.approx(float(2 * weights[k] ** 2 * misfit[k]), rel=1e-5)


def test_a_matrix_turns_about_the_mean_of_the_attractor():
    code = attractor.normalize(codes.known("fern"))
    picture = objective(target(code, 32))
    drawn = picture.judge(affine.from_code(code))
    jacobian = FromPoints(picture, drawn, [2], 0)
    mean = torch.tensor(jacobian.mean)
    for parameter, (i, j, _) in enumerate(jacobian.units):
        before, after = drawn.maps[i], jacobian.nudged(parameter, 0.1)[i]
        sent = [one[:4].view(2, 2) @ mean + one[4:] for one in (before, after)]
        assert not torch.equal(before[j], after[j])
        if j < 4:
            torch.testing.assert_close(*sent, atol=1e-6, rtol=0)


def spread(pixel=2 / 256):
    return Spread(torch.tensor([0.2, -0.1]).double(), 0.16 * torch.eye(2).double(), pixel, RENDERED)


@pytest.mark.parametrize(("pixels", "near"), [(0.8 * RENDERED.near_px, True), (0.04, True), (0.1, False)])
def test_a_matrix_is_rounded_if_that_moves_the_attractor_by_a_twentieth_of_a_pixel_at_most(pixels, near):
    one = torch.tensor([0.5, 0.25, 0, 0.5, 0.3, -0.2])
    one[0] += pixels * 2 / 256 / 0.4  # times the attractor's standard deviation: by so many pixels
    found = spread().rounded(one)
    assert (found is not None) == near
    if near:
        torch.testing.assert_close(found[:4], torch.tensor([0.5, 0.25, 0, 0.5]))
        sent = [each[:4].view(2, 2) @ spread().mean.float() + each[4:] for each in (one, found)]
        torch.testing.assert_close(*sent, atol=1e-6, rtol=0)


class Priced:
    """A picture whose error rises by the worth of each map that is gone."""

    params, subpixels = PARAMS, 1

    @staticmethod
    def without(drawn, gone):
        left = [i for i in range(len(drawn.maps)) if i not in gone]
        return SimpleNamespace(maps=drawn.maps[left], error=drawn.error + float(drawn.maps[gone].sum()))


def test_maps_go_that_are_not_worth_their_price():
    def left(price, picture=Priced):
        drawn = SimpleNamespace(maps=torch.tensor([[0.5], [0.09], [0.3], [-0.2], [0.11]]), error=1.0)
        return [round(worth, 2) for worth in pruned(picture, drawn, price).maps.flatten().tolist()]

    assert left(Price(0.1)) == [0.5, 0.3, 0.11]
    assert left(Price(0.0)) == [0.5, 0.09, 0.3, 0.11]
    assert len(left(Price(10.0))) == 2
    assert len(left(Price(10.0), type("Asked", (Priced,), {"params": PARAMS.updated(maps=4)}))) == 4


def test_a_map_that_is_clearly_needed_is_tried_once():
    tried = []

    class Watched(Priced):
        @staticmethod
        def without(drawn, gone):
            tried.append(round(float(drawn.maps[gone[0]]), 2))
            return Priced.without(drawn, gone)

    drawn = SimpleNamespace(maps=torch.tensor([[0.4], [9.0], [0.01], [0.02]]), error=1.0)
    assert [round(worth, 2) for worth in pruned(Watched, drawn, Price(0.1)).maps.flatten().tolist()] == [0.4, 9.0]
    assert tried == [0.4, 9.0, 0.01, 0.02, 0.4, 0.02]   # the third sweep finds no map that may go


def test_a_needless_double_of_a_needed_map_goes():
    class Doubled(Priced):
        @staticmethod
        def without(drawn, gone):
            left = [i for i in range(len(drawn.maps)) if i not in gone]
            return SimpleNamespace(maps=drawn.maps[left], worths=[drawn.worths[i] for i in left],
                                   error=drawn.error + sum(drawn.worths[i] for i in gone))

    drawn = SimpleNamespace(maps=torch.tensor([[1.0], [1.0], [2.0], [3.0]]), worths=[9.0, 0.0, 9.0, 9.0], error=1.0)
    assert pruned(Doubled, drawn, Price(0.1)).worths == [9.0, 9.0, 9.0]


def test_every_step_of_a_search_and_every_seed_tries_something_else():
    masses = torch.rand(32, 32, generator=torch.Generator().manual_seed(0)).square()
    maps = torch.tensor([[0.5, 0, 0, 0.5, 0.3, 0.3], [0.5, 0, 0, 0.5, -0.3, -0.3]])
    bad = Candidate(maps, torch.tensor([0.25, 0.25]), float("inf"))
    few = {"search": {"proposals": 2}, "births": {"count": 12}}
    found = [measure_search(masses, 32, seed, **few).step(bad, number).maps
             for seed, number in ((0, 1), (0, 2), (1, 1), (0, 1))]
    assert torch.equal(found[0], found[3])
    assert not any(a.shape == b.shape and torch.equal(a, b)
                   for a, b in ((found[0], found[1]), (found[0], found[2]), (found[1], found[2])))
