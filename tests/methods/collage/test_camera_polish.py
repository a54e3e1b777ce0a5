"""A code and its camera polished together, and the ink of tiles."""

import numpy as np
import pytest
import torch
from PIL import Image, ImageDraw

from fractal_exp import codes
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.camera.pens import Dots, Drawn, ToneMapped
from fractal_exp.methods.collage.camera.tiles import tiled
from fractal_exp.methods.collage.camera.tones import camera_of
from fractal_exp.methods.collage.image.camera import angle_of, as_seen, estimated, nearest, sharpened
from fractal_exp.methods.collage.image.gauss_newton import polished
from fractal_exp.methods.collage.image.jacobian import FromPoints, FromRenderings
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.stages.construction import _tries
from fractal_exp.runtime.deadline import NO_DEADLINE

PARAMS, SIDE = CollageParams(), 128
CAMERA, PIXEL = PARAMS.camera, 2 / SIDE
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))
KOCH = attractor.normalize(codes.known("koch_curve"))
PEN = (0.0, 1.0 * PIXEL, 0.5 * PIXEL)


def drawn_by(levels, code, seed=0):
    return levels.render(code, SIDE, seed)


def koch_lines(depth, width, fine=8):
    """The Koch curve of a depth on the frame of `KOCH`, as lines `width` pixels wide, (SIDE, SIDE)."""
    maps = affine.from_code(KOCH).double()
    ends = [torch.linalg.solve(torch.eye(2).double() - one[:4].reshape(2, 2), one[4:]) for one in (maps[0], maps[-1])]
    points = torch.stack(ends)[None]
    for _ in range(depth):
        points = torch.cat([points @ one[:4].reshape(2, 2).T + one[4:] for one in maps])
    picture = Image.new("L", (SIDE * fine,) * 2)
    pen = ImageDraw.Draw(picture)
    for start, end in ((points * torch.tensor([1.0, -1])).add(1) * (SIDE * fine / 2)).tolist():
        pen.line([tuple(start), tuple(end)], fill=255, width=round(width * fine))
    return torch.from_numpy(np.asarray(picture, np.float32).reshape(SIDE, fine, SIDE, fine).mean((1, 3)) / 255)


@pytest.mark.parametrize("jacobian", [FromPoints, pytest.param(FromRenderings, marks=pytest.mark.slow)])
def test_a_pen_and_a_code_that_make_up_for_each_other_are_polished_together(jacobian):
    image = drawn_by(Drawn(CAMERA, None, PEN), GASKET)
    maps = affine.from_code(GASKET)
    maps[:, 4:] *= 1.02                                       # a larger attractor, drawn by a thinner pen
    thin = ImageObjective(image, Drawn(CAMERA, image, (0.0, 0.4 * PIXEL, 0.5 * PIXEL)), PARAMS)
    start = thin.judge(maps)
    alone = polished(thin, start, 8, jacobian=jacobian)
    both = polished(thin, start, 8, jacobian=jacobian, camera=True)
    assert alone.levels.values == start.levels.values
    assert both.error < 0.3 * alone.error
    assert both.levels.values[1] == pytest.approx(PEN[1], abs=0.15 * PIXEL)
    seen = thin.seen_with(both.levels)
    assert seen.judge(both.maps, both.weights).error == pytest.approx(both.error)


def test_the_gain_of_dots_is_polished_with_the_code():
    image = drawn_by(Dots(CAMERA, None, (0.3, 0.5 * PIXEL)), GASKET)
    start = ImageObjective(image, Dots(CAMERA, image, (0.2, 0.5 * PIXEL)), PARAMS)
    found = polished(start, start.judge(affine.from_code(GASKET)), 8, camera=True)
    assert found.levels.values[0] == pytest.approx(0.3, rel=0.05)


def test_only_values_that_the_user_left_open_move():
    image = torch.zeros(SIDE, SIDE)
    assert Drawn(CAMERA, image, PEN).open_values == [1, 2], "the size of a tile is one of a list"
    assert Drawn(CAMERA.updated(pen_px=1.0), image, PEN).open_values == [2]
    assert Drawn(CAMERA, image, (0.1, *PEN[1:])).open_values == [2], "tiles have no pen"
    assert ToneMapped(CAMERA.updated(gamma=2.0), image, (0.1, 2.0, 0.0)).open_values == [0, 2]
    assert Drawn(CAMERA, image).open_values == []


def test_a_thin_line_is_drawn_by_thin_tiles():
    image = koch_lines(3, 0.6)
    angles = {}
    for angle, (_, size, *_) in nearest(image, Drawn.of(image, CAMERA), KOCH, PARAMS, 0):
        angles[size] = angle
        if 0.05 < size < 0.2:  # not the whole picture, and not less than its segments
            ink = float(tiled(image, KOCH, size, SIDE, 3, camera=CAMERA).sum())
            assert ink == pytest.approx(float(image.sum()), rel=0.6)
    assert min(angles.values()) < 0.15
    assert min(angles, key=angles.get) > 0, "tiles explain the picture better than any pen"


def test_the_kind_of_the_camera_is_chosen_after_the_polish():
    image = drawn_by(Dots(CAMERA, None, (0.16, 0.7 * PIXEL)), GASKET)
    maps = affine.from_code(GASKET)
    maps[:, 4:] *= 1.01
    pen = ImageObjective(image, Drawn(CAMERA, image, (0.0, 0.5 * PIXEL, 0.5 * PIXEL)), PARAMS)
    objective, found = sharpened(pen, pen.judge(maps))
    assert camera_of(objective.levels)[0] == "dots"
    assert torch.allclose(found.maps, affine.from_code(GASKET), atol=0.2 * PIXEL)
    assert angle_of((objective, found)) < 0.5 * pen.angle(pen.judge(maps).error)


def test_a_kind_of_camera_that_the_user_chose_is_kept():
    image = drawn_by(Dots(CAMERA, None, (0.16, 0.7 * PIXEL)), GASKET)
    chosen = PARAMS.updated(levels="coverage")
    pen = ImageObjective(image, Drawn(CAMERA, image, (0.0, 0.5 * PIXEL, 0.5 * PIXEL)), chosen)
    objective, _ = sharpened(pen, pen.judge(affine.from_code(GASKET)))
    assert camera_of(objective.levels)[0] == "coverage"


def test_the_likeliest_cameras_of_a_kind_come_best_first():
    image = koch_lines(3, 0.6)
    pen = ImageObjective(image, Drawn(CAMERA, image, PEN), PARAMS)
    seen = as_seen(pen, pen.judge(affine.from_code(KOCH)), "coverage", NO_DEADLINE)
    assert len(seen) == CAMERA.likeliest
    assert [angle_of(each) for each in seen] == sorted(map(angle_of, seen))
    assert len({each[0].levels.values[0] for each in seen}) == len(seen), "one for each tile size"


def test_a_known_pen_excludes_dots_and_a_known_gain_excludes_pens():
    image = drawn_by(Dots(CAMERA, None, (0.16, 0.7 * PIXEL)), GASKET)
    for known, kind in ({"pen_px": 0.5}, "coverage"), ({"gain": 0.16}, "dots"):
        params = PARAMS.updated(camera=known)
        pen = ImageObjective(image, Drawn(params.camera, image, (0.0, 0.5 * PIXEL, 0.5 * PIXEL)), params)
        objective, _ = sharpened(pen, pen.judge(affine.from_code(GASKET)))
        assert camera_of(objective.levels)[0] == kind


@pytest.mark.parametrize("known, kinds", [({"pen_px": 0.5}, {"coverage"}), ({"gain": 0.16}, {"dots", "tonemapped"}),
                                          ({"gamma": 2.0}, {"tonemapped"}),
                                          ({"blur_px": 0.5}, {"coverage", "dots", "tonemapped"})])
def test_a_known_value_excludes_the_kinds_that_do_not_have_it(known, kinds):
    params = PARAMS.updated(camera=known)
    for drawn in Dots(CAMERA, None, (0.16, 0.7 * PIXEL)), Drawn(CAMERA, None, (0.0, 0.5 * PIXEL, 0.5 * PIXEL)):
        image = drawn_by(drawn, GASKET)
        levels = Drawn(params.camera, image, (0.0, 0.5 * PIXEL, 0.5 * PIXEL))
        assert estimated(image, levels, GASKET, params, 0)[0] in kinds
    assert bool(_tries(params)) == ("coverage" in kinds), "no construction is sought in dots"
