"""The trunk of a tree: what the copies of the whole leave over of a picture becomes strokes, drawn with a round pen."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from collage_helpers import PARAMS, stroke_camera
from drawn_helpers import FOOT, PIXEL, RATIO, SIDE, TOP, drawing, objective, stage, tree

from fractal_exp import codes
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.cameras.stroke_kernels import outline
from fractal_exp.cameras.strokes import flat_maps, parts_of
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.limits import SMALLER
from fractal_exp.methods.collage.stages.construction import COARSE_SIDE
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.methods.collage.trees.trunk import BESIDE_PX, _segments, flat_maps_onto, with_trunk


def test_the_trunk_is_what_the_branches_leave_over():
    image, branches = drawing(6), affine.from_code(tree())[1:]
    found = with_trunk(objective(image), objective(image).judge(branches), 4)
    assert torch.equal(found.maps[:2], branches) and len(found.maps) == 3
    assert flat_maps(found.code).tolist() == [False, False, True]
    (segment,), _ = parts_of(found.code)
    beside = BESIDE_PX + 2
    low, high = sorted(segment.tolist(), key=lambda end: end[1])
    assert low == pytest.approx(FOOT, abs=2 * PIXEL)
    assert high[0] == pytest.approx(TOP[0], abs=PIXEL) and TOP[1] - beside * PIXEL < high[1] < TOP[1] + PIXEL


def test_flat_maps_are_replaced():
    image, maps = drawing(6), affine.from_code(tree())
    wrong = maps.clone()
    wrong[0] = torch.tensor([0.3, 0, 0, 0, 0.2, 0.2])   # a stroke where the picture has none
    found = with_trunk(objective(image), objective(image).judge(wrong), 4)
    right = with_trunk(objective(image), objective(image).judge(maps[1:]), 4)
    assert torch.equal(found.maps, right.maps)


def test_a_crown_that_leaves_nothing_over_keeps_its_trunk():
    seen = objective(drawing(6))
    whole = seen.judge(affine.from_code(tree()))
    assert with_trunk(seen, whole, 0) is whole


def test_there_is_no_trunk_where_copies_leave_nothing_over():
    gasket = attractor.normalize(codes.known("sierpinski_triangle"))
    image = levels_of(torch.ones(SIDE, SIDE), DRAWN, PARAMS.camera).render(gasket, SIDE, 0)
    seen = objective(image)
    whole = seen.judge(affine.from_code(gasket))
    assert with_trunk(seen, whole, 4) is None
    assert with_trunk(seen, seen.judge(whole.maps[:1]), 4) is None, "of a single copy"


def segments(mask, most=4, shape=None):
    shape = mask if shape is None else shape
    return [torch.stack(ends) for ends in _segments(*map(torch.from_numpy, (mask, shape)), most, 0)]


def lengths(found):
    return [float((last - first).norm()) / PIXEL for first, last in found]


def test_a_bent_trunk_is_two_segments_the_longest_first():
    mask = np.zeros((SIDE, SIDE), bool)
    mask[20:100, 40:43] = True
    mask[100:103, 40:80] = True
    assert lengths(segments(mask)) == pytest.approx([80, 37], abs=5)
    assert len(segments(mask, 1)) == 1


def trunk_behind_a_branch(gap):
    """A stroke without `gap` pixels in the middle, and the shape, which is lit there too."""
    shape = np.zeros((SIDE, SIDE), bool)
    shape[20:100, 40] = True
    mask = shape.copy()
    mask[50:50 + gap] = False
    return mask, shape


def test_a_trunk_behind_a_branch_is_one_segment():
    mask, shape = trunk_behind_a_branch(12)
    assert lengths(segments(mask, shape=shape)) == pytest.approx([79], abs=1)
    assert lengths(segments(mask)) == pytest.approx([37, 29], abs=1), "the picture is dark between the two"


def test_a_gap_longer_than_a_piece_ends_a_segment():
    mask, shape = trunk_behind_a_branch(35)
    assert lengths(segments(mask, shape=shape)) == pytest.approx([29, 14], abs=1)


def test_the_longest_is_measured_in_pixels_and_not_counted():
    mask = np.zeros((SIDE, SIDE), bool)
    mask[range(10, 70), range(10, 70)] = True   # 60 pixels, 84 long
    mask[100, 10:80] = True                     # 70 pixels
    assert lengths(segments(mask)) == pytest.approx([83.4, 69], abs=2)


def test_crumbs_on_a_line_are_no_segment_and_do_not_hide_one():
    mask = np.zeros((SIDE, SIDE), bool)
    mask[10, np.arange(SIDE) % 10 < 4] = True    # far more pixels than the segment has
    mask[60:84, 50] = True
    assert lengths(segments(mask)) == pytest.approx([23], abs=1)


def test_a_shape_as_long_as_its_trunk_gets_a_contractive_code():
    """A flag: its longer axis of inertia is not the direction in which it is longest."""
    mask = torch.zeros(SIDE, SIDE)
    mask[4:60, 20:120] = 1
    mask[4:124, 20:22] = 1
    seen = objective(mask)
    copies = torch.tensor([[.4, 0, 0, .4, .2, .6], [.4, 0, 0, .4, .6, .2]])
    found = with_trunk(seen, seen.judge(copies), 4)
    assert len(found.maps) > 2
    found.code.check_contractive()


def test_a_trunk_longer_than_the_shape_is_contractive_too():
    branches = affine.from_code(tree())[1:].double()
    ends = torch.tensor([-0.9, -0.9]).double(), torch.tensor([0.9, 0.9]).double()
    points = torch.rand(50, 2, generator=torch.Generator().manual_seed(0)).double() * 0.2
    maps = flat_maps_onto([ends], branches, points)
    assert float(torch.linalg.matrix_norm(maps[:, :4].view(-1, 2, 2), 2)) <= SMALLER + 1e-6


def test_the_pen_outlines_segments():
    generator = torch.Generator().manual_seed(1)
    ends = torch.rand(6, 2, 2, generator=generator).double() * 1.4 - 0.7
    ends[0, 1] = ends[0, 0]                            # a dot
    ends[3, 1] = ends[3, 0] + 3                        # beyond the border
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


def test_known_widths_are_scaled_with_the_image():
    camera = stage(drawing(5), camera={"pen_px": 1.5, "blur_px": 0.0})._coarse.params.camera
    assert (camera.pen_px, camera.blur_px) == (1.5 * COARSE_SIDE / SIDE, 0.0)


@pytest.mark.parametrize("ratio, explained", [(0.57, False), (RATIO, True)])
def test_strokes_must_draw_the_picture_well(ratio, explained):
    image = drawing(6)
    tried = stage(image)
    state = tried.open(State(best=Candidate(affine.from_code(tree()), None, 1.0, 1.0)))
    found = Candidate(affine.from_code(tree(ratio)), None, 1.0, 1.0, stroke_camera(6.0, 0.0, 0.8 * PIXEL, 0.35 * PIXEL))
    assert ("explain the picture" in tried.close(replace(state, current=found)).stopped) is explained


def test_a_trunk_does_not_exceed_the_maps_that_are_asked_for():
    image, branches = drawing(6), affine.from_code(tree())[1:]
    for most, maps in (3, 3), (9, 3), (2, None):
        seen = ImageObjective(image, levels_of(image, DRAWN, PARAMS.camera), PARAMS.updated(at_most=most))
        found = with_trunk(seen, seen.judge(branches), 4)
        assert (found and len(found.maps)) == maps
