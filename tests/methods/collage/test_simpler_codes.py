"""Simpler codes for one shape: its symmetries, parents of maps, doubles, and maps that nobody sees or needs."""

import pytest
import torch
from collage_helpers import dot_camera, pen_camera
from drawn_helpers import at, triangles

from fractal_exp import codes
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.pens import Dots, Drawn
from fractal_exp.cameras.points import attractor_points
from fractal_exp.ifs import attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.simplify import needless, parents
from fractal_exp.methods.collage.simplify.flat import on_their_line
from fractal_exp.methods.collage.simplify.likeness import likeness_of, without_unseen
from fractal_exp.methods.collage.simplify.needless import without_needless
from fractal_exp.methods.collage.simplify.parents import with_fewer_maps, with_parents, without_contained
from fractal_exp.methods.collage.simplify.pruning import Price, without_doubles
from fractal_exp.methods.collage.simplify.symmetry import simplest, symmetries
from fractal_exp.methods.collage.stages import drawn as last_stages
from fractal_exp.methods.collage.stages.drawn import DrawnLastDigits
from fractal_exp.methods.collage.stages.problem import SearchProblem

PARAMS, SIDE = CollageParams(), 128
CAMERA, PIXEL = PARAMS.camera, 2 / SIDE
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))
PEN = pen_camera(0.0, 1.0 * PIXEL, 0.5 * PIXEL)
CULCITA, CYCLOSORUS = (attractor.normalize(codes.known(name)) for name in ("culcita", "cyclosorus"))
CANTOR = torch.tensor([[1 / 3, 0, 0, 1 / 3, -0.5, 0], [1 / 3, 0, 0, 1 / 3, 0.5, 0]])  # maps
INK, THICK_INK = dot_camera(0.24, 0.5 * PIXEL), dot_camera(0.15, 0.8 * PIXEL)


def inked(camera=INK, code=CULCITA, **options) -> ImageObjective:
    """Dots of a fern, looked at with this camera."""
    params, image = PARAMS.updated(**options), Dots(CAMERA, torch.zeros(SIDE, SIDE), INK).render(code, SIDE, 0)
    return ImageObjective(image, Dots(params.camera, image, camera), params)


def with_compositions() -> affine.WeightedMaps:
    """Another code of the same measure: half of what the largest map f brings is brought by f∘g, for each map g."""
    maps, shares = affine.from_code(CULCITA), CULCITA.probabilities
    largest = int(shares.argmax())
    more = torch.stack([affine.composed(maps[largest], each) for each in maps])
    less = shares.index_fill(0, torch.tensor([largest]), float(shares[largest]) / 2)
    return affine.WeightedMaps(torch.cat([maps, more]), torch.cat([less, shares[largest] / 2 * shares]))


def test_the_symmetries_of_a_triangle_are_found():
    group = symmetries(at(triangles(4)), PARAMS.canonical)
    assert len(group) == 6
    assert torch.equal(group[0][:4], torch.tensor([1.0, 0, 0, 1]))


def test_of_the_codes_of_a_symmetric_shape_the_textbook_has_the_simplest():
    group = symmetries(at(triangles(5)), PARAMS.canonical)
    maps = affine.from_code(GASKET)
    turned = torch.stack([affine.composed(one, group[k]) for one, k in zip(maps, (1, 3, 5), strict=True)])
    assert not torch.allclose(turned, maps, atol=0.01)
    assert torch.allclose(simplest(turned, group, PARAMS.canonical), maps, atol=0.02)


def test_a_map_takes_the_place_of_its_compositions():
    dragon = attractor.normalize(codes.known("heighway_dragon"))
    first, second = affine.from_code(dragon)
    parts = torch.stack([first, affine.composed(second, first), affine.composed(second, second)])
    image = Drawn(CAMERA, torch.zeros(SIDE, SIDE), pen_camera(0.0, 0.5 * PIXEL, 0.0)).render(dragon, SIDE, 0)
    levels = Drawn(CAMERA, image, pen_camera(0.0, 0.5 * PIXEL, 0.0))
    judge = ImageObjective(image, levels, PARAMS)
    best = min(with_parents(judge, judge.judge(parts)), key=lambda each: each.error)
    assert sorted(best.maps.tolist()) == [pytest.approx(each, abs=1e-4) for each in sorted([first.tolist(),
                                                                                            second.tolist()])]


def test_doubles_are_one_map_with_both_weights():
    maps = affine.from_code(GASKET)
    doubled = torch.cat([maps, maps[:1] + 0.3 * PIXEL * torch.tensor([0, 0, 0, 0, 1.0, 1])])
    points = attractor_points(maps, torch.full((3,), 1 / 3), 2000, 0)
    kept, weights = without_doubles(doubled, torch.tensor([.3, .3, .3, .1]), points, 2 * PIXEL)
    assert torch.equal(kept, maps)
    assert weights.tolist() == pytest.approx([.4, .3, .3])


def test_a_map_must_lower_the_error_by_its_price():
    assert Price(0.1).score(1.0, 3) == pytest.approx(1.3)
    assert Price(0.0, 0.1).score(1.0, 2) == pytest.approx(1.21)
    assert Price(0.0, 0.1).spares(1.05, 1.0) and not Price(0.0, 0.1).spares(1.2, 1.0)


def test_what_maps_do_across_a_line_does_not_keep_their_parent_from_being_found():
    """Cantor's set: f1, and what f2 makes of f1 and of itself, each with something else across the line."""
    first, second = torch.tensor([[1 / 3, 0, 0, 1 / 3, -0.5, 0], [1 / 3, 0, 0, 1 / 3, 0.5, 0]])
    cantor = affine.to_code(torch.stack([first, second]))
    parts = torch.stack([first, affine.composed(second, first), affine.composed(second, second)])
    parts[:, [1, 3]] = torch.tensor([[0.7, 0.1], [-0.4, 0.9], [-0.4, 0.3]])  # what y does cannot be seen
    image = Drawn(CAMERA, torch.zeros(SIDE, SIDE), pen_camera(0.0, PIXEL, 0.0)).render(cantor, SIDE, 0)
    judge = ImageObjective(image, Drawn(CAMERA, image, pen_camera(0.0, PIXEL, 0.0)), PARAMS)
    fewer = with_fewer_maps(judge, judge.judge(parts), Price(0.0, 0.1), 4)
    assert len(fewer.maps) == 2
    lines = fewer.maps[:, [0, 4]].abs()  # a set that is its own mirror image: either sign
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
    pen = pen_camera(0.0, 0.5 * PIXEL, 0.0)
    image = Drawn(CAMERA, torch.zeros(SIDE, SIDE), pen).render(GASKET, SIDE, 0)
    judge = ImageObjective(image, Drawn(CAMERA, image, pen), PARAMS)
    shown = judge.judge(torch.cat([maps, tiny]))
    found = without_unseen(judge, shown, 0)
    assert len(found.maps) == 3
    assert torch.allclose(found.maps, maps, atol=PIXEL)
    assert len(without_unseen(judge, shown, 4).maps) == 4
    none = PARAMS.updated(canonical={"drawn_worse": 0.1, "drawn_noise": 0})
    exact = ImageObjective(image, Drawn(CAMERA, image, pen), none)
    assert len(without_unseen(exact, exact.judge(shown.maps), 0).maps) == 4, "no code has a tenth of the error"
    rough = ImageObjective(image, Drawn(CAMERA, image, pen), PARAMS.updated(canonical={"drawn_worse": 0.1}))
    assert len(without_unseen(rough, rough.judge(shown.maps), 0).maps) == 3, "less than the noise of a picture"


def test_maps_within_the_image_of_a_larger_one_give_it_their_weights(monkeypatch):
    judge, many = inked(), with_compositions()
    shown = judge.judge(many.maps, many.weights)
    found = without_contained(judge, shown, 2)
    assert torch.equal(found.maps, affine.from_code(CULCITA))
    assert torch.allclose(found.probabilities, CULCITA.probabilities)
    assert [len(without_contained(judge, shown, least).maps) for least in (6, 8)] == [6, 8]
    assert without_contained(judge, found, 2) is found
    tied = judge.judge(many.maps)
    assert without_contained(judge, tied, 2).weights is None
    monkeypatch.setattr(parents, "with_parents", lambda *_: [])
    assert len(with_fewer_maps(judge, shown, Price(0.0, 0.1), 4).maps) == 4
    assert with_fewer_maps(inked(moves={"needless": None}), shown, Price(0.0, 0.1), 4) is shown


def test_maps_whose_absence_the_camera_makes_up_for_are_needless():
    judge, many = inked(THICK_INK), with_compositions()
    seen = judge, judge.judge(many.maps, many.weights)
    assert len(without_unseen(*seen, 0).maps) > 4, "with this camera, the code without them looks worse"
    objective, found = without_needless(seen, 0)
    assert torch.allclose(found.maps, affine.from_code(CULCITA), atol=PIXEL)
    assert found.error < 0.02 * seen[1].error and objective.levels is found.levels
    assert objective.levels.camera.gain == pytest.approx(INK.gain, rel=0.1)
    assert len(without_needless(seen, 8)[1].maps) == 8
    assert without_needless((objective, found), 0)[1] is found, "all are needed"
    assert len(without_needless(seen, 0, contained=True)[1].maps) == 4
    kept = inked(THICK_INK, moves={"needless": None})
    assert len(without_needless((kept, seen[1]), 0)[1].maps) == 8


@pytest.mark.parametrize("camera", [INK, THICK_INK])
def test_a_map_that_is_hardly_seen_stays(camera):
    judge = inked(camera, CYCLOSORUS)
    shown = judge.judge(affine.from_code(CYCLOSORUS), CYCLOSORUS.probabilities)
    assert without_needless((judge, shown), 0)[1] is shown
    loose = inked(camera, CYCLOSORUS, moves={"needless": 0.002})
    assert len(without_needless((loose, shown), 0)[1].maps) == 3, "the stem"


def test_single_maps_are_needless_too(monkeypatch):
    monkeypatch.setattr(needless, "without_contained", lambda judge, shown, least: shown)
    judge, many = inked(THICK_INK), with_compositions()
    seen = judge, judge.judge(many.maps, many.weights)
    least = len(without_unseen(*seen, 0).maps) - 1
    objective, found = without_needless(seen, least)
    assert len(found.maps) == least
    assert found.error <= 1.5 * seen[1].error and likeness_of(found, objective) > 0.99


def test_two_maps_that_a_symmetry_makes_one_are_one():
    maps = affine.from_code(GASKET)
    mirror = torch.tensor([-1.0, 0, 0, 1, 0, 0])              # of the triangle, about its axis
    doubled = torch.cat([maps, affine.composed(maps[2], mirror)[None] + 0.2 * PIXEL * torch.eye(6)[5]])
    levels, params = Drawn(CAMERA, Drawn(CAMERA, None, PEN).render(GASKET, SIDE, 0)), PARAMS.updated(
        moves={"parent_maps": 0, "pruning": False, "unseen": None})  # nothing else leaves maps out
    stage = DrawnLastDigits(SearchProblem(levels.picture, levels, params))
    stage.objective = ImageObjective(levels.picture, Drawn(CAMERA, levels.picture, PEN), params)
    found = stage._rounded(stage.objective.judge(doubled))
    assert len(found.maps) == 3
    assert torch.allclose(found.maps[:, :4], torch.tensor([0.5, 0, 0, 0.5]).expand(3, 4), atol=0.01)


def test_a_number_of_maps_that_was_asked_for_stays():
    maps = affine.from_code(GASKET)
    doubled = torch.cat([maps, maps[:1]])
    asked = PARAMS.updated(maps=4)
    levels = Drawn(CAMERA, Drawn(CAMERA, None, PEN).render(GASKET, SIDE, 0))
    stage = DrawnLastDigits(SearchProblem(levels.picture, levels, asked))
    stage.objective = ImageObjective(levels.picture, Drawn(CAMERA, levels.picture, PEN), asked)
    assert len(stage._rounded(stage.objective.judge(doubled)).maps) == 4


def last_stage(picture, pen_px):
    """The last stage, which sees codes with this pen."""
    params = PARAMS.updated(canonical={"matrices": False})
    levels = levels_of(picture, DRAWN, CAMERA)
    stage = DrawnLastDigits(SearchProblem(picture, levels, params))
    seen = with_camera(levels, pen_camera(0.0, pen_px * PIXEL, 0.0))
    stage.objective = ImageObjective(picture, seen, params)
    return stage


def last_digits(picture, code, pen_px):
    """What the last stage makes of a code."""
    stage = last_stage(picture, pen_px)
    return stage._rounded(stage.objective.judge(code)).maps


def test_a_shape_on_a_line_ends_as_similarities_though_its_maps_drew_the_pen():
    """Cantor's set as bars, by maps that take long to reach its line: so long that the thinner pen seems right."""
    near = torch.tensor([[1 / 3, 0.1, 0, 0.93, -0.5, 0], [1 / 3, -0.1, 0, 0.96, 0.5, 0]])
    picture = Drawn(CAMERA, None, pen_camera(0.0, 2 * PIXEL, 0.0)).render(affine.to_code(CANTOR), SIDE, 0)
    assert torch.allclose(last_digits(picture, near, pen_px=1).abs(), CANTOR.abs(), atol=0.01)


def test_what_the_polish_does_across_a_line_is_undone(monkeypatch):
    bent = CANTOR + torch.tensor([0, 0.1, 0, 0.2, 0, 0])  # the same along the line
    monkeypatch.setattr(last_stages, "sharpened", lambda judge, found, deadline: (judge, judge.judge(bent)))
    picture = Drawn(CAMERA, None, pen_camera(0.0, PIXEL, 0.0)).render(affine.to_code(CANTOR), SIDE, 0)
    stage = last_stage(picture, pen_px=1)
    _, found = stage._on_line((stage.objective, stage.objective.judge(bent)))
    assert torch.allclose(found.maps, CANTOR, atol=0.001)


def test_a_curve_that_is_nearly_a_line_keeps_its_maps():
    """Two maps, each of which turns half of the curve a little, up and down again."""
    rise = 0.0125
    curve = torch.tensor([[0.5, -rise, rise, 0.5, -0.375, 0], [0.5, rise, -rise, 0.5, 0.375, 0]])
    picture = Drawn(CAMERA, None, pen_camera(0.0, PIXEL, 0.0)).render(affine.to_code(curve), SIDE, 0)
    assert torch.allclose(last_digits(picture, curve, pen_px=1), curve, atol=1e-3)


def test_parents_are_found_though_points_take_long_to_reach_a_line():
    """Cantor's set: f1, and what f2 makes of f1 and of itself. The maps hardly contract across the line."""
    first, second = torch.tensor([[1 / 3, 0.1, 0, 0.99, -0.5, 0], [1 / 3, -0.1, 0, 0.99, 0.5, 0]])
    parts = torch.stack([first, affine.composed(second, first), affine.composed(second, second)])
    picture = Drawn(CAMERA, None, PEN).render(affine.to_code(CANTOR), SIDE, 0)
    judge = ImageObjective(picture, Drawn(CAMERA, picture, PEN), PARAMS)
    assert any(len(each.maps) == 2 for each in with_parents(judge, judge.judge(parts)))


@pytest.mark.parametrize("contained", [True, False])
def test_the_last_stage_leaves_needless_maps_out(monkeypatch, contained):
    """Contained ones before the polish with all cameras, any after it."""
    monkeypatch.setattr(last_stages, "sharpened", lambda judge, found, deadline: (judge, found))
    tried = last_stages.without_needless
    monkeypatch.setattr(last_stages, "without_needless", lambda seen, *args, **options: (
        tried(seen, *args, **options) if options.get("contained", False) is contained else seen))
    many, levels = with_compositions(), inked().levels
    only = PARAMS.updated(moves={"parent_maps": 0, "pruning": False}, canonical={"matrices": False})
    for params, expected in (only, 4), (only.updated(maps=8), 8):
        stage = DrawnLastDigits(SearchProblem(levels.picture, levels, params))
        stage.objective = ImageObjective(levels.picture, Dots(CAMERA, levels.picture, THICK_INK), params)
        assert len(stage._rounded(stage.objective.judge(many.maps, many.weights)).maps) == expected
