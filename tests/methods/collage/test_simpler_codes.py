"""Simpler codes for one shape: its symmetries, parents of maps, doubles, and maps that nobody sees or needs."""

import pytest
import torch
from collage_helpers import dot_camera, pen_camera
from drawn_helpers import at, triangles

from fractal_exp import codes
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.pens import Dots, Inked
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.simplify import drawn
from fractal_exp.methods.collage.simplify.drawn import simplified_in_every_way
from fractal_exp.methods.collage.simplify.flat import on_their_line
from fractal_exp.methods.collage.simplify.loop import Draft, Price, Proposer, maps_polished, simplified
from fractal_exp.methods.collage.simplify.parents import fewer, parents, uncontained
from fractal_exp.methods.collage.simplify.removal import (
    dropping_unseen,
    without_doubles,
    without_least,
    without_needless,
)
from fractal_exp.methods.collage.simplify.symmetry import least_turned, symmetries
from fractal_exp.methods.collage.state import WeightedMaps

PARAMS, SIDE = CollageParams(), 128
CAMERA, PIXEL = PARAMS.camera, 2 / SIDE
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))
PEN = pen_camera(0.0, 1.0 * PIXEL, 0.5 * PIXEL)
CULCITA, CYCLOSORUS = (attractor.normalize(codes.known(name)) for name in ("culcita", "cyclosorus"))
CANTOR = torch.tensor([[1 / 3, 0, 0, 1 / 3, -0.5, 0], [1 / 3, 0, 0, 1 / 3, 0.5, 0]])  # maps
WORTH = Price(share=0.1)
INK, THICK_INK = dot_camera(0.24, 0.5 * PIXEL), dot_camera(0.15, 0.8 * PIXEL)


def inked(camera=INK, code=CULCITA, **options) -> ImageObjective:
    """Dots of a fern, looked at with this camera."""
    params, image = PARAMS.updated(**options), Dots(CAMERA, torch.zeros(SIDE, SIDE), INK).render(code, SIDE, 0)
    return ImageObjective(image, with_camera(levels_of(image, DRAWN, params.camera), camera), params)


def penned(code, pen=PEN, **options) -> ImageObjective:
    """A drawing with this pen, looked at with this pen."""
    image = Inked(CAMERA, torch.zeros(SIDE, SIDE), pen).render(code, SIDE, 0)
    return ImageObjective(image, with_camera(levels_of(image, DRAWN, CAMERA), pen), PARAMS.updated(**options))


def fitted(judge, code, weights=None, **options) -> Draft:
    """The code as an image with these parameters sees it."""
    judge = ImageObjective(judge.image, judge.levels, judge.params.updated(**options))
    return Draft(judge, judge.judge(code, weights))


def with_fewer(fit: Draft, way=fewer) -> Draft:
    return simplified(fit, [Proposer(way, maps_polished(4))], WORTH)


def without_unseen(fit: Draft) -> Draft:
    return simplified(fit, [dropping_unseen(fit.objective.params)], Price.of_drawn(fit.objective))


def with_compositions() -> WeightedMaps:
    """Another code of the same measure: half of what the largest map f brings is brought by f∘g, for each map g."""
    maps, shares = affine.from_code(CULCITA), CULCITA.probabilities
    largest = int(shares.argmax())
    more = torch.stack([affine.composed(maps[largest], each) for each in maps])
    less = shares.index_fill(0, torch.tensor([largest]), float(shares[largest]) / 2)
    return WeightedMaps(torch.cat([maps, more]), torch.cat([less, shares[largest] / 2 * shares]))


@pytest.fixture
def one_camera(monkeypatch):
    """A code is seen with the camera that is given: to look for others takes most of the time of the simplest one."""
    for name in ("sharpened", "in_turns"):
        monkeypatch.setattr(drawn, name, lambda objective, shown, *_, **__: (objective, shown))


def test_the_symmetries_of_a_triangle_are_found():
    group = symmetries(at(triangles(4)), PARAMS.rounding)
    assert len(group) == 6
    assert torch.equal(group[0][:4], torch.tensor([1.0, 0, 0, 1]))


def test_of_the_codes_of_a_symmetric_shape_the_textbook_has_the_simplest():
    group = symmetries(at(triangles(5)), PARAMS.rounding)
    maps = affine.from_code(GASKET)
    turned = torch.stack([affine.composed(one, group[k]) for one, k in zip(maps, (1, 3, 5), strict=True)])
    assert not torch.allclose(turned, maps, atol=0.01)
    assert torch.allclose(least_turned(turned, group), maps, atol=0.02)


def test_a_map_takes_the_place_of_its_compositions():
    dragon = attractor.normalize(codes.known("heighway_dragon"))
    first, second = affine.from_code(dragon)
    parts = torch.stack([first, affine.composed(second, first), affine.composed(second, second)])
    judge = penned(dragon, pen_camera(0.0, 0.5 * PIXEL, 0.0))
    best = min((each.shown for each in parents(fitted(judge, parts))), key=lambda each: each.error)
    assert sorted(best.maps.tolist()) == [pytest.approx(each, abs=1e-4) for each in sorted([first.tolist(),
                                                                                            second.tolist()])]


def test_doubles_are_one_map_with_both_weights():
    maps = affine.from_code(GASKET)
    doubled = torch.cat([maps, maps[:1] + 0.3 * PIXEL * torch.tensor([0, 0, 0, 0, 1.0, 1])])
    found = without_doubles(WeightedMaps(doubled, torch.tensor([.3, .3, .3, .1])), PARAMS, SIDE, 0)
    assert torch.equal(found.maps, maps)
    assert found.weights.tolist() == pytest.approx([.4, .3, .3])
    assert without_doubles(found, PARAMS, SIDE, 0) is found


def test_a_map_must_lower_the_error_by_its_price():
    assert Price(0.1).score(1.0, 3) == pytest.approx(1.3)
    assert WORTH.score(1.0, 2) == pytest.approx(1.21)
    assert WORTH.score(1.05, 2) < WORTH.score(1.0, 3) < WORTH.score(1.2, 2)
    assert Price(noise=0.5).score(0.1, 3) == Price(noise=0.5).score(0.4, 2) == 0.5


def test_what_maps_do_across_a_line_does_not_keep_their_parent_from_being_found():
    """Cantor's set: f1, and what f2 makes of f1 and of itself, each with something else across the line."""
    first, second = torch.tensor([[1 / 3, 0, 0, 1 / 3, -0.5, 0], [1 / 3, 0, 0, 1 / 3, 0.5, 0]])
    cantor = affine.to_code(torch.stack([first, second]))
    parts = torch.stack([first, affine.composed(second, first), affine.composed(second, second)])
    parts[:, [1, 3]] = torch.tensor([[0.7, 0.1], [-0.4, 0.9], [-0.4, 0.3]])  # what y does cannot be seen
    found = with_fewer(fitted(penned(cantor, pen_camera(0.0, PIXEL, 0.0)), parts)).shown
    assert len(found.maps) == 2
    lines = found.maps[:, [0, 4]].abs()  # a set that is its own mirror image: either sign
    assert torch.allclose(lines, torch.tensor([[1 / 3, 0.5]]).expand(2, 2), atol=0.01)


def test_maps_of_a_shape_that_is_no_line_stay():
    maps = affine.from_code(GASKET)
    assert on_their_line(maps, torch.full((3,), 1 / 3), PIXEL) is maps
    thick = torch.tensor([[0.3, 0, 0, 0.95, x, y] for x in (-0.5, 0.5) for y in (-0.02, 0.02)])
    std = 0.02 / (1 - 0.95**2) ** 0.5  # of y: what 0.95 leaves of it, and the offset
    assert on_their_line(thick, torch.ones(4), 0.99 * std) is thick
    assert on_their_line(thick, torch.ones(4), 1.01 * std) is not thick
    rare = torch.tensor([1.0, 3, 1, 3])  # the offsets of y have a standard deviation of sqrt(3) / 2 times 0.02
    assert on_their_line(thick, rare, 0.99 * 0.75**0.5 * std) is thick
    assert on_their_line(thick, rare, 1.01 * 0.75**0.5 * std) is not thick


def test_an_attractor_on_a_line_is_known_though_points_take_long_to_reach_it():
    """Cantor's set on the line y = 0.1 + 0.2 x, whose maps are near isometries across it."""
    across = torch.tensor([0.99, -0.98])
    maps = torch.tensor([[1 / 3, 0, 0, 0, -0.5, 0], [1 / 3, 0, 0, 0, 0.5, 0]])
    maps[:, 2], maps[:, 3], maps[:, 5] = 0.2 * (1 / 3 - across), across, 0.1 * (1 - across) + 0.2 * maps[:, 4]
    found = on_their_line(maps, torch.tensor([0.7, 0.3]), PIXEL / 100)
    assert torch.allclose(found[:, :4], torch.tensor([1 / 3, 0, 0, 1 / 3]).expand(2, 4), atol=1e-5)
    x = torch.linspace(-0.75, 0.75, 7)
    line = torch.stack([x, 0.1 + 0.2 * x], 1)
    for one, new in zip(maps, found, strict=True):
        assert torch.allclose(line @ new[:4].view(2, 2).T + new[4:], line @ one[:4].view(2, 2).T + one[4:], atol=1e-5)


def test_a_map_that_nobody_sees_is_left_out_and_those_of_the_code_stay():
    maps = affine.from_code(GASKET)
    tiny = torch.tensor([[.02, 0, 0, .02, *maps[0, 4:]]])  # within the image of the first
    judge, every = penned(GASKET, pen_camera(0.0, 0.5 * PIXEL, 0.0)), torch.cat([maps, tiny])
    found = without_unseen(fitted(judge, every)).shown
    assert len(found.maps) == 3
    assert torch.allclose(found.maps, maps, atol=PIXEL)
    assert len(without_unseen(fitted(judge, every, maps=4)).shown.maps) == 4


def test_maps_within_the_image_of_a_larger_one_give_it_their_weights():
    judge, many = inked(), with_compositions()
    fit = fitted(judge, many.maps, many.weights)
    (found,) = uncontained(fit)
    assert torch.equal(found.shown.maps, affine.from_code(CULCITA))
    assert torch.allclose(found.shown.probabilities, CULCITA.probabilities)
    asked = [list(uncontained(fitted(judge, many.maps, many.weights, maps=count))) for count in (6, 8)]
    assert [len(each.shown.maps) for each in asked[0]] == [6] and not asked[1] and not list(uncontained(found))
    (tied,) = uncontained(fitted(judge, many.maps))
    assert tied.shown.weights is None
    assert len(with_fewer(fit, uncontained).shown.maps) == 4


def test_maps_whose_absence_the_camera_makes_up_for_are_needless():
    judge, many = inked(THICK_INK), with_compositions()
    fit = fitted(judge, many.maps, many.weights)
    assert len(without_unseen(fit).shown.maps) > 4, "with this camera, the code without them looks worse"
    found = without_needless(fit, uncontained, without_least)
    assert torch.allclose(found.shown.maps, affine.from_code(CULCITA), atol=PIXEL)
    assert found.shown.error < 0.02 * fit.shown.error and found.objective.levels is found.shown.levels
    assert found.objective.levels.camera.gain == pytest.approx(INK.gain, rel=0.1)
    assert without_needless(found, uncontained, without_least) is found, "all are needed"
    assert len(without_needless(fit, uncontained).shown.maps) == 4
    for options in {"maps": 8}, {"simplify": {"needless": None}}:
        kept = fitted(judge, many.maps, many.weights, **options)
        assert without_needless(kept, uncontained, without_least) is kept


@pytest.mark.parametrize("camera", [pytest.param(INK, marks=pytest.mark.slow), THICK_INK])
def test_a_map_that_is_hardly_seen_stays(camera):
    judge = inked(camera, CYCLOSORUS)
    code = affine.from_code(CYCLOSORUS), CYCLOSORUS.probabilities
    fit, loose = fitted(judge, *code), fitted(judge, *code, simplify={"needless": 0.002})
    assert without_needless(fit, uncontained, without_least) is fit
    assert len(without_needless(loose, uncontained, without_least).shown.maps) == 3, "the stem"


def test_single_maps_are_needless_too():
    judge, many = inked(THICK_INK), with_compositions()
    fit = fitted(judge, many.maps, many.weights)
    least = len(without_unseen(fit).shown.maps) - 1
    found = without_needless(fitted(judge, many.maps, many.weights, maps=least), without_least)
    assert len(found.shown.maps) == least
    assert found.shown.error <= 1.5 * fit.shown.error and found.objective.likeness_of(found.shown) > 0.99


@pytest.mark.usefixtures("one_camera")
def test_two_maps_that_a_symmetry_makes_one_are_one():
    maps = affine.from_code(GASKET)
    mirror = torch.tensor([-1.0, 0, 0, 1, 0, 0])              # of the triangle, about its axis
    doubled = torch.cat([maps, affine.composed(maps[2], mirror)[None] + 0.2 * PIXEL * torch.eye(6)[5]])
    # nothing else leaves maps out
    only = {"simplify": {"parent_maps": 0, "unseen": None, "needless": None}, "moves": {"pruning": False}}
    found = simplified_in_every_way(fitted(penned(GASKET), doubled, **only)).shown
    assert len(found.maps) == 3
    assert torch.allclose(found.maps[:, :4], torch.tensor([0.5, 0, 0, 0.5]).expand(3, 4), atol=0.01)


@pytest.mark.usefixtures("one_camera")
def test_a_number_of_maps_that_was_asked_for_stays():
    maps = affine.from_code(GASKET)
    doubled = torch.cat([maps, maps[:1]])
    assert len(simplified_in_every_way(fitted(penned(GASKET), doubled, maps=4)).shown.maps) == 4


def simplest_of(picture, code, pen_px):
    """The simplest code of a picture, which is first looked at with this pen."""
    levels = with_camera(levels_of(picture, DRAWN, CAMERA), pen_camera(0.0, pen_px * PIXEL, 0.0))
    judge = ImageObjective(picture, levels, PARAMS)
    return simplified_in_every_way(fitted(judge, code, rounding={"matrices": False})).shown.maps


@pytest.mark.slow
def test_a_shape_on_a_line_ends_as_similarities_though_its_maps_drew_the_pen():
    """Cantor's set as bars, by maps that take long to reach its line: so long that the thinner pen seems right."""
    near = torch.tensor([[1 / 3, 0.1, 0, 0.93, -0.5, 0], [1 / 3, -0.1, 0, 0.96, 0.5, 0]])
    picture = Inked(CAMERA, None, pen_camera(0.0, 2 * PIXEL, 0.0)).render(affine.to_code(CANTOR), SIDE, 0)
    assert torch.allclose(simplest_of(picture, near, pen_px=1).abs(), CANTOR.abs(), atol=0.01)


@pytest.mark.usefixtures("one_camera")
def test_the_simplest_code_has_no_needless_maps():
    many, judge = with_compositions(), inked(THICK_INK)
    only = {"simplify": {"parent_maps": 0}, "moves": {"pruning": False}, "rounding": {"matrices": False}}
    assert len(simplified_in_every_way(fitted(judge, many.maps, many.weights, **only)).shown.maps) == 4
