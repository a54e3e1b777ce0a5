"""A code and its camera polished together, and the ink of tiles."""

from functools import partial
from itertools import count

import numpy as np
import pytest
import torch
from collage_helpers import dot_camera, pen_camera
from drawn_helpers import lines

from fractal_exp import codes
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.estimate import estimated, nearest
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.pens import Dots, Inked, ToneMapped
from fractal_exp.cameras.tiles import tiled
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.methods.collage.image.camera import LIKELIEST, angle_of, polish_under, sharpened
from fractal_exp.methods.collage.image.gauss_newton import polished
from fractal_exp.methods.collage.image.jacobian import FromPoints, FromRenderings
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.construction import Construction
from fractal_exp.runtime.deadline import NO_DEADLINE, Deadline

PARAMS, SIDE = CollageParams(), 128
CAMERA, PIXEL = PARAMS.camera, 2 / SIDE
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))
KOCH = attractor.normalize(codes.known("koch_curve"))
PEN = pen_camera(0.0, 1.0 * PIXEL, 0.5 * PIXEL)


def drawn_by(levels, code, seed=0):
    return levels.render(code, SIDE, seed)


@pytest.mark.parametrize("jacobian", [FromPoints, pytest.param(FromRenderings, marks=pytest.mark.slow)])
def test_a_pen_and_a_code_that_make_up_for_each_other_are_polished_together(jacobian):
    image = drawn_by(Inked(CAMERA, None, PEN), GASKET)
    maps = affine.from_code(GASKET)
    maps[:, 4:] *= 1.02                                       # a larger attractor, drawn by a thinner pen
    thin = ImageObjective(image, Inked(CAMERA, image, pen_camera(0.0, 0.4 * PIXEL, 0.5 * PIXEL)), PARAMS)
    start = thin.judge(maps)
    alone = polished(thin, start, 8, jacobian=jacobian)
    both = polished(thin, start, 8, jacobian=jacobian, camera=True)
    assert alone.levels.values == start.levels.values
    assert both.error < 0.3 * alone.error
    assert both.levels.camera.pen == pytest.approx(PEN.pen, abs=0.15 * PIXEL)
    seen = thin.seen_with(both.levels)
    assert seen.judge(both.maps, both.weights).error == pytest.approx(both.error)


def test_the_gain_of_dots_is_polished_with_the_code():
    image = drawn_by(Dots(CAMERA, None, dot_camera(0.3, 0.5 * PIXEL)), GASKET)
    start = ImageObjective(image, Dots(CAMERA, image, dot_camera(0.2, 0.5 * PIXEL)), PARAMS)
    found = polished(start, start.judge(affine.from_code(GASKET)), 8, camera=True)
    assert found.levels.camera.gain == pytest.approx(0.3, rel=0.05)


def test_only_values_that_the_user_left_open_move():
    image = torch.zeros(SIDE, SIDE)
    assert Inked(CAMERA, image, PEN).open_values == ["pen", "blur"], "the size of a tile is one of a list"
    assert Inked(CAMERA.updated(pen_px=1.0), image, PEN).open_values == ["blur"]
    assert Inked(CAMERA, image, PEN.moved({"tile": 0.1})).open_values == ["blur"], "tiles have no pen"
    curve = Camera("tonemapped", gain=0.1, gamma=2.0, blur=0.0)
    assert ToneMapped(CAMERA.updated(gamma=2.0), image, curve).open_values == ["gain", "blur"]
    assert Inked(CAMERA, image).open_values == []


def test_a_pen_of_no_width_has_its_whole_derivative():
    image = drawn_by(Inked(CAMERA, None, PEN), GASKET)
    thin = ImageObjective(image, Inked(CAMERA, image, pen_camera(0.0, 0.0, 0.5 * PIXEL)), PARAMS)
    start = thin.judge(affine.from_code(GASKET))
    columns = [kind(thin, start, range(len(start.maps)), 0, camera=True) for kind in (FromPoints, FromRenderings)]
    pens = [float(each.square[-2, -2]) ** 0.5 for each in columns]
    assert pens[1] == pytest.approx(pens[0], rel=0.3)


def test_a_length_stays_positive_and_a_number_changes_by_a_factor():
    image = torch.zeros(SIDE, SIDE)
    drawn = Inked(CAMERA, image, pen_camera(0.0, 0.01, 0.02)).adjusted({"pen": -0.5, "blur": 0.01})
    assert drawn.camera == pen_camera(0.0, 0.0, 0.03)
    twice = Dots(CAMERA, image, dot_camera(0.2, 0.0)).adjusted({"gain": float(np.log(2))})
    assert (twice.camera.gain, twice.camera.blur) == pytest.approx((0.4, 0.0))


def test_a_thin_line_is_drawn_by_thin_tiles():
    image = lines(KOCH, 3, 0.6)
    angles = {}
    for angle, tried in nearest(image, Inked(CAMERA, image), KOCH, 0):
        size = tried.tile
        angles[size] = angle
        if 0.05 < size < 0.2:  # not the whole picture, and not less than its segments
            ink = float(tiled(image, KOCH, size, SIDE, 3).sum())
            assert ink == pytest.approx(float(image.sum()), rel=0.6)
    assert min(angles.values()) < 0.15
    assert min(angles, key=angles.get) > 0, "tiles explain the picture better than any pen"


def test_the_kind_of_the_camera_is_chosen_after_the_polish():
    image = drawn_by(Dots(CAMERA, None, dot_camera(0.16, 0.7 * PIXEL)), GASKET)
    maps = affine.from_code(GASKET)
    maps[:, 4:] *= 1.01
    drawn = with_camera(levels_of(image, DRAWN, CAMERA), pen_camera(0.0, 0.5 * PIXEL, 0.5 * PIXEL))
    pen = ImageObjective(image, drawn, PARAMS)
    objective, found = sharpened(pen, pen.judge(maps))
    assert objective.levels.camera.kind == "dots"
    assert torch.allclose(found.maps, affine.from_code(GASKET), atol=0.2 * PIXEL)
    assert angle_of((objective, found)) < 0.5 * pen.angle(pen.judge(maps).error)


def test_a_kind_of_camera_that_the_user_chose_is_kept():
    image = drawn_by(Dots(CAMERA, None, dot_camera(0.16, 0.7 * PIXEL)), GASKET)
    chosen = with_camera(levels_of(image, "coverage", CAMERA), pen_camera(0.0, 0.5 * PIXEL, 0.5 * PIXEL))
    pen = ImageObjective(image, chosen, PARAMS)
    objective, _ = sharpened(pen, pen.judge(affine.from_code(GASKET)))
    assert objective.levels.camera.kind == "coverage"


def test_the_likeliest_cameras_of_a_kind_come_best_first():
    image = lines(KOCH, 3, 0.6)
    pen = ImageObjective(image, Inked(CAMERA, image, PEN), PARAMS)
    seen = polish_under(pen, pen.judge(affine.from_code(KOCH)), "coverage", NO_DEADLINE)
    assert len(seen) == LIKELIEST
    assert [angle_of(each) for each in seen] == sorted(map(angle_of, seen))
    assert len({each[0].levels.camera.tile for each in seen}) == len(seen), "one for each tile size"


def test_a_known_pen_excludes_dots_and_a_known_gain_excludes_pens():
    image = drawn_by(Dots(CAMERA, None, dot_camera(0.16, 0.7 * PIXEL)), GASKET)
    for known, kind in ({"pen_px": 0.5}, "coverage"), ({"gain": 0.16}, "dots"):
        params = PARAMS.updated(camera=known)
        levels = with_camera(levels_of(image, DRAWN, params.camera), pen_camera(0.0, 0.5 * PIXEL, 0.5 * PIXEL))
        pen = ImageObjective(image, levels, params)
        objective, _ = sharpened(pen, pen.judge(affine.from_code(GASKET)))
        assert objective.levels.camera.kind == kind


@pytest.mark.parametrize("known, kinds", [({"pen_px": 0.5}, {"coverage"}), ({"gain": 0.16}, {"dots", "tonemapped"}),
                                          ({"gamma": 2.0}, {"tonemapped"}),
                                          ({"blur_px": 0.5}, {"coverage", "dots", "tonemapped"})])
def test_a_known_value_excludes_the_kinds_that_do_not_have_it(known, kinds):
    params = PARAMS.updated(camera=known)
    by_dots, by_pen = dot_camera(0.16, 0.7 * PIXEL), pen_camera(0.0, 0.5 * PIXEL, 0.5 * PIXEL)
    for drawn in Dots(CAMERA, None, by_dots), Inked(CAMERA, None, by_pen):
        image = drawn_by(drawn, GASKET)
        levels = levels_of(image, DRAWN, params.camera)
        assert estimated(image, levels, GASKET, 0).kind in kinds
        problem = SearchProblem(image, levels, params)
        assert Construction.may_help(problem) == ("coverage" in kinds), "no construction is sought in dots"


@pytest.mark.parametrize("readings", [2, 3, 4, 6])
def test_the_polish_loses_nothing_if_time_runs_out_at_the_first_camera(readings):
    """Each look at this clock takes a second."""
    image = drawn_by(Dots(CAMERA, None, dot_camera(0.16, 0.7 * PIXEL)), GASKET)
    dots = ImageObjective(image, Dots(CAMERA, image, dot_camera(0.16, 0.7 * PIXEL)), PARAMS)
    start = dots.judge(affine.from_code(GASKET))
    deadline = Deadline(readings, partial(next, count()))
    assert angle_of(sharpened(dots, start, deadline)) <= angle_of((dots, start)) and deadline.passed


def test_a_tile_that_is_white_all_over_is_drawn_whole():
    image = torch.ones(SIDE, SIDE)
    drawn = tiled(image, GASKET, 0.25, SIDE, 3)
    assert float(drawn.max()) == 1.0 and float(tiled(image * 0, GASKET, 0.25, SIDE, 3).max()) == 0.0
