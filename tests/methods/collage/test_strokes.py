"""Drawings of a recursion that ended: their depth and pen are found, and the code behind them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from collage_helpers import CAMERA, PARAMS
from drawn_helpers import DEPTH, FOOT, PIXEL, RATIO, SIDE, TOP, drawing, tree
from PIL import Image, ImageDraw

from fractal_exp import IFS, codes
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.camera.strokes import Strokes, as_lines
from fractal_exp.methods.collage.camera.tones import camera_of, described, levels_of, seen_with, taken_with
from fractal_exp.methods.collage.given import OPTIONS
from fractal_exp.methods.collage.image.camera import nearest, sharpened
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.simplify.likeness import likeness_of, likeness_of_attractor
from fractal_exp.methods.collage.stages.construction import Recursion
from fractal_exp.methods.collage.stages.image import DrawnMoves, stages_of
from fractal_exp.methods.collage.stages.problem import SearchProblem
from fractal_exp.methods.collage.stages.rounding import DrawnLastDigits
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.runtime.deadline import Deadline


def judged(image, kind, camera):
    return ImageObjective(image, seen_with(levels_of(image, kind, CAMERA), camera), PARAMS)


@pytest.mark.parametrize(("depth", "width", "thinning"), [(4, 1.6, False), (6, 1.6, False), (6, 4.0, True)])
def test_depth_and_pen_of_a_drawn_tree_are_found(depth, width, thinning):
    image = drawing(depth, width, thinning)
    levels = levels_of(image, "coverage", CAMERA)
    (angle, camera), *_ = nearest(image, Strokes.of(image, CAMERA), tree(), PARAMS, 0)
    (whole, _), *_ = nearest(image, levels, tree(), PARAMS, 0)
    assert camera[0] == "strokes" and bool(camera[2]) == thinning
    assert depth - thinning <= camera[1] <= depth, "the last twigs of a pen that shrinks are faint"
    assert camera[3] == pytest.approx(width / 2 * PIXEL, abs=0.3 * PIXEL)
    assert angle < 0.6 * whole, "than of a pen that draws the whole attractor"


def test_a_code_that_draws_no_strokes_has_no_such_camera():
    gasket = attractor.normalize(codes.known("sierpinski_triangle"))
    image = drawing()
    assert nearest(image, Strokes.of(image, CAMERA), gasket, PARAMS, 0) == []


def test_a_code_is_polished_as_strokes_until_it_explains_the_drawing():
    image, true = drawing(), affine.from_code(tree())
    start = true.clone()
    start[1:, :4] *= 0.985   # the twigs end before the attractor does: a pen asks for smaller branches
    objective = judged(image, "coverage", ("coverage", 0.0, 0.75 * PIXEL, 0.0))
    other, found = sharpened(objective, objective.judge(start))
    assert camera_of(other.levels)[:3] == ("strokes", DEPTH, 0)
    assert found.error < 0.3 * objective.judge(start).error
    assert found.error < 0.7 * other.judge(true).error, "nearer than the true code, whose pen has other ends"


def test_a_branch_that_makes_up_for_the_wrong_camera_is_left_out():
    image = drawing()
    maps = affine.from_code(tree())
    mirror = torch.tensor([-1.0, 0, 0, 1, 0, 0])
    start = torch.cat([maps, affine.composed(maps[1], mirror)[None]])
    start[1:, :4] *= 0.985
    stage = DrawnLastDigits(SearchProblem(image, levels_of(image, "coverage", CAMERA), PARAMS))
    stage.objective = judged(image, "coverage", ("coverage", 0.0, 0.75 * PIXEL, 0.0))
    found = stage._rounded(stage.objective.judge(start))
    assert len(found.maps) == 3
    assert camera_of(stage.objective.levels)[:3] == ("strokes", DEPTH, 0)


def test_strokes_without_width_draw_the_same():
    wide = affine.from_code(tree())
    wide[0] = torch.tensor([0.04, 0.01, 0.02, 0.3, 0.03, -0.45])   # a trunk that leans and has a width
    lines = as_lines(affine.to_code(wide), CAMERA)
    assert torch.equal(lines[1:], wide[1:]) and float(affine.smaller_singular(lines)[0]) < 1e-6
    assert float(affine.smaller_singular(wide)[0]) > 0.03
    seen = judged(drawing(), "coverage", ("strokes", 6.0, 0.0, 0.8 * PIXEL, 0.35 * PIXEL))
    same, before = seen.judge(lines).image, seen.judge(wide).image
    assert float((same - before).abs().mean()) < 0.03 * float(before.mean())


def test_a_code_seen_as_strokes_ends_without_their_widths():
    image, wide = drawing(), affine.from_code(tree())
    wide[0, :2] = torch.tensor([0.02, 0.0])
    stage = DrawnLastDigits(SearchProblem(image, levels_of(image, "coverage", CAMERA), PARAMS))
    for name, thin in (("strokes", True), ("coverage", False)):
        values = (6.0, 0.0, 0.8 * PIXEL, 0.35 * PIXEL) if thin else (0.0, 0.8 * PIXEL, 0.0)
        stage.objective = judged(image, "coverage", (name, *values))
        found = stage._without_width(stage.objective.judge(wide))
        assert (float(affine.smaller_singular(found.maps)[0]) < 1e-6) == thin


def test_a_code_of_many_maps_and_exact_levels_stay_as_they_are():
    image = drawing()
    objective = judged(image, "coverage", ("coverage", 0.0, 0.75 * PIXEL, 0.0))
    many = objective.judge(affine.from_code(tree()).repeat(5, 1))
    assert len(many.maps) > CAMERA.sharpened_maps and sharpened(objective, many) == (objective, many)
    exact = ImageObjective(image, levels_of(image, "density", CAMERA), PARAMS)
    shown = exact.judge(affine.from_code(tree()))
    assert sharpened(exact, shown) == (exact, shown)


def test_strokes_are_described_in_pixels_and_taken_up_again():
    image = drawing()
    levels = seen_with(levels_of(image, "coverage", CAMERA), ("strokes", 6.0, 0.0, 0.75 * PIXEL, 0.35 * PIXEL))
    told = described(levels)
    assert told == pytest.approx({"levels": "strokes", "depth": 6, "thinning": 0, "pen_px": 0.75, "blur_px": 0.35})
    again = taken_with(image, told, CAMERA)
    assert torch.equal(again.render(tree(), SIDE, 0), levels.render(tree(), SIDE, 0))


def test_strokes_beside_the_canvas_and_codes_without_copies_are_drawn():
    strokes = Strokes(CAMERA, drawing(), (3.0, 0.0, PIXEL, 0.0))
    flat = IFS(torch.tensor([[[0.0, 0], [0, 0.5]], [[0.0, 0], [0, 0.5]]]), torch.tensor([[0.0, 0.1], [0.0, -0.1]]))
    assert float(strokes.render(flat, SIDE, 0).max()) > 0.9
    away = affine.to_code(affine.from_code(tree()) + torch.tensor([0, 0, 0, 0, 3.0, 0]))
    assert float(strokes.render(away, SIDE, 0).max()) == 0


@pytest.mark.parametrize("side", [64, 256, 512])
def test_strokes_cover_as_much_of_the_canvas_at_any_resolution(side):
    strokes = Strokes(CAMERA, drawing(), (6.0, 0.0, PIXEL, 0.0))
    wide = affine.from_code(tree())
    wide[0, 0] = 0.03                                      # a trunk of some width
    shares = [float(strokes.render(affine.to_code(wide), each, 0).mean()) for each in (SIDE, side)]
    assert shares[1] == pytest.approx(shares[0], rel=0.1) and shares[0] > 0.01


def test_a_deadline_that_has_passed_leaves_all_as_it_is():
    image = drawing()
    objective = judged(image, "coverage", ("coverage", 0.0, 0.75 * PIXEL, 0.0))
    shown = objective.judge(affine.from_code(tree()))
    assert sharpened(objective, shown, Deadline(0.0)) == (objective, shown)


def test_a_tree_is_like_its_drawing_though_its_attractor_goes_on():
    image = drawing(depth=3)
    strokes = judged(image, "coverage", ("strokes", 3.0, 0.0, 0.8 * PIXEL, 0.0))
    twig = RATIO**3 * (TOP[1] - FOOT[1])
    assert strokes.levels.smallest_part(tree(), SIDE) == pytest.approx(twig, rel=0.02)
    maps = affine.from_code(tree())
    assert likeness_of(strokes.judge(maps), strokes) > 0.95
    assert likeness_of_attractor(tree(), image, strokes.levels) < 0.7
    bare = strokes.judge(maps[1:])    # no trunk, and so no strokes
    assert likeness_of(bare, strokes) < 0.5


@pytest.mark.slow
def test_a_tree_of_few_levels_is_found_as_few_maps():
    """To the measure it is a lattice of lines. The stage is handed a wrong code, as the search before it would."""
    image = drawing(4)
    problem = SearchProblem(image, levels_of(image, "coverage", CAMERA), PARAMS)
    stage = Recursion(problem, 0)
    wrong = affine.from_code(tree(0.5))
    state = State(best=Candidate(wrong, None, 1.0, 1.0), stopped="a stage before it had no time")
    assert stage.is_wanted(state)
    stage.open(state)
    state = replace(state, current=stage.begin(state))
    while not stage.is_settled(state) and state.step < stage.most_moves:
        state = stage.moved(state)
    state = stage.close(state)
    found = state.best
    assert found.camera[:2] == ("strokes", 4) and len(found.maps) <= 4
    assert state.stopped == "few steps of a construction explain the picture"
    assert not DrawnMoves(problem).is_wanted(state)   # the moves by renderings are left out
    assert DrawnMoves(problem).is_wanted(State(best=replace(found, camera=("coverage", 0.01))))
    branches = found.maps[affine.smaller_singular(found.maps) > 0.3]
    assert affine.smaller_singular(branches).tolist() == pytest.approx([RATIO] * 2, abs=0.04)


def test_a_code_to_be_polished_is_not_replaced_by_a_search_for_a_tree():
    problem = SearchProblem(drawing(4), levels_of(drawing(4), "coverage", CAMERA), PARAMS)
    assert "construction" in [stage.name for stage in stages_of(problem, 0)]
    polishing = replace_params(problem, **OPTIONS)
    assert "construction" not in [stage.name for stage in stages_of(polishing, 0)] and polishing.rounds == 1


@pytest.mark.slow
@pytest.mark.parametrize("depth", [8, 10])
def test_a_lattice_of_few_steps_is_two_maps_seen_as_tiles(depth):
    """Heighway's dragon as lines: a lattice, not yet the filled attractor."""
    dragon = attractor.normalize(codes.known("heighway_dragon"))
    maps = affine.from_code(dragon).double()
    ends = torch.stack([torch.linalg.solve(torch.eye(2).double() - one[:4].reshape(2, 2), one[4:]) for one in maps])
    parts = ends[None]
    for _ in range(depth):
        parts = torch.cat([parts @ one[:4].reshape(2, 2).T + one[4:] for one in maps])
    picture, fine = Image.new("L", (8 * SIDE,) * 2), 4 * SIDE
    pen = ImageDraw.Draw(picture)
    for start, end in ((parts * torch.tensor([1.0, -1])).add(1) * fine).tolist():
        pen.line([tuple(start), tuple(end)], fill=255, width=6)
    image = torch.from_numpy(np.asarray(picture, np.float32).reshape(SIDE, 8, SIDE, 8).mean((1, 3)) / 255)
    stage = Recursion(SearchProblem(image, levels_of(image, "coverage", CAMERA), PARAMS), 0)
    state = State(best=Candidate(affine.from_code(tree()), None, 1.0, 1.0))
    assert stage.is_wanted(state)
    state = replace(state, current=stage.begin(state))
    while not stage.is_settled(state) and state.step < stage.expected_moves:
        state = stage.moved(state)
    best = stage.close(state).best
    assert len(best.maps) == 2 and best.camera[0] == "coverage" and best.camera[1] > 0
    drawn, true = (attractor.visible_box(each) for each in (best.code, dragon))
    assert max(abs(a - b) for a, b in zip(drawn, true, strict=True)) < 2 * PIXEL
    assert not DrawnMoves(stage.problem, 0).is_wanted(replace(state, best=best, current=None))


def test_a_code_that_draws_the_picture_is_not_searched_again():
    image = drawing(10)
    problem = SearchProblem(image, levels_of(image, "coverage", CAMERA), PARAMS)
    true = affine.from_code(tree())
    assert not Recursion(problem, 0).is_wanted(State(best=Candidate(true, None, 1.0, 1.0)))
    assert Recursion(replace_params(problem, camera={"recursion_below": 1.0})).is_wanted(
        State(best=Candidate(true, None, 1.0, 1.0)))
    many = true.repeat(2, 1)   # more maps than such a search allows
    assert Recursion(problem, 0).is_wanted(State(best=Candidate(many, None, 1.0, 1.0)))
    assert not Recursion.may_help(replace_params(problem, maps=3)) and Recursion.may_help(problem)


def replace_params(problem, **options):
    return SearchProblem(problem.given, problem.levels, problem.params.updated(**options))
