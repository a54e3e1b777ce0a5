"""Registration of a tree: its strokes are moved onto the lines of a picture before pixels are compared."""

import numpy as np
import pytest
import torch
from drawn_helpers import PIXEL, SIDE, drawing, objective, tree

from fractal_exp.cameras.strokes import parts_of
from fractal_exp.ifs import affine
from fractal_exp.methods.collage.limits import SMALLER
from fractal_exp.methods.collage.trees.registration import Registration, _drawn, _Tree
from fractal_exp.runtime.deadline import Deadline

DEPTH = 5
COPIES = affine.from_code(tree())[1:]


def knocked(size, seed=0):
    """The tree with all numbers of its branches moved at random."""
    maps = affine.from_code(tree())
    maps[1:] += size * (2 * torch.rand(2, 6, generator=torch.Generator().manual_seed(seed)) - 1)
    return maps


def registered(image, maps):
    seen = objective(image)
    return Registration(seen).fits(seen.judge(maps))


def ends(maps):
    return parts_of(affine.to_code(maps))[0]


def largest_shift(maps):
    """By how much the images of the corners of the canvas under the branches differ from the true ones, pixels."""
    corners = torch.tensor([[x, y] for x in (-0.7, 0.7) for y in (-0.7, 0.7)])
    shift = maps - COPIES
    return float((corners @ shift[:, :4].view(-1, 2, 2).mT + shift[:, None, 4:]).norm(dim=-1).max()) / PIXEL


@pytest.mark.parametrize("seed", range(4))
def test_branches_beside_the_lines_are_moved_onto_them(seed):
    maps = knocked(0.04, seed)
    assert largest_shift(maps[1:]) > 2.5
    best = registered(drawing(DEPTH), maps)[0]
    assert largest_shift(best.maps[:2]) < 1.5
    assert best.misfit < PIXEL**2


def test_the_best_depth_comes_first():
    depths = {}

    class Watched(Registration):
        def fitted(self, tree, depth):
            found = super().fitted(tree, depth)
            depths[found.misfit] = depth
            return found

    seen = objective(drawing(DEPTH))
    fits = Watched(seen).fits(seen.judge(knocked(0.02)))
    assert [each.misfit for each in fits] == sorted(depths)
    assert depths[fits[0].misfit] == DEPTH and set(depths.values()) >= set(range(1, 8))


def test_strokes_too_short_to_see_are_not_drawn():
    maps = knocked(0.0)
    maps[1:, :4] *= 0.3   # to 0.18
    assert len(registered(drawing(3), maps)) == 3, "their lengths are 28 pixels, 5, 0.9 and, too short, 0.2"


def test_the_trunk_moves_along():
    maps = knocked(0.0)
    maps[0, 4] += 0.05
    assert ends(maps)[0, :, 0].tolist() == pytest.approx([0.05, 0.05], abs=0.01)
    best = registered(drawing(DEPTH), maps)[0]
    assert ends(best.maps)[0, :, 0].tolist() == pytest.approx([0, 0], abs=0.5 * PIXEL)


def test_codes_without_strokes_or_branches_are_not_registered():
    assert registered(drawing(DEPTH), COPIES) == []
    assert registered(drawing(DEPTH), affine.from_code(tree())[:2]) == []


@pytest.mark.parametrize("lit", [0, 1])
def test_a_picture_of_a_pixel_is_not_registered(lit):
    image = torch.zeros(SIDE, SIDE)
    image[0, :lit] = 1
    assert registered(image, knocked(0.0)) == []


def test_strokes_without_length_are_left_out():
    maps = torch.cat([knocked(0.02), torch.tensor([[0, 0, 0, 0, 0.1, 0.1]])])
    assert len(registered(drawing(DEPTH), maps)[0].maps) == 3
    maps[0] = 0
    assert registered(drawing(DEPTH), maps) == []


def test_nothing_is_registered_after_the_deadline():
    seen = objective(drawing(DEPTH))
    assert Registration(seen, Deadline(0.0)).fits(seen.judge(knocked(0.02))) == []


def test_no_step_makes_a_copy_that_does_not_contract():
    first = _Tree(COPIES.double().numpy(), np.zeros((1, 2, 2)))
    moved = first.moved(np.concatenate([first.copies.ravel(), np.zeros(4)]))   # twice as large: 1.2
    assert affine.largest_singular(torch.from_numpy(moved.copies)).tolist() == pytest.approx([SMALLER] * 2, abs=1e-5)


def test_the_derivatives_are_those_of_the_points():
    rng = np.random.default_rng(0)
    first = _Tree(rng.uniform(-0.5, 0.5, (2, 6)), rng.uniform(-0.5, 0.5, (2, 2, 2)))
    slopes = _drawn(first, 3, 10.0, 100).slopes
    steps = 1e-6 * np.eye(slopes.shape[-1])
    there, back = ([_drawn(first.moved(sign * each), 3, 10.0, 100).places for each in steps] for sign in (1, -1))
    numeric = (np.array(there) - back) / 2e-6
    np.testing.assert_allclose(slopes, np.moveaxis(numeric, 0, -1), atol=1e-8)


def test_points_are_a_spacing_apart_unless_they_are_too_many():
    line = _Tree(np.zeros((0, 6)), np.array([[[0.0, 0.0], [1.0, 0.0]]]))
    np.testing.assert_allclose(_drawn(line, 0, 0.3, 9).places, [[1 / 8, 0], [3 / 8, 0], [5 / 8, 0], [7 / 8, 0]])
    np.testing.assert_allclose(_drawn(line, 0, 0.3, 2).places, [[1 / 4, 0], [3 / 4, 0]])
