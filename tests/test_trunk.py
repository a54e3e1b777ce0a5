"""The trunk of a tree: what the copies of the whole leave over of a picture becomes strokes, drawn with a round pen."""

import numpy as np
import pytest
import torch
from test_strokes import FOOT, PIXEL, SIDE, TOP, drawing, tree

from fractal_exp import codes
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.image.trunk import _longest_run, _segments, with_trunk
from fractal_exp.methods.collage.measure.stroke_kernels import outline
from fractal_exp.methods.collage.measure.strokes import Strokes, flat_maps
from fractal_exp.methods.collage.measure.tones import levels_of
from fractal_exp.methods.collage.params import CollageParams

PARAMS = CollageParams()


def objective(image, **camera):
    params = PARAMS.updated(camera=camera)
    return ImageObjective(image, levels_of(image, "coverage", params.camera), params)


def test_the_trunk_is_what_the_branches_leave_over():
    image, branches = drawing(6), affine.from_code(tree())[1:]
    found = with_trunk(objective(image), objective(image).judge(branches))
    assert torch.equal(found.maps[:2], branches) and len(found.maps) == 3
    assert flat_maps(found.code, PARAMS.camera).tolist() == [False, False, True]
    levels = Strokes(PARAMS.camera, image, (0.0, 0.0, 0.8 * PIXEL, 0.0))
    (trunk,), _ = levels._parts(found.code)
    beside = PARAMS.camera.trunk_beside_px + 2
    low, high = sorted(trunk.tolist(), key=lambda end: end[1])
    assert low == pytest.approx(FOOT, abs=2 * PIXEL)
    assert high[0] == pytest.approx(TOP[0], abs=PIXEL) and TOP[1] - beside * PIXEL < high[1] < TOP[1] + PIXEL


def test_flat_maps_are_replaced():
    image, maps = drawing(6), affine.from_code(tree())
    wrong = maps.clone()
    wrong[0] = torch.tensor([0.3, 0, 0, 0, 0.2, 0.2])   # a stroke where the picture has none
    found = with_trunk(objective(image), objective(image).judge(wrong))
    assert len(found.maps) == 3 and torch.equal(found.maps[:2], maps[1:])
    assert not torch.equal(found.maps[2], wrong[0])


def test_there_is_no_trunk_where_copies_leave_nothing_over():
    gasket = attractor.normalize(codes.known("sierpinski_triangle"))
    image = levels_of(torch.ones(SIDE, SIDE), "coverage", PARAMS.camera).render(gasket, SIDE, 0)
    seen = objective(image)
    whole = seen.judge(affine.from_code(gasket))
    assert with_trunk(seen, whole) is None
    assert with_trunk(seen, seen.judge(whole.maps[:1])) is None, "of a single copy"


@pytest.mark.parametrize("camera", [{"trunk_strokes": 0}, {"trunk_least_px": 100.0}, {"trunk_beside_px": 100.0}])
def test_how_much_counts_as_a_trunk_is_a_parameter(camera):
    seen = objective(drawing(6), **camera)
    assert with_trunk(seen, seen.judge(affine.from_code(tree())[1:])) is None


def test_a_bent_trunk_is_two_segments_the_longest_first():
    mask = np.zeros((SIDE, SIDE), bool)
    mask[20:100, 40:43] = True
    mask[100:103, 40:80] = True
    (top, bottom), (left, right) = _segments(mask, PARAMS, 0)
    assert abs(top - bottom)[1] == pytest.approx(80 * PIXEL, abs=4 * PIXEL)
    assert abs(left - right)[0] == pytest.approx(40 * PIXEL, abs=8 * PIXEL), "its ends are thinned away"


def test_a_segment_ends_where_the_line_is_broken():
    assert _longest_run(np.array([0.0, 1, 2, 9, 10, 11, 12]), 3.0) == (9.0, 12.0)


def test_the_pen_outlines_segments():
    generator = torch.Generator().manual_seed(1)
    ends = torch.rand(6, 2, 2, generator=generator).double() * 1.4 - 0.7
    ends[0, 1] = ends[0, 0]                            # a dot
    ends[1, 1, 1], ends[2, 1, 0] = ends[1, 0, 1], ends[2, 0, 0]    # a level and an upright one
    fine, side, radius = 3, 40, 1.3
    off = np.full((side * fine, side * fine), np.inf, np.float32)
    outline(ends.numpy(), radius, fine, off)
    axis = (torch.arange(side * fine).double() + 0.5) / fine
    cells = torch.stack([axis.expand(len(axis), -1), axis[:, None].expand(-1, len(axis))], -1)
    places = torch.stack([(ends[..., 0] + 1) * side / 2, (1 - ends[..., 1]) * side / 2], -1)
    first, along = places[:, 0], places[:, 1] - places[:, 0]
    share = ((cells[..., None, :] - first) * along).sum(-1) / along.square().sum(-1).clamp_min(1e-12)
    nearest = first + share.clamp(0, 1)[..., None] * along
    true = ((cells[..., None, :] - nearest).norm(dim=-1) - radius).amin(-1)
    near = true < 1 / fine
    assert torch.from_numpy(off)[near].double() == pytest.approx(true[near].numpy(), abs=1e-5)
    assert bool((torch.from_numpy(off)[~near] >= true[~near] - 1e-5).all()) and np.isinf(off).any()
