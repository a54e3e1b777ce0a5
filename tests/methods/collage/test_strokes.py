"""Drawings of a recursion that ended: their depth and pen are found, and the code behind them."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import CAMERA, PARAMS, dot_camera, pen_camera, stroke_camera
from drawn_helpers import DEPTH, FOOT, PIXEL, RATIO, SIDE, TOP, drawing, ended, lines, tree

from fractal_exp import IFS, codes
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.estimate import nearest
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.strokes import Strokes, as_lines
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.likeness import likeness_of_attractor
from fractal_exp.methods.collage import method
from fractal_exp.methods.collage.given import OPTIONS
from fractal_exp.methods.collage.image.camera import MOST_MAPS, sharpened
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.simplify.drawn import simplified_in_every_way, without_width
from fractal_exp.methods.collage.simplify.loop import Draft
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.construction import Construction, is_construction
from fractal_exp.methods.collage.stages.drawn import DrawnMoves
from fractal_exp.methods.collage.state import Candidate, Key, State
from fractal_exp.runtime.checkpoint import Checkpoint


def judged(image, kind, camera):
    return ImageObjective(image, with_camera(levels_of(image, kind, CAMERA), camera), PARAMS)


@pytest.mark.parametrize(("depth", "width", "thinning"), [(4, 1.6, False), (6, 1.6, False), (6, 4.0, True)])
def test_depth_and_pen_of_a_drawn_tree_are_found(depth, width, thinning):
    image = drawing(depth, width, thinning)
    levels = levels_of(image, DRAWN, CAMERA)
    (angle, camera), *_ = nearest(image, Strokes(CAMERA, image), tree(), 0)
    (whole, _), *_ = nearest(image, levels, tree(), 0)
    assert bool(camera.thinning) == thinning
    assert depth - thinning <= camera.depth <= depth, "the last twigs of a pen that shrinks are faint"
    assert camera.pen == pytest.approx(width / 2 * PIXEL, abs=0.3 * PIXEL)
    assert angle < 0.6 * whole, "than of a pen that draws the whole attractor"


def test_a_code_that_draws_no_strokes_has_no_such_camera():
    gasket = attractor.normalize(codes.known("sierpinski_triangle"))
    image = drawing()
    assert nearest(image, Strokes(CAMERA, image), gasket, 0) == []


def test_a_code_is_polished_as_strokes_until_it_explains_the_drawing():
    image, true = drawing(), affine.from_code(tree())
    start = true.clone()
    start[1:, :4] *= 0.985   # the twigs end before the attractor does: a pen asks for smaller branches
    objective = judged(image, "coverage", pen_camera(0.0, 0.75 * PIXEL, 0.0))
    other, found = sharpened(objective, objective.judge(start))
    assert (other.levels.camera.depth, other.levels.camera.thinning) == (DEPTH, 0)
    assert found.error < 0.3 * objective.judge(start).error
    assert found.error < 0.7 * other.judge(true).error, "nearer than the true code, whose pen has other ends"


def test_a_branch_that_makes_up_for_the_wrong_camera_is_left_out():
    image = drawing()
    maps = affine.from_code(tree())
    mirror = torch.tensor([-1.0, 0, 0, 1, 0, 0])
    start = torch.cat([maps, affine.composed(maps[1], mirror)[None]])
    start[1:, :4] *= 0.985
    objective = judged(image, DRAWN, pen_camera(0.0, 0.75 * PIXEL, 0.0))
    found = simplified_in_every_way(Draft(objective, objective.judge(start)))
    assert len(found.shown.maps) == 3
    camera = found.objective.levels.camera
    assert (camera.depth, camera.thinning) == (DEPTH, 0)


def test_strokes_without_width_draw_the_same():
    wide = affine.from_code(tree())
    wide[0] = torch.tensor([0.04, 0.01, 0.02, 0.3, 0.03, -0.45])   # a trunk that leans and has a width
    thin = as_lines(affine.to_code(wide))
    assert torch.equal(thin[1:], wide[1:]) and float(affine.smaller_singular(thin)[0]) < 1e-6
    assert float(affine.smaller_singular(wide)[0]) > 0.03
    seen = judged(drawing(), "coverage", stroke_camera(6.0, 0.0, 0.8 * PIXEL, 0.35 * PIXEL))
    same, before = seen.judge(thin).image, seen.judge(wide).image
    assert float((same - before).abs().mean()) < 0.03 * float(before.mean())


def test_a_code_seen_as_strokes_ends_without_their_widths():
    image, wide = drawing(), affine.from_code(tree())
    wide[0, :2] = torch.tensor([0.02, 0.0])
    for camera, thin in ((stroke_camera(6.0, 0.0, 0.8 * PIXEL, 0.35 * PIXEL), True),
                         (pen_camera(0.0, 0.8 * PIXEL, 0.0), False)):
        objective = judged(image, DRAWN, camera)
        proposed = [each.shown.maps for each in without_width(Draft(objective, objective.judge(wide)))]
        assert len(proposed) == thin
        assert not thin or float(affine.smaller_singular(proposed[0])[0]) < 1e-6


def test_a_code_of_many_maps_and_exact_levels_stay_as_they_are():
    image = drawing()
    objective = judged(image, "coverage", pen_camera(0.0, 0.75 * PIXEL, 0.0))
    many = objective.judge(affine.from_code(tree()).repeat(5, 1))
    assert len(many.maps) > MOST_MAPS and sharpened(objective, many) == (objective, many)
    exact = ImageObjective(image, levels_of(image, "density", CAMERA), PARAMS)
    shown = exact.judge(affine.from_code(tree()))
    assert sharpened(exact, shown) == (exact, shown)


def test_strokes_beside_the_canvas_and_codes_without_copies_are_drawn():
    strokes = Strokes(CAMERA, drawing(), stroke_camera(3.0, 0.0, PIXEL, 0.0))
    flat = IFS(torch.tensor([[[0.0, 0], [0, 0.5]], [[0.0, 0], [0, 0.5]]]), torch.tensor([[0.0, 0.1], [0.0, -0.1]]))
    assert float(strokes.render(flat, SIDE, 0).max()) > 0.9
    away = affine.to_code(affine.from_code(tree()) + torch.tensor([0, 0, 0, 0, 3.0, 0]))
    assert float(strokes.render(away, SIDE, 0).max()) == 0


@pytest.mark.parametrize("side", [64, 256, 512])
def test_strokes_cover_as_much_of_the_canvas_at_any_resolution(side):
    strokes = Strokes(CAMERA, drawing(), stroke_camera(6.0, 0.0, PIXEL, 0.0))
    wide = affine.from_code(tree())
    wide[0, 0] = 0.03                                      # a trunk of some width
    shares = [float(strokes.render(affine.to_code(wide), each, 0).mean()) for each in (SIDE, side)]
    assert shares[1] == pytest.approx(shares[0], rel=0.1) and shares[0] > 0.01


def test_a_tree_is_like_its_drawing_though_its_attractor_goes_on():
    image = drawing(depth=3)
    strokes = judged(image, "coverage", stroke_camera(3.0, 0.0, 0.8 * PIXEL, 0.0))
    twig = RATIO**3 * (TOP[1] - FOOT[1])
    assert strokes.levels.smallest_part(tree(), SIDE) == pytest.approx(twig, rel=0.02)
    maps = affine.from_code(tree())
    assert strokes.likeness_of(strokes.judge(maps)) > 0.95
    assert likeness_of_attractor(tree(), image, strokes.levels) < 0.7
    bare = strokes.judge(maps[1:])    # no trunk, and so no strokes
    assert strokes.likeness_of(bare) < 0.5


@pytest.mark.slow
def test_a_tree_of_few_levels_is_found_as_few_maps():
    """To the measure it is a lattice of lines. The stage is handed a wrong code, as the search before it would."""
    image = drawing(4)
    problem = SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS)
    stage = Construction(problem, 0)
    wrong = affine.from_code(tree(0.5))
    begun = State(best=Candidate(wrong, None, 1.0, 1.0), stopped="a stage before it had no time")
    state = ended(stage, begun, stage.most_moves)
    found = state.best
    assert found.camera.depth == 4 and len(found.maps) <= 4
    assert state.stopped == "few steps of a construction explain the picture"
    assert not DrawnMoves(problem).is_wanted(state)   # the moves by renderings are left out
    assert DrawnMoves(problem).is_wanted(State(best=replace(found, camera=pen_camera(0.0, 0.01, 0.0))))
    branches = found.maps[affine.smaller_singular(found.maps) > 0.3]
    assert affine.smaller_singular(branches).tolist() == pytest.approx([RATIO] * 2, abs=0.04)


def test_a_code_to_be_polished_is_not_replaced_by_a_search_for_a_tree():
    problem = SearchProblem(drawing(4), levels_of(drawing(4), DRAWN, CAMERA), PARAMS)
    assert "construction" in [stage.name for stage in plan_of(problem).stages]
    polishing = replace_params(problem, **OPTIONS)
    assert "construction" not in [stage.name for stage in plan_of(polishing).stages] and polishing.rounds == 1


@pytest.mark.slow
@pytest.mark.parametrize("depth", [8, 10])
def test_a_lattice_of_few_steps_is_two_maps_seen_as_tiles(depth):
    """Heighway's dragon as lines: a lattice, not yet the filled attractor."""
    dragon = attractor.normalize(codes.known("heighway_dragon"))
    image = lines(dragon, depth, 0.75)
    stage = Construction(SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS), 0)
    state = ended(stage, State(best=Candidate(affine.from_code(tree()), None, 1.0, 1.0)), stage.expected_moves)
    best = state.best
    assert len(best.maps) == 2 and best.camera.kind == "coverage" and best.camera.tile > 0
    drawn, true = (attractor.visible_box(each) for each in (best.code, dragon))
    assert max(abs(a - b) for a, b in zip(drawn, true, strict=True)) < 2 * PIXEL
    assert not DrawnMoves(stage.problem, 0).is_wanted(replace(state, best=best, current=None))


@pytest.mark.parametrize("camera, noted", [(pen_camera(0.0, 0.01, 0.0), False), (pen_camera(0.1, 0.0, 0.0), True),
                                           (stroke_camera(4.0, 0.0, 0.01, 0.0), True), (None, True)])
def test_a_note_tells_that_the_attractor_goes_on(tmp_path, camera, noted):
    """Of a search that is resumed at its end. Without a camera, it is estimated: tiles, as the drawing is of few steps.
    """
    found = Candidate(affine.from_code(tree()), None, 1.0, 1.0, camera)
    Checkpoint(tmp_path / "end").save(State(done=Key(9, "growth"), best=found).snapshot())
    notes = method.Collage().reconstruct(drawing(4), checkpoint=Checkpoint(tmp_path / "end", resume=True)).notes
    assert notes == ((method.ENDED,) if noted else ())


def test_tiles_of_many_maps_explain_nothing():
    few, many = (Candidate(affine.from_code(tree()).repeat(n, 1)[:2 * n], None, 1.0, 1.0, pen_camera(0.1, 0.0, 0.0))
                 for n in (1, 2))
    assert is_construction(few) and not is_construction(many)
    assert not is_construction(replace(few, camera=pen_camera(0.0, 0.1, 0.0))), "a pen"


def test_a_code_that_draws_the_picture_is_not_searched_again():
    image = drawing(10)
    problem = SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS)
    true = affine.from_code(tree())
    asked = Construction(problem)
    before = dict(vars(asked))
    assert not asked.is_wanted(State(best=Candidate(true, None, 1.0, 1.0))) and vars(asked) == before
    many = true.repeat(2, 1)   # more maps than such a search allows
    assert Construction(problem, 0).is_wanted(State(best=Candidate(many, None, 1.0, 1.0)))
    assert not Construction.may_help(replace_params(problem, maps=3)) and Construction.may_help(problem)


@pytest.mark.parametrize("kind, likeness, wanted", [("coverage", 0.98, True), ("dots", 0.98, False),
                                                    ("dots", 0.94, True)])
def test_scatter_plots_are_no_constructions(kind, likeness, wanted):
    class Seen(SearchProblem):
        def camera(self, *_):
            return Camera(kind)

    class Alike(Construction):
        def likeness(self, *_):
            return likeness

    stage = Alike(Seen(drawing(4), levels_of(drawing(4), DRAWN, CAMERA), PARAMS))
    assert stage.is_wanted(State(best=Candidate(affine.from_code(tree()), None, 1.0, 1.0))) is wanted


def replace_params(problem, **options):
    return SearchProblem(problem.given, problem.levels, problem.params.updated(**options))


def test_dots_and_pens_are_compared_by_their_angles():
    """Dots have sixteen times as many subpixels as a pen, so their errors are as many times as large."""
    image = drawing(4)
    stage = Construction(SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS))
    pen, dots = (judged(image, *each) for each in (("coverage", pen_camera(0.0, 0.75 * PIXEL, 0.0)),
                                                    ("dots", dot_camera(0.08, 0.5 * PIXEL))))
    shown, other = pen.judge(affine.from_code(tree())), dots.judge(affine.from_code(tree()))
    assert stage.pen_error(pen, shown) == pytest.approx(shown.error)
    assert stage.pen_error(dots, other) == pytest.approx(other.error / 16)


def test_no_tiles_are_sought_with_a_known_pen():
    image = drawing(4)
    tried = ({}, {"coverage", "strokes"}), ({"pen_px": 0.8}, {"strokes"}), ({"tiles": False}, {"strokes"})
    for known, cameras in tried:
        problem = SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS.updated(camera=known))
        assert {each.camera for each in Construction(problem)._tries} == cameras


def test_a_shrunk_picture_is_not_taken_for_a_construction_that_was_not_sought():
    image = drawing(4)
    problem = SearchProblem(image, levels_of(image, DRAWN, CAMERA), PARAMS.updated(
        stages={"largest_side": 64, "full_side": 128}))
    state = State(best=Candidate(affine.from_code(tree())[:2], None, 1.0, 1.0, pen_camera(0.1, 0.0, 0.0)))
    assert problem.is_reduced and not Construction.may_help(problem)
    assert DrawnMoves(problem).is_wanted(state)
