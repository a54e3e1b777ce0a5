"""Pavings of pictures of no code, and the descent of all their maps."""

from dataclasses import replace

import pytest
import torch
from growth_helpers import BRANCH, clouds, grower, stage, target_of

from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.kinds import with_camera
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.pens import Dots
from fractal_exp.cameras.points import attractor_points, counted
from fractal_exp.evaluation.inside import ssim_inside
from fractal_exp.ifs import affine
from fractal_exp.ifs.canvas import canvas_to_pixel
from fractal_exp.images.known import Known
from fractal_exp.methods.collage.growth.adjoint import Adjoint
from fractal_exp.methods.collage.growth.descent import descended
from fractal_exp.methods.collage.growth.exposed import WHITEST, Exposed
from fractal_exp.methods.collage.growth.inside import InsideSsim
from fractal_exp.methods.collage.growth.paving import paving
from fractal_exp.methods.collage.growth.turns import closer, turned
from fractal_exp.ops.collage import pushforward
from fractal_exp.ops.filters import filtered
from fractal_exp.runtime.deadline import Deadline
from fractal_exp.runtime.seeds import generator


@pytest.mark.parametrize(("levels", "whole"), [("density", 50e6 / 1024**2 / 256), ("linear", 0.3)])
def test_a_pixel_of_mass_m_shows_what_its_levels_say(levels, whole):
    image = torch.full((32, 32), 0.3)
    seen = target_of(image, levels)
    torch.testing.assert_close(seen.curve.grey(seen.masses), image)
    assert seen.mass == pytest.approx(whole * 32**2, rel=1e-4)


def test_points_of_a_picture_are_where_its_masses_are():
    image = torch.zeros(32, 32)
    image[4, 20], image[25, 3] = 0.9, 0.5
    seen = target_of(image, "density")
    points = seen.points(4000, generator(0))
    share = float((points[:, 1] > 0).float().mean())
    assert share == pytest.approx(float(seen.masses[4, 20] / seen.masses.sum()), abs=1e-3)
    row, column = canvas_to_pixel(points, 32).long().unbind(1)
    assert set(zip(row.tolist(), column.tolist(), strict=True)) == {(4, 20), (25, 3)}


def test_ssim_inside_is_that_of_the_likeness_and_so_is_its_slope():
    g = torch.Generator().manual_seed(0)
    picture = clouds(48)
    shown = (picture + 0.1 * torch.randn(48, 48, generator=g)).clamp(0, 1)
    part = InsideSsim(picture, torch.ones_like(picture))
    slope, count = part.slope(shown), int(part.inside.sum())
    step = 1e-3 * slope / slope.norm()
    rise = ssim_inside(shown + step, picture) - ssim_inside(shown - step, picture)
    assert rise * count == pytest.approx(2 * float((slope * step).sum()), rel=0.01)


def test_a_paving_gives_each_cell_its_mass_and_no_map_expands():
    mask = torch.zeros(64, 64)
    mask[32, 4:60] = 1
    mask[28:37, 54:63] = 1                                # its shorter axis is longer than that of the whole
    found = paving(target_of(mask), 3)
    assert float(affine.largest_singular(found.maps).max()) == pytest.approx(0.95, abs=1e-5)
    assert float(found.weights.sum()) == pytest.approx(1)
    few = torch.zeros(32, 32)
    few[10, 10] = few[20, 12] = few[20, 13] = 1           # fewer pixels than maps
    found = paving(target_of(few), 5)
    assert found.maps.shape == (5, 6) and bool(found.maps.isfinite().all())


@pytest.mark.parametrize(("image", "count"), [(BRANCH, 12), (clouds(), 24)], ids=["lines", "grey"])
def test_the_more_maps_the_more_alike_and_the_descent_beats_the_paving(image, count):
    some = grower(image, steps=300)
    paved, few, many = some.plain(count), some.grown(count // 2), some.grown(count)
    assert max(few.likeness, paved.likeness) < many.likeness - 0.03
    assert many.camera.kind == "dots" and len(many.maps) == count


def test_maps_of_a_known_exposure_keep_its_mass_and_others_find_one():
    known, other = target_of(clouds(), "density"), target_of(clouds())
    for seen in (known, other):
        found, mass = descended(paving(seen, 8), seen, 100, 0)
        assert float(found.weights.sum()) == pytest.approx(1)
        dots = Dots(CameraParams(), clouds(), Camera("dots", gain=mass / 96**2, blur=0.7 * 2 / 96))
        drawn = dots.render(found.code, 96, 0)
        if seen is other:
            assert float(drawn.mean()) == pytest.approx(float(clouds().mean()), rel=0.3)
        else:
            assert mass == known.mass


def test_the_mass_of_a_white_shape_does_not_run_away(monkeypatch):
    seen = Exposed(torch.nn.functional.pad(torch.ones(48, 48), (8, 8, 8, 8)))
    assert float(seen.slope(torch.tensor(50.0))) == pytest.approx(1 - WHITEST, rel=1e-3)
    start = paving(seen, 8)
    _, held = descended(start, seen, 300, 0)
    monkeypatch.setattr(Exposed, "slope", lambda seen, masses: seen.curve.slope(masses))
    _, free = descended(start, seen, 300, 0)
    assert held < 0.8 * free


def test_maps_of_a_tone_curve_are_grown_through_it():
    """The same masses, seen through a gamma of 3: growth reads them, and draws what is seen."""
    curved = clouds() ** (1 / 3)
    some = stage(curved, levels="tonemapped", growth={"steps": 300}, camera={"gamma": 3.0}).grower
    torch.testing.assert_close(some.target.masses, target_of(clouds()).masses, rtol=1e-3, atol=1e-4)
    grown = some.grown(24)
    assert grown.camera.kind == "tonemapped" and grown.camera.gamma == 3.0
    drawn = with_camera(some.levels, grown.camera).render(grown.code, len(curved), 0)
    assert float((drawn - curved).square().mean()) < 0.02


def test_a_known_gain_fixes_the_mass_of_grown_maps():
    some = stage(clouds(), camera={"gain": 0.5}).grower
    assert some.target.mass == 0.5 * 96**2 and some.grown(8).camera.gain == 0.5


def test_the_adjoint_gives_the_gradient_of_the_invariant_measure():
    """Of a smooth function's mean, by each number of the maps: beside that by differences of chaos games."""
    side, weights = 64, torch.tensor([0.3, 0.3, 0.2, 0.2])
    maps = torch.tensor([[0.5, 0.1, -0.1, 0.5, x, y] for x in (-0.4, 0.4) for y in (-0.4, 0.4)])   # of a square
    y, x = torch.meshgrid(*2 * [(torch.arange(side) + 0.5) / side * 2 - 1], indexing="ij")
    cost = torch.sin(2 * x) + torch.cos(2 * y)

    def mean(maps):
        x, y = attractor_points(maps, weights, 400_000, 1).double().unbind(1)
        return float((torch.sin(2 * x) + torch.cos(2 * y)).mean())

    adjoint, points = Adjoint(side), attractor_points(maps, weights, 20_000, 2)
    shares = torch.full((len(points), 1), 1 / len(points))
    for _ in range(100):
        moved, samples = maps.clone().requires_grad_(), torch.cat([points, shares], 1).requires_grad_()
        with torch.enable_grad():
            drawn = pushforward(moved[None], weights[None], samples, side)[0]
        drawn.backward(cost + adjoint.echo())
        adjoint.learn(points, samples.grad[:, 2])
    steps = 0.01 * torch.eye(24).view(24, 4, 6)
    true = torch.tensor([(mean(maps + step) - mean(maps - step)) / 0.02 for step in steps])
    still = torch.autograd.grad((pushforward(maps.requires_grad_()[None], weights[None], samples.detach(), side)[0]
                                 * cost).sum(), maps)[0].flatten()
    error, without = ((each - true).norm() / true.norm() for each in (moved.grad.flatten(), still))
    assert error < 0.13 < 0.4 < without


def test_a_descent_follows_the_measure_that_its_maps_make(monkeypatch):
    """The drawing of few maps is nearer to the picture than where their own measure counts as one that stands still."""
    seen, start = target_of(clouds()), paving(target_of(clouds()), 6)

    def error():
        shown = 1 - (-drawing(descended(start, seen, 300, 3), 96)).exp()
        return float((shown - clouds()).square().mean())

    followed = error()
    monkeypatch.setattr(Adjoint, "echo", lambda self: torch.zeros(self.side, self.side))
    assert followed < 0.9 * error()


def test_a_turned_copy_has_the_covariance_that_it_had():
    points = torch.randn(500, 2, generator=generator(1)) @ torch.tensor([[0.5, 0.2], [0, 0.1]])
    points = points - points.mean(0)
    linear = torch.tensor([[0.3, 0.1, -0.2, 0.2]]).repeat(20, 1)
    images, others = (points @ each.unflatten(1, (2, 2)).mT for each in (linear, turned(linear, points, generator(2))))
    torch.testing.assert_close(others.mT @ others, images.mT @ images, rtol=1e-3, atol=1e-4)
    assert len({round(float(each), 3) for each in others[:, 0, 0]}) > 10


@pytest.mark.parametrize("at", [(0.3, -0.2), (-0.97, 0.9)], ids=["inside", "at the edge"])
def test_a_copy_is_turned_if_the_collage_is_closer_then_and_no_wide_copy_is(at):
    g, blur, mass = generator(1), (0.25, 0.5, 0.25), torch.tensor([20.0, 30.0])
    wedge = torch.rand(2000, 2, generator=g) ** torch.tensor([1.0, 3.0])
    samples = torch.cat([wedge - wedge.mean(0), torch.full((2000, 1), 1 / 2000)], 1)
    right = torch.tensor([[0.2, 0, 0, 0.2, *at], [0.1, 0, 0, 0.3, 0.3, -0.1]])
    wrong = torch.cat([right[:, :4] * torch.tensor([[-1.0], [1.0]]), right[:, 4:]], 1)

    def drawn(maps):
        return filtered(pushforward(maps[None], mass[None], samples, 160)[0], blur)

    seen = Exposed(1 - (-drawn(right)).exp())
    assert closer(right, wrong, mass, samples, drawn(wrong), seen, blur).tolist() == [True, False]
    assert closer(wrong, right, mass, samples, drawn(right), seen, blur).tolist() == [False, False]
    wide = torch.cat([8 * right[:, :4], right[:, 4:]], 1)
    assert not closer(right, wide, mass, samples, drawn(wide), seen, blur)[0]


def test_a_descent_with_turns_comes_closer(monkeypatch):
    seen, start = target_of(clouds()), paving(target_of(clouds()), 12)

    def error():
        shown = 1 - (-drawing(descended(start, seen, 300, 3), 96)).exp()
        return float((shown - clouds()).square().mean())

    with_turns = error()
    monkeypatch.setattr("fractal_exp.methods.collage.growth.descent.TURNED_UNTIL", 0)
    assert with_turns < 0.95 * error()


def test_a_descent_that_begins_late_goes_through_all_of_its_phases():
    seen, start = target_of(clouds()), paving(target_of(clouds()), 8)
    late = Deadline(10, clock=iter([0.0, *[6.0] * 1000]).__next__)
    assert late.used == 0.6
    assert torch.equal(descended(start, seen, 40, 3, late)[0].maps, descended(start, seen, 40, 3)[0].maps)


def test_what_lies_beyond_the_part_that_is_shown_counts_in_no_error():
    image, known = clouds(), Known(-1, -1, 1, 0.25)
    cut = image * known.mask(len(image))
    part, whole = (replace(target_of(cut), known=each) for each in (known, None))
    start = paving(target_of(image), 24)
    beyond = ~known.mask(len(image))
    drawn = [drawing(descended(start, each, 300, 3), len(image))[beyond].mean() for each in (part, whole)]
    assert drawn[0] > 2 * drawn[1], "what is drawn beyond is taken away only where the picture says that it is empty"


def test_an_exposure_that_is_known_is_kept_where_a_picture_is_cut_off():
    dots = Dots(CameraParams(gain=0.5), clouds()).within(Known(-1, -1, 1, 0.25))
    assert Exposed.of(clouds(), dots).mass == dots.whole_mass(96) > 0


def drawing(found, side):
    """The masses (R,R) of maps and the mass of their drawing."""
    maps, mass = found
    return counted(maps.code, side, 200_000, seed=1) * (mass / 200_000)
